//! Writing files with the errors of this crate.

use std::io::{self, Write};
use std::path::Path;

use antumbra_files::{Output, write_file, write_file_seeking};

use crate::Error;

/// Replaces a file as a whole or not at all, as [`write_file`] does.
///
/// # Errors
/// [`Error::Write`], also when `write` itself fails.
pub fn atomic_write(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    let path = path.as_ref();
    write_file(path, write).map_err(|source| failed(path, source))
}

/// As [`atomic_write`], for writers that go back, as formats with tables at the front need.
///
/// # Errors
/// As [`atomic_write`].
pub fn atomic_write_seeking(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Output) -> io::Result<()>,
) -> Result<(), Error> {
    let path = path.as_ref();
    write_file_seeking(path, write).map_err(|source| failed(path, source))
}

fn failed(path: &Path, source: io::Error) -> Error {
    let path = path.to_path_buf();
    Error::Write { path, source }
}
