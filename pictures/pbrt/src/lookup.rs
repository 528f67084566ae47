//! Typed lookup of a directive's parameters.
//!
//! Every lookup is remembered. At the end, [`Lookup::finish`] reports parameters that the directive does not have, and
//! parameters of another type, without a separate table of parameters.

use antumbra_scene::Rgb;
use glam::DVec3;

use crate::params::{Param, ParamType, Params, Values};
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

/// Lookups in one parameter list, and perhaps in a second list with defaults from another directive.
pub(crate) struct Lookup<'a> {
    /// Place of the directive's name, where missing parameters are reported.
    pub at: Span,
    /// Owner of the parameters, for messages: `shape "sphere"`.
    what: String,
    params: &'a Params,
    fallback: Option<&'a Params>,
    used: Vec<bool>,
    asked: Vec<(&'static str, &'static [ParamType])>,
}

impl<'a> Lookup<'a> {
    /// Starts the lookups of a directive.
    pub fn new(at: Span, what: impl Into<String>, params: &'a Params) -> Self {
        Self {
            at,
            what: what.into(),
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

    /// Owner of the parameters, for messages.
    pub fn what(&self) -> &str {
        &self.what
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
            fallback
                .list
                .iter()
                .find(|p| p.name == name && p.param_type == *param_type)
        })
    }

    /// Returns true if the directive gives a parameter of that name, of any type.
    pub fn has(&self, name: &str) -> bool {
        self.params.list.iter().any(|p| p.name == name)
    }

    /// Finds a parameter that must be given. `written` is its type as the advice has it.
    pub fn needed(
        &mut self,
        name: &'static str,
        types: &'static [ParamType],
        written: &str,
        report: &mut Report,
    ) -> Option<&'a Param> {
        let found = self.find(name, types);
        if found.is_none() {
            self.report_missing(name, written, report);
        }
        found
    }

    /// Reports that a parameter is missing, unless there is one of another type. Parameters of a wrong type and broken ones are
    /// reported elsewhere.
    pub fn report_missing(&self, name: &str, param_type: &str, report: &mut Report) {
        if !self.has(name) {
            report.error_help(
                self.at,
                format!("{} needs a parameter {name:?}", self.what),
                format!("add \"{param_type} {name}\""),
            );
        }
    }

    /// Marks all parameters as used. Called when a directive is refused as a whole.
    pub fn ignore_all(&mut self) {
        self.used.fill(true);
    }

    /// Reports every parameter that was not used.
    pub fn finish(self, report: &mut Report) {
        for (param, used) in self.params.list.iter().zip(&self.used) {
            if !used && !param.is_attribute {
                self.report_unused(param, report);
            }
        }
    }

    fn report_unused(&self, param: &Param, report: &mut Report) {
        let mut wanted: Vec<ParamType> = Vec::new();
        for (_, types) in self.asked.iter().filter(|(name, _)| *name == param.name) {
            for param_type in *types {
                if !wanted.contains(param_type) {
                    wanted.push(*param_type);
                }
            }
        }
        if wanted.is_empty() {
            let mut known: Vec<&str> = self.asked.iter().map(|(name, _)| *name).collect();
            known.sort_unstable();
            known.dedup();
            report.error_help(
                param.declaration,
                format!("{} has no parameter {:?}", self.what, param.name),
                suggest::help(&param.name, &known),
            );
        } else if wanted.contains(&param.param_type) {
            report.error(
                param.declaration,
                format!(
                    "parameter {:?} is given in two ways; remove one",
                    param.name
                ),
            );
        } else {
            let names: Vec<&str> = wanted.iter().map(|t| t.name()).collect();
            report.error_help(
                param.declaration,
                format!(
                    "parameter {:?} of {} is of type {}, found type {}",
                    param.name,
                    self.what,
                    names.join(" or "),
                    param.param_type.name()
                ),
                format!("write \"{} {}\"", names[0], param.name),
            );
        }
    }

    /// Single finite number, or the default.
    pub fn float(&mut self, name: &'static str, default: f32, report: &mut Report) -> f32 {
        self.optional_float(name, report).unwrap_or(default)
    }

    /// Single finite number, if it is given.
    pub fn optional_float(&mut self, name: &'static str, report: &mut Report) -> Option<f32> {
        let param = self.find(name, &[ParamType::Float])?;
        one_float(param, report)
    }

    /// Single number within inclusive limits, or the default.
    ///
    /// `f32::MIN_POSITIVE` means "above 0", and `f32::MAX` means no upper limit.
    pub fn float_in(
        &mut self,
        name: &'static str,
        default: f32,
        [low, high]: [f32; 2],
        report: &mut Report,
    ) -> f32 {
        let Some(param) = self.find(name, &[ParamType::Float]) else {
            return default;
        };
        match one_float(param, report) {
            Some(value) if (low..=high).contains(&value) => value,
            Some(value) => {
                report.error(
                    param.value,
                    format!("{name:?} must be {}, found {value}", range_text(low, high)),
                );
                default
            }
            None => default,
        }
    }

    /// Exactly `N` finite numbers, if they are given.
    pub fn floats<const N: usize>(
        &mut self,
        name: &'static str,
        report: &mut Report,
    ) -> Option<[f32; N]> {
        let param = self.find(name, &[ParamType::Float])?;
        let Values::Floats(values) = &param.values else {
            return None;
        };
        match <[f32; N]>::try_from(values.as_slice()) {
            Ok(values) if values.iter().all(|v| v.is_finite()) => Some(values),
            Ok(_) => {
                report.error(param.list, format!("{name:?} must be finite"));
                None
            }
            Err(_) => {
                let found = values.len();
                report.error(
                    param.list,
                    format!("{name:?} takes {N} values, found {found}"),
                );
                None
            }
        }
    }

    /// Single integer of at least `least`, or the default.
    pub fn integer_from(
        &mut self,
        name: &'static str,
        default: u32,
        least: u32,
        report: &mut Report,
    ) -> u32 {
        self.integer_in(name, default, [least, i32::MAX as u32], report)
    }

    /// Single integer within inclusive limits, or the default.
    pub fn integer_in(
        &mut self,
        name: &'static str,
        default: u32,
        [least, most]: [u32; 2],
        report: &mut Report,
    ) -> u32 {
        let Some(param) = self.find(name, &[ParamType::Integer]) else {
            return default;
        };
        let Some(Single::Integer(value)) = one(param, report) else {
            return default;
        };
        match u32::try_from(value) {
            Ok(value) if (least..=most).contains(&value) => value,
            Ok(value) if value > most => {
                let message = format!("{name:?} must be at most {most}, found {value}");
                report.error(param.value, message);
                default
            }
            _ => {
                let message = format!("{name:?} must be at least {least}, found {value}");
                report.error(param.value, message);
                default
            }
        }
    }

    /// Single boolean, or the default.
    pub fn bool(&mut self, name: &'static str, default: bool, report: &mut Report) -> bool {
        match self.find(name, &[ParamType::Bool]) {
            Some(param) => match one(param, report) {
                Some(Single::Bool(value)) => value,
                _ => default,
            },
            None => default,
        }
    }

    /// Single string with its place, if it is given.
    pub fn string(&mut self, name: &'static str, report: &mut Report) -> Option<(&'a str, Span)> {
        let param = self.find(name, &[ParamType::String])?;
        one_string(param, report).map(|text| (text, param.value))
    }

    /// Single string with its place, which must be given.
    pub fn needed_string(
        &mut self,
        name: &'static str,
        report: &mut Report,
    ) -> Option<(&'a str, Span)> {
        let found = self.string(name, report);
        if found.is_none() {
            self.report_missing(name, "string", report);
        }
        found
    }

    /// Colour with finite components that are not negative, or the default.
    pub fn color(&mut self, name: &'static str, default: Rgb, report: &mut Report) -> Rgb {
        match self.find(name, COLOR) {
            Some(param) => spectrum::read(param, report).unwrap_or(default),
            None => default,
        }
    }

    /// Emitted colour, or the default. In pbrt-v4, spectra and black bodies have luminance 1.
    pub fn emission(&mut self, name: &'static str, default: Rgb, report: &mut Report) -> Rgb {
        match self.find(name, COLOR) {
            Some(param) => spectrum::read_emission(param, report).unwrap_or(default),
            None => default,
        }
    }

    /// Single finite point, or the default.
    pub fn point(&mut self, name: &'static str, default: DVec3, report: &mut Report) -> DVec3 {
        let Some(param) = self.find(name, &[ParamType::Point3]) else {
            return default;
        };
        let Values::Points(values) = &param.values else {
            return default;
        };
        one_triple(param, values, report).unwrap_or(default)
    }

    /// Single finite vector, or the default.
    pub fn vector(&mut self, name: &'static str, default: DVec3, report: &mut Report) -> DVec3 {
        let Some(param) = self.find(name, &[ParamType::Vector3]) else {
            return default;
        };
        let Values::Floats(values) = &param.values else {
            return default;
        };
        let values: Vec<f64> = values.iter().copied().map(f64::from).collect();
        one_triple(param, &values, report).unwrap_or(default)
    }

    /// Choice of one of several words. The first is the default.
    pub fn choice<T: Copy, const N: usize>(
        &mut self,
        name: &'static str,
        choices: [(&str, T); N],
        report: &mut Report,
    ) -> T {
        if let Some((word, span)) = self.string(name, report) {
            if let Some((_, choice)) = choices.iter().find(|(known, _)| *known == word) {
                return *choice;
            }
            report.error_help(
                span,
                format!("{name:?} cannot be {word:?}"),
                suggest::help(word, &choices.map(|(known, _)| known)),
            );
        }
        choices[0].1
    }

    /// Accepts a parameter that cannot change the picture, with a note.
    pub fn left_out(
        &mut self,
        name: &'static str,
        types: &'static [ParamType],
        why: &str,
        report: &mut Report,
    ) {
        if let Some(param) = self.find(name, types) {
            report.note(
                param.declaration,
                format!("{name:?} of {} is left out: {why}", self.what),
            );
        }
    }

    /// Refuses a parameter of pbrt-v3 that is not supported.
    pub fn unsupported(
        &mut self,
        name: &'static str,
        types: &'static [ParamType],
        report: &mut Report,
    ) {
        if let Some(param) = self.find(name, types) {
            report.unsupported(
                param.declaration,
                format!("parameter {name:?} of {} is", self.what),
            );
        }
    }
}

enum Single<'a> {
    Float(f32),
    Integer(i32),
    Bool(bool),
    String(&'a str),
}

/// Only value of a parameter. `None`: there are none or several, which was reported.
fn one<'a>(param: &'a Param, report: &mut Report) -> Option<Single<'a>> {
    match &param.values {
        Values::Broken => return None,
        Values::Floats(v) if v.len() == 1 => return Some(Single::Float(v[0])),
        Values::Integers(v) if v.len() == 1 => return Some(Single::Integer(v[0])),
        Values::Bools(v) if v.len() == 1 => return Some(Single::Bool(v[0])),
        Values::Strings(v) if v.len() == 1 => return Some(Single::String(&v[0])),
        _ => {}
    }
    report.error(
        param.list,
        format!(
            "{:?} takes one value, found {}",
            param.name,
            param.values.len()
        ),
    );
    None
}

/// Only value of a float parameter, if it is finite.
pub(crate) fn one_float(param: &Param, report: &mut Report) -> Option<f32> {
    match one(param, report)? {
        Single::Float(value) if value.is_finite() => Some(value),
        Single::Float(value) => {
            report.error(
                param.value,
                format!("{:?} must be finite, found {value}", param.name),
            );
            None
        }
        _ => None,
    }
}

/// One finite point or vector. `None`: a mistake was reported.
fn one_triple(param: &Param, values: &[f64], report: &mut Report) -> Option<DVec3> {
    let name = &param.name;
    match *values {
        [x, y, z] if DVec3::new(x, y, z).is_finite() => Some(DVec3::new(x, y, z)),
        [_, _, _] => {
            report.error(param.list, format!("{name:?} must be finite"));
            None
        }
        _ => {
            let what = param.param_type.name();
            let found = values.len() / 3;
            report.error(param.list, format!("{name:?} is one {what}, found {found}"));
            None
        }
    }
}

/// Only value of a string or texture parameter.
pub(crate) fn one_string<'a>(param: &'a Param, report: &mut Report) -> Option<&'a str> {
    match one(param, report)? {
        Single::String(text) => Some(text),
        _ => None,
    }
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
