//! Lexer: splits a file into tokens.
//!
//! Tokens carry only their place. Their text stays in the file.

use std::sync::Arc;

use crate::report::Report;
use crate::source::Span;

/// Kind of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TokenKind {
    /// `[`
    Open,
    /// `]`
    Close,
    /// Quoted string, including the quotes.
    Text,
    /// Number, directive or other word, up to a space, quote, bracket or comment.
    Word,
    /// String without a closing quote, which has been reported.
    Broken,
}

/// Token: its kind and its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Token {
    pub kind: TokenKind,
    pub span: Span,
}

/// Lexer of one file.
pub(crate) struct Lexer {
    file: u32,
    bytes: Arc<Vec<u8>>,
    position: usize,
    line: u32,
    peeked: Option<Option<Token>>,
}

impl Lexer {
    /// Makes a lexer at the beginning of a file.
    pub fn new(report: &Report, file: u32) -> Self {
        Self {
            file,
            bytes: Arc::clone(&report.sources.file(file).bytes),
            position: 0,
            line: 1,
            peeked: None,
        }
    }

    /// Makes a lexer at a token that was read before.
    pub fn at(report: &Report, span: Span) -> Self {
        Self {
            position: span.offset as usize,
            line: span.line,
            ..Self::new(report, span.file)
        }
    }

    /// Index of the file.
    pub fn file(&self) -> u32 {
        self.file
    }

    /// Bytes of a token of the file.
    pub fn slice(&self, token: Token) -> &[u8] {
        let start = token.span.offset as usize;
        &self.bytes[start..start + token.span.len as usize]
    }

    /// Place of the end of the file.
    pub fn end(&self) -> Span {
        self.span(self.bytes.len(), self.bytes.len())
    }

    /// Returns the next token without consuming it; `None` at the end of the file.
    pub fn peek(&mut self, report: &mut Report) -> Option<Token> {
        if self.peeked.is_none() {
            self.peeked = Some(self.read(report));
        }
        self.peeked.flatten()
    }

    /// Consumes the next token; `None` at the end of the file.
    pub fn next(&mut self, report: &mut Report) -> Option<Token> {
        match self.peeked.take() {
            Some(token) => token,
            None => self.read(report),
        }
    }

    fn read(&mut self, report: &mut Report) -> Option<Token> {
        let token = self.scan()?;
        if token.kind == TokenKind::Broken {
            let message = "the string does not end on its line";
            report.error_help(token.span, message, "close it with \"");
        }
        Some(token)
    }

    /// Consumes the next token, without a report of a string that does not end.
    pub fn scan(&mut self) -> Option<Token> {
        self.skip_space_and_comments();
        let start = self.position;
        let kind = match *self.bytes.get(start)? {
            b'[' => {
                self.position += 1;
                TokenKind::Open
            }
            b']' => {
                self.position += 1;
                TokenKind::Close
            }
            b'"' => self.read_string(),
            _ => {
                let ends_word = |b: &u8| is_space(*b) || matches!(b, b'"' | b'[' | b']' | b'#');
                let rest = &self.bytes[start..];
                self.position += rest.iter().position(ends_word).unwrap_or(rest.len());
                TokenKind::Word
            }
        };
        let span = self.span(start, self.position);
        Some(Token { kind, span })
    }

    fn skip_space_and_comments(&mut self) {
        while let Some(&byte) = self.bytes.get(self.position) {
            match byte {
                b'\n' => self.line += 1,
                // Lone CRs are the line ends of very old files.
                b'\r' if self.bytes.get(self.position + 1) != Some(&b'\n') => self.line += 1,
                b'#' => {
                    let rest = &self.bytes[self.position..];
                    let is_end = |b: &u8| *b == b'\n' || *b == b'\r';
                    self.position += rest.iter().position(is_end).unwrap_or(rest.len());
                    continue;
                }
                byte if is_space(byte) => {}
                _ => return,
            }
            self.position += 1;
        }
    }

    fn read_string(&mut self) -> TokenKind {
        let mut end = self.position + 1;
        loop {
            match self.bytes.get(end) {
                Some(b'"') => {
                    self.position = end + 1;
                    return TokenKind::Text;
                }
                Some(b'\\') if !matches!(self.bytes.get(end + 1), None | Some(b'\n' | b'\r')) => {
                    end += 2;
                }
                None | Some(b'\n' | b'\r') => {
                    self.position = end;
                    return TokenKind::Broken;
                }
                Some(_) => end += 1,
            }
        }
    }

    fn span(&self, start: usize, end: usize) -> Span {
        Span {
            file: self.file,
            offset: start as u32,
            len: (end - start) as u32,
            line: self.line,
        }
    }
}

fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\n' | b'\r')
}

/// Text between the quotes of a [`TokenKind::Text`] token, with escapes resolved as in pbrt.
pub(crate) fn unquote(quoted: &[u8], span: Span, report: &mut Report) -> String {
    let inner = quoted.get(1..quoted.len() - 1).unwrap_or_default();
    let text = String::from_utf8_lossy(inner);
    if !text.contains('\\') {
        return text.into_owned();
    }
    let mut resolved = String::with_capacity(text.len());
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        if c != '\\' {
            resolved.push(c);
            continue;
        }
        match chars.next() {
            Some('b') => resolved.push('\u{8}'),
            Some('f') => resolved.push('\u{c}'),
            Some('n') => resolved.push('\n'),
            Some('r') => resolved.push('\r'),
            Some('t') => resolved.push('\t'),
            Some(c @ ('\\' | '\'' | '"')) => resolved.push(c),
            other => report.error_help(
                span,
                format!(
                    "unknown escape \\{} in the string",
                    other.map_or_else(String::new, |c| c.escape_debug().to_string())
                ),
                r#"known: \b \f \n \r \t \\ \' \"; write folders with /"#,
            ),
        }
    }
    resolved
}

/// Number of first bytes of a file that decide whether it is text.
const START: usize = 1024;

/// Whether bytes are no text: an eighth of the first ones are not UTF-8 or control characters, and more than a few.
pub(crate) fn is_binary(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(START)];
    let is_control = |c: &char| c.is_control() && !c.is_whitespace();
    let strange: usize = start
        .utf8_chunks()
        .map(|chunk| chunk.valid().chars().filter(is_control).count() + chunk.invalid().len())
        .sum();
    strange > 16 && strange > start.len() / 8
}

/// Reports every run of bytes that is not UTF-8. The lexer continues after them. A file that is no text at all is one
/// mistake, and the reading ends.
pub(crate) fn check_utf8(report: &mut Report, file: u32) {
    let bytes = Arc::clone(&report.sources.file(file).bytes);
    if is_binary(&bytes) {
        let span = Span {
            file,
            offset: 0,
            len: 0,
            line: 1,
        };
        report.error(span, "the file is no text");
        report.end();
        return;
    }
    let mut offset = 0;
    let mut line = 1;
    let mut counted_to = 0;
    for chunk in bytes.utf8_chunks() {
        offset += chunk.valid().len();
        if !chunk.invalid().is_empty() {
            line += count_lines(&bytes[counted_to..offset]);
            counted_to = offset;
            let span = Span {
                file,
                offset: offset as u32,
                len: chunk.invalid().len() as u32,
                line,
            };
            let message = format!("byte 0x{:02X} is not UTF-8", chunk.invalid()[0]);
            report.error_help(span, message, "save the file as UTF-8");
        }
        offset += chunk.invalid().len();
    }
}

/// Number of line ends as the lexer counts them: LF, CR LF or a lone CR.
fn count_lines(bytes: &[u8]) -> u32 {
    let is_end = |(i, b): (usize, &u8)| match b {
        b'\n' => true,
        b'\r' => bytes.get(i + 1) != Some(&b'\n'),
        _ => false,
    };
    bytes.iter().enumerate().filter(|&at| is_end(at)).count() as u32
}
