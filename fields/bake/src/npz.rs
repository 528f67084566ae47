//! Arrays for numpy: .npz files, which are .zip archives of .npy files without compression.

use std::io::{self, Write};

use antumbra::LocalOrigin;

use crate::BitMatrix;

/// An array of numbers, row by row.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Array<'a> {
    /// `float64`.
    F64(&'a [f64]),
    /// `float32`.
    F32(&'a [f32]),
    /// `float32`, three for each row.
    Points(&'a [[f32; 3]]),
    /// Points of the world that are measured from an origin: in double precision, unless it is zero.
    Places(&'a [[f32; 3]], LocalOrigin),
    /// `int64`, which unsigned numbers below 2⁶³ are written as.
    Counts(&'a [u64]),
    /// One bit per number, as `uint8`: rows of whole words of 8 bytes, for `numpy.unpackbits(x, axis=1, count=columns,
    /// bitorder="little")`.
    Bits(&'a BitMatrix),
    /// Text, as an array without dimensions.
    Text(&'a str),
}

/// Whether points are in world coordinates, without an offset.
fn is_zero(local: &LocalOrigin) -> bool {
    *local == LocalOrigin::default()
}

/// Numbers that are converted together.
const PIECE: usize = 1 << 12;

impl Array<'_> {
    fn len(&self) -> usize {
        match self {
            Self::F64(values) => values.len(),
            Self::F32(values) => values.len(),
            Self::Points(points) | Self::Places(points, _) => 3 * points.len(),
            Self::Counts(values) => values.len(),
            Self::Bits(matrix) => 8 * matrix.words().len(),
            Self::Text(_) => 1,
        }
    }

    /// Size of the values in the file in bytes, without the header.
    pub fn bytes(&self) -> u64 {
        let of_one = match self {
            Self::F64(_) | Self::Counts(_) => 8,
            Self::F32(_) | Self::Points(_) => 4,
            Self::Places(_, local) => {
                if is_zero(local) {
                    4
                } else {
                    8
                }
            }
            Self::Bits(_) => 1,
            Self::Text(text) => 4 * text.chars().count().max(1),
        };
        self.len() as u64 * of_one as u64
    }

    fn kind(&self) -> String {
        match self {
            Self::F64(_) => "<f8".into(),
            Self::Places(_, local) if !is_zero(local) => "<f8".into(),
            Self::F32(_) | Self::Points(_) | Self::Places(..) => "<f4".into(),
            Self::Counts(_) => "<i8".into(),
            Self::Bits(_) => "|u1".into(),
            Self::Text(text) => format!("<U{}", text.chars().count().max(1)),
        }
    }

    /// Hands over the bytes, some at a time.
    fn each(&self, put: &mut dyn FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
        let mut bytes = Vec::new();
        let mut numbers = |piece: &mut dyn Iterator<Item = [u8; 8]>, width: usize| {
            bytes.clear();
            piece.for_each(|number| bytes.extend(&number[..width]));
            put(&bytes)
        };
        let four = |bytes: [u8; 4]| [bytes[0], bytes[1], bytes[2], bytes[3], 0, 0, 0, 0];
        match self {
            Self::F64(values) => values
                .chunks(PIECE)
                .try_for_each(|piece| numbers(&mut piece.iter().map(|x| x.to_le_bytes()), 8)),
            Self::F32(values) => values
                .chunks(PIECE)
                .try_for_each(|piece| numbers(&mut piece.iter().map(|x| four(x.to_le_bytes())), 4)),
            Self::Places(points, local) if !is_zero(local) => {
                points.chunks(PIECE).try_for_each(|piece| {
                    let world = piece.iter().flat_map(|point| local.world(*point));
                    numbers(&mut world.map(f64::to_le_bytes), 8)
                })
            }
            Self::Points(points) | Self::Places(points, _) => points
                .as_flattened()
                .chunks(PIECE)
                .try_for_each(|piece| numbers(&mut piece.iter().map(|x| four(x.to_le_bytes())), 4)),
            Self::Counts(values) => values
                .chunks(PIECE)
                .try_for_each(|piece| numbers(&mut piece.iter().map(|x| x.to_le_bytes()), 8)),
            Self::Bits(matrix) => matrix
                .words()
                .chunks(PIECE)
                .try_for_each(|piece| numbers(&mut piece.iter().map(|x| x.to_le_bytes()), 8)),
            Self::Text("") => numbers(&mut [[0; 8]].into_iter(), 4),
            Self::Text(text) => numbers(
                &mut text.chars().map(|c| four(u32::from(c).to_le_bytes())),
                4,
            ),
        }
    }

    /// Header of the .npy file, version 1.0.
    fn header(&self, shape: &[usize]) -> Vec<u8> {
        let shape: String = shape.iter().map(|n| format!("{n}, ")).collect();
        let mut text = format!(
            "{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}",
            self.kind(),
            shape.trim_end()
        );
        // Data begin at a multiple of 64 bytes.
        let unpadded = 10 + text.len() + 1;
        text.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
        text.push('\n');
        let mut header = b"\x93NUMPY\x01\x00".to_vec();
        header.extend((text.len() as u16).to_le_bytes());
        header.extend(text.bytes());
        header
    }
}

/// An array with its name and shape.
#[derive(Clone, Debug)]
pub struct Entry<'a> {
    name: &'a str,
    shape: Vec<usize>,
    array: Array<'a>,
}

impl<'a> Entry<'a> {
    /// An array called `name`, with its own shape: `[n]`, `[n, 3]`, `[rows, bytes per row]`, or none for text.
    pub fn new(name: &'a str, array: Array<'a>) -> Self {
        let shape = match array {
            Array::Points(points) | Array::Places(points, _) => vec![points.len(), 3],
            Array::Bits(matrix) => vec![matrix.rows(), 8 * matrix.words_per_row()],
            Array::Text(_) => Vec::new(),
            Array::F64(_) | Array::F32(_) | Array::Counts(_) => vec![array.len()],
        };
        Self { name, shape, array }
    }

    /// The array with rows of so many columns.
    #[must_use]
    pub fn columns(mut self, columns: usize) -> Self {
        let len = self.array.len();
        self.shape = vec![len.checked_div(columns).unwrap_or(0), columns];
        self
    }
}

/// Size of a file in bytes, up to about 300 bytes for each array.
pub fn npz_bytes(entries: &[Entry<'_>]) -> u64 {
    entries.iter().map(|entry| entry.array.bytes() + 400).sum()
}

/// Writes arrays as an .npz file. Equal arrays make equal bytes: no time is written.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] if a shape does not have as many numbers as its array, or if a name is longer than 100
/// bytes. Otherwise errors of the writer.
pub fn write_npz(entries: &[Entry<'_>], file: &mut dyn Write) -> io::Result<()> {
    let invalid = |reason: &'static str| io::Error::new(io::ErrorKind::InvalidInput, reason);
    let mut offset = 0;
    let mut directory = Vec::new();
    for entry in entries {
        let name = format!("{}.npy", entry.name);
        let numbers: usize = entry.shape.iter().product();
        if numbers != entry.array.len() {
            return Err(invalid("a shape that does not fit its array"));
        }
        if name.len() > 104 {
            return Err(invalid("a name that is too long"));
        }
        let header = entry.array.header(&entry.shape);
        let size = header.len() as u64 + entry.array.bytes();
        let mut sum = Crc::new();
        sum.add(&header);
        entry.array.each(&mut |bytes| {
            sum.add(bytes);
            Ok(())
        })?;
        let record = Record {
            name,
            crc: sum.value(),
            size,
            offset,
        };
        let local = record.local();
        file.write_all(&local)?;
        file.write_all(&header)?;
        entry.array.each(&mut |bytes| file.write_all(bytes))?;
        offset += local.len() as u64 + size;
        directory.extend(record.central());
    }
    file.write_all(&directory)?;
    file.write_all(&end(entries.len() as u64, directory.len() as u64, offset))
}

/// A file of the archive. Sizes and offsets are always in the extra field of large archives (zip64).
struct Record {
    name: String,
    crc: u32,
    size: u64,
    offset: u64,
}

/// Mark of a number whose 64 bits are in another field.
const ELSEWHERE: u32 = u32::MAX;
/// Version of the format that has numbers of 64 bits: 4.5.
const VERSION: u16 = 45;
/// 1980-01-01, the first date there is.
const DATE: u16 = (1 << 5) | 1;

impl Record {
    fn shared(&self, bytes: &mut Vec<u8>, extra: u16) {
        // Flags, method (stored) and time.
        for number in [VERSION, 0, 0, 0, DATE] {
            bytes.extend(number.to_le_bytes());
        }
        for number in [self.crc, ELSEWHERE, ELSEWHERE] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend((self.name.len() as u16).to_le_bytes());
        bytes.extend(extra.to_le_bytes());
    }

    fn local(&self) -> Vec<u8> {
        let mut bytes = b"PK\x03\x04".to_vec();
        self.shared(&mut bytes, 20);
        bytes.extend(self.name.bytes());
        bytes.extend([1, 0, 16, 0]);
        bytes.extend([self.size, self.size].map(u64::to_le_bytes).as_flattened());
        bytes
    }

    fn central(&self) -> Vec<u8> {
        let mut bytes = b"PK\x01\x02".to_vec();
        bytes.extend(VERSION.to_le_bytes());
        self.shared(&mut bytes, 28);
        // Comment, disk and attributes.
        bytes.extend([0; 10]);
        bytes.extend(ELSEWHERE.to_le_bytes());
        bytes.extend(self.name.bytes());
        bytes.extend([1, 0, 24, 0]);
        let numbers = [self.size, self.size, self.offset];
        bytes.extend(numbers.map(u64::to_le_bytes).as_flattened());
        bytes
    }
}

/// End of an archive, in its long form and its short one.
fn end(files: u64, size: u64, offset: u64) -> Vec<u8> {
    let mut bytes = b"PK\x06\x06".to_vec();
    bytes.extend(44_u64.to_le_bytes());
    bytes.extend([VERSION, VERSION].map(u16::to_le_bytes).as_flattened());
    bytes.extend([0; 8]);
    let numbers = [files, files, size, offset];
    bytes.extend(numbers.map(u64::to_le_bytes).as_flattened());
    bytes.extend(b"PK\x06\x07\x00\x00\x00\x00");
    bytes.extend((offset + size).to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(b"PK\x05\x06\x00\x00\x00\x00");
    bytes.extend([u16::MAX; 2].map(u16::to_le_bytes).as_flattened());
    bytes.extend([ELSEWHERE; 2].map(u32::to_le_bytes).as_flattened());
    bytes.extend([0; 2]);
    bytes
}

/// Check sum of .zip files: CRC-32, four bytes at a time.
struct Crc {
    tables: [[u32; 256]; 4],
    state: u32,
}

impl Crc {
    fn new() -> Self {
        let mut tables = [[0; 256]; 4];
        for index in 0..256 {
            tables[0][index] = (0..8).fold(index as u32, |value, _| {
                (value >> 1) ^ if value & 1 == 1 { 0xEDB8_8320 } else { 0 }
            });
        }
        for table in 1..4 {
            for index in 0..256 {
                let before = tables[table - 1][index];
                tables[table][index] = (before >> 8) ^ tables[0][(before & 0xFF) as usize];
            }
        }
        Self { tables, state: !0 }
    }

    fn add(&mut self, bytes: &[u8]) {
        let (fours, rest) = bytes.as_chunks::<4>();
        for four in fours {
            let value = self.state ^ u32::from_le_bytes(*four);
            let look =
                |table: usize, byte: u32| self.tables[table][(value >> byte & 0xFF) as usize];
            self.state = look(3, 0) ^ look(2, 8) ^ look(1, 16) ^ look(0, 24);
        }
        for &byte in rest {
            let index = (self.state ^ u32::from(byte)) & 0xFF;
            self.state = (self.state >> 8) ^ self.tables[0][index as usize];
        }
    }

    fn value(&self) -> u32 {
        !self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn check_sums_are_the_published_ones() {
        for (text, value) in [("", 0), ("123456789", 0xCBF4_3926), ("a", 0xE8B7_BE43)] {
            let mut sum = Crc::new();
            sum.add(text.as_bytes());
            assert_eq!(sum.value(), value, "{text}");
        }
    }

    #[test]
    fn headers_are_what_numpy_writes() {
        let header = Array::F64(&[0.0; 6]).header(&[2, 3]);
        assert_eq!(header.len() % 64, 0);
        let text = String::from_utf8_lossy(&header[10..]);
        let expected = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3,), }";
        assert_eq!(text.trim_end(), expected);
        let scalar = Array::Text("ä").header(&[]);
        assert!(
            String::from_utf8_lossy(&scalar).contains("'<U1', 'fortran_order': False, 'shape': ()")
        );
    }

    #[test]
    fn bytes_lie_where_the_directory_says() {
        let matrix = BitMatrix::from_words(2, 70, vec![1, 2, 3, 4]).expect("a matrix");
        let entries = [
            Entry::new("seen", Array::Bits(&matrix)),
            Entry::new("hours", Array::F64(&[1.5, 2.5])).columns(1),
            Entry::new("points", Array::Points(&[[1.0, 2.0, 3.0]])),
        ];
        let mut file = Vec::new();
        write_npz(&entries, &mut file).expect("written");
        assert!(file.len() as u64 <= npz_bytes(&entries) + 400);
        let find = |word: &[u8]| {
            let mut windows = file.windows(word.len());
            windows.position(|window| window == word).expect("a place")
        };
        let start = find(b"hours.npy");
        let data = &file[start + 9 + 20..];
        assert!(data.starts_with(b"\x93NUMPY"));
        assert_eq!(data[64..72].len(), 8);
        let header = 10 + usize::from(u16::from_le_bytes([data[8], data[9]]));
        assert_eq!(data[header..header + 8], 1.5_f64.to_le_bytes());
        let central = find(b"PK\x01\x02");
        let long_end = find(b"PK\x06\x06");
        assert_eq!(
            file[long_end + 48..long_end + 56],
            (central as u64).to_le_bytes()
        );
        let bad = Entry::new("x", Array::F64(&[1.0; 3])).columns(2);
        assert!(write_npz(&[bad], &mut Vec::new()).is_err());
    }
}
