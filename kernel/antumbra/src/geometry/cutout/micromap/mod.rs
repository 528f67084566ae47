//! Opacity micromaps: which parts of a triangle are opaque, clear or unknown. Micromaps are computed once, so that the
//! filter need not be called where the answer is known.
//!
//! Source: Gruen, Benthin and Woop (2020), "Sub-triangle opacity masks for faster ray tracing of transparent objects".
//! The leaf of a plant, for example, is two triangles around a picture of it. Half of them is clear, and only along the
//! outline does one need to look at the picture.
//!
//! Many triangles show the same part of the same picture. Triangles of one
//! [`Pattern`](crate::geometry::cutout::opacity::Pattern) share a micromap, and the more of them there are, the finer it
//! is. One of 64 parts takes 16 bytes. One that four times as many triangles share has four times as many parts, so that
//! finer micromaps never cost more than one of 64 parts for every triangle would.
//!
//! - here: micromaps as queries look them up;  `join`: micromaps of several objects;  `make`: micromaps being made;
//!   `parts`: how a triangle is divided

use alloc::vec::Vec;

mod join;
mod make;
mod parts;
#[cfg(test)]
mod tests;

use antumbra_simd::Simd;

pub(crate) use join::Moved;
use parts::{MIN_LEVELS, part_at, words};

/// Knowledge of 64 parts, a bit for each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Parts {
    /// Parts of opacity 1.
    opaque: u64,
    /// Parts of opacity 0.
    clear: u64,
}

/// The opacity micromaps of all partly transparent triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct MicroMaps {
    /// Micromap after micromap; the first is [`MapRef::UNKNOWN`].
    parts: Vec<Parts>,
}

/// One of the opacity micromaps.
///
/// Bits 31 and 30 are its levels, less the fewest; the others are where it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MapRef(u32);

impl MapRef {
    const PLACE_BITS: u32 = 30;

    /// Micromap of unknown parts only.
    pub const UNKNOWN: Self = Self(0);

    /// The micromap that begins at this place; `None` if there are too many before it.
    fn new(place: usize, levels: u32) -> Option<Self> {
        let place = u32::try_from(place).ok()?;
        let fits = place < 1 << Self::PLACE_BITS;
        fits.then_some(Self((levels - MIN_LEVELS) << Self::PLACE_BITS | place))
    }

    /// The number of the reference in files.
    pub fn number(self) -> u32 {
        self.0
    }

    /// A reference by its number, to whatever micromap.
    pub fn of_number(number: u32) -> Self {
        Self(number)
    }

    #[inline(always)]
    fn levels(self) -> u32 {
        MIN_LEVELS + (self.0 >> Self::PLACE_BITS)
    }

    #[inline(always)]
    fn place(self) -> usize {
        (self.0 & ((1 << Self::PLACE_BITS) - 1)) as usize
    }
}

/// Knowledge of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Known {
    /// Opaque everywhere.
    Opaque,
    /// Clear everywhere.
    Clear,
    /// Some of it is opaque or clear, or nobody knows.
    Mixed(Cutout),
}

/// Knowledge of a partly transparent triangle, kept for queries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cutout {
    pub map: MapRef,
    /// Number of what the triangle shows: triangles of one [`Pattern`](crate::geometry::cutout::opacity::Pattern) have one
    /// number.
    pub pattern: u32,
}

impl MicroMaps {
    /// The part in which a point of a triangle with this map lies, counted from the first part of the first map.
    #[inline(always)]
    pub fn part(&self, map: MapRef, u: f32, v: f32) -> usize {
        64 * map.place() + part_at(map.levels(), u, v)
    }

    /// Prefetches the bits of a part.
    #[inline(always)]
    pub fn prefetch<S: Simd>(&self, simd: S, part: usize) {
        simd.prefetch(&self.parts[part / 64]);
    }

    /// Whether a hit counts in a part, if that is known.
    #[inline(always)]
    pub fn accepts(&self, part: usize) -> Option<bool> {
        let Parts { opaque, clear } = self.parts[part / 64];
        let bit = 1 << (part % 64);
        if clear & bit != 0 {
            Some(false)
        } else if opaque & bit != 0 {
            Some(true)
        } else {
            None
        }
    }

    /// All parts as words, opaque and clear ones.
    pub fn words(&self) -> impl ExactSizeIterator<Item = [u64; 2]> {
        self.parts.iter().map(|parts| [parts.opaque, parts.clear])
    }

    /// Micromaps of such words.
    pub fn of_words(words: Vec<[u64; 2]>) -> Self {
        let parts = words.into_iter();
        let parts = parts.map(|[opaque, clear]| Parts { opaque, clear });
        Self {
            parts: parts.collect(),
        }
    }

    /// Whether there is such a micromap.
    pub fn contains(&self, map: MapRef) -> bool {
        map.place() + words(map.levels()) <= self.parts.len()
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.parts[..])
    }
}
