//! The nearest hits of a ray, several at a time: how batches visit the hits of rays that have many.

use antumbra_simd::Simd;

use crate::geometry::best::{Best, TreeHit};
use crate::geometry::cutout::Filters;
use crate::geometry::cutout::opacity::QueryKind;
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::LanesOf;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::judge::{self, Takes};
use crate::trace::query::{Closest, Query};
use crate::trace::stack::Stack;
use crate::tree::node::Child;

/// Hits that are found at a time. A ray through foliage seldom has more, and 64 lists fill a quarter of the first cache.
pub(crate) const MOST: usize = 8;

/// Hits of a ray, front to back, with ids as in the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearestHits {
    hits: [TreeHit; MOST],
    len: usize,
}

impl NearestHits {
    const EMPTY: Self = Self {
        hits: [TreeHit {
            hit: Hit::none(0.0),
            t: 0.0,
        }; MOST],
        len: 0,
    };

    pub fn hits(&self) -> &[TreeHit] {
        &self.hits[..self.len]
    }

    /// The last hit of a full list: the ray may have more behind it.
    pub fn last(&self) -> Option<TreeHit> {
        self.hits().get(MOST - 1).copied()
    }

    /// Puts a hit in its place. The last hit of a full list leaves it. Hits that are in the list are not taken again: a
    /// triangle may be in several leaves.
    fn insert(&mut self, found: TreeHit) {
        let hit = found.hit;
        let before = (self.hits()).partition_point(|other| other.hit.precedes(&hit));
        let is_there = (self.hits().get(before)).is_some_and(|other| !hit.precedes(&other.hit));
        if before == MOST || is_there {
            return;
        }
        self.len = MOST.min(self.len + 1);
        self.hits[before..self.len].rotate_right(1);
        self.hits[before] = found;
    }
}

impl Default for NearestHits {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// Query for the nearest hits: [`Closest`] under a condition, where the last hit of a full list is the one to precede. Visits
/// children in the order of occlusion, as few lists get full and nothing behind a hit can be left out before.
pub(crate) struct Nearest;

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
pub(crate) struct Listed {
    nearest: NearestHits,
    /// The last hit of a full list.
    last: Best,
}

impl Takes for Listed {
    fn offer_if(&mut self, found: TreeHit, counts: impl FnOnce(&TreeHit) -> bool) -> bool {
        let Some(found) = self.last.preceded_by(found).filter(counts) else {
            return false;
        };
        self.nearest.insert(found);
        if let Some(last) = self.nearest.last() {
            self.last.take(last);
        }
        true
    }
}

impl Query for Nearest {
    type Item = u32;
    type State = Listed;
    type Answer = NearestHits;

    const IDLE: Listed = Listed {
        nearest: NearestHits::EMPTY,
        last: Closest::IDLE,
    };
    const KIND: QueryKind = QueryKind::Intersect;
    const CONDITIONAL: bool = true;

    #[inline(always)]
    fn begin(ray: &Ray) -> Listed {
        Listed {
            nearest: NearestHits::EMPTY,
            last: Closest::begin(ray),
        }
    }

    #[inline(always)]
    fn finish(listed: &Listed) -> NearestHits {
        listed.nearest
    }

    #[inline(always)]
    fn limit(listed: &Listed, ray: &RaySetup) -> f32 {
        Closest::limit(&listed.last, ray)
    }

    #[inline(always)]
    fn judge<B: LeafBlock>(
        listed: &mut Listed,
        block: &B,
        lanes: LanesOf,
        ray: &RaySetup,
        filters: &Filters,
        condition: &Condition<'_>,
    ) -> bool {
        judge::offer(block, lanes, ray, filters, condition, listed)
    }

    #[inline(always)]
    fn prune<S: Simd>(_: &mut Listed, _: &mut Stack<'_, u32>, _: S, _: Child, _: bool) {}

    #[inline(always)]
    fn enter(listed: &mut Listed, inst_id: u32, _: usize, interval: Interval) {
        listed.last.enter(interval, inst_id);
    }

    #[inline(always)]
    fn exit(listed: &mut Listed) {
        listed.last.exit();
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
            list.insert(hit.into());
            list.insert(hit.into());
            all.push((step * 7 % 11, step % 2));
            all.sort_unstable();
            all.dedup();
            let found = list.hits().iter().map(|found| found.hit);
            let found = found.map(|hit| (hit.t as u32, hit.prim_id));
            assert!(found.eq(all.iter().copied().take(MOST)));
            assert_eq!(list.last().is_some(), all.len() >= MOST);
        }
    }
}
