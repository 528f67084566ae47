//! Typed lookup of a directive's parameters.
//!
//! Every lookup is remembered. At the end, [`Lookup::finish`] reports parameters that the directive does not have, and
//! parameters of another type, without a separate table of parameters. Mistakes go to the report that the lookup holds.

use antumbra_scene::Rgb;
use glam::DVec3;

use crate::directive::Quoted;
use crate::params::{Param, ParamType, Params};
use crate::report::Report;
use crate::source::Span;
use crate::spectrum;
use crate::suggest;

/// Types of a colour parameter.
pub(crate) const COLOR: &[ParamType] = &[
    ParamType::Rgb,
    ParamType::Xyz,
    ParamType::Spectrum,
    ParamType::Blackbody,
];

/// Types of parameters with one number, integer or string.
pub(crate) const FLOAT: &[ParamType] = &[ParamType::Float];
pub(crate) const INTEGER: &[ParamType] = &[ParamType::Integer];
pub(crate) const STRING: &[ParamType] = &[ParamType::String];

/// Numbers above 0, and numbers from 0, for [`Lookup::float_in`].
pub(crate) const POSITIVE: [f32; 2] = [f32::MIN_POSITIVE, f32::MAX];
pub(crate) const NOT_NEGATIVE: [f32; 2] = [0.0, f32::MAX];

/// Lookups in one parameter list, and perhaps in a second list with defaults from another directive.
pub(crate) struct Lookup<'a> {
    /// Place of the directive's name, where missing parameters are reported.
    pub at: Span,
    pub report: &'a mut Report,
    /// Word for what the directive makes, such as `shape`, and its name in the file.
    noun: &'static str,
    pub kind: &'a Quoted,
    params: &'a Params,
    fallback: Option<&'a Params>,
    used: Vec<bool>,
    asked: Vec<(&'static str, &'static [ParamType])>,
}

impl<'a> Lookup<'a> {
    /// Starts the lookups of a directive.
    pub fn new(
        noun: &'static str,
        at: Span,
        kind: &'a Quoted,
        params: &'a Params,
        report: &'a mut Report,
    ) -> Self {
        Self {
            at,
            report,
            noun,
            kind,
            params,
            fallback: None,
            used: vec![false; params.list.len()],
            asked: Vec::new(),
        }
    }

    /// Sets the list in which further lookups find parameters that the directive does not give.
    pub fn fall_back_on(&mut self, fallback: &'a Params) {
        self.fallback = Some(fallback);
    }

    /// Owner of the parameters, for messages: `shape "sphere"`.
    pub fn what(&self) -> String {
        format!("{} {:?}", self.noun, self.kind.text)
    }

    /// Whether the scene is of pbrt-v4.
    pub fn is_version4(&self) -> bool {
        self.report.is_version4
    }

    /// Records a mistake at the directive's name.
    pub fn error(&mut self, message: impl Into<String>) {
        self.report.error(self.at, message);
    }

    /// Records a mistake at the directive's name and what would be right.
    pub fn error_help(&mut self, message: impl Into<String>, help: &str) {
        self.report.error_help(self.at, message, help);
    }

    /// Records a mistake at the directive's name, in place of a value.
    pub fn fail<T>(&mut self, message: impl Into<String>) -> Option<T> {
        self.report.fail(self.at, message)
    }

    /// Records a mistake at the directive's name and what would be right, in place of a value.
    pub fn fail_help<T>(&mut self, message: impl Into<String>, help: &str) -> Option<T> {
        self.report.fail_help(self.at, message, help)
    }

    /// Records a note at the directive's name.
    pub fn note(&mut self, message: impl Into<String>) {
        self.report.note(self.at, message);
    }

    /// Records the use of an unsupported feature at the directive's name.
    pub fn unsupported(&mut self, feature: impl Into<String>) {
        self.report.unsupported(self.at, feature);
    }

    /// Records the use of an unsupported feature at the directive's name, in place of a value.
    pub fn refuse<T>(&mut self, feature: impl Into<String>) -> Option<T> {
        self.unsupported(feature);
        None
    }

    /// Reports that the directive's name is none of the `known`, and reads no parameters.
    pub fn unknown(&mut self, known: &[&str]) {
        (self.report).unknown(self.kind.span, self.noun, &self.kind.text, known);
        self.ignore_all();
    }

    /// Finds a parameter by name and type. Earlier types take precedence.
    pub fn find(&mut self, name: &'static str, types: &'static [ParamType]) -> Option<&'a Param> {
        self.asked.push((name, types));
        for param_type in types {
            let is_it = |p: &Param| p.name == name && p.param_type == *param_type;
            if let Some(index) = self.params.list.iter().position(is_it) {
                self.used[index] = true;
                return Some(&self.params.list[index]);
            }
        }
        let fallback = self.fallback?;
        types.iter().find_map(|param_type| {
            let mut list = fallback.list.iter();
            list.find(|p| p.name == name && p.param_type == *param_type)
        })
    }

    /// Returns true if the directive gives a parameter of that name, of any type.
    pub fn has(&self, name: &str) -> bool {
        self.params.list.iter().any(|p| p.name == name)
    }

    /// Finds a parameter that must be given.
    pub fn needed(&mut self, name: &'static str, types: &'static [ParamType]) -> Option<&'a Param> {
        let found = self.find(name, types);
        if found.is_none() {
            self.report_missing(name, types[0].name());
        }
        found
    }

    /// Reports that a parameter is missing, unless there is one of another type. Parameters of a wrong type and broken ones are
    /// reported elsewhere.
    pub fn report_missing(&mut self, name: &str, param_type: &str) {
        if !self.has(name) {
            let message = format!("{} needs a parameter {name:?}", self.what());
            let help = format!("add \"{param_type} {name}\"");
            self.report.error_help(self.at, message, help);
        }
    }

    /// Marks all parameters as used. Called when a directive is refused as a whole.
    pub fn ignore_all(&mut self) {
        self.used.fill(true);
    }

    /// Reports every parameter that was not used.
    pub fn finish(self) {
        for (param, used) in self.params.list.iter().zip(&self.used) {
            if !used && !param.is_attribute {
                let (message, help) = self.unused(param);
                self.report.add_error(param.declaration, message, help);
            }
        }
    }

    /// Message and help about a parameter that was not used.
    fn unused(&self, param: &Param) -> (String, Option<String>) {
        let (name, found) = (&param.name, param.param_type.name());
        let mut wanted: Vec<&str> = Vec::new();
        for (_, types) in self.asked.iter().filter(|(asked, _)| asked == name) {
            for param_type in *types {
                if !wanted.contains(&param_type.name()) {
                    wanted.push(param_type.name());
                }
            }
        }
        if wanted.is_empty() {
            let mut known: Vec<&str> = self.asked.iter().map(|(name, _)| *name).collect();
            known.sort_unstable();
            known.dedup();
            let message = format!("{} has no parameter {name:?}", self.what());
            return (message, Some(suggest::help(name, &known)));
        }
        if wanted.contains(&found) {
            let message = format!("parameter {name:?} is given in two ways; remove one");
            return (message, None);
        }
        let (what, types) = (self.what(), wanted.join(" or "));
        let message =
            format!("parameter {name:?} of {what} is of type {types}, found type {found}");
        (message, Some(format!("write \"{} {name}\"", wanted[0])))
    }

    /// Value of a parameter, if it is given and `read` reports no mistake.
    fn value<T>(
        &mut self,
        name: &'static str,
        types: &'static [ParamType],
        read: impl FnOnce(&'a Param, &mut Report) -> Option<T>,
    ) -> Option<T> {
        let param = self.find(name, types)?;
        read(param, self.report)
    }

    /// Single finite number, or the default.
    pub fn float(&mut self, name: &'static str, default: f32) -> f32 {
        self.optional_float(name).unwrap_or(default)
    }

    /// Single finite number, if it is given.
    pub fn optional_float(&mut self, name: &'static str) -> Option<f32> {
        self.value(name, FLOAT, one_float)
    }

    /// Single number within inclusive limits, or the default.
    ///
    /// `f32::MIN_POSITIVE` means "above 0", and `f32::MAX` means no upper limit.
    pub fn float_in(&mut self, name: &'static str, default: f32, [low, high]: [f32; 2]) -> f32 {
        let read = |param: &Param, report: &mut Report| {
            let value = one_float(param, report)?;
            if (low..=high).contains(&value) {
                return Some(value);
            }
            let range = range_text(low, high);
            let message = format!("{name:?} must be {range}, found {value}");
            report.fail(param.value, message)
        };
        self.value(name, FLOAT, read).unwrap_or(default)
    }

    /// Exactly `N` finite numbers, if they are given.
    pub fn floats<const N: usize>(&mut self, name: &'static str) -> Option<[f32; N]> {
        let param = self.find(name, FLOAT)?;
        let values = param.values.floats()?;
        let message = match <[f32; N]>::try_from(values) {
            Ok(values) if values.iter().all(|v| v.is_finite()) => return Some(values),
            Ok(_) => format!("{name:?} must be finite"),
            Err(_) => format!("{name:?} takes {N} values, found {}", values.len()),
        };
        self.report.fail(param.list, message)
    }

    /// Single integer of at least `least`, or the default.
    pub fn integer_from(&mut self, name: &'static str, default: u32, least: u32) -> u32 {
        self.integer_in(name, default, [least, i32::MAX as u32])
    }

    /// Single integer within inclusive limits, or the default.
    pub fn integer_in(&mut self, name: &'static str, default: u32, [least, most]: [u32; 2]) -> u32 {
        let read = |param: &'a Param, report: &mut Report| {
            let value = *one(param, param.values.integers(), report)?;
            let limit = match u32::try_from(value) {
                Ok(value) if (least..=most).contains(&value) => return Some(value),
                Ok(value) if value > most => format!("at most {most}"),
                _ => format!("at least {least}"),
            };
            let message = format!("{name:?} must be {limit}, found {value}");
            report.fail(param.value, message)
        };
        self.value(name, INTEGER, read).unwrap_or(default)
    }

    /// Single boolean, or the default.
    pub fn bool(&mut self, name: &'static str, default: bool) -> bool {
        let read = |param: &'a Param, report: &mut Report| one(param, param.values.bools(), report);
        *self
            .value(name, &[ParamType::Bool], read)
            .unwrap_or(&default)
    }

    /// Single string with its place, if it is given.
    pub fn string(&mut self, name: &'static str) -> Option<(&'a str, Span)> {
        let param = self.find(name, STRING)?;
        one_string(param, self.report).map(|text| (text, param.value))
    }

    /// Single string with its place, which must be given.
    pub fn needed_string(&mut self, name: &'static str) -> Option<(&'a str, Span)> {
        let found = self.string(name);
        if found.is_none() {
            self.report_missing(name, "string");
        }
        found
    }

    /// Colour with finite components that are not negative, or the default.
    pub fn color(&mut self, name: &'static str, default: Rgb) -> Rgb {
        self.value(name, COLOR, spectrum::read).unwrap_or(default)
    }

    /// Emitted colour, or the default. In pbrt-v4, spectra and black bodies have luminance 1.
    pub fn emission(&mut self, name: &'static str, default: Rgb) -> Rgb {
        let found = self.value(name, COLOR, spectrum::read_emission);
        found.unwrap_or(default)
    }

    /// Single finite point, or the default.
    pub fn point(&mut self, name: &'static str, default: DVec3) -> DVec3 {
        let found = self.value(name, &[ParamType::Point3], one_triple);
        found.unwrap_or(default)
    }

    /// Single finite vector, or the default.
    pub fn vector(&mut self, name: &'static str, default: DVec3) -> DVec3 {
        let found = self.value(name, &[ParamType::Vector3], one_triple);
        found.unwrap_or(default)
    }

    /// Choice of one of several words. The first is the default.
    pub fn choice<T: Copy, const N: usize>(
        &mut self,
        name: &'static str,
        choices: [(&str, T); N],
    ) -> T {
        if let Some((word, span)) = self.string(name) {
            if let Some((_, choice)) = choices.iter().find(|(known, _)| *known == word) {
                return *choice;
            }
            let help = suggest::help(word, &choices.map(|(known, _)| known));
            (self.report).error_help(span, format!("{name:?} cannot be {word:?}"), help);
        }
        choices[0].1
    }

    /// Accepts a parameter that cannot change the picture, with a note.
    pub fn left_out(&mut self, name: &'static str, types: &'static [ParamType], why: &str) {
        if let Some(param) = self.find(name, types) {
            let message = format!("{name:?} of {} is left out: {why}", self.what());
            self.report.note(param.declaration, message);
        }
    }

    /// Refuses a parameter of pbrt-v3 that is not supported.
    pub fn refuse_param(&mut self, name: &'static str, types: &'static [ParamType]) {
        if let Some(param) = self.find(name, types) {
            let feature = format!("parameter {name:?} of {} is", self.what());
            self.report.unsupported(param.declaration, feature);
        }
    }
}

/// Reads what a directive declares, and reports the parameters that `by` does not use. `noun` says what that is.
pub(crate) fn read<T>(
    noun: &'static str,
    at: Span,
    (kind, params): (&Quoted, &Params),
    report: &mut Report,
    by: impl FnOnce(&mut Lookup) -> T,
) -> T {
    let mut lookup = Lookup::new(noun, at, kind, params, report);
    let value = by(&mut lookup);
    lookup.finish();
    value
}

/// Only value of a parameter. `None`: there are none or several, which was reported.
fn one<'a, T>(param: &Param, values: Option<&'a [T]>, report: &mut Report) -> Option<&'a T> {
    match values? {
        [value] => Some(value),
        values => {
            let (name, found) = (&param.name, values.len());
            let message = format!("{name:?} takes one value, found {found}");
            report.fail(param.list, message)
        }
    }
}

/// Only value of a float parameter, if it is finite.
pub(crate) fn one_float(param: &Param, report: &mut Report) -> Option<f32> {
    let value = *one(param, param.values.floats(), report)?;
    if value.is_finite() {
        return Some(value);
    }
    let message = format!("{:?} must be finite, found {value}", param.name);
    report.fail(param.value, message)
}

/// One finite point or vector. `None`: a mistake was reported.
fn one_triple(param: &Param, report: &mut Report) -> Option<DVec3> {
    let (name, what) = (&param.name, param.param_type.name());
    let message = match param.values.doubles()?[..] {
        [x, y, z] if DVec3::new(x, y, z).is_finite() => return Some(DVec3::new(x, y, z)),
        [_, _, _] => format!("{name:?} must be finite"),
        ref values => format!("{name:?} is one {what}, found {}", values.len() / 3),
    };
    report.fail(param.list, message)
}

/// Only value of a string or texture parameter.
pub(crate) fn one_string<'a>(param: &'a Param, report: &mut Report) -> Option<&'a str> {
    one(param, param.values.strings(), report).map(String::as_str)
}

fn range_text(low: f32, high: f32) -> String {
    let is_positive = low == f32::MIN_POSITIVE;
    match (is_positive, high == f32::MAX) {
        (true, true) => "positive".into(),
        (true, false) => format!("positive and at most {high}"),
        (false, true) => format!("at least {low}"),
        (false, false) => format!("from {low} to {high}"),
    }
}
