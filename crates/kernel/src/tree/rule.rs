//! How the occlusion queries of a tree pick the next child.

use alloc::format;

use super::words::{Sink, Words};
use crate::error::Error;
#[cfg(feature = "lab")]
use crate::lab::by_ray::ByRay;

/// How the occlusion queries of a tree pick. Trees are given a rule together with the places of their slots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Rule {
    /// In the order of slots.
    #[default]
    Slots,
    /// By a look at the ray.
    #[cfg(feature = "lab")]
    ByRay(ByRay),
}

impl Rule {
    /// Writes the number of the rule.
    pub fn write(self, sink: &mut Sink<'_>) {
        match self {
            Self::Slots => sink.word(0),
            #[cfg(feature = "lab")]
            Self::ByRay(rule) => rule.write(sink),
        }
    }

    /// A rule as [`Rule::write`] wrote it.
    pub fn read(words: &mut Words<'_>) -> Result<Self, Error> {
        let number = words.word()?;
        if number == 0 {
            return Ok(Self::Slots);
        }
        #[cfg(feature = "lab")]
        if let Some(rule) = ByRay::read(number) {
            return Ok(Self::ByRay(rule));
        }
        Err(words.error(format!("no rule has number {number}")))
    }
}
