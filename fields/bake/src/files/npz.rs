//! Arrays for numpy: .npz files, which are .zip archives of .npy files without compression.

use std::io::{self, Write};

use antumbra::LocalOrigin;
use rawzip::time::UtcDateTime;
use rawzip::{ErrorKind, ZipArchiveWriter};

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

/// Numbers that are converted together.
const PIECE: usize = 1 << 12;

/// Writes numbers, some at a time; `add` adds the bytes of one.
fn put<T>(numbers: &[T], file: &mut dyn Write, add: impl Fn(&T, &mut Vec<u8>)) -> io::Result<()> {
    let mut bytes = Vec::new();
    numbers.chunks(PIECE).try_for_each(|piece| {
        bytes.clear();
        piece.iter().for_each(|number| add(number, &mut bytes));
        file.write_all(&bytes)
    })
}

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
        (self.len() * self.kind().1) as u64
    }

    /// The type of the numbers as numpy names it, and bytes of one.
    fn kind(&self) -> (String, usize) {
        let (name, width) = match self {
            Self::F64(_) => ("<f8", 8),
            Self::Places(_, local) if *local != LocalOrigin::default() => ("<f8", 8),
            Self::F32(_) | Self::Points(_) | Self::Places(..) => ("<f4", 4),
            Self::Counts(_) => ("<i8", 8),
            Self::Bits(_) => ("|u1", 1),
            Self::Text(text) => {
                let length = text.chars().count().max(1);
                return (format!("<U{length}"), 4 * length);
            }
        };
        (name.to_owned(), width)
    }

    fn write(&self, file: &mut dyn Write) -> io::Result<()> {
        match *self {
            Self::F64(values) => put(values, file, |x, to| to.extend(x.to_le_bytes())),
            Self::F32(values) => put(values, file, |x, to| to.extend(x.to_le_bytes())),
            Self::Places(points, local) if local != LocalOrigin::default() => {
                put(points, file, |&point, to| {
                    to.extend(local.world(point).map(f64::to_le_bytes).as_flattened());
                })
            }
            Self::Points(points) | Self::Places(points, _) => {
                Array::F32(points.as_flattened()).write(file)
            }
            Self::Counts(values) => put(values, file, |x, to| to.extend(x.to_le_bytes())),
            Self::Bits(matrix) => Array::Counts(matrix.words()).write(file),
            Self::Text("") => file.write_all(&[0; 4]),
            Self::Text(text) => {
                let mut characters = text.chars();
                characters.try_for_each(|c| file.write_all(&u32::from(c).to_le_bytes()))
            }
        }
    }

    /// Header of the .npy file, version 1.0.
    fn header(&self, shape: &[usize]) -> Vec<u8> {
        let shape: String = shape.iter().map(|n| format!("{n}, ")).collect();
        let mut text = format!(
            "{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}",
            self.kind().0,
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

/// 1980-01-01, the first date that archives can have.
const DATE: i64 = 315_532_800;

/// The error of the writer as it is, so that its kind and its words are kept.
fn plain(error: rawzip::Error) -> io::Error {
    match error.into_kind() {
        ErrorKind::IO(error) => error,
        kind => io::Error::other(format!("{kind}")),
    }
}

/// Writes arrays as an .npz file. Equal arrays make equal bytes, because all have the same date.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] if a shape does not have as many numbers as its array. Otherwise errors of the writer.
pub fn write_npz(entries: &[Entry<'_>], file: &mut dyn Write) -> io::Result<()> {
    let mut archive = ZipArchiveWriter::new(file);
    for Entry { name, shape, array } in entries {
        if shape.iter().product::<usize>() != array.len() {
            let reason = "a shape that does not fit its array";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        let member = archive.new_file(format!("{name}.npy"));
        let member = member.last_modified(UtcDateTime::from_unix(DATE));
        let (mut member, config) = member.start().map_err(plain)?;
        let mut data = config.wrap(&mut member);
        data.write_all(&array.header(shape))?;
        array.write(&mut data)?;
        let (_, sums) = data.finish().map_err(plain)?;
        member.finish(sums).map_err(plain)?;
    }
    archive.finish().map_err(plain)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use rawzip::ZipArchive;

    use super::*;

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
    fn archives_have_the_arrays() {
        let matrix = BitMatrix::from_words(2, 70, vec![1, 2, 3, 4]).expect("a matrix");
        let entries = [
            Entry::new("seen", Array::Bits(&matrix)),
            Entry::new("hours", Array::F64(&[1.5, 2.5])).columns(1),
            Entry::new("points", Array::Points(&[[1.0, 2.0, 3.0]])),
        ];
        let mut file = Vec::new();
        write_npz(&entries, &mut file).expect("written");
        assert!(file.len() as u64 <= npz_bytes(&entries) + 400);
        let mut again = Vec::new();
        write_npz(&entries, &mut again).expect("written");
        assert!(again == file, "equal arrays make equal bytes");
        let archive = ZipArchive::from_slice(&file).expect("an archive");
        let mut found = Vec::new();
        for record in archive.entries() {
            let record = record.expect("a record");
            let member = archive.get_entry(record.wayfinder()).expect("a member");
            let (name, data) = (record.file_path(), member.data());
            assert!(data.starts_with(b"\x93NUMPY"));
            let length = 10 + usize::from(u16::from_le_bytes([data[8], data[9]]));
            assert_eq!(length % 64, 0);
            assert_eq!(record.crc32(), rawzip::crc32(data));
            found.push((name.as_ref().to_vec(), data[length..].to_vec()));
        }
        let names: Vec<&[u8]> = found.iter().map(|(name, _)| &name[..]).collect();
        assert_eq!(names, [&b"seen.npy"[..], b"hours.npy", b"points.npy"]);
        assert_eq!(found[1].1, [1.5_f64, 2.5].map(f64::to_le_bytes).concat());
        assert_eq!(
            found[2].1,
            [1.0_f32, 2.0, 3.0].map(f32::to_le_bytes).concat()
        );
        let bad = Entry::new("x", Array::F64(&[1.0; 3])).columns(2);
        assert!(write_npz(&[bad], &mut Vec::new()).is_err());
    }
}
