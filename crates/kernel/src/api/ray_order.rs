//! The order in which a batch is traced.

use super::bvh::Bvh;
use super::columns::Rays;
use crate::trace::ray_sort::Grid;

/// Order in which the rays of a batch are traced. Answers, and their places, are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum RayOrder {
    /// As they are given. Best if neighbouring rays begin near each other, as those of a picture or of a surface do.
    #[default]
    AsGiven,
    /// Sorted by direction and origin, up to a million rays at a time.
    Sorted,
    /// Sorted if a look at some rays tells that it pays.
    ByRule,
}

/// Rays that are sorted together at most.
const MOST: usize = 1 << 20;

/// Fewer rays are not worth sorting apart.
const LEAST: usize = 1 << 14;

/// How many rays of a batch are sorted together, so that every thread has some.
pub(super) fn piece_len(rays: usize, threads: usize) -> usize {
    rays.div_ceil(4 * threads).clamp(LEAST, MOST)
}

impl RayOrder {
    /// Grid to sort these rays by; `None` if they are to be traced as given.
    pub(super) fn grid(self, rays: &Rays<'_>, bvh: &Bvh) -> Option<Grid> {
        let sorts = match self {
            Self::AsGiven => false,
            Self::Sorted => true,
            Self::ByRule => pays(rays, bvh),
        };
        sorts.then(|| Grid::new(&bvh.bounds()))
    }
}

/// Whether sorting pays.
fn pays(rays: &Rays<'_>, _bvh: &Bvh) -> bool {
    rays.len() >= LEAST
}
