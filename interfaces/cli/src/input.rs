//! Files that the command line names as inputs, beside scenes.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;

use antumbra_load::MemorySize;

use crate::exit::Failure;

/// A file that is open, and its length in bytes; `None` if there is none. Devices and pipes are refused: they may have no
/// end, and a pipe waits for its writer.
pub fn open(path: &Path) -> Result<Option<(File, u64)>, Failure> {
    let length = |file: File| Ok::<_, io::Error>(Some((file.metadata()?.len(), file)));
    match antumbra_files::open(path).and_then(length) {
        Ok(found) => Ok(found.map(|(length, file)| (file, length))),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        // Of this kind are names of devices, pipes and folders.
        Err(error) if error.kind() == ErrorKind::Other => {
            Err(Failure::Data(format!("{}: {error}", path.display())))
        }
        Err(error) => Err(unread(path, &error)),
    }
}

/// The bytes of a file whose contents take as much memory again.
pub fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    let Some((file, length)) = open(path)? else {
        return Err(unread(path, &ErrorKind::NotFound.into()));
    };
    check_memory(path, 2 * length)?;
    let mut bytes = Vec::new();
    // A file that grows meanwhile is cut off at the length that was checked.
    let read = file.take(length).read_to_end(&mut bytes);
    read.map_err(|error| unread(path, &error))?;
    Ok(bytes)
}

/// The text of a file whose contents take as much memory again, without a byte order mark. Bytes that are no UTF-8 are of
/// Latin-1, as names often are.
pub fn text(path: &Path) -> Result<String, Failure> {
    let mut bytes = read(path)?;
    let mark = bytes.len() - antumbra_scene::without_mark(&bytes).len();
    bytes.drain(..mark);
    let text = String::from_utf8(bytes);
    let latin = |bytes: &[u8]| bytes.iter().map(|&byte| char::from(byte)).collect();
    Ok(text.unwrap_or_else(|error| latin(error.as_bytes())))
}

/// Refuses a file that needs more memory than is allowed.
pub fn check_memory(path: &Path, needed: u64) -> Result<(), Failure> {
    let allowed = antumbra_guard::limit();
    if needed <= allowed {
        return Ok(());
    }
    let [needed, allowed] = [needed, allowed].map(MemorySize::new);
    Err(Failure::Data(format!(
        "{} takes about {needed} of memory, more than the {allowed} allowed; allow more with --max-memory",
        path.display()
    )))
}

/// Refuses a job whose answers need more memory than is left, before the first of them is computed.
pub fn check_answers(name: &str, needed: u64) -> Result<(), Failure> {
    let left = antumbra_guard::limit().saturating_sub(antumbra_guard::taken());
    if needed <= left {
        return Ok(());
    }
    let [needed, left] = [needed, left].map(MemorySize::new);
    Err(Failure::Data(format!(
        "{name}: the answers take about {needed} of memory, and {left} are left; take fewer points, share the work with --shard, or \
         allow more with --max-memory"
    )))
}

/// The failure to read a file.
pub fn unread(path: &Path, error: &io::Error) -> Failure {
    Failure::Work(format!("cannot read {}: {error}", path.display()))
}
