//! Files of answers: records, each with a check sum. A record that was cut short is left out, and computed again.

use std::ffi::OsString;
use std::io::{self, Write};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use crate::Error;

/// What the answers in a file belong to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// [`Key`](crate::Key) of the job.
    pub key: u64,
    /// Number of items of the job.
    pub items: usize,
    /// Number of items of a chunk. The last chunk may have fewer.
    pub chunk: usize,
    /// Command line that computes the answers: a note for whoever joins parts.
    pub command: Vec<OsString>,
    /// Share of the chunks: every `shard[1]`-th chunk, from chunk `shard[0]` on.
    pub shard: [u32; 2],
}

/// Answers from a file that [`Work`](crate::Work) wrote.
#[derive(Clone, Debug)]
pub struct Part {
    /// What the answers belong to.
    pub identity: Identity,
    /// Whether the last record is complete.
    pub is_sound: bool,
    /// Numbers and answers of chunks.
    pub(crate) chunks: Vec<(usize, Vec<u8>)>,
}

impl Part {
    /// First bytes of every file.
    pub const MAGIC: &[u8; 16] = b"ANTUMBRABAKE\0\0\0\x02";

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`Error::NoPart`] if the file is another one, [`Error::DamagedPart`] if its identity cannot be read, or makes no sense.
    pub fn read(bytes: &[u8]) -> Result<Self, Error> {
        let mut reader = Reader(bytes.strip_prefix(Self::MAGIC).ok_or(Error::NoPart)?);
        let (_, identity) = reader.record().ok_or(Error::DamagedPart)?;
        let identity: Identity =
            serde_json::from_slice(identity).map_err(|_| Error::DamagedPart)?;
        let [share, shares] = identity.shard;
        if share >= shares || identity.chunk == 0 {
            return Err(Error::DamagedPart);
        }
        let mut chunks = Vec::new();
        while let Some((index, bytes)) = reader.record() {
            chunks.push((index as usize, bytes.to_vec()));
        }
        Ok(Self {
            identity,
            is_sound: reader.0.is_empty(),
            chunks,
        })
    }
}

/// Writes the beginning of a file.
pub(crate) fn write_head(identity: &Identity, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(Part::MAGIC)?;
    write_record(0, &serde_json::to_vec(identity)?, out)
}

/// Writes a record: number, length, check sum, bytes.
pub(crate) fn write_record(number: u64, bytes: &[u8], out: &mut dyn Write) -> io::Result<()> {
    for word in [number, bytes.len() as u64, xxh3_64(bytes) ^ number] {
        out.write_all(&word.to_le_bytes())?;
    }
    out.write_all(bytes)
}

/// Size of a record with so many bytes.
pub(crate) fn record_bytes(bytes: usize) -> u64 {
    24 + bytes as u64
}

/// Reads records.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn record(&mut self) -> Option<(u64, &'a [u8])> {
        let (head, rest) = self.0.split_at_checked(24)?;
        let (words, _) = head.as_chunks::<8>();
        let [number, length, sum] = [0, 1, 2].map(|i| u64::from_le_bytes(words[i]));
        let (bytes, rest) = rest.split_at_checked(usize::try_from(length).ok()?)?;
        if xxh3_64(bytes) ^ number != sum {
            return None;
        }
        self.0 = rest;
        Some((number, bytes))
    }
}
