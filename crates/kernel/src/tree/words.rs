//! Files as words: a name, a version, a length, the contents and a checksum. `docs/src/file-format.md` describes them.
//!
//! All numbers are words of 32 bits, little-endian, so that a file is the same on every machine. Nothing of a file is
//! believed before its checksum is right, and nothing afterwards either: a reader checks what it uses.

use std::io::{self, Read, Write};

use crate::error::Error;
use crate::hash;

/// Version of all files. Raise it with every change of their contents or meaning.
const VERSION: u32 = 1;

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Tree,
    Order,
}

impl Kind {
    /// The first eight bytes of a file.
    fn magic(self) -> &'static [u8; 8] {
        match self {
            Self::Tree => b"ANTUTREE",
            Self::Order => b"ANTUSLOT",
        }
    }

    /// Name in errors.
    fn name(self) -> &'static str {
        match self {
            Self::Tree => "tree",
            Self::Order => "child order",
        }
    }

    /// A file of this kind that cannot be read.
    pub fn error(self, why: impl Into<String>) -> Error {
        Error::Unreadable {
            what: self.name(),
            why: why.into(),
        }
    }
}

impl Error {
    fn io(error: &io::Error) -> Self {
        Self::Io {
            kind: error.kind(),
            message: error.to_string(),
        }
    }
}

/// Takes the words of a file.
pub(crate) trait Sink {
    fn word(&mut self, word: u32);

    fn float(&mut self, float: f32) {
        self.word(float.to_bits());
    }

    fn floats(&mut self, floats: &[f32]) {
        floats.iter().for_each(|float| self.float(*float));
    }

    /// Two words, the lower one first.
    fn long(&mut self, long: u64) {
        self.word(long as u32);
        self.word((long >> 32) as u32);
    }

    /// Four bytes per word, the last one filled up with zeros.
    fn bytes(&mut self, bytes: &[u8]) {
        for bytes in bytes.chunks(4) {
            let byte = |index: usize| bytes.get(index).copied().unwrap_or(0);
            self.word(u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]));
        }
    }
}

/// Counts words.
struct Count(u64);

impl Sink for Count {
    fn word(&mut self, _: u32) {
        self.0 += 1;
    }
}

/// Sum of words: the state after SplitMix64 has mixed in one after the other.
struct Checksum(u64);

impl Checksum {
    #[inline(always)]
    fn add(&mut self, word: u32) {
        self.0 = hash::mixed((self.0 ^ u64::from(word)).wrapping_add(hash::STEP));
    }
}

/// Writes words and adds them up. After an error nothing more is written.
struct Output<W> {
    out: W,
    buffer: Vec<u8>,
    sum: Checksum,
    result: io::Result<()>,
}

impl<W: Write> Output<W> {
    const BUFFER: usize = 1 << 16;

    fn flush(&mut self) {
        if self.result.is_ok() {
            self.result = self.out.write_all(&self.buffer);
        }
        self.buffer.clear();
    }
}

impl<W: Write> Sink for Output<W> {
    fn word(&mut self, word: u32) {
        self.sum.add(word);
        self.buffer.extend(word.to_le_bytes());
        if self.buffer.len() >= Self::BUFFER {
            self.flush();
        }
    }
}

/// Writes a file. `contents` are given twice: to be counted first.
pub(crate) fn write(
    kind: Kind,
    out: impl Write,
    contents: impl Fn(&mut dyn Sink),
) -> Result<(), Error> {
    let mut count = Count(0);
    contents(&mut count);
    let mut output = Output {
        out,
        buffer: Vec::with_capacity(1 << 16),
        sum: Checksum(0),
        result: Ok(()),
    };
    output.bytes(kind.magic());
    output.word(VERSION);
    output.long(count.0);
    contents(&mut output);
    let sum = output.sum.0;
    output.long(sum);
    output.flush();
    output.result = output.result.and_then(|()| output.out.flush());
    output.result.map_err(|error| Error::io(&error))
}

/// The contents of a file, which are then read by [`Words`]. Takes no more bytes than the file has, and no more memory than
/// twice the bytes that come.
pub(crate) fn read(kind: Kind, mut input: impl Read) -> Result<Vec<u8>, Error> {
    let mut header = [0; 20];
    let mut have = 0;
    while have < header.len() {
        match input.read(&mut header[have..]) {
            Ok(0) => return Err(kind.error("it ends too early")),
            Ok(count) => have += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(Error::io(&error)),
        }
    }
    if !header.starts_with(kind.magic()) {
        return Err(kind.error("it does not begin as such a file does"));
    }
    let mut sum = Checksum(0);
    let (words, _) = header.as_chunks::<4>();
    words
        .iter()
        .for_each(|word| sum.add(u32::from_le_bytes(*word)));
    let [_, _, version, low, high] = core::array::from_fn(|word| u32::from_le_bytes(words[word]));
    if version != VERSION {
        return Err(kind.error(format!("it has version {version}, not {VERSION}")));
    }
    let len = (u64::from(high) << 32 | u64::from(low))
        .saturating_mul(4)
        .saturating_add(8);
    let mut contents = Vec::new();
    let taken = input.take(len).read_to_end(&mut contents);
    let taken = taken.map_err(|error| Error::io(&error))?;
    if taken as u64 != len {
        return Err(kind.error("it ends too early"));
    }
    let Some((_, found)) = contents.split_last_chunk::<8>() else {
        return Err(kind.error("it ends too early"));
    };
    let found = u64::from_le_bytes(*found);
    contents.truncate(contents.len() - 8);
    let (words, _) = contents.as_chunks::<4>();
    words
        .iter()
        .for_each(|word| sum.add(u32::from_le_bytes(*word)));
    if sum.0 != found {
        return Err(kind.error("its checksum is wrong"));
    }
    Ok(contents)
}

/// Contents of a file, word by word.
pub(crate) struct Words<'a> {
    kind: Kind,
    words: &'a [[u8; 4]],
}

impl<'a> Words<'a> {
    pub fn new(kind: Kind, contents: &'a [u8]) -> Self {
        let (words, _) = contents.as_chunks();
        Self { kind, words }
    }

    pub fn word(&mut self) -> Result<u32, Error> {
        let (first, rest) =
            (self.words.split_first()).ok_or_else(|| self.error("its contents end too early"))?;
        self.words = rest;
        Ok(u32::from_le_bytes(*first))
    }

    pub fn float(&mut self) -> Result<f32, Error> {
        self.word().map(f32::from_bits)
    }

    pub fn floats<const N: usize>(&mut self) -> Result<[f32; N], Error> {
        let mut floats = [0.0; N];
        for float in &mut floats {
            *float = self.float()?;
        }
        Ok(floats)
    }

    pub fn long(&mut self) -> Result<u64, Error> {
        let low = self.word()?;
        Ok(u64::from(self.word()?) << 32 | u64::from(low))
    }

    /// How many items follow, each of at least `least` words: no more than there are words for.
    pub fn count(&mut self, least: usize) -> Result<usize, Error> {
        let count = self.word()? as usize;
        self.check(count, least)?;
        Ok(count)
    }

    /// Fails unless there can be so many items, each of at least `least` words.
    pub fn check(&self, count: usize, least: usize) -> Result<(), Error> {
        if count > self.words.len() / least {
            return Err(self.error("it counts more than it holds"));
        }
        Ok(())
    }

    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let words = count.div_ceil(4);
        if words > self.words.len() {
            return Err(self.error("its contents end too early"));
        }
        let (bytes, rest) = self.words.split_at(words);
        self.words = rest;
        Ok(&bytes.as_flattened()[..count])
    }

    /// Fails unless all words are read.
    pub fn end(&self) -> Result<(), Error> {
        if self.words.is_empty() {
            Ok(())
        } else {
            Err(self.error("something follows its contents"))
        }
    }

    pub fn error(&self, why: impl Into<String>) -> Error {
        self.kind.error(why)
    }
}
