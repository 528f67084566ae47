//! Atomic replacement of files: an interruption never costs the last good one.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::Error;

/// Replaces a file as a whole or not at all.
///
/// `write` fills a buffered temporary file in the directory of `path`. The temporary file is synced to the disk and
/// renamed to `path`, and the directory is synced too. At every moment, even across a crash, `path` is the old file
/// or the complete new one. On failure, the old file is untouched and the temporary file is removed.
///
/// Symbolic links are followed and stay. Permissions of an existing file are kept. Directories, devices and pipes are
/// refused, because renaming would replace them.
///
/// # Errors
/// [`Error::Write`], also when `write` itself fails.
pub fn atomic_write(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    let path = path.as_ref();
    replace(path, write).map_err(|source| Error::Write {
        path: path.to_path_buf(),
        source,
    })
}

fn replace(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let (target, existing) = resolve(path)?;
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?;
    let directory = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };

    // Dropping the temporary file before `persist` removes it.
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".tmp");
    // The default is private to the user. Pictures get the permissions of any other new file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut temporary = builder.tempfile_in(directory)?;

    let mut buffered = BufWriter::new(temporary.as_file_mut());
    write(&mut buffered)?;
    buffered.flush()?;
    drop(buffered);
    if let Some(existing) = existing {
        temporary
            .as_file()
            .set_permissions(existing.permissions())?;
    }
    temporary.as_file().sync_all()?;
    temporary.persist(&target).map_err(|error| error.error)?;
    sync_directory(directory)
}

/// Syncs a directory, so that a new name survives a crash. Possible on Unix only.
fn sync_directory(directory: &Path) -> io::Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    match fs::File::open(directory)?.sync_all() {
        // Some file systems, most of them on networks, cannot sync directories and need not.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        outcome => outcome,
    }
}

/// Resolves symbolic links of `path`, and returns the metadata of an existing file.
fn resolve(path: &Path) -> io::Result<(PathBuf, Option<fs::Metadata>)> {
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_file() => Ok((fs::canonicalize(path)?, Some(metadata))),
        Ok(_) => Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "the path exists and is not a regular file",
        )),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok((path.to_path_buf(), None)),
        Err(error) => Err(error),
    }
}
