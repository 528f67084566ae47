//! What the reader has to say about a file: mistakes and notes, each with its place.

use std::fmt;
use std::path::PathBuf;

/// How serious a [`Diagnostic`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Severity {
    /// The scene cannot be read as it stands.
    Error,
    /// Something was left out or mapped; the picture is the same up to its noise.
    Note,
}

/// One message about one place of a file.
///
/// Its `Display` is several lines: `file:line:column: error: message`, the source line, a caret line
/// under the offending token and what would be right, if known. There is no newline at the end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Error or note.
    pub severity: Severity,
    /// The file, named as it was opened.
    pub file: PathBuf,
    /// Line, counted from 1.
    pub line: u32,
    /// Column in characters, counted from 1.
    pub column: u32,
    /// What is wrong, in one sentence without a full stop.
    pub message: String,
    /// The line of the file; a long one is cut to a window around the token, with `…` at the cuts.
    /// Control characters other than tab are replaced.
    pub source_line: String,
    /// What would be right.
    pub help: Option<String>,
    /// Length of the offending token in characters, at least 1, cut to what `source_line` shows.
    pub span_len: u32,
    /// Characters of `source_line` before the token.
    pub(crate) caret: usize,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Note => "note",
        };
        write!(
            f,
            "{}:{}:{}: {severity}: {}",
            self.file.display(),
            self.line,
            self.column,
            self.message
        )?;
        // Repeating the tabs of the line keeps the caret under its token whatever the tab width is.
        let indent: String = self
            .source_line
            .chars()
            .take(self.caret)
            .map(|c| if c == '\t' { '\t' } else { ' ' })
            .collect();
        let carets = "^".repeat(self.span_len.max(1) as usize);
        write!(f, "\n    {}\n    {indent}{carets}", self.source_line)?;
        if let Some(help) = &self.help {
            write!(f, "\n    help: {help}")?;
        }
        Ok(())
    }
}

/// Everything that is wrong with a scene: the first mistakes, and how many more there are.
///
/// Its `Display` is that of each diagnostic, one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostics {
    pub(crate) list: Vec<Diagnostic>,
    pub(crate) omitted: usize,
}

impl Diagnostics {
    /// The mistakes in order of file and position, at most 100.
    pub fn as_slice(&self) -> &[Diagnostic] {
        &self.list
    }

    /// The number of further mistakes that are not in [`Self::as_slice`].
    pub fn omitted(&self) -> usize {
        self.omitted
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, diagnostic) in self.list.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{diagnostic}")?;
        }
        if self.omitted > 0 {
            write!(f, "\nand {} more", self.omitted)?;
        }
        Ok(())
    }
}
