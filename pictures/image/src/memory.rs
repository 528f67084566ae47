//! Memory that pictures may take, shared by readers on several threads.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of a file that its format is recognised by.
const START: u64 = 32;

/// Memory that pictures may still take in bytes. Readers on several threads can share one.
#[derive(Debug)]
pub struct Allowance {
    left: AtomicU64,
}

impl Allowance {
    /// An allowance of so many bytes.
    pub const fn new(bytes: u64) -> Self {
        Self {
            left: AtomicU64::new(bytes),
        }
    }

    /// An allowance without an end.
    pub const fn unlimited() -> Self {
        Self::new(u64::MAX)
    }

    /// Bytes that are left.
    pub fn left(&self) -> u64 {
        self.left.load(Ordering::Relaxed)
    }

    fn take(&self, bytes: u64) -> bool {
        let rest = |left: u64| left.checked_sub(bytes);
        let order = Ordering::Relaxed;
        self.left.fetch_update(order, order, rest).is_ok()
    }

    fn give_back(&self, bytes: u64) {
        self.left.fetch_add(bytes, Ordering::Relaxed);
    }
}

/// Memory that one reader has taken. Dropped, it gives back all but what was kept.
pub(crate) struct Claim<'a> {
    allowance: &'a Allowance,
    taken: u64,
}

impl<'a> Claim<'a> {
    pub fn new(allowance: &'a Allowance) -> Self {
        Self {
            allowance,
            taken: 0,
        }
    }

    /// Takes memory before it is allocated.
    pub fn take(&mut self, bytes: u64) -> Result<(), String> {
        if self.allowance.take(bytes) {
            self.taken += bytes;
            return Ok(());
        }
        let left = self.allowance.left();
        Err(format!(
            "it needs {bytes} bytes of memory, more than the {left} bytes that are allowed"
        ))
    }

    /// Takes memory for pixels and for what their decoder needs beside them, in bytes per pixel.
    pub fn take_pixels(&mut self, width: u64, height: u64, each: u64) -> Result<(), String> {
        self.take(width.saturating_mul(height).saturating_mul(each))
    }

    /// Leaves so many bytes taken.
    pub fn keep(mut self, bytes: u64) {
        self.taken = self.taken.saturating_sub(bytes);
    }
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        self.allowance.give_back(self.taken);
    }
}

/// Reads a regular file. Of a file that does not start as its format says, only the start is read, which is enough for
/// the decoder to refuse it: a file that is no picture may be huge. Devices are refused, because they may never end.
pub(crate) fn read_file(
    path: &Path,
    claim: &mut Claim,
    starts: fn(&[u8]) -> bool,
) -> Result<Vec<u8>, Unread> {
    let regular = |metadata: &Metadata| {
        let message = "not a regular file";
        let error = || io::Error::new(io::ErrorKind::InvalidInput, message);
        metadata.is_file().then_some(()).ok_or_else(error)
    };
    // Checked before opening, because opening a pipe waits for its writer.
    regular(&std::fs::metadata(path)?)?;
    let mut file = File::open(path)?;
    // Asked again of the open file: the name may lead to another one by now.
    let metadata = file.metadata()?;
    regular(&metadata)?;
    let length = metadata.len();
    let mut bytes = Vec::new();
    file.by_ref().take(START).read_to_end(&mut bytes)?;
    if !starts(&bytes) {
        return Ok(bytes);
    }
    claim.take(length).map_err(Unread::Refused)?;
    let rest = length.saturating_sub(bytes.len() as u64);
    bytes
        .try_reserve_exact(rest as usize)
        .map_err(io::Error::from)?;
    // A file that grows meanwhile is cut off at the checked length.
    file.take(rest).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Why a file was not read.
pub(crate) enum Unread {
    /// An error of the operating system.
    Io(io::Error),
    /// The file takes more memory than is allowed.
    Refused(String),
}

impl From<io::Error> for Unread {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn claims_give_back_what_they_do_not_keep() {
        let allowance = Allowance::new(100);
        let mut claim = Claim::new(&allowance);
        assert!(claim.take(60).is_ok() && claim.take(41).is_err());
        assert_eq!(allowance.left(), 40);
        claim.keep(25);
        assert_eq!(allowance.left(), 75);
        drop(Claim::new(&allowance));
        assert_eq!(allowance.left(), 75);
        assert!(Claim::new(&allowance).take_pixels(u64::MAX, 2, 3).is_err());
    }
}
