//! Regular files of limited size, read into memory.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Reads a regular file of at most `limit` bytes.
///
/// Larger files are refused before anything is read, and so are devices and pipes, which may never end.
pub(crate) fn read(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let refused = |message: String| Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    // Checked before opening, because opening a pipe waits for its writer.
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        return refused("not a regular file".to_owned());
    }
    let length = metadata.len();
    if length > limit {
        return refused(format!(
            "the file has {length} bytes, but only {limit} bytes of memory are allowed"
        ));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length as usize)?;
    // A file that grows meanwhile is cut off at the checked length.
    File::open(path)?.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}
