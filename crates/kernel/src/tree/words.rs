//! Files as words: a name, a version, a length, the contents and a checksum. `docs/src/file-format.md` describes them.
//!
//! All numbers are words of 32 bits, little-endian, so that a file is the same on every machine. Nothing of a file is
//! believed before its checksum is right, and nothing afterwards either: a reader checks what it uses.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
#[cfg(feature = "std")]
use std::io::{self, Read, Write};

use crate::error::Error;
use crate::hash;

/// Version of all files. Raise it with every change of their contents or meaning.
const VERSION: u32 = 2;

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Tree,
    #[cfg(feature = "lab")]
    Order,
    #[cfg(feature = "lab")]
    Log,
}

impl Kind {
    /// The first eight bytes of a file.
    fn magic(self) -> &'static [u8; 8] {
        match self {
            Self::Tree => b"ANTUTREE",
            #[cfg(feature = "lab")]
            Self::Order => b"ANTUSLOT",
            #[cfg(feature = "lab")]
            Self::Log => b"ANTULOGS",
        }
    }

    /// Name in errors.
    fn name(self) -> &'static str {
        match self {
            Self::Tree => "tree",
            #[cfg(feature = "lab")]
            Self::Order => "child order",
            #[cfg(feature = "lab")]
            Self::Log => "training log",
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

    /// Whole words.
    fn add_all(&mut self, bytes: &[u8]) {
        let (words, _) = bytes.as_chunks::<4>();
        for word in words {
            self.add(u32::from_le_bytes(*word));
        }
    }
}

/// Adds words up and hands on their bytes.
struct Output<F> {
    put: F,
    buffer: Vec<u8>,
    sum: Checksum,
}

impl<F: FnMut(&[u8])> Output<F> {
    const BUFFER: usize = 1 << 16;

    fn flush(&mut self) {
        (self.put)(&self.buffer);
        self.buffer.clear();
    }
}

impl<F: FnMut(&[u8])> Sink for Output<F> {
    fn word(&mut self, word: u32) {
        self.sum.add(word);
        self.buffer.extend(word.to_le_bytes());
        if self.buffer.len() >= Self::BUFFER {
            self.flush();
        }
    }
}

/// Gives the bytes of a file to `put`, piece after piece. `contents` are given twice: to be counted first.
fn give(kind: Kind, put: impl FnMut(&[u8]), contents: impl Fn(&mut dyn Sink)) {
    let mut count = Count(0);
    contents(&mut count);
    let mut output = Output {
        put,
        buffer: Vec::with_capacity(1 << 16),
        sum: Checksum(0),
    };
    output.bytes(kind.magic());
    output.word(VERSION);
    output.long(count.0);
    contents(&mut output);
    let sum = output.sum.0;
    output.long(sum);
    output.flush();
}

/// A file in memory.
pub(crate) fn to_bytes(kind: Kind, contents: impl Fn(&mut dyn Sink)) -> Vec<u8> {
    let mut bytes = Vec::new();
    give(kind, |piece| bytes.extend_from_slice(piece), contents);
    bytes
}

/// Writes a file. After an error nothing more is written.
#[cfg(feature = "std")]
pub(crate) fn write(
    kind: Kind,
    mut out: impl Write,
    contents: impl Fn(&mut dyn Sink),
) -> Result<(), Error> {
    let mut result = Ok(());
    let put = |bytes: &[u8]| {
        if result.is_ok() {
            result = out.write_all(bytes);
        }
    };
    give(kind, put, contents);
    result.and_then(|()| out.flush()).map_err(Error::from)
}

/// Bytes before the contents of a file.
const HEADER: usize = 20;

/// What the header of a file says.
struct Header {
    kind: Kind,
    /// Of the header.
    sum: Checksum,
    /// Bytes that follow: the contents and the checksum.
    len: u64,
}

impl Header {
    fn new(kind: Kind, bytes: &[u8; HEADER]) -> Result<Self, Error> {
        if !bytes.starts_with(kind.magic()) {
            return Err(kind.error("it does not begin as such a file does"));
        }
        let mut sum = Checksum(0);
        sum.add_all(bytes);
        let (words, _) = bytes.as_chunks::<4>();
        let [_, _, version, low, high] =
            core::array::from_fn(|word| u32::from_le_bytes(words[word]));
        if version != VERSION {
            return Err(kind.error(format!("it has version {version}, not {VERSION}")));
        }
        let len = (u64::from(high) << 32 | u64::from(low))
            .saturating_mul(4)
            .saturating_add(8);
        Ok(Self { kind, sum, len })
    }

    /// The contents, of the bytes that follow the header.
    fn contents(mut self, bytes: &[u8]) -> Result<&[u8], Error> {
        let end = || self.kind.error("it ends too early");
        if bytes.len() as u64 != self.len {
            return Err(end());
        }
        let (contents, found) = bytes.split_last_chunk::<8>().ok_or_else(end)?;
        self.sum.add_all(contents);
        if self.sum.0 != u64::from_le_bytes(*found) {
            return Err(self.kind.error("its checksum is wrong"));
        }
        Ok(contents)
    }
}

/// The contents of a file in memory, which are then read by [`Words`]. Nothing may follow it.
pub(crate) fn contents(kind: Kind, file: &[u8]) -> Result<&[u8], Error> {
    let (header, rest) =
        (file.split_first_chunk()).ok_or_else(|| kind.error("it ends too early"))?;
    let header = Header::new(kind, header)?;
    if rest.len() as u64 > header.len {
        return Err(kind.error("something follows its end"));
    }
    header.contents(rest)
}

/// The contents of a file, which are then read by [`Words`]. Takes no more bytes than the file has, and no more memory than
/// twice the bytes that come.
#[cfg(feature = "std")]
pub(crate) fn read(kind: Kind, mut input: impl Read) -> Result<Vec<u8>, Error> {
    let mut header = [0; HEADER];
    let mut have = 0;
    while have < header.len() {
        match input.read(&mut header[have..]) {
            Ok(0) => return Err(kind.error("it ends too early")),
            Ok(count) => have += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(Error::from(error)),
        }
    }
    let header = Header::new(kind, &header)?;
    let mut bytes = Vec::new();
    let taken = input.take(header.len).read_to_end(&mut bytes);
    taken.map_err(Error::from)?;
    let len = header.contents(&bytes)?.len();
    bytes.truncate(len);
    Ok(bytes)
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

    #[cfg(feature = "lab")]
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
