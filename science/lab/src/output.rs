//! Directories and JSON files of results.

use std::fs;
use std::path::Path;

use antumbra_image::{atomic_write, probe, remove_leftovers};
use serde::Serialize;

use crate::Error;

/// Makes a directory and those around it, and checks that files can be put there. Temporary files that killed
/// processes left there are removed.
///
/// # Errors
/// [`Error::Write`].
pub fn make_directory(path: &Path) -> Result<(), Error> {
    fs::create_dir_all(path)
        .and_then(|()| probe(path))
        .map_err(Error::write(path))?;
    remove_leftovers(path);
    Ok(())
}

/// A document as indented JSON. Numbers that are not finite become `null`.
///
/// # Errors
/// [`Error::Report`] if the document is not of JSON's kind.
pub fn json(document: &impl Serialize) -> Result<String, Error> {
    serde_json::to_string_pretty(document).map_err(Error::report)
}

/// Writes a document as JSON to a file, as a whole or not at all.
///
/// # Errors
/// [`Error::Report`] as for [`json`], and [`Error::Image`] if the file cannot be written.
pub fn write_json(document: &impl Serialize, path: &Path) -> Result<(), Error> {
    let text = json(document)?;
    atomic_write(path, |file| writeln!(file, "{text}"))?;
    Ok(())
}

/// Writes bytes to a file, as a whole or not at all.
///
/// # Errors
/// [`Error::Image`] if the file cannot be written.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    atomic_write(path, |file| file.write_all(bytes))?;
    Ok(())
}
