//! Report: collects diagnostics while a scene is read.

use std::collections::HashMap;

use glam::DMat3;

use crate::bsdf_file::Tables;
use crate::diagnostic::{Diagnostic, Diagnostics, Severity};
use crate::source::{Sources, Span};
use crate::suggest;

/// Directives that only a picture shows.
const LOOKS: [&str; 13] = [
    "AreaLightSource",
    "ColorSpace",
    "Film",
    "Integrator",
    "LightSource",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "PixelFilter",
    "Sampler",
    "Texture",
];

/// Largest number of diagnostics kept per severity. Further ones are only counted.
const KEPT: usize = 100;

/// Files of a scene, and the diagnostics about them so far.
#[derive(Default)]
pub(crate) struct Report {
    pub sources: Sources,
    /// Tables of scattering that materials name.
    pub tables: Tables,
    errors: Kept,
    notes: Kept,
    /// Repeated messages: their number, and the index of the first.
    repeated: HashMap<String, Repeated>,
    is_over: bool,
    /// See [`Options::skip_unsupported`](crate::Options::skip_unsupported).
    pub skips_unsupported: bool,
    /// See [`Options::strict`](crate::Options::strict).
    pub is_strict: bool,
    /// Whether the scene is of pbrt-v4, whose parameters mean other things in places.
    pub is_version4: bool,
    /// Primaries of `rgb` parameters, where the picture has others.
    pub color_space: Option<DMat3>,
}

#[derive(Default)]
struct Kept {
    list: Vec<(Span, Diagnostic)>,
    omitted: usize,
}

struct Repeated {
    place: Option<usize>,
    more: usize,
}

impl Report {
    /// Records a mistake.
    pub fn error(&mut self, span: Span, message: impl Into<String>) {
        self.add(Severity::Error, span, message.into(), None);
    }

    /// Records a mistake and what would be right.
    pub fn error_help(&mut self, span: Span, message: impl Into<String>, help: impl Into<String>) {
        self.add(Severity::Error, span, message.into(), Some(help.into()));
    }

    /// Records a mistake in place of a value.
    pub fn fail<T>(&mut self, span: Span, message: impl Into<String>) -> Option<T> {
        self.error(span, message);
        None
    }

    /// Records a mistake and what would be right, in place of a value.
    pub fn fail_help<T>(
        &mut self,
        span: Span,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> Option<T> {
        self.error_help(span, message, help);
        None
    }

    /// Records a mistake and perhaps what would be right.
    pub fn add_error(&mut self, span: Span, message: String, help: Option<String>) {
        self.add(Severity::Error, span, message, help);
    }

    /// Records that a name is not known, with the known one that is closest.
    pub fn unknown(&mut self, span: Span, what: &str, name: &str, known: &[&str]) {
        let message = format!("unknown {what} {name:?}");
        self.error_help(span, message, suggest::help(name, known));
    }

    /// Records a note. Further notes with an equal text are dropped.
    pub fn note(&mut self, span: Span, message: impl Into<String>) {
        self.once(Severity::Note, span, message.into(), None);
    }

    /// Records a warning, or a note. Further ones with an equal text are dropped.
    fn once(&mut self, severity: Severity, span: Span, message: String, help: Option<String>) {
        if self.notes.list.iter().all(|(_, d)| d.message != message) {
            self.add(severity, span, message, help);
        }
    }

    /// Records a mistake that pbrt-v3 goes on after: a warning that says what is `taken` in its place, and an error where the reader
    /// is strict. `help` says what would be right; nobody calls it where nobody would read it.
    pub fn tolerated(
        &mut self,
        span: Span,
        mistake: String,
        taken: &str,
        help: impl FnOnce() -> String,
    ) {
        if self.is_strict {
            if !self.is_counted_only() {
                self.error_help(span, mistake, help());
            }
            return;
        }
        let message = format!("{mistake}; {taken}, as in pbrt-v3");
        if self.notes.list.len() < KEPT {
            self.once(Severity::Warning, span, message, Some(help()));
        }
    }

    /// Records a mistake that a file is likely to have many times. The first is kept, and its message counts the
    /// others.
    pub fn error_once(&mut self, span: Span, message: impl Into<String>, help: Option<&str>) {
        let message = message.into();
        if let Some(repeated) = self.repeated.get_mut(&message) {
            repeated.more += 1;
            return;
        }
        let place = self.add(
            Severity::Error,
            span,
            message.clone(),
            help.map(String::from),
        );
        // Messages that were not kept are not remembered either, which bounds the memory.
        if place.is_some() {
            self.repeated.insert(message, Repeated { place, more: 0 });
        }
    }

    /// Records the use of a feature of pbrt-v3 that is not supported yet. `feature` ends in "is" or "are".
    pub fn unsupported(&mut self, span: Span, feature: impl Into<String>) {
        self.unsupported_help(span, format!("{} not supported yet", feature.into()), None);
    }

    /// Records the use of an unsupported feature in place of a value.
    pub fn refuse<T>(&mut self, span: Span, feature: impl Into<String>) -> Option<T> {
        self.unsupported(span, feature);
        None
    }

    fn unsupported_help(&mut self, span: Span, message: String, help: Option<&str>) {
        if self.skips_unsupported {
            let help = help.map(String::from);
            self.once(
                Severity::Warning,
                span,
                format!("{message}, and left out"),
                help,
            );
        } else {
            self.error_once(span, message, help);
        }
    }

    /// Records the use of a kind of pbrt-v3 that is not supported yet, with those that are.
    pub fn unsupported_kind(&mut self, span: Span, what: &str, name: &str, known: &[&str]) {
        let message = format!("{what} {name:?} is not supported yet");
        let help = format!("supported: {}", known.join(", "));
        self.unsupported_help(span, message, Some(&help));
    }

    /// Ends the reading: what follows would only take more memory or time.
    pub fn end(&mut self) {
        self.is_over = true;
    }

    /// Whether the reading is ended.
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// Number of mistakes so far, including those that were not kept.
    pub fn error_count(&self) -> usize {
        self.errors.list.len() + self.errors.omitted
    }

    /// `None` if there was a mistake after the first `earlier` ones.
    pub fn clean_since(&self, earlier: usize) -> Option<()> {
        (self.error_count() == earlier).then_some(())
    }

    /// Counts a mistake and returns true if it would not be kept. Returns false if it should be recorded.
    ///
    /// The check spares the search for advice in a file with very many mistakes.
    pub fn is_counted_only(&mut self) -> bool {
        // Not `omitted += usize::from(is_full)`, which was observed to add nothing when optimised by rustc 1.95.
        if self.errors.list.len() < KEPT {
            return false;
        }
        self.errors.omitted += 1;
        true
    }

    /// Returns warnings and notes if there was no mistake, and the mistakes otherwise. Perhaps only what is about geometry.
    pub fn finish(mut self, only_geometry: bool) -> Result<Vec<Diagnostic>, Diagnostics> {
        for repeated in self.repeated.values() {
            if let (Some(place), 1..) = (repeated.place, repeated.more) {
                let message = &mut self.errors.list[place].1.message;
                *message = format!("{message} (and {} more like it)", repeated.more);
            }
        }
        if self.error_count() == 0 {
            if only_geometry {
                let sources = &self.sources;
                (self.notes.list).retain(|(span, _)| !LOOKS.contains(&sources.directive(*span)));
            }
            return Ok(self.notes.sorted());
        }
        Err(Diagnostics {
            omitted: self.errors.omitted,
            list: self.errors.sorted(),
        })
    }

    fn add(
        &mut self,
        severity: Severity,
        span: Span,
        message: String,
        help: Option<String>,
    ) -> Option<usize> {
        let kept = match severity {
            Severity::Error => &mut self.errors,
            Severity::Warning | Severity::Note => &mut self.notes,
        };
        let is_known = |(s, d): &(Span, Diagnostic)| *s == span && d.message == message;
        if let Some(place) = kept.list.iter().position(is_known) {
            return Some(place);
        }
        if kept.list.len() == KEPT {
            kept.omitted += 1;
            return None;
        }
        let excerpt = self.sources.excerpt(span);
        kept.list.push((
            span,
            Diagnostic {
                severity,
                file: self.sources.file(span.file).path.clone(),
                line: span.line,
                column: excerpt.column,
                message,
                source_line: excerpt.line,
                help,
                span_len: excerpt.span_len,
                caret: excerpt.caret,
            },
        ));
        Some(kept.list.len() - 1)
    }
}

impl Kept {
    fn sorted(mut self) -> Vec<Diagnostic> {
        self.list.sort_by_key(|(span, _)| (span.file, span.offset));
        self.list.into_iter().map(|(_, d)| d).collect()
    }
}
