//! Regular files of limited size, read into memory.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Bytes that a file is recognised by.
const START: u64 = 4096;

/// Reads a regular file of at most `limit` bytes, whose first bytes are checked: `starts` returns what is wrong with them.
///
/// Larger files are refused before anything is read, and so are devices and pipes, which may never end. A file that is
/// something else may be huge, so only its start is read.
pub(crate) fn read(
    path: &Path,
    limit: u64,
    starts: fn(&[u8]) -> Result<(), String>,
) -> io::Result<Vec<u8>> {
    let refused = |message: String| Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    // Checked before opening, because opening a pipe waits for its writer.
    if !fs::metadata(path)?.is_file() {
        return refused("not a regular file".to_owned());
    }
    let mut file = File::open(path)?;
    // Of the open file: the name may lead to another one by now.
    let length = file.metadata()?.len();
    if length > limit {
        return refused(format!(
            "the file has {length} bytes, but only {limit} bytes of memory are allowed"
        ));
    }
    let mut bytes = Vec::new();
    file.by_ref()
        .take(START.min(length))
        .read_to_end(&mut bytes)?;
    if let Err(message) = starts(&bytes) {
        return refused(message);
    }
    let rest = length.saturating_sub(bytes.len() as u64);
    bytes.try_reserve_exact(rest as usize)?;
    // A file that grows meanwhile is cut off at the checked length.
    file.take(rest).read_to_end(&mut bytes)?;
    Ok(bytes)
}
