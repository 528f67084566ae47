//! The file of peaks beside an index.
//!
//! Its bytes are `antumbra.peaks/1`, and a record for each square of 512 cells, in the order of files and of their squares: 64 x 64 peaks of
//! squares of 8 cells, row by row, in single precision and little-endian order, and the checksum of these bytes (XXH3, 64 bits) with
//! the number of the record as seed. Last come 8 bytes, the checksum of all checksums, which the index has, too. So a file of
//! another index is found at once, and a damaged record where it is read.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use antumbra_terrain::Peaks;
use xxhash_rust::xxh3::{Xxh3, xxh3_64_with_seed};

use crate::Error;

/// Cells on a side of the squares whose peaks the index has.
pub const BLOCK: usize = 512;
/// Cells on a side of the squares whose peaks this file has.
const SIDE: usize = 8;
/// Squares on a side of a block.
const ACROSS: usize = BLOCK / SIDE;

const MAGIC: &[u8] = b"antumbra.peaks/1";
const RECORD: usize = 4 * ACROSS * ACROSS + 8;

/// The name of the file.
pub fn path(index: &Path) -> PathBuf {
    let mut name = index.as_os_str().to_owned();
    name.push(".peaks");
    name.into()
}

/// Peaks of one block.
#[derive(Clone, Debug)]
pub struct Record([f32; ACROSS * ACROSS]);

impl Record {
    /// Of a block without data.
    pub fn new() -> Self {
        Self([f32::NEG_INFINITY; ACROSS * ACROSS])
    }

    /// Counts a height of a cell of the block.
    pub fn add(&mut self, [column, row]: [usize; 2], height: f64) {
        let peak = &mut self.0[row / SIDE * ACROSS + column / SIDE];
        *peak = peak.max(up(height));
    }

    /// The largest one, if there is data.
    pub fn peak(&self) -> Option<f32> {
        let most = self.0.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        (most > f32::NEG_INFINITY).then_some(most)
    }

    fn bytes(&self, number: u64) -> [u8; RECORD] {
        let mut bytes = [0; RECORD];
        for (bytes, peak) in bytes.chunks_exact_mut(4).zip(self.0) {
            bytes.copy_from_slice(&peak.to_le_bytes());
        }
        let sum = xxh3_64_with_seed(&bytes[..RECORD - 8], number);
        bytes[RECORD - 8..].copy_from_slice(&sum.to_le_bytes());
        bytes
    }
}

/// The least number of single precision that is not below.
fn up(height: f64) -> f32 {
    let near = height as f32;
    if f64::from(near) < height {
        near.next_up()
    } else {
        near
    }
}

/// Writes records.
pub struct Writer<'a> {
    file: &'a mut dyn Write,
    sums: Xxh3,
    number: u64,
}

impl<'a> Writer<'a> {
    pub fn new(file: &'a mut dyn Write) -> io::Result<Self> {
        file.write_all(MAGIC)?;
        Ok(Self {
            file,
            sums: Xxh3::new(),
            number: 0,
        })
    }

    pub fn push(&mut self, record: &Record) -> io::Result<()> {
        let bytes = record.bytes(self.number);
        self.sums.update(&bytes[RECORD - 8..]);
        self.number += 1;
        self.file.write_all(&bytes)
    }

    /// Ends the file. Returns its checksum.
    pub fn finish(self) -> io::Result<u64> {
        let sum = self.sums.digest();
        self.file.write_all(&sum.to_le_bytes())?;
        Ok(sum)
    }
}

/// Reads records.
#[derive(Debug)]
pub struct Reader {
    path: PathBuf,
    file: Mutex<File>,
}

impl Reader {
    /// Opens the file of an index, which has so many records and this checksum.
    pub fn open(index: &Path, records: usize, sum: u64) -> Result<Self, Error> {
        let path = path(index);
        let check = || {
            let mut file = File::open(&path)?;
            let mut last = [0; 8];
            let wanted = (MAGIC.len() + RECORD * records) as u64;
            if file.metadata()?.len() == wanted + 8 {
                file.seek(SeekFrom::Start(wanted))?;
                file.read_exact(&mut last)?;
            }
            Ok((file, u64::from_le_bytes(last)))
        };
        let (file, found) = check().map_err(|error| Error::io(&path, error))?;
        match found == sum {
            true => Ok(Self {
                path,
                file: Mutex::new(file),
            }),
            false => Err(Error::broken(
                &path,
                format!(
                    "it is not of {}; make both again by `antumbra index`",
                    index.display()
                ),
            )),
        }
    }

    /// Peaks of the block of this number, which has so many columns and rows.
    pub fn read(&self, number: usize, size: [usize; 2]) -> Result<Peaks, Error> {
        let mut bytes = [0; RECORD];
        let place = SeekFrom::Start((MAGIC.len() + RECORD * number) as u64);
        {
            let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
            let read = file.seek(place).and_then(|_| file.read_exact(&mut bytes));
            read.map_err(|error| Error::io(&self.path, error))?;
        }
        let (numbers, sum) = bytes.split_at(RECORD - 8);
        if xxh3_64_with_seed(numbers, number as u64).to_le_bytes() != *sum {
            return Err(Error::broken(
                &self.path,
                format!("record {number} is damaged; make it again by `antumbra index`"),
            ));
        }
        let [across, down] = size.map(|cells| cells.div_ceil(SIDE));
        let (numbers, _) = numbers.as_chunks::<4>();
        let rows = numbers.chunks_exact(ACROSS).take(down);
        let values = rows.flat_map(|row| {
            row[..across]
                .iter()
                .map(|&bytes| f32::from_le_bytes(bytes).into())
        });
        Ok(Peaks::from_values(
            size,
            SIDE,
            &values.collect::<Vec<f64>>(),
        )?)
    }
}
