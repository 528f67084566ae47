//! Lines, words and numbers with their places, and mistakes and warnings with theirs.

use std::borrow::Cow;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use crate::Warning;

/// Lines without their comments, with the numbers of their first lines from 1. A line that ends with `\` goes on in the next.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, [u8]>)> {
    fn code(line: &[u8]) -> &[u8] {
        match line.iter().position(|&byte| byte == b'#') {
            Some(comment) => &line[..comment],
            None => line,
        }
    }
    let text = antumbra_scene::without_mark(bytes);
    let mut rest = (1..).zip(text.split(|&byte| byte == b'\n'));
    std::iter::from_fn(move || {
        let (number, line) = rest.next()?;
        let mut whole = Cow::Borrowed(code(line));
        // A comment that ends so is complete.
        let goes_on = |line: &[u8]| {
            let start = line.trim_ascii_end().strip_suffix(b"\\")?;
            (code(line) == line).then_some(line.len() - start.len())
        };
        let mut last = line;
        while let Some(end) = goes_on(last) {
            let kept = whole.len() - end;
            let joined = whole.to_mut();
            joined.truncate(kept);
            joined.push(b' ');
            last = rest.next().map_or(&[], |(_, next)| next);
            joined.extend_from_slice(code(last));
        }
        Some((number, whole))
    })
}

/// Words of a line, with their columns in bytes from 1.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = (usize, &[u8])> + Clone {
    line.split(|byte| byte.is_ascii_whitespace())
        .scan(1, |next, word| {
            let column = *next;
            *next += word.len() + 1;
            Some((column, word))
        })
        .filter(|(_, word)| !word.is_empty())
}

/// Number that a word stands for.
pub(super) fn number<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Text of a line from a byte on, without blanks around it.
pub(super) fn text_after(line: &[u8], start: usize) -> String {
    let rest = line.get(start.saturating_sub(1)..).unwrap_or_default();
    String::from_utf8_lossy(rest.trim_ascii()).into_owned()
}

/// The known name that differs from `name` only in letter case, or all names if they are few, as part of a sentence.
pub(super) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let mut known: Vec<&str> = known.collect();
    known.sort_unstable();
    if let Some(same) = known.iter().find(|other| other.eq_ignore_ascii_case(name)) {
        return format!("; did you mean `{same}`?");
    }
    match known.len() {
        0 => "; no library defines any".into(),
        1..=8 => format!("; known are {}", known.join(", ")),
        _ => String::new(),
    }
}

/// Mistakes of a file, each with its place.
pub(super) struct Mistakes {
    path: PathBuf,
    /// The current line, from 1.
    pub line: usize,
    found: Vec<(usize, usize, String)>,
    /// Mistakes of other files, as lines of text.
    elsewhere: Vec<String>,
    /// Warnings, and how many there are of each kind.
    warnings: Vec<(Warning, u64)>,
}

/// Mistakes after which no more are kept.
const ENOUGH: usize = 1000;

impl Mistakes {
    pub fn of(path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            line: 0,
            found: Vec::new(),
            elsewhere: Vec::new(),
            warnings: Vec::new(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.found.is_empty() && self.elsewhere.is_empty()
    }

    /// Adds a mistake in the current line.
    pub fn add(&mut self, column: usize, text: String) {
        self.at(self.line, column, text);
    }

    /// Adds a mistake at a place.
    pub fn at(&mut self, line: usize, column: usize, text: String) {
        if self.found.len() < ENOUGH {
            self.found.push((line, column, text));
        }
    }

    /// Adds a mistake in another file.
    pub fn of_file(&mut self, path: &Path, line: usize, column: usize, text: impl Display) {
        let path = path.display();
        self.elsewhere
            .push(format!("{path}:{line}:{column}: error: {text}"));
    }

    /// Adds a warning about a place. Those with the same text are one kind, of which the first place is kept.
    pub fn warn(&mut self, line: usize, column: usize, text: String) {
        self.warn_of_file(&self.path.clone(), line, column, text);
    }

    /// Adds a warning about a place in another file.
    pub fn warn_of_file(&mut self, path: &Path, line: usize, column: usize, text: String) {
        if let Some((_, count)) = self
            .warnings
            .iter_mut()
            .find(|(known, _)| known.text == text)
        {
            *count += 1;
        } else if self.warnings.len() < ENOUGH {
            let place = format!("{}:{line}:{column}", path.display());
            self.warnings.push((Warning { place, text }, 1));
        }
    }

    /// Removes and returns the warnings so far, with the number of places if there are several.
    pub fn take_warnings(&mut self) -> Vec<Warning> {
        let counted = std::mem::take(&mut self.warnings).into_iter();
        let counted = counted.map(|(Warning { place, text }, count)| Warning {
            place,
            text: match count {
                1 => text,
                _ => format!("{text} (the first of {count} places)"),
            },
        });
        counted.collect()
    }

    /// All mistakes in the order of their places, mistakes in other files last.
    pub fn into_lines(mut self) -> Vec<String> {
        self.found.sort_by_key(|&(line, column, _)| (line, column));
        let path = self.path.display();
        let found = self.found.iter();
        let lines =
            found.map(|(line, column, text)| format!("{path}:{line}:{column}: error: {text}"));
        lines.chain(self.elsewhere).collect()
    }
}
