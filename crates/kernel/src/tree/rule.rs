//! How the occlusion queries of a tree pick the next child.

use alloc::format;

use super::words::{Sink, Words};
use crate::error::Error;

/// How the occlusion queries of a tree pick. Trees are given a rule together with the places of their slots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Rule {
    /// In the order of slots.
    #[default]
    Slots,
    /// By the distance at which the ray enters boxes, nearest first.
    #[cfg(feature = "lab")]
    Distance,
}

impl Rule {
    /// Writes the number of the rule.
    pub fn write(self, sink: &mut Sink<'_>) {
        sink.word(self as u32);
    }

    /// A rule as [`Rule::write`] wrote it.
    pub fn read(words: &mut Words<'_>) -> Result<Self, Error> {
        match words.word()? {
            0 => Ok(Self::Slots),
            #[cfg(feature = "lab")]
            1 => Ok(Self::Distance),
            #[cfg(not(feature = "lab"))]
            1 => Err(words.error("its order looks at the ray, which needs the feature `lab`")),
            other => Err(words.error(format!("no rule has number {other}"))),
        }
    }
}
