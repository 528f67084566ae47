//! Quads: pairs of triangles with the number of the quad.
//!
//! A quad with corners 0, 1, 2, 3 is the triangles (0, 1, 3) and (2, 3, 1), as in Embree. Everything from the copy of a
//! geometry to the test of a leaf knows only triangles. The number of a half distinguishes it from other triangles: the
//! upper bit is set, the lowest one says which half it is, and the bits between are the number of the quad. No other
//! primitive has a number that large, and numbers of quads compare like quads. Where a hit leaves the kernel, it becomes
//! one on the quad.

use crate::geometry::PrimRef;
use crate::geometry::best::TreeHit;
use crate::geometry::primitives::dropped::DropReason;
use crate::geometry::sound::{is_finite, is_sound};
use crate::ray::{Hit, INVALID_ID};

/// Smallest number of a half.
pub(crate) const FIRST_HALF: u32 = 1 << 31;

/// Number of a half of a quad.
pub(crate) const fn half_id(quad: u32, half: usize) -> u32 {
    FIRST_HALF | quad << 1 | half as u32
}

/// The quad of this number, and which half it is, unless it is the number of another primitive.
#[inline(always)]
pub(crate) const fn quad_of(prim_id: u32) -> Option<(u32, usize)> {
    if prim_id < FIRST_HALF || prim_id == INVALID_ID {
        None
    } else {
        Some(((prim_id ^ FIRST_HALF) >> 1, (prim_id & 1) as usize))
    }
}

/// Number of a primitive as the user knows it.
#[inline(always)]
pub(crate) const fn told_id(prim_id: u32) -> u32 {
    match quad_of(prim_id) {
        Some((quad, _)) => quad,
        None => prim_id,
    }
}

/// Barycentrics of a hit on a primitive of this number as the user knows them.
#[inline(always)]
pub(crate) fn told_uv(prim_id: u32, [u, v]: [f32; 2]) -> [f32; 2] {
    match quad_of(prim_id) {
        Some((_, 1)) => [1.0 - u, 1.0 - v],
        _ => [u, v],
    }
}

/// Half of a quad, 0 or 1, in which a hit with these barycentrics lies. On the diagonal, the first one.
pub(crate) fn half_at([u, v]: [f32; 2]) -> usize {
    usize::from(u + v > 1.0)
}

/// Corners of a half.
#[inline(always)]
pub(crate) fn half<T>([a, b, c, d]: [T; 4], half: usize) -> [T; 3] {
    if half == 0 { [a, b, d] } else { [c, d, b] }
}

/// Whether each half of a quad can be kept. Some writers of files make a triangle of a quad by giving a corner twice:
/// then one half is left, or two.
///
/// # Errors
/// Why neither can.
pub(crate) fn kept_halves(corners: &[[f32; 3]; 4]) -> Result<[bool; 2], DropReason> {
    if !corners.iter().all(is_finite) {
        return Err(DropReason::NotFinite);
    }
    let kept = [0, 1].map(|which| is_sound(&half(*corners, which)));
    if kept == [false; 2] {
        return Err(DropReason::CornersCoincide);
    }
    Ok(kept)
}

impl PrimRef {
    /// The name as the user knows it.
    pub fn told(self) -> Self {
        Self {
            prim_id: told_id(self.prim_id),
            ..self
        }
    }
}

impl TreeHit {
    /// The hit as the user knows it, unless it is still [`Hit::none`].
    pub fn reported(&self) -> Option<Hit> {
        (self.hit.prim_id != INVALID_ID).then(|| self.told())
    }

    /// The hit as the user knows it.
    #[inline(always)]
    pub fn told(self) -> Hit {
        let hit = Hit {
            t: self.t,
            ..self.hit
        };
        if hit.prim_id < FIRST_HALF {
            hit
        } else {
            on_quad(hit)
        }
    }
}

/// A hit on a half as one on its quad.
#[inline(never)]
fn on_quad(hit: Hit) -> Hit {
    let [u, v] = told_uv(hit.prim_id, [hit.u, hit.v]);
    Hit {
        u,
        v,
        prim_id: told_id(hit.prim_id),
        ..hit
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    #[test]
    fn numbers_come_back_and_keep_their_order() {
        // Two of 2²⁹ primitives each.
        let last = (1 << 28) - 1;
        let ids: Vec<_> = [0, 1, 77, last]
            .into_iter()
            .flat_map(|quad| [0, 1].map(|half| (quad, half)))
            .collect();
        for &(quad, half) in &ids {
            let id = half_id(quad, half);
            assert_eq!(quad_of(id), Some((quad, half)));
            assert_eq!(told_id(id), quad);
            assert!(id < INVALID_ID);
        }
        assert!(ids.is_sorted_by_key(|&(quad, half)| half_id(quad, half)));
        for id in [0, 5, (1 << 29) - 1, INVALID_ID] {
            assert_eq!((quad_of(id), told_id(id)), (None, id));
        }
    }
}
