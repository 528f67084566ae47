//! A file in memory, if it is one that ends.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Reads a file whole. Devices and pipes, which may never end, are refused, and so is what is longer than
/// `limit` bytes; both before anything is read.
pub(crate) fn read(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let refused = |message: String| Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    // Asked before opening: opening a pipe would wait for its writer.
    let metadata = fs::metadata(path)?;
    if !metadata.is_file() {
        return refused("it is not a regular file".to_owned());
    }
    let length = metadata.len();
    if length > limit {
        return refused(format!(
            "it is {length} bytes long, and {limit} bytes of memory are allowed"
        ));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length as usize)?;
    // A file that grows meanwhile is cut.
    File::open(path)?.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}
