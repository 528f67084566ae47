//! Diagnostics: mistakes and notes about files, each with its place.

use std::fmt;
use std::path::PathBuf;

/// Severity of a [`Diagnostic`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Severity {
    /// Mistake because of which the scene cannot be read.
    Error,
    /// Warning about a part that was left out or taken as something else. The picture may show it.
    Warning,
    /// Note about a part that was left out or taken as something else. Only the noise of the picture depends on it.
    Note,
}

/// Message about a place in a file.
///
/// `Display` prints several lines: `file:line:column: error: message`, the source line, carets under the offending
/// token and what would be right, if known. There is no newline at the end.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Diagnostic {
    /// Severity: error or note.
    pub severity: Severity,
    /// Path of the file as it was opened.
    pub file: PathBuf,
    /// Line, counted from 1.
    pub line: u32,
    /// Column in characters, counted from 1.
    pub column: u32,
    /// Problem in one sentence, without a full stop.
    pub message: String,
    /// Text of the line. Long lines are cut to a window around the token, with `…` at the cuts. Control characters
    /// other than tabs are replaced.
    pub source_line: String,
    /// Advice on what would be right, if known.
    pub help: Option<String>,
    /// Length of the offending token in characters, at least 1, limited to the part that `source_line` shows.
    pub span_len: u32,
    /// Number of characters of `source_line` before the token.
    pub(crate) caret: usize,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
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
        // Tabs of the line are repeated, so that the caret is under its token for every tab width.
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

/// Mistakes of a scene: the first ones, and the number of further ones.
///
/// `Display` prints each diagnostic on lines of its own, then the number of further ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostics {
    pub(crate) list: Vec<Diagnostic>,
    pub(crate) omitted: usize,
}

impl Diagnostics {
    /// Mistakes in order of file and position, at most 100.
    pub fn as_slice(&self) -> &[Diagnostic] {
        &self.list
    }

    /// Number of further mistakes that are not in [`Self::as_slice`].
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
