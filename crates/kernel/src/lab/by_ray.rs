//! The order that depends on the ray: by the distance of boxes.

use antumbra_simd::Lanes;

use crate::tree::words::Sink;

/// How an occlusion query picks the next child by the ray.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ByRay {
    /// By the distance at which boxes are entered, nearest first.
    Distance,
}

impl ByRay {
    /// The lanes of a node that are hit, the one to be visited first at the end, and how many they are. `mask`
    /// are these lanes, `entry` the distances at which their boxes are entered.
    #[inline(always)]
    pub fn lanes<const N: usize, L: Lanes<N>>(&self, mask: L::Mask, entry: L) -> ([u32; N], usize) {
        let all: [u32; N] = core::array::from_fn(|lane| lane as u32);
        let mut pairs = [0; N];
        let count = entry.compress_sorted(mask, &all, &mut pairs);
        (pairs.map(|pair| pair as u32), count)
    }

    /// Writes the number of the rule.
    pub fn write(&self, sink: &mut Sink<'_>) {
        match self {
            Self::Distance => sink.word(1),
        }
    }
}
