//! The format of all files: kind, version and checksum around postcard's encoding.
//!
//! | bytes | |
//! |---|---|
//! | 8 | `ANTUMBRA` |
//! | 4 | version of the format, little-endian |
//! | 4 | kind of the contents: [`Kind`] |
//! | … | the contents |
//! | 16 | XXH3-128 of all bytes before |

use std::io::{self, BufWriter, Write};

use serde::Serialize;
use serde::de::DeserializeOwned;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

use crate::Error;

const MAGIC: &[u8; 8] = b"ANTUMBRA";
/// Version of the format. Raise it with every change of the contents, or of the meaning of samples and tiles.
const FORMAT: u32 = 5;
const HEADER: usize = 16;
const CHECKSUM: usize = 16;

/// Kind of the contents of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    /// A [`crate::Snapshot`] and its identity.
    Snapshot = 1,
    /// A [`crate::Lesson`] and its place.
    Lesson = 2,
}

impl Kind {
    /// Name in errors.
    pub fn name(self) -> &'static str {
        match self {
            Self::Snapshot => "a checkpoint or a part of a picture",
            Self::Lesson => "a learned order",
        }
    }
}

/// Writes a file with these contents, without a copy of them in memory.
pub fn write(kind: Kind, contents: &impl Serialize, file: &mut dyn Write) -> io::Result<()> {
    // Numbers come byte by byte, which is a slow way to sum and to write.
    let mut writer = BufWriter::with_capacity(1 << 16, Summed::new(file));
    writer.write_all(MAGIC)?;
    writer.write_all(&FORMAT.to_le_bytes())?;
    writer.write_all(&(kind as u32).to_le_bytes())?;
    if let Err(error) = postcard::to_io(contents, &mut writer) {
        let failure = writer.get_mut().failure.take();
        return Err(failure.unwrap_or_else(|| io::Error::other(error)));
    }
    writer.flush()?;
    let sum = writer.get_ref().sum.digest128();
    writer.write_all(&sum.to_le_bytes())?;
    writer.flush()
}

/// Writer that knows the checksum of what it has written.
struct Summed<'a> {
    file: &'a mut dyn Write,
    sum: Xxh3,
    /// Why writing failed. The encoder reports only that it did.
    failure: Option<io::Error>,
}

impl<'a> Summed<'a> {
    fn new(file: &'a mut dyn Write) -> Self {
        Self {
            file,
            sum: Xxh3::new(),
            failure: None,
        }
    }
}

impl Write for Summed<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.file.write(bytes) {
            Ok(count) => {
                self.sum.update(&bytes[..count]);
                Ok(count)
            }
            Err(error) => {
                let told = error.kind().into();
                self.failure = Some(error);
                Err(told)
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Contents of a file.
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

    /// Files of random contents with a good checksum are refused, or harmless.
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
            let mut good = Vec::new();
            snapshot.write(&identity, &mut good).expect("bytes");
            for seed in 0..4000 {
                let mut bytes = good[..good.len() - CHECKSUM].to_vec();
                // Sizes are at the beginning, sums in the rest.
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

    /// A file of limited size, as on a full disk.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0 == 0 {
                return Err(io::Error::new(
                    io::ErrorKind::StorageFull,
                    "the disk is full",
                ));
            }
            let count = bytes.len().min(self.0);
            self.0 -= count;
            Ok(count)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_full_disk_is_told_of_by_its_own_error() {
        let contents = vec![7_u32; 100_000];
        for room in [0, 1, 70_000] {
            let error = write(Kind::Lesson, &contents, &mut Full(room)).expect_err("no room");
            assert_eq!(error.kind(), io::ErrorKind::StorageFull, "{room}: {error}");
        }
        let mut bytes = Vec::new();
        write(Kind::Lesson, &contents, &mut bytes).expect("room");
        let read: Vec<u32> = decode(Kind::Lesson, &bytes).expect("a good file");
        assert_eq!(read, contents);
    }
}
