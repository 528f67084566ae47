//! The files of a scene in memory, and places in them.
//!
//! A [`Span`] is small and carries no text: line and column, and the line's text, are worked out only
//! when a diagnostic is made of it.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A place in a file: a token, or a part of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// Index into [`Sources`].
    pub file: u32,
    /// Bytes before it.
    pub offset: u32,
    /// Its length in bytes.
    pub len: u32,
    /// Its line, counted from 1.
    pub line: u32,
}

/// One file, read whole.
pub(crate) struct Source {
    /// The path as it was opened.
    pub path: PathBuf,
    /// The path without links and dots: the identity of the file.
    pub canonical: PathBuf,
    /// What is in it.
    pub bytes: Arc<Vec<u8>>,
}

/// All files opened so far. A file opened twice is read once.
#[derive(Default)]
pub(crate) struct Sources {
    /// The folder of the main file, where relative paths start, as in pbrt-v3.
    pub folder: PathBuf,
    files: Vec<Source>,
    by_path: HashMap<PathBuf, u32>,
}

/// A line of a file made fit to be shown.
pub(crate) struct Excerpt {
    pub line: String,
    pub column: u32,
    pub caret: usize,
    pub span_len: u32,
}

/// Bytes that one text may have, so that a [`Span`] can name each.
const MAX_TEXT: u64 = (u32::MAX / 2) as u64;

/// Characters of a long line shown before the token, and from it on.
const SHOWN_BEFORE: usize = 70;
const SHOWN_FROM: usize = 70;

impl Sources {
    /// Reads the file unless it was read before; the second value tells whether it is new.
    pub fn open(&mut self, path: &Path) -> io::Result<(u32, bool)> {
        let canonical = path.canonicalize()?;
        if let Some(&id) = self.by_path.get(&canonical) {
            return Ok((id, false));
        }
        let bytes = read_regular_file(path, MAX_TEXT)?;
        Ok((self.add(path, canonical, bytes), true))
    }

    /// Takes a text for the file of this path, whether there is one or not.
    ///
    /// # Errors
    /// The text is too long.
    pub fn take(&mut self, path: &Path, bytes: Vec<u8>) -> io::Result<u32> {
        check_length(bytes.len() as u64, MAX_TEXT)?;
        let canonical = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        Ok(self.add(path, canonical, bytes))
    }

    fn add(&mut self, path: &Path, canonical: PathBuf, bytes: Vec<u8>) -> u32 {
        let id = self.files.len() as u32;
        self.by_path.insert(canonical.clone(), id);
        self.files.push(Source {
            path: path.to_path_buf(),
            canonical,
            bytes: Arc::new(bytes),
        });
        id
    }

    /// All files, without links and dots.
    pub fn paths(&self) -> Vec<PathBuf> {
        let files = self.files.iter();
        files.map(|file| file.canonical.clone()).collect()
    }

    /// The file of that index.
    pub fn file(&self, id: u32) -> &Source {
        &self.files[id as usize]
    }

    /// The bytes a span covers.
    pub fn slice(&self, span: Span) -> &[u8] {
        let bytes = &self.file(span.file).bytes;
        let start = (span.offset as usize).min(bytes.len());
        let end = (start + span.len as usize).min(bytes.len());
        &bytes[start..end]
    }

    /// The line of a span, its column, and where the caret goes.
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

/// Reads a file whole, refusing what is not a regular file (a device may never end) or too large.
pub(crate) fn read_regular_file(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let invalid = |message: String| io::Error::new(io::ErrorKind::InvalidInput, message);
    // Asked before opening: opening a pipe would wait for its writer.
    let metadata = std::fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(invalid("it is a folder, not a file".into()));
    }
    if !metadata.is_file() {
        return Err(invalid("it is not a regular file".into()));
    }
    check_length(metadata.len(), limit)?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(metadata.len() as usize)?;
    File::open(path)?.take(limit).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn check_length(length: u64, limit: u64) -> io::Result<()> {
    if length <= limit {
        return Ok(());
    }
    Err(io::Error::new(
        io::ErrorKind::InvalidInput,
        format!("it is {length} bytes long and the limit is {limit}"),
    ))
}

/// Whether a byte is the first of a UTF-8 character.
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

/// Text without control characters, so that a file cannot steer the terminal it is shown on.
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
