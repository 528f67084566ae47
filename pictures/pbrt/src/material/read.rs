//! Parameters of materials by the list of their fields.

use std::sync::LazyLock;

use antumbra_scene::material::{Limit, Reader, Source};
use antumbra_scene::{Material, Param, Rgb};

use crate::texture::Textured;

impl Textured<'_> {
    /// Number in a range. `None`: it is not given, or a mistake was reported.
    pub fn limited(&mut self, name: &'static str, limit: Limit) -> Option<Param<f32>> {
        let (found, span) = self.textured(name)?;
        let Param::Constant(value) = found else {
            return Some(found);
        };
        let report = &mut *self.report;
        match limit {
            Limit::Rough if value < 0.0 => report.fail(
                span,
                format!("{name:?} must not be negative, found {value}"),
            ),
            Limit::Index if !(value > 0.0) => {
                let message = format!("the index of refraction must be positive, found {value}");
                report.fail(span, message)
            }
            Limit::Angle if !(0.0..=90.0).contains(&value) => {
                let clamped = value.clamp(0.0, 90.0);
                let message = format!("{name} {value} is taken as {clamped}, as pbrt does");
                report.note(span, message);
                Some(clamped.into())
            }
            Limit::UpTo(most) if !(0.0..=most).contains(&value) => {
                let nearest = value.clamp(0.0, most);
                let message = format!("{name:?} is taken as {nearest}, found {value}");
                report.note(span, message);
                Some(nearest.into())
            }
            _ => Some(found),
        }
    }
}

impl Reader for Textured<'_> {
    fn color(&mut self, source: &Source<Rgb>) -> Param<Rgb> {
        let found = source.names.iter().find_map(|name| self.textured(name));
        found.map_or(source.default.into(), |(value, _)| value)
    }

    fn number(&mut self, source: &Source<f32>) -> Param<f32> {
        let mut found = None;
        for name in source.names {
            // What comes after the first is known, but has no effect.
            match found {
                None => found = self.limited(name, source.limit),
                Some(_) => drop(self.textured::<f32>(name)),
            }
        }
        found.unwrap_or(source.default.into())
    }

    fn switch(&mut self, (name, default): (&'static str, bool)) -> bool {
        self.bool(name, default)
    }
}

/// Names of all parameters of the materials in [`Material::READ`], which a shape may override. Not "alpha", which masks shapes.
pub(super) static NAMES: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let mut names = Names(Vec::new());
    for kind in Material::READ {
        let _ = Material::read(kind, &mut names);
    }
    names.0.retain(|name| *name != "alpha");
    names.0.sort_unstable();
    names.0.dedup();
    names.0
});

struct Names(Vec<&'static str>);

impl Reader for Names {
    fn color(&mut self, source: &Source<Rgb>) -> Param<Rgb> {
        self.0.extend(source.names);
        source.default.into()
    }

    fn number(&mut self, source: &Source<f32>) -> Param<f32> {
        self.0.extend(source.names);
        source.default.into()
    }

    fn switch(&mut self, (name, default): (&'static str, bool)) -> bool {
        self.0.push(name);
        default
    }
}
