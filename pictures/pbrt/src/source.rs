//! Files of a scene in memory, and places in them.
//!
//! A [`Span`] is small and carries no text. Column and text of the line are computed only for diagnostics.

use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::read::MultiGzDecoder;

use crate::directive::DIRECTIVES;

/// Place in a file: a token or a part of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// Index of the file in [`Sources`].
    pub file: u32,
    /// Offset from the beginning of the file in bytes.
    pub offset: u32,
    /// Length in bytes.
    pub len: u32,
    /// Line, counted from 1.
    pub line: u32,
}

/// File in memory.
pub(crate) struct Source {
    /// Path as it was opened.
    pub path: PathBuf,
    /// Canonical path, which identifies the file.
    pub canonical: PathBuf,
    /// Contents of the file.
    pub bytes: Arc<Vec<u8>>,
}

/// All files opened so far. A file that is opened twice is read once.
pub(crate) struct Sources {
    /// Folder of the main file, where relative paths start, as in pbrt-v3.
    pub folder: PathBuf,
    /// Memory that the texts of all files may take in bytes.
    pub limit: u64,
    /// Memory that they take.
    bytes: u64,
    files: Vec<Source>,
    by_path: HashMap<PathBuf, u32>,
    /// Meshes, images and spectra that were read or looked for.
    others: BTreeSet<PathBuf>,
}

/// Line of a file for a diagnostic, with the position of the caret.
pub(crate) struct Excerpt {
    pub line: String,
    pub column: u32,
    pub caret: usize,
    pub span_len: u32,
}

/// Largest size of a text in bytes, so that a [`Span`] can name each byte.
const MAX_TEXT: u64 = (u32::MAX / 2) as u64;

/// Number of characters of a long line that are shown before the start of the token.
const SHOWN_BEFORE: usize = 70;
const SHOWN_FROM: usize = 70;

impl Default for Sources {
    /// No files, and no limit.
    fn default() -> Self {
        Self {
            folder: PathBuf::new(),
            limit: u64::MAX,
            bytes: 0,
            files: Vec::new(),
            by_path: HashMap::new(),
            others: BTreeSet::new(),
        }
    }
}

impl Sources {
    /// Memory that the texts of all files take in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Reads a file unless it was read before. The second value is true if the file is new.
    ///
    /// # Errors
    /// An error of kind [`io::ErrorKind::OutOfMemory`] if the texts of all files take more memory than they may.
    pub fn open(&mut self, path: &Path) -> io::Result<(u32, bool)> {
        let canonical = path.canonicalize()?;
        if let Some(&id) = self.by_path.get(&canonical) {
            return Ok((id, false));
        }
        let length = regular_file_size(path)?;
        let left = self.limit - self.bytes.min(self.limit);
        if length > left {
            let message = format!(
                "the file has {length} bytes, but the texts of the scene may take only {left} bytes more"
            );
            return Err(io::Error::new(io::ErrorKind::OutOfMemory, message));
        }
        let bytes = read_regular_file(path, MAX_TEXT)?;
        Ok((self.add(path, canonical, bytes), true))
    }

    /// Adds a text in memory as the file `path`, which need not exist.
    ///
    /// # Errors
    /// If the text is too long.
    pub fn take(&mut self, path: &Path, bytes: Vec<u8>) -> io::Result<u32> {
        check_length(bytes.len() as u64, MAX_TEXT)?;
        let canonical = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        Ok(self.add(path, canonical, bytes))
    }

    fn add(&mut self, path: &Path, canonical: PathBuf, bytes: Vec<u8>) -> u32 {
        let id = self.files.len() as u32;
        self.bytes += bytes.len() as u64;
        self.by_path.insert(canonical.clone(), id);
        self.files.push(Source {
            path: path.to_path_buf(),
            canonical,
            bytes: Arc::new(bytes),
        });
        id
    }

    /// Canonical paths of all files.
    pub fn paths(&self) -> Vec<PathBuf> {
        let files = self.files.iter();
        files.map(|file| file.canonical.clone()).collect()
    }

    /// Notes a file other than text of the scene: a mesh, an image or a spectrum.
    pub fn note(&mut self, path: PathBuf) {
        self.others.insert(path);
    }

    /// All files other than texts of the scene, sorted.
    pub fn others(&self) -> Vec<PathBuf> {
        self.others.iter().cloned().collect()
    }

    /// File with the given index.
    pub fn file(&self, id: u32) -> &Source {
        &self.files[id as usize]
    }

    /// Bytes of a span.
    pub fn slice(&self, span: Span) -> &[u8] {
        let bytes = &self.file(span.file).bytes;
        let start = (span.offset as usize).min(bytes.len());
        let end = (start + span.len as usize).min(bytes.len());
        &bytes[start..end]
    }

    /// Directive that a span belongs to: the last one that begins up to its end, or none.
    pub fn directive(&self, span: Span) -> &'static str {
        let bytes = &self.file(span.file).bytes;
        let end = (span.offset as usize + span.len as usize).min(bytes.len());
        let words = bytes[..end].rsplit(u8::is_ascii_whitespace);
        let mut known = words.filter_map(|word| {
            let name = std::str::from_utf8(word).ok()?;
            let place = DIRECTIVES.binary_search(&name).ok()?;
            Some(DIRECTIVES[place])
        });
        known.next().unwrap_or_default()
    }

    /// Line of a span for a diagnostic, with its column and the position of the caret.
    pub fn excerpt(&self, span: Span) -> Excerpt {
        let bytes = &self.file(span.file).bytes;
        let offset = (span.offset as usize).min(bytes.len());
        let is_end = |b: &u8| *b == b'\n' || *b == b'\r';
        let start = bytes[..offset]
            .iter()
            .rposition(is_end)
            .map_or(0, |i| i + 1);
        let column = 1 + bytes[start..offset].iter().filter(starts_char).count() as u32;

        let from = back_by_chars(&bytes[start..offset], SHOWN_BEFORE) + start;
        let rest = &bytes[offset..];
        let line_end = rest.iter().position(is_end).unwrap_or(rest.len());
        let shown = forward_by_chars(&rest[..line_end], SHOWN_FROM);

        let before = printable(&bytes[from..offset]);
        let after = printable(&rest[..shown]);
        let span_chars = printable(&rest[..(span.len as usize).min(shown)])
            .chars()
            .count();
        let cut_before = if from > start { "…" } else { "" };
        let cut_after = if shown < line_end { "…" } else { "" };
        Excerpt {
            column,
            caret: cut_before.chars().count() + before.chars().count(),
            span_len: span_chars.max(1) as u32,
            line: format!("{cut_before}{before}{after}{cut_after}"),
        }
    }
}

/// First bytes of a file in the format of gzip (RFC 1952).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads a regular file of at most `limit` bytes. Other files are refused, because a device may never end.
pub(crate) fn read_regular_file(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    read_regular_file_that(path, limit, |_| true)
}

/// Reads a regular file of at most `limit` bytes, but only its first bytes unless they are as they must be.
///
/// A file that is something else may be huge. A file in the format of gzip is decompressed, whatever its name, and the limit is that
/// of its contents.
pub(crate) fn read_regular_file_that(
    path: &Path,
    limit: u64,
    starts: fn(&[u8]) -> bool,
) -> io::Result<Vec<u8>> {
    const START: u64 = 16;
    let length = regular_file_size(path)?;
    let mut file = File::open(path)?;
    let mut bytes = Vec::new();
    file.by_ref().take(START).read_to_end(&mut bytes)?;
    if bytes.starts_with(&GZIP) {
        let compressed = io::Cursor::new(bytes).chain(file);
        let mut contents = MultiGzDecoder::new(compressed);
        let mut bytes = Vec::new();
        contents.by_ref().take(START).read_to_end(&mut bytes)?;
        if starts(&bytes) {
            let rest = limit.saturating_sub(bytes.len() as u64).saturating_add(1);
            contents.take(rest).read_to_end(&mut bytes)?;
            if bytes.len() as u64 > limit {
                let message = format!(
                    "the decompressed file has more than {limit} bytes, which is the limit"
                );
                return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
            }
        }
        return Ok(bytes);
    }
    if !starts(&bytes) {
        return Ok(bytes);
    }
    check_length(length, limit)?;
    bytes.try_reserve_exact((length as usize).saturating_sub(bytes.len()))?;
    let rest = limit.saturating_sub(bytes.len() as u64);
    file.take(rest).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Size of a regular file in bytes. Other files are refused.
fn regular_file_size(path: &Path) -> io::Result<u64> {
    let invalid = |message: String| io::Error::new(io::ErrorKind::InvalidInput, message);
    // Checked before opening, because opening a pipe waits for its writer.
    let metadata = std::fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(invalid("the path is a folder, not a file".into()));
    }
    if !metadata.is_file() {
        return Err(invalid("not a regular file".into()));
    }
    Ok(metadata.len())
}

fn check_length(length: u64, limit: u64) -> io::Result<()> {
    if length <= limit {
        return Ok(());
    }
    Err(io::Error::new(
        io::ErrorKind::InvalidInput,
        format!("the file has {length} bytes; the limit is {limit} bytes"),
    ))
}

/// Returns true if a byte is the first of a UTF-8 character.
fn starts_char(byte: &&u8) -> bool {
    **byte & 0xC0 != 0x80
}

/// Index at which the last `count` characters of the bytes begin.
fn back_by_chars(bytes: &[u8], count: usize) -> usize {
    bytes
        .iter()
        .enumerate()
        .rev()
        .filter(|(_, b)| starts_char(b))
        .nth(count - 1)
        .map_or(0, |(i, _)| i)
}

/// Index at which the first `count` characters of the bytes end.
fn forward_by_chars(bytes: &[u8], count: usize) -> usize {
    bytes
        .iter()
        .enumerate()
        .filter(|(_, b)| starts_char(b))
        .nth(count)
        .map_or(bytes.len(), |(i, _)| i)
}

/// Text without control characters, so that a file cannot control the terminal.
fn printable(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes)
        .chars()
        .map(|c| match c {
            '\t' => c,
            c if c.is_control() => char::REPLACEMENT_CHARACTER,
            c => c,
        })
        .collect()
}
