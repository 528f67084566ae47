//! Parser: turns tokens into directives, follows `Include`, and continues after every mistake.
//!
//! A [`Handler`] receives each directive with its place and builds the scene. Included files are an explicit stack of
//! lexers, so no input can exhaust the call stack.

use crate::arguments::{ACTIVE_TRANSFORMS, Arguments, Failed};
use crate::directive::{DIRECTIVES, Directive, Handler, Quoted};
use crate::lexer::{Lexer, Token, TokenKind, check_utf8};
use crate::number::parse_float;
use crate::params::{self, Params, shorten};
use crate::report::Report;
use crate::source::Span;
use crate::{suggest, version4};

/// Largest depth of includes.
const MAX_INCLUDE_DEPTH: usize = 64;
/// Largest number of includes in total. A few files that each include the next one twice would otherwise double the
/// work at every level.
const MAX_INCLUDES: usize = 100_000;
/// Largest number of bytes that are read again, in files that are included more than once. Texts that are read for the
/// first time stay in memory, whose limit bounds them.
pub(crate) const MAX_TEXT_AGAIN: u64 = 4 << 30;

/// Parses an open file and all files it includes. Returns the place of the end of the file.
pub(crate) fn parse(main_file: u32, handler: &mut impl Handler, report: &mut Report) -> Span {
    check_utf8(report, main_file);
    let mut parser = Parser {
        current: Lexer::new(report, main_file),
        includers: Vec::new(),
        includes: 0,
        again: 0,
    };
    parser.run(handler, report)
}

struct Parser {
    /// Lexer of the file that is being read.
    current: Lexer,
    /// Files that include the current one, the main file first.
    includers: Vec<Includer>,
    includes: usize,
    /// Bytes of files that were included more than once, but for the first time each.
    again: u64,
}

/// File that includes another one.
struct Includer {
    lexer: Lexer,
    /// Place of the `Include`.
    at: Span,
    /// Place of the directive, if it is an `Import`.
    import: Option<Span>,
}

impl Parser {
    /// Reads all files to their ends, and returns the end of the main file. Stops early when reading is ended.
    fn run(&mut self, handler: &mut impl Handler, report: &mut Report) -> Span {
        loop {
            if report.is_over() {
                return self.current.end();
            }
            let lexer = &mut self.current;
            let Some(token) = lexer.next(report) else {
                let end = self.current.end();
                let Some(Includer { lexer, import, .. }) = self.includers.pop() else {
                    return end;
                };
                self.current = lexer;
                if let Some(at) = import {
                    handler.directive(at, Directive::AttributeEnd(), report);
                }
                continue;
            };
            let name = match token.kind {
                TokenKind::Word => directive_name(lexer.slice(token)),
                _ => None,
            };
            let Some(name) = name else {
                report_stray(lexer, token, report);
                skip_past_arguments(lexer, report);
                continue;
            };
            if !report.is_version4 && version4::DIRECTIVES.contains(&name) {
                let message =
                    format!("{name} is a directive of pbrt-v4, but the scene is read as pbrt-v3");
                let help = "the main file decides by its first name that only one version has";
                report.error_help(token.span, message, help);
                skip_past_arguments(lexer, report);
                continue;
            }
            let mut arguments = Arguments {
                lexer,
                report,
                at: token,
            };
            match Directive::read(name, &mut arguments) {
                Ok(Directive::Include(path)) => {
                    self.include(path, None, report);
                }
                // In pbrt-v4, the state after an `Import` is the state before.
                Ok(Directive::Import(path)) => {
                    if self.include(path, Some(token.span), report) {
                        handler.directive(token.span, Directive::AttributeBegin(), report);
                    }
                }
                Ok(mut directive) => {
                    if let Some(params) = directive.params_mut() {
                        self.take_parameters_of_includers(params, report);
                    }
                    handler.directive(token.span, directive, report);
                }
                Err(Failed) => skip_to_directive(lexer, report),
            }
        }
    }

    /// Adds the parameters after the `Include` of a file that ends with a directive: the list goes on there, as in pbrt-v3.
    fn take_parameters_of_includers(&mut self, params: &mut Params, report: &mut Report) {
        while self.current.peek(report).is_none() {
            // The directive of an imported file ends with the file.
            let Some(includer) = self.includers.pop_if(|file| file.import.is_none()) else {
                return;
            };
            self.current = includer.lexer;
            match params::parse(&mut self.current, report) {
                Some(more) => params.extend(more, report),
                None => skip_to_directive(&mut self.current, report),
            }
        }
    }

    /// Goes on in another file. False: a mistake was reported.
    fn include(&mut self, path: Quoted, import: Option<Span>, report: &mut Report) -> bool {
        let full = report.sources.folder.join(&path.text);
        let (file, is_new) = match report.sources.open(&full) {
            Ok(opened) => opened,
            Err(error) => {
                let is_over = error.kind() == std::io::ErrorKind::OutOfMemory;
                let help = match is_over {
                    true => "allow more memory, or leave something out",
                    false => "paths start at the folder of the main scene file",
                };
                let message = format!("cannot include {:?}: {error}", path.text);
                report.error_help(path.span, message, help);
                if is_over {
                    report.end();
                }
                return false;
            }
        };
        if !self.may_include(&path, file, is_new, report) {
            return false;
        }
        let includer = std::mem::replace(&mut self.current, Lexer::new(report, file));
        self.includers.push(Includer {
            lexer: includer,
            at: path.span,
            import,
        });
        true
    }

    /// Whether a file is no includer of itself, and within all limits. Reports it otherwise.
    fn may_include(&mut self, path: &Quoted, file: u32, is_new: bool, report: &mut Report) -> bool {
        let mut open = self.includers.iter().map(|includer| includer.lexer.file());
        if self.current.file() == file || open.any(|f| f == file) {
            let chain = self.chain(file, report);
            let message = format!("{:?} includes itself: {chain}", path.text);
            report.error_once(path.span, message, Some("remove this Include"));
            return false;
        }
        if self.includers.len() == MAX_INCLUDE_DEPTH {
            let chain = self.chain(file, report);
            let message =
                format!("files include each other more than {MAX_INCLUDE_DEPTH} deep: {chain}");
            report.error_once(path.span, message, None);
            return false;
        }
        self.includes += 1;
        if self.includes > MAX_INCLUDES {
            let message = format!("more than {MAX_INCLUDES} files are included");
            report.error_once(path.span, message, None);
            return false;
        }
        if is_new {
            check_utf8(report, file);
        } else {
            self.again += report.sources.file(file).bytes.len() as u64;
            if self.again > MAX_TEXT_AGAIN {
                let message = format!(
                    "files that are included again have more than {MAX_TEXT_AGAIN} bytes in all"
                );
                let help = "define an object once, and place it with ObjectInstance";
                report.error_help(path.span, message, help);
                report.end();
                return false;
            }
        }
        true
    }

    /// Chain of includes down to `last`, for messages. The middle of a long chain is omitted.
    fn chain(&self, last: u32, report: &Report) -> String {
        const SHOWN_AT_EACH_END: usize = 4;
        let name = |file: u32| {
            let path = &report.sources.file(file).canonical;
            path.file_name()
                .unwrap_or(path.as_os_str())
                .to_string_lossy()
                .into_owned()
        };
        let mut links: Vec<String> = Vec::new();
        for includer in &self.includers {
            links.push(format!(
                "{}:{}",
                name(includer.lexer.file()),
                includer.at.line
            ));
        }
        links.push(name(self.current.file()));
        links.push(name(last));
        if links.len() > 2 * SHOWN_AT_EACH_END {
            let middle = SHOWN_AT_EACH_END..links.len() - SHOWN_AT_EACH_END;
            let omitted = format!("… {} more …", middle.len());
            links.splice(middle, [omitted]);
        }
        links.join(" → ")
    }
}

fn directive_name(word: &[u8]) -> Option<&'static str> {
    let word = std::str::from_utf8(word).ok()?;
    DIRECTIVES.binary_search(&word).ok().map(|i| DIRECTIVES[i])
}

/// Reports a token that is in the place of a directive.
fn report_stray(lexer: &Lexer, token: Token, report: &mut Report) {
    if token.kind != TokenKind::Broken && report.is_counted_only() {
        return;
    }
    let text = String::from_utf8_lossy(lexer.slice(token)).into_owned();
    let shown = shorten(&text);
    match token.kind {
        TokenKind::Broken => {}
        TokenKind::Word if parse_float(text.as_bytes()).is_err() => {
            let message = format!("unknown directive {shown}");
            // The list of all directives would be too long for a message.
            match suggest::closest(&text, DIRECTIVES.iter().copied()) {
                Some(name) => {
                    report.error_help(token.span, message, format!("did you mean {name}?"));
                }
                None => report.error(token.span, message),
            }
        }
        TokenKind::Text => report.error(
            token.span,
            format!("expected a directive, found the string {shown}"),
        ),
        _ => report.error_help(
            token.span,
            format!("expected a directive, found {shown}"),
            "several values of a parameter go in [ ]",
        ),
    }
}

/// Skips the rest of a directive that failed at the next token.
fn skip_to_directive(lexer: &mut Lexer, report: &mut Report) {
    let is_directive =
        |l: &Lexer, t: Token| t.kind == TokenKind::Word && directive_name(l.slice(t)).is_some();
    // The failed token was reported and must not be taken for a directive again.
    if let Some(token) = lexer.peek(report)
        && !is_directive(lexer, token)
    {
        lexer.next(report);
    }
    skip_past_arguments(lexer, report);
}

/// Skips to the next word that is a directive, or looks like one and will be reported as unknown.
fn skip_past_arguments(lexer: &mut Lexer, report: &mut Report) {
    while let Some(token) = lexer.peek(report) {
        if token.kind == TokenKind::Word && looks_like_directive(lexer.slice(token)) {
            return;
        }
        lexer.next(report);
    }
}

/// Returns true for words that begin with a capital, except the arguments of `ActiveTransform`.
fn looks_like_directive(word: &[u8]) -> bool {
    word[0].is_ascii_uppercase()
        && parse_float(word).is_err()
        && ACTIVE_TRANSFORMS.iter().all(|(name, _)| *name != word)
}
