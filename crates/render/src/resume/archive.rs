//! The frame of our own files: what they are, in which version, and a checksum, around postcard's encoding.
//!
//! | bytes | |
//! |---|---|
//! | 8 | `ANTUMBRA` |
//! | 4 | version of the format, little-endian |
//! | 4 | what is in it: [`Kind`] |
//! | … | the contents |
//! | 16 | XXH3-128 of all before |

use serde::Serialize;
use serde::de::DeserializeOwned;
use xxhash_rust::xxh3::xxh3_128;

use crate::Error;

const MAGIC: &[u8; 8] = b"ANTUMBRA";
/// To be raised with every change to what is stored, or to the meaning of samples and tiles.
const FORMAT: u32 = 1;
const HEADER: usize = 16;
const CHECKSUM: usize = 16;

/// What is in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    /// A [`crate::Snapshot`] and what it is of.
    Snapshot = 1,
    /// A [`crate::Lesson`] and what it is of.
    Lesson = 2,
}

impl Kind {
    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Snapshot => "a checkpoint or a part of a picture",
            Self::Lesson => "a learned order",
        }
    }
}

/// The bytes of a file.
pub fn encode(kind: Kind, contents: &impl Serialize) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::from(MAGIC);
    bytes.extend(FORMAT.to_le_bytes());
    bytes.extend((kind as u32).to_le_bytes());
    let mut bytes = postcard::to_extend(contents, bytes).map_err(Error::Encode)?;
    bytes.extend(xxh3_128(&bytes).to_le_bytes());
    Ok(bytes)
}

/// What is in the bytes of a file.
pub fn decode<T: DeserializeOwned>(kind: Kind, bytes: &[u8]) -> Result<T, Error> {
    if !bytes.starts_with(MAGIC) {
        return Err(Error::NotAnArchive);
    }
    let number = |at: usize| {
        let bytes = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    };
    let (Some(format), Some(found)) = (number(8), number(12)) else {
        return Err(Error::DamagedArchive);
    };
    if format != FORMAT {
        return Err(Error::ArchiveFormat {
            found: format,
            known: FORMAT,
        });
    }
    let Some((checked, sum)) = bytes.split_last_chunk::<CHECKSUM>() else {
        return Err(Error::DamagedArchive);
    };
    if xxh3_128(checked) != u128::from_le_bytes(*sum) {
        return Err(Error::DamagedArchive);
    }
    if found != kind as u32 {
        let expected = kind.name();
        return Err(Error::ArchiveKind { expected });
    }
    let contents = checked.get(HEADER..).ok_or(Error::DamagedArchive)?;
    match postcard::take_from_bytes(contents) {
        Ok((value, [])) => Ok(value),
        _ => Err(Error::DamagedArchive),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::mix;
    use crate::{Identity, Options, Shard, Snapshot, Task, World, render_task};
    use antumbra_scene::builtin;

    /// Files with any contents but a good checksum: refused, or harmless.
    #[test]
    fn forged_files_do_no_harm() {
        let mut scene = builtin::by_name("city:100").expect("a scene");
        scene.film.resolution = [20, 9];
        let options = Options {
            spp: Some(1),
            standard_error: true,
            ..Options::default()
        };
        let world = World::new(&scene).expect("a valid scene");
        let mut refused = 0;
        for count in [1, 2] {
            let task = Task {
                shard: Shard::new(0, count).expect("a shard"),
                ..Task::default()
            };
            let (_, snapshot) = render_task(&world, &options, task, &()).expect("a part");
            let identity = Identity::new(&scene, &options);
            let good = snapshot.to_bytes(&identity).expect("bytes");
            for seed in 0..4000 {
                let mut bytes = good[..good.len() - CHECKSUM].to_vec();
                // The beginning decides about sizes; the rest is sums.
                let random = |n: u64| mix(seed * 16 + n) as usize;
                for change in 0..1 + random(0) as u64 % 3 {
                    let span = if random(1) % 4 == 0 {
                        bytes.len()
                    } else {
                        200.min(bytes.len())
                    };
                    let at = HEADER + random(2 + change) % (span - HEADER);
                    bytes[at] = random(5 + change) as u8;
                }
                if random(9) % 8 == 0 {
                    bytes.truncate(HEADER + random(10) % bytes.len());
                }
                bytes.extend(xxh3_128(&bytes).to_le_bytes());
                match Snapshot::from_bytes(&bytes) {
                    Err(_) => refused += 1,
                    Ok((identity, snapshot)) => {
                        snapshot.dropped_samples();
                        let part = (String::new(), identity, snapshot);
                        if let Ok(whole) = Snapshot::join(vec![part]) {
                            let _ = (whole.image(), whole.standard_error());
                        }
                    }
                }
            }
        }
        assert!(refused > 1000, "only {refused} of 8000 were refused");
    }
}
