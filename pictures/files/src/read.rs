//! Files that are read from beginning to end.

use std::fs::{self, File};
use std::io::{Error, Result};
use std::path::Path;

/// Opens a file to read. Devices and pipes are refused: they may have no end, and a pipe waits for its writer.
///
/// # Errors
/// There is no regular file of this name, or the system fails.
pub fn open(path: &Path) -> Result<File> {
    let check = |metadata: fs::Metadata| match metadata.is_file() {
        true => Ok(()),
        false => Err(Error::other("it is no regular file, and may have no end")),
    };
    check(fs::metadata(path)?)?;
    let file = File::open(path)?;
    // Of the open file: the name may lead to another one by now.
    check(file.metadata()?)?;
    Ok(file)
}
