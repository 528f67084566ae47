//! How the occlusion queries of a tree pick the next child.

use alloc::format;

use super::words::{Sink, Words};
use crate::error::Error;
#[cfg(feature = "lab")]
use crate::lab::by_ray::ByRay;

/// How the occlusion queries of a tree pick. Trees are given a rule together with the places of their slots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum Rule {
    /// In the order of slots.
    #[default]
    Slots,
    /// By a look at the ray.
    #[cfg(feature = "lab")]
    ByRay(ByRay),
}

impl Rule {
    /// Bytes of the rule beside the tree.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Slots => 0,
            #[cfg(feature = "lab")]
            Self::ByRay(_) => 0,
        }
    }

    /// Writes the rule and its tables.
    pub fn write(&self, sink: &mut Sink<'_>) {
        match self {
            Self::Slots => sink.word(0),
            #[cfg(feature = "lab")]
            Self::ByRay(rule) => rule.write(sink),
        }
    }

    /// A rule as [`Rule::write`] wrote it.
    pub fn read(words: &mut Words<'_>) -> Result<Self, Error> {
        match words.word()? {
            0 => Ok(Self::Slots),
            #[cfg(feature = "lab")]
            1 => Ok(Self::ByRay(ByRay::Distance)),
            #[cfg(not(feature = "lab"))]
            1 => Err(words.error("its order looks at the ray, which needs the feature `lab`")),
            other => Err(words.error(format!("no rule has number {other}"))),
        }
    }
}
