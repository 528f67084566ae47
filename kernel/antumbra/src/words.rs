//! Files as words: a name, a version, and the contents in frames. `docs/src/file-format.md` describes them.
//!
//! All numbers are words of 32 bits, little-endian, so that a file is the same on every machine. Nothing of a frame is
//! believed before its checksum is right, and nothing afterwards either: a reader checks what it uses.
//!
//! Frames are small enough to stay in a cache between their checksum and their use, so a file is read in one pass. A file
//! needs no length in front, so it is written in one pass, too.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
#[cfg(feature = "std")]
use std::io::{self, Read, Write};

use antumbra_simd::memory::vec_in_huge_pages;

use crate::error::Error;
use crate::hash;

/// Version of all files. Raise it with every change of their contents or meaning.
const VERSION: u32 = 4;

/// Words of contents in a frame, at most.
const FRAME: usize = 1 << 14;

/// Bit of the first word of a frame, beside the number of words: no frame follows.
const LAST: u32 = 1 << 31;

/// Kind of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Tree,
    Object,
    World,
}

impl Kind {
    /// The first eight bytes of a file.
    fn magic(self) -> &'static [u8; 8] {
        match self {
            Self::Tree => b"ANTUTREE",
            Self::Object => b"ANTUOBJT",
            Self::World => b"ANTUWRLD",
        }
    }

    /// Name of the kind in error messages.
    fn name(self) -> &'static str {
        match self {
            Self::Tree => "tree",
            Self::Object => "object",
            Self::World => "world",
        }
    }

    /// A file of this kind that cannot be read.
    pub fn error(self, why: impl Into<String>) -> Error {
        Error::Unreadable {
            what: self.name(),
            why: why.into(),
        }
    }

    /// A file whose end is missing.
    fn cut_off(self) -> Error {
        self.error("it ends too early")
    }
}

/// Checksum of a frame with this first word, and of all before it, whose checksum is `before`.
///
/// Eight lanes take the words of 64 bits in turn, so that their multiplications overlap. Every step is a bijection of the lane
/// and of the word: damage within one word is always found.
fn checksum(before: u64, first: u32, contents: &[u8]) -> u64 {
    let start = hash::mixed((before ^ u64::from(first)).wrapping_add(hash::STEP));
    let mut lanes: [u64; 8] = core::array::from_fn(|lane| start ^ lane as u64);
    let mut add = |words: &[u8; 64]| {
        let (words, _) = words.as_chunks();
        for (lane, word) in lanes.iter_mut().zip(words) {
            let mixed = (*lane ^ u64::from_le_bytes(*word)).wrapping_mul(hash::STEP);
            *lane = mixed.rotate_left(29);
        }
    };
    let (stripes, rest) = contents.as_chunks();
    stripes.iter().for_each(&mut add);
    let mut last = [0; 64];
    last[..rest.len()].copy_from_slice(rest);
    add(&last);
    lanes.iter().fold(0, |sum: u64, lane| {
        hash::mixed((sum ^ lane).wrapping_add(hash::STEP))
    })
}

/// Takes the words of a file, and hands on its frames.
pub struct Sink<'a> {
    put: &'a mut dyn FnMut(&[u8]),
    /// A frame: its first word, its contents and its checksum.
    frame: Box<[[u8; 4]]>,
    /// Words of contents.
    len: usize,
    sum: u64,
}

impl Sink<'_> {
    #[inline(always)]
    pub fn words<const COUNT: usize>(&mut self, words: [u32; COUNT]) {
        if self.len + COUNT > FRAME {
            self.flush(0);
        }
        let places = &mut self.frame[1 + self.len..][..COUNT];
        for (place, word) in places.iter_mut().zip(words) {
            *place = word.to_le_bytes();
        }
        self.len += COUNT;
    }

    #[inline(always)]
    pub fn word(&mut self, word: u32) {
        self.words([word]);
    }

    #[inline(always)]
    pub fn floats<const COUNT: usize>(&mut self, floats: [f32; COUNT]) {
        self.words(floats.map(f32::to_bits));
    }

    /// Two words, the lower one first.
    pub fn long(&mut self, long: u64) {
        self.words([long as u32, (long >> 32) as u32]);
    }

    /// A number that may be missing, as two words. No number is NaN.
    pub fn double(&mut self, double: Option<f64>) {
        self.long(double.unwrap_or(f64::NAN).to_bits());
    }

    /// Ends the frame. `last` is [`LAST`] or 0.
    fn flush(&mut self, last: u32) {
        let first = self.len as u32 | last;
        self.frame[0] = first.to_le_bytes();
        let (contents, end) = self.frame[1..].split_at_mut(self.len);
        self.sum = checksum(self.sum, first, contents.as_flattened());
        end[..2]
            .as_flattened_mut()
            .copy_from_slice(&self.sum.to_le_bytes());
        (self.put)(self.frame[..self.len + 3].as_flattened());
        self.len = 0;
    }
}

/// Gives the bytes of a file to `put`, piece after piece.
fn give(kind: Kind, put: &mut dyn FnMut(&[u8]), contents: impl FnOnce(&mut Sink<'_>)) {
    put(kind.magic());
    put(&VERSION.to_le_bytes());
    let mut sink = Sink {
        put,
        frame: vec![[0; 4]; FRAME + 3].into(),
        len: 0,
        sum: 0,
    };
    contents(&mut sink);
    sink.flush(LAST);
}

/// A file in memory, of about so many bytes.
pub(crate) fn to_bytes(kind: Kind, about: usize, contents: impl FnOnce(&mut Sink<'_>)) -> Vec<u8> {
    let mut bytes = vec_in_huge_pages(about);
    give(kind, &mut |piece| bytes.extend_from_slice(piece), contents);
    bytes.shrink_to_fit();
    bytes
}

/// Writes a file. After an error nothing more is written.
#[cfg(feature = "std")]
pub(crate) fn write(
    kind: Kind,
    mut out: impl Write,
    contents: impl FnOnce(&mut Sink<'_>),
) -> Result<(), Error> {
    let mut result = Ok(());
    let mut put = |bytes: &[u8]| {
        if result.is_ok() {
            result = out.write_all(bytes);
        }
    };
    give(kind, &mut put, contents);
    result.and_then(|()| out.flush()).map_err(Error::from)
}

/// Reads a file in memory. Nothing may follow it.
pub(crate) fn from_bytes<T>(
    kind: Kind,
    mut file: &[u8],
    contents: impl FnOnce(&mut Words<'_>) -> Result<T, Error>,
) -> Result<T, Error> {
    // No list takes more memory per byte of a file.
    let room = file.len().saturating_mul(32);
    let mut fill = |bytes: &mut [u8]| {
        let (taken, rest) = (file.split_at_checked(bytes.len())).ok_or_else(|| kind.cut_off())?;
        bytes.copy_from_slice(taken);
        file = rest;
        Ok(())
    };
    let read = Words::read(kind, &mut fill, room, contents)?;
    if file.is_empty() {
        Ok(read)
    } else {
        Err(kind.error("something follows its end"))
    }
}

/// Reads a file. Takes no more bytes than the file has.
#[cfg(feature = "std")]
pub(crate) fn read<T>(
    kind: Kind,
    mut input: impl Read,
    contents: impl FnOnce(&mut Words<'_>) -> Result<T, Error>,
) -> Result<T, Error> {
    /// Bytes of a list that may be reserved before they are known to be needed.
    const ROOM: usize = 1 << 28;
    let mut fill = |bytes: &mut [u8]| {
        input.read_exact(bytes).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => kind.cut_off(),
            _ => Error::from(error),
        })
    };
    Words::read(kind, &mut fill, ROOM, contents)
}

/// Contents of a file, word by word.
pub struct Words<'a> {
    kind: Kind,
    /// Fills in the next bytes of the file.
    fill: &'a mut dyn FnMut(&mut [u8]) -> Result<(), Error>,
    /// Contents and checksum of a frame.
    frame: Box<[[u8; 4]]>,
    /// Words of the frame that are read, and words of contents.
    at: usize,
    len: usize,
    is_last: bool,
    sum: u64,
    /// Bytes of memory that a list may reserve before its items are read.
    room: usize,
}

impl<'a> Words<'a> {
    /// Reads all contents of a file.
    fn read<T>(
        kind: Kind,
        fill: &'a mut dyn FnMut(&mut [u8]) -> Result<(), Error>,
        room: usize,
        contents: impl FnOnce(&mut Self) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let (mut magic, mut version) = ([0; 8], [0; 4]);
        fill(&mut magic)?;
        if magic != *kind.magic() {
            return Err(kind.error("it does not begin as such a file does"));
        }
        fill(&mut version)?;
        let version = u32::from_le_bytes(version);
        if version != VERSION {
            return Err(kind.error(format!(
                "it has version {version}, not {VERSION}: build it again and save it"
            )));
        }
        let mut words = Self {
            kind,
            fill,
            frame: vec![[0; 4]; FRAME + 2].into(),
            at: 0,
            len: 0,
            is_last: false,
            sum: 0,
            room,
        };
        let read = contents(&mut words)?;
        if words.at == words.len && !words.is_last {
            words.next_frame()?;
        }
        if words.at == words.len && words.is_last {
            Ok(read)
        } else {
            Err(kind.error("something follows its contents"))
        }
    }

    fn next_frame(&mut self) -> Result<(), Error> {
        if self.is_last {
            return Err(self.error("its contents end too early"));
        }
        let mut first = [0; 4];
        (self.fill)(&mut first)?;
        let first = u32::from_le_bytes(first);
        self.is_last = first & LAST != 0;
        self.len = (first & !LAST) as usize;
        self.at = 0;
        // Without an end there would be no end of empty frames.
        if self.len > FRAME || (self.len == 0 && !self.is_last) {
            return Err(self.error("a frame has a wrong length"));
        }
        let frame = &mut self.frame[..self.len + 2];
        (self.fill)(frame.as_flattened_mut())?;
        let (contents, sum) = frame.split_at(self.len);
        self.sum = checksum(self.sum, first, contents.as_flattened());
        if sum.as_flattened() == self.sum.to_le_bytes() {
            Ok(())
        } else {
            Err(self.error("its checksum is wrong"))
        }
    }

    #[inline(always)]
    pub fn words<const COUNT: usize>(&mut self) -> Result<[u32; COUNT], Error> {
        match self.frame[self.at..self.len].first_chunk() {
            Some(words) => {
                self.at += COUNT;
                Ok(words.map(u32::from_le_bytes))
            }
            None => self.words_of_frames(),
        }
    }

    /// Words that are not all in this frame.
    #[cold]
    fn words_of_frames<const COUNT: usize>(&mut self) -> Result<[u32; COUNT], Error> {
        let mut words = [0; COUNT];
        for word in &mut words {
            if self.at == self.len {
                self.next_frame()?;
            }
            if self.at < self.len {
                *word = u32::from_le_bytes(self.frame[self.at]);
                self.at += 1;
            } else {
                return Err(self.error("its contents end too early"));
            }
        }
        Ok(words)
    }

    #[inline(always)]
    pub fn word(&mut self) -> Result<u32, Error> {
        self.words().map(|[word]| word)
    }

    /// Reads a word that counts something.
    pub fn count(&mut self) -> Result<usize, Error> {
        self.word().map(|word| word as usize)
    }

    #[inline(always)]
    pub fn floats<const COUNT: usize>(&mut self) -> Result<[f32; COUNT], Error> {
        self.words().map(|words| words.map(f32::from_bits))
    }

    pub fn long(&mut self) -> Result<u64, Error> {
        let [low, high] = self.words()?;
        Ok(u64::from(high) << 32 | u64::from(low))
    }

    /// A number that may be missing.
    pub fn double(&mut self) -> Result<Option<f64>, Error> {
        let double = f64::from_bits(self.long()?);
        Ok(Some(double).filter(|double| !double.is_nan()))
    }

    /// Memory for so many items, or for as many of them as can be reserved before they are read.
    pub fn memory<T>(&self, count: usize) -> Vec<T> {
        vec_in_huge_pages(count.min(self.room / size_of::<T>() + 1))
    }

    /// These items and, behind them, so many more. Memory grows with the items that are read, so that a count that is too
    /// large takes none.
    #[inline(always)]
    pub fn list<T>(
        &mut self,
        first: impl IntoIterator<Item = T>,
        count: usize,
        mut item: impl FnMut(&mut Self) -> Result<T, Error>,
    ) -> Result<Vec<T>, Error> {
        let first = first.into_iter();
        let all = count.saturating_add(first.size_hint().0);
        let mut list = self.memory(all);
        list.extend(first);
        for _ in 0..count {
            let item = item(self)?;
            if list.len() == list.capacity() {
                let mut longer = vec_in_huge_pages(all.min(8 * list.len()));
                longer.append(&mut list);
                list = longer;
            }
            list.push(item);
        }
        Ok(list)
    }

    pub fn error(&self, why: impl Into<String>) -> Error {
        self.kind.error(why)
    }
}
