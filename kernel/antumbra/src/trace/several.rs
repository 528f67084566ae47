//! The nearest hits of a ray, several at a time: how batches visit the hits of rays that have many.

use antumbra_simd::{Scalar, Simd};

use crate::geometry::best::Best;
use crate::geometry::cutout::opacity::QueryKind;
use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::{LanesOf, VectorHits};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::conditional::named;
use crate::trace::query::{Closest, Query, StreamQuery, lanes_in_stream};
use crate::trace::stack::Stack;
use crate::trace::view::{View, on_seen_leaf};
use crate::tree::node::Leaf;
use crate::tree::wide::WideTree;

/// Hits that are found at a time. A ray through foliage seldom has more, and 64 lists fill a quarter of the first cache.
pub(crate) const MOST: usize = 8;

/// Hits of a ray, front to back, with ids as in the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearestHits {
    hits: [Hit; MOST],
    len: usize,
}

impl NearestHits {
    const EMPTY: Self = Self {
        hits: [Hit::none(0.0); MOST],
        len: 0,
    };

    pub fn hits(&self) -> &[Hit] {
        &self.hits[..self.len]
    }

    /// The last hit of a full list: the ray may have more behind it.
    pub fn last(&self) -> Option<Hit> {
        self.hits().get(MOST - 1).copied()
    }

    /// Puts a hit in its place. The last hit of a full list leaves it. Hits that are in the list are not taken again: a
    /// triangle may be in several leaves.
    fn insert(&mut self, hit: Hit) {
        let before = self.hits().partition_point(|other| other.precedes(&hit));
        let is_there = (self.hits().get(before)).is_some_and(|other| !hit.precedes(other));
        if before == MOST || is_there {
            return;
        }
        self.len = MOST.min(self.len + 1);
        self.hits[before..self.len].rotate_right(1);
        self.hits[before] = hit;
    }
}

impl Default for NearestHits {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// Query for the nearest hits: [`Closest`], where the last hit of a full list is the one to precede. Visits children in
/// the order of occlusion, as few lists get full and nothing behind a hit can be left out before.
pub(crate) struct Nearest;

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
pub(crate) struct Found {
    nearest: NearestHits,
    /// The last hit of a full list.
    last: Best,
}

impl Found {
    /// Takes a hit, where the ray is now, if it precedes the last one and counts.
    #[inline(always)]
    fn offer_if(&mut self, hit: Hit, counts: impl FnOnce(&Hit) -> bool) {
        if let Some(hit) = self.last.preceded_by(hit).filter(counts) {
            self.nearest.insert(hit);
            if let Some(last) = self.nearest.last() {
                self.last.take(last);
            }
        }
    }
}

impl Query for Nearest {
    type Item = u32;
    type State = Found;
    type Answer = NearestHits;

    const IDLE: Found = Found {
        nearest: NearestHits::EMPTY,
        last: Closest::IDLE,
    };

    #[inline(always)]
    fn begin(ray: &Ray) -> Found {
        Found {
            nearest: NearestHits::EMPTY,
            last: Closest::begin(ray),
        }
    }

    #[inline(always)]
    fn finish(found: &Found) -> NearestHits {
        found.nearest
    }

    #[inline(always)]
    fn limit(found: &Found, ray: &RaySetup) -> f32 {
        Closest::limit(&found.last, ray)
    }

    fn leaf<S: Simd, V: View, const N: usize>(
        found: &mut Found,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        let lanes = lanes_in_stream(simd, bvh, view, leaf, ray, found.last.limit);
        let ray = (ray, Interval::WORLD);
        Self::confirm_when(
            found,
            stack,
            (bvh, view),
            (leaf, lanes),
            ray,
            &Condition::NONE,
        );
    }

    #[inline(always)]
    fn enter<const N: usize>(
        found: &mut Found,
        bvh: &WideTree<N>,
        index: usize,
        interval: Interval,
    ) {
        Closest::enter(&mut found.last, bvh, index, interval);
    }

    #[inline(always)]
    fn exit(found: &mut Found) {
        Closest::exit(&mut found.last);
    }
}

impl StreamQuery for Nearest {
    const CONFIRMS: bool = true;

    #[inline(always)]
    fn leaf_in_stream<S: Simd, V: View, const N: usize>(
        found: &mut Found,
        _: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
        _: bool,
    ) -> u32 {
        lanes_in_stream(simd, bvh, view, leaf, ray, found.last.limit)
    }

    #[inline(always)]
    fn confirm<S: Simd, V: View, const N: usize>(
        found: &mut Found,
        stack: &mut Stack<'_, u32>,
        _: S,
        bvh: &WideTree<N>,
        view: V,
        lanes: (Leaf, u32),
        ray: &RaySetup,
    ) -> bool {
        Self::confirm_when(
            found,
            stack,
            (bvh, view),
            lanes,
            (ray, Interval::WORLD),
            &Condition::NONE,
        )
        .0
    }

    fn confirm_when<const N: usize>(
        found: &mut Found,
        _: &mut Stack<'_, u32>,
        (bvh, view): (&WideTree<N>, impl View),
        (leaf, lanes): (Leaf, u32),
        (ray, _): (&RaySetup, Interval),
        condition: &Condition<'_>,
    ) -> (bool, Option<PrimId>) {
        on_seen_leaf!(Scalar, bvh, view, leaf, block => for lane in LanesOf(lanes) {
            if condition.may_count(named(block.id(lane), ray))
                && let Some(hit) = block.hit(lane, ray, &bvh.filters, QueryKind::Intersect)
            {
                let counts = |hit: &Hit| condition.is_behind(hit) && condition.counts(&hit.told());
                found.offer_if(hit, counts);
            }
        });
        (false, None)
    }

    #[inline(always)]
    fn cutout_hits<S: Simd>(
        found: &Found,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        Closest::cutout_hits(&found.last, simd, block, ray)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        found: &mut Found,
        _: &mut Stack<'_, u32>,
        _: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) -> bool {
        let counts = |_: &Hit| hit.counts(QueryKind::Intersect, ray, filters);
        found.offer_if(hit.hit(), counts);
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_keeps_the_nearest_hits_once() {
        let hit = |t: u32, prim_id| Hit {
            prim_id,
            ..Hit::none(t as f32)
        };
        let mut list = NearestHits::EMPTY;
        let mut all = alloc::vec::Vec::new();
        for step in 0..40 {
            let hit = hit(step * 7 % 11, step % 2);
            list.insert(hit);
            list.insert(hit);
            all.push((step * 7 % 11, step % 2));
            all.sort_unstable();
            all.dedup();
            let found = list.hits().iter().map(|hit| (hit.t as u32, hit.prim_id));
            assert!(found.eq(all.iter().copied().take(MOST)));
            assert_eq!(list.last().is_some(), all.len() >= MOST);
        }
    }
}
