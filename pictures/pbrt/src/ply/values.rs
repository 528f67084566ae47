//! Single values of the body of a PLY file: words of an ASCII file, or bytes in either order.

use antumbra_scene::TriangleMesh;

use super::header::Scalar;
use super::{Fault, PlyPlace};

/// Source of single values.
pub(super) trait Values {
    /// Next value. Every integer type of PLY is exact in an `f64`.
    fn next(&mut self, scalar: Scalar) -> Result<f64, Problem>;
    /// Skips values.
    fn skip(&mut self, scalar: Scalar, count: u64) -> Result<(), Problem>;
    /// Place of the last value read.
    fn place(&self) -> PlyPlace;
    /// Number of bytes that are not read yet.
    fn remaining(&self) -> u64;
    /// Notes that one of the items called `what` is complete.
    fn end_item(&mut self, _what: &'static str) {}
}

/// Reason why there is no next value. The type is small, because every value is returned with it.
pub(super) enum Problem {
    End,
    NotANumber,
}

/// Source of values in ASCII files.
pub(super) struct Ascii<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Range of the last word read.
    word: std::ops::Range<usize>,
    line: u64,
    /// Number of words of the current item.
    words: u64,
    /// First line on which something follows an item, with the words on it, the words of the item, and its name.
    crowded: Option<(u64, u64, u64, &'static str)>,
}

impl<'a> Ascii<'a> {
    /// The values of `bytes`, which begin on this line of the file.
    pub fn new(bytes: &'a [u8], line: u64) -> Self {
        Self {
            bytes,
            at: 0,
            word: 0..0,
            line,
            words: 0,
            crowded: None,
        }
    }

    fn next_word(&mut self) -> Result<(), Problem> {
        while let Some(byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' => self.line += 1,
                b'\r' if self.bytes.get(self.at + 1) != Some(&b'\n') => self.line += 1,
                byte if byte.is_ascii_whitespace() => {}
                _ => break,
            }
            self.at += 1;
        }
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace);
        let length = length.unwrap_or(rest.len());
        self.word = self.at..self.at + length;
        self.at += length;
        self.words += 1;
        if length == 0 {
            return Err(Problem::End);
        }
        Ok(())
    }

    /// The mesh, unless a line has more values than its item and the values do not end with the file. Then items are cut
    /// at the wrong places. A file that has all its values on one line is as good as others.
    pub fn judge(
        mut self,
        read: Result<(TriangleMesh, u64), Fault>,
    ) -> Result<(TriangleMesh, u64), Fault> {
        let Some((line, found, declared, what)) = self.crowded else {
            return read;
        };
        if read.is_ok() && self.next_word().is_err() {
            return read;
        }
        let message = format!(
            "the line has {found} values, but the header declares {declared} for this {what}"
        );
        Err(Fault::at_line(line, message))
    }
}

impl Values for Ascii<'_> {
    fn next(&mut self, _: Scalar) -> Result<f64, Problem> {
        self.next_word()?;
        std::str::from_utf8(&self.bytes[self.word.clone()])
            .ok()
            .and_then(|word| word.parse().ok())
            .ok_or(Problem::NotANumber)
    }

    fn skip(&mut self, _: Scalar, count: u64) -> Result<(), Problem> {
        // Ends with the file at the latest, whatever the count.
        (0..count).try_for_each(|_| self.next_word())
    }

    fn place(&self) -> PlyPlace {
        PlyPlace::Line(self.line)
    }

    fn remaining(&self) -> u64 {
        (self.bytes.len() - self.at) as u64
    }

    fn end_item(&mut self, what: &'static str) {
        let declared = std::mem::take(&mut self.words);
        if self.crowded.is_none() {
            let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
            let line = self.bytes[self.at..]
                .split(is_end)
                .next()
                .unwrap_or_default();
            let more = line
                .split(u8::is_ascii_whitespace)
                .filter(|word| !word.is_empty());
            let more = more.count() as u64;
            if more > 0 {
                self.crowded = Some((self.line, declared + more, declared, what));
            }
        }
    }
}

/// Source of values in binary files, in big-endian order if `BIG`.
pub(super) struct Binary<'a, const BIG: bool> {
    bytes: &'a [u8],
    at: usize,
    /// Offset of the last value read.
    last: usize,
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    /// The values of a file, from the offset `at` on.
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self {
            bytes,
            at,
            last: at,
        }
    }

    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Problem> {
        self.last = self.at;
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let mut bytes = *rest.first_chunk::<N>().ok_or(Problem::End)?;
        self.at += N;
        if BIG {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl<const BIG: bool> Values for Binary<'_, BIG> {
    #[inline]
    fn next(&mut self, scalar: Scalar) -> Result<f64, Problem> {
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.take()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.take()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.take()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.take()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.take()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.take()?).into(),
            Scalar::F32 => f32::from_le_bytes(self.take()?).into(),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    fn skip(&mut self, scalar: Scalar, count: u64) -> Result<(), Problem> {
        self.last = self.at;
        let bytes = count.checked_mul(scalar.size() as u64);
        match bytes {
            Some(bytes) if bytes <= self.remaining() => {
                self.at += bytes as usize;
                Ok(())
            }
            _ => Err(Problem::End),
        }
    }

    fn place(&self) -> PlyPlace {
        PlyPlace::Byte(self.last as u64)
    }

    fn remaining(&self) -> u64 {
        (self.bytes.len() - self.at) as u64
    }
}
