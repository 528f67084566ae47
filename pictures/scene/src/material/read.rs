//! Where the fields of materials come from in files of pbrt-v3.

use crate::{Param, Rgb};

/// Parameter of a file that gives a field.
#[derive(Clone, Copy, Debug)]
pub struct Source<T> {
    /// Names of the parameter. The first that a file gives counts.
    pub names: &'static [&'static str],
    /// Value where none is given.
    pub default: T,
    /// Range of constants.
    pub limit: Limit,
}

/// Range of a constant, and what a constant outside of it becomes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// Any number.
    None,
    /// Not negative. Others are mistakes.
    Rough,
    /// Positive. Others are mistakes.
    Index,
    /// 0 to 90 degrees, or the nearest of these.
    Angle,
    /// 0 to this number, or the nearest of these.
    UpTo(f32),
}

impl Limit {
    /// 0 to 1, or the nearest of these.
    pub const SHARE: Self = Self::UpTo(1.0);
}

/// Reads parameters of a material. Mistakes are reported elsewhere, and replaced by defaults.
pub trait Reader {
    /// Reads a parameter with colours.
    fn color(&mut self, source: &Source<Rgb>) -> Param<Rgb>;
    /// Reads a parameter with numbers.
    fn number(&mut self, source: &Source<f32>) -> Param<f32>;
    /// Reads a switch of this name, with its default.
    fn switch(&mut self, source: (&'static str, bool)) -> bool;
}

/// Switch of all materials whose roughness may be mapped.
pub(super) const REMAP: (&str, bool) = ("remaproughness", true);

/// Index of refraction inside over outside.
pub(super) const INDEX: Source<f32> = number(&["eta", "index"], 1.5, Limit::Index);

pub(super) const fn number(
    names: &'static [&'static str],
    default: f32,
    limit: Limit,
) -> Source<f32> {
    Source {
        names,
        default,
        limit,
    }
}

pub(super) const fn spectrum(name: &'static [&'static str; 1], default: [f32; 3]) -> Source<Rgb> {
    Source {
        names: name,
        default: Rgb::from_array(default),
        limit: Limit::None,
    }
}

pub(super) const fn color(name: &'static [&'static str; 1], grey: f32) -> Source<Rgb> {
    spectrum(name, [grey; 3])
}

/// Roughness along u and v.
pub(super) const fn rough(
    u: &'static [&'static str],
    v: &'static [&'static str],
    default: f32,
) -> [Source<f32>; 2] {
    [
        number(u, default, Limit::Rough),
        number(v, default, Limit::Rough),
    ]
}
