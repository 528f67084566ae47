//! What the leaf blocks of all kinds have in common: everything that trees and traversals need of them.
//!
//! Traversals know no kinds: a leaf is a block, and the block knows its primitives. (Loops that are worth hundreds of
//! instructions per ray have a faster path for triangles beside the general one.)

use antumbra_simd::Simd;

use crate::aabb::Aabb;
use crate::geometry::best::{Best, TreeHit};
use crate::geometry::cutout::Filters;
use crate::geometry::cutout::join::Joined;
use crate::geometry::moved::Moved;
use crate::geometry::nearest::{Near, Place};
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::LanesOf;
use crate::geometry::{BLOCK, PrimRef, QueryKind};
use crate::ray::{Hit, Ray};

/// A geometric normal, of any length.
pub(crate) struct Normal {
    pub direction: [f64; 3],
    /// Whether a mirror turns the normal around, as it does the corners of a triangle.
    pub mirrors_turn: bool,
}

/// Smallest and largest coordinates of boxes, `[axis][side][lane]`.
pub(crate) type LanePlanes = [[[f32; BLOCK]; 2]; 3];

/// A type of primitives, or a block itself, with the leaf block that it has.
pub(crate) trait InBlock {
    type Block: LeafBlock;
}

/// Up to [`BLOCK`] primitives of one kind, laid out for their test. Occupied lanes come first.
pub(crate) trait LeafBlock: Clone + Send + Sync {
    /// Kind of the primitives.
    const KIND: PrimKind;
    /// A block without primitives.
    const EMPTY: Self;
    /// Whether all [`LeafBlock::occluders`] surely occlude the ray.
    const OCCLUDERS_ARE_SURE: bool = false;

    /// Number of occupied lanes.
    fn count(&self) -> usize;

    /// Name of the primitive in an occupied lane.
    fn id(&self, lane: usize) -> PrimRef;

    /// Bounds of the primitive in an occupied lane.
    fn bounds(&self, lane: usize) -> Aabb;

    /// Writes primitives of this kind, by their numbers, into the first lanes of an empty block.
    fn fill(&mut self, primitives: &Primitives, prims: &[u32]);

    /// Puts the primitive of lane `lanes[i]` into lane `i`.
    fn permute(&mut self, lanes: &[u8; BLOCK]);

    /// Prefetches what [`LeafBlock::fill`] reads of a primitive.
    fn prefetch(_primitives: &Primitives, _prim: u32) {}

    /// The lanes that may be hit no farther than `limit`, which is at most the end of the ray. In a ray stream (`STREAM`)
    /// all lanes go the whole way: leaving early saves less than a wrong guess costs.
    fn candidates<S: Simd, const STREAM: bool>(
        &self,
        simd: S,
        ray: &RaySetup,
        limit: f32,
    ) -> LanesOf;

    /// The hit in a lane, if it counts.
    fn hit(
        &self,
        lane: usize,
        ray: &RaySetup,
        filters: &Filters,
        query: QueryKind,
    ) -> Option<TreeHit>;

    /// Whether there is such a hit for an occlusion query.
    #[inline(always)]
    fn occludes(&self, lane: usize, ray: &RaySetup, filters: &Filters) -> bool {
        self.hit(lane, ray, filters, QueryKind::Occluded).is_some()
    }

    /// The lanes that may occlude the ray, as bits.
    #[inline(always)]
    fn occluders<S: Simd, const STREAM: bool>(&self, simd: S, ray: &RaySetup) -> u32 {
        self.candidates::<S, STREAM>(simd, ray, ray.tfar).0
    }

    /// The first lane found that occludes the ray.
    #[inline(always)]
    fn occluded<S: Simd>(&self, simd: S, ray: &RaySetup, filters: &Filters) -> Option<usize> {
        let found = self.occluders::<S, false>(simd, ray);
        if Self::OCCLUDERS_ARE_SURE {
            (found != 0).then_some(found.trailing_zeros() as usize)
        } else {
            self.first_occluder(LanesOf(found), ray, filters)
        }
    }

    /// The first of these lanes that occludes the ray.
    #[inline(never)]
    fn first_occluder(
        &self,
        mut lanes: LanesOf,
        ray: &RaySetup,
        filters: &Filters,
    ) -> Option<usize> {
        lanes.find(|&lane| self.occludes(lane, ray, filters))
    }

    /// Replaces `best` by the closest hit in these lanes where that precedes it, and returns whether it did.
    fn improve(&self, lanes: LanesOf, ray: &RaySetup, filters: &Filters, best: &mut Best) -> bool;

    /// The corners of the triangle in a lane, if it is one.
    fn corners(&self, _lane: usize) -> Option<[[f32; 3]; 3]> {
        None
    }

    /// Normal at a hit in a lane.
    fn normal(&self, lane: usize, ray: &Ray, hit: &Hit) -> Option<Normal>;

    /// Boxes of all lanes as planes, `[axis][side][lane]`. Empty lanes are NaN.
    #[inline(always)]
    fn planes(&self) -> LanePlanes {
        let mut planes = [[[f32::NAN; BLOCK]; 2]; 3];
        for lane in 0..self.count() {
            let Aabb { min, max } = self.bounds(lane);
            for axis in 0..3 {
                planes[axis][0][lane] = min[axis];
                planes[axis][1][lane] = max[axis];
            }
        }
        planes
    }

    /// The nearest point of the primitive in a lane, if it has one.
    fn near(&self, lane: usize, place: &Place<'_>) -> Option<Near>;

    /// Signed crossing of the primitive in a lane, see [`crate::geometry::winding`].
    fn crossing(&self, lane: usize, point: [f64; 3]) -> i32;

    /// Whether the geometry that moved has such a primitive, and it is sound.
    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool;

    /// Writes all primitives again, where they moved to, in the same lanes. Returns the box around them. They are there.
    fn refill(&mut self, moved: &Moved<'_>) -> Aabb;

    /// A copy of the block for filters that joined others.
    fn joined(&self, _how: Joined) -> Self {
        self.clone()
    }
}
