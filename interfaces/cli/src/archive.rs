//! Files of this program's own kinds: checkpoints, parts and orders.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::exit::Failure;
use crate::input;

/// First bytes of all these files.
const START: &[u8; 8] = b"ANTUMBRA";

/// Whether a file is one of our own, by its first bytes. Its other bytes may be damaged.
pub fn is_own(path: &Path) -> bool {
    starts_with(path, START)
}

/// Whether there is a regular file with these first bytes.
pub fn starts_with(path: &Path, first: &[u8]) -> bool {
    let Ok(Some((mut file, _))) = input::open(path) else {
        return false;
    };
    start(&mut file, first.len()).is_ok_and(|bytes| bytes == first)
}

fn start(file: &mut File, length: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(length as u64).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The bytes of one of our own files; `None` if there is none. Of another file, which may be huge, only the first bytes
/// are read: those who read it refuse it for them.
pub fn read(path: &Path) -> Result<Option<Vec<u8>>, Failure> {
    let Some((mut file, length)) = input::open(path)? else {
        return Ok(None);
    };
    let failed = |error: io::Error| input::unread(path, &error);
    let mut bytes = start(&mut file, START.len()).map_err(failed)?;
    if bytes != START {
        return Ok(Some(bytes));
    }
    // Its contents take as much again.
    input::check_memory(path, 2 * length)?;
    bytes.reserve_exact(length as usize);
    file.take(length).read_to_end(&mut bytes).map_err(failed)?;
    Ok(Some(bytes))
}
