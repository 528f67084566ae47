//! Words and numbers of a line with their columns, and mistakes with their places.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use crate::Warning;

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
    warnings: Vec<Warning>,
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

    /// Adds a warning about a place.
    pub fn warn(&mut self, line: usize, column: usize, text: String) {
        self.warn_of_file(&self.path.clone(), line, column, text);
    }

    /// Adds a warning about a place in another file.
    pub fn warn_of_file(&mut self, path: &Path, line: usize, column: usize, text: String) {
        let place = format!("{}:{line}:{column}", path.display());
        let warning = Warning { place, text };
        if self.warnings.len() < ENOUGH && !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }

    /// Removes and returns the warnings so far.
    pub fn take_warnings(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.warnings)
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
