//! Files of this program's own kinds: checkpoints, parts and orders.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use antumbra_load::MemorySize;

use crate::exit::Failure;

/// First bytes of all these files.
const START: &[u8; 8] = b"ANTUMBRA";

/// Whether a file is one of our own, by its first bytes. Its other bytes may be damaged.
pub fn is_own(path: &Path) -> bool {
    let read = File::open(path).and_then(|mut file| start(&mut file));
    read.is_ok_and(|bytes| bytes == START)
}

fn start(file: &mut File) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(START.len() as u64).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The bytes of one of our own files; `None` if there is none. Of another file, which may be huge, only the first bytes
/// are read: those who read it refuse it for them.
pub fn read(path: &Path) -> Result<Option<Vec<u8>>, Failure> {
    let failed =
        |error: io::Error| Failure::Work(format!("cannot read {}: {error}", path.display()));
    match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        // Devices and pipes may have no end.
        Ok(metadata) if !metadata.is_file() => {
            return Err(Failure::Data(format!("{} is not a file", path.display())));
        }
        found => found.map_err(failed)?,
    };
    let mut file = File::open(path).map_err(failed)?;
    // Of the open file: the name may lead to another one by now.
    let length = file.metadata().map_err(failed)?.len();
    let mut bytes = start(&mut file).map_err(failed)?;
    if bytes != START {
        return Ok(Some(bytes));
    }
    // Its contents take as much again.
    let (needed, allowed) = (2 * length, antumbra_guard::limit());
    if needed > allowed {
        let [needed, allowed] = [needed, allowed].map(MemorySize::new);
        return Err(Failure::Data(format!(
            "{} takes about {needed} of memory, more than the {allowed} allowed; allow more with --max-memory",
            path.display()
        )));
    }
    bytes.reserve_exact(length as usize);
    file.take(length).read_to_end(&mut bytes).map_err(failed)?;
    Ok(Some(bytes))
}
