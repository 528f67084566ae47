//! The one place that says whether the lanes of a leaf count for a ray.
//!
//! A block finds the lanes that may be hit. Queries without a condition take them as the block does. All others come here,
//! where a hit counts by the [`Condition`] of its ray: first by the name of the primitive, which costs next to nothing, then
//! by the hit, and last by the function of the user.
//!
//! Which it is, is a type, [`Query::CONDITIONAL`](crate::trace::query::Query::CONDITIONAL): a flag that streams look at costs
//! those that have no condition 13 %. What is here is compiled once for all levels and widths, away from the loops.

use crate::geometry::best::{Best, TreeHit};
use crate::geometry::cutout::Filters;
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::LanesOf;
use crate::geometry::{PrimRef, QueryKind};
use crate::prim_id::PrimId;
use crate::ray::Hit;
use crate::trace::condition::Condition;
use crate::trace::ray_batch::RayBatch;

/// The ray whose condition counts, in its batch. Without a batch there is no condition.
#[derive(Clone, Copy)]
pub(crate) struct Owner<'a> {
    /// The batch, which gets reports as well.
    pub batch: Option<&'a RayBatch<'a>>,
    pub index: usize,
}

impl Owner<'_> {
    /// Runs `work` with the condition.
    pub fn with<R>(self, work: impl FnOnce(&Condition<'_>) -> R) -> R {
        match self.batch {
            None => work(&Condition::NONE),
            Some(batch) => batch.with_condition(self.index, work),
        }
    }

    /// Whether anything in an instance can count.
    #[inline(never)]
    pub fn enters(self, inst_id: u32) -> bool {
        self.with(|condition| condition.enters(inst_id))
    }
}

/// The best hits of a ray so far.
pub(crate) trait Takes {
    /// Takes a hit, where the ray is now, if it is among the best and counts, which is owner last. Whether it did.
    fn offer_if(&mut self, found: TreeHit, counts: impl FnOnce(&TreeHit) -> bool) -> bool;
}

impl Takes for Best {
    #[inline(always)]
    fn offer_if(&mut self, found: TreeHit, counts: impl FnOnce(&TreeHit) -> bool) -> bool {
        Self::offer_if(self, found, counts)
    }
}

/// Offers the hits in these lanes of a block to the best so far. Whether one was taken.
#[inline(never)]
pub(crate) fn offer<B: LeafBlock>(
    block: &B,
    lanes: LanesOf,
    ray: &RaySetup,
    filters: &Filters,
    condition: &Condition<'_>,
    best: &mut impl Takes,
) -> bool {
    let mut taken = false;
    for lane in lanes {
        if condition.may_count(named(block.id(lane), ray))
            && let Some(hit) = block.hit(lane, ray, filters, QueryKind::Intersect)
        {
            taken |= best.offer_if(hit, |hit| counts(hit, condition));
        }
    }
    taken
}

/// Whether a hit on a primitive that may count, with ids as in the tree and as it is reported, counts.
pub(crate) fn counts(found: &TreeHit, condition: &Condition<'_>) -> bool {
    condition.is_behind(&found.hit) && condition.accept.is_none_or(|accept| accept(&found.told()))
}

/// The first of these lanes of a block that occludes a ray, where it is: in the instance of this interval, or in the world.
#[inline(never)]
pub(crate) fn occluder<B: LeafBlock>(
    block: &B,
    mut lanes: LanesOf,
    (ray, interval): (&RaySetup, Interval),
    filters: &Filters,
    condition: &Condition<'_>,
) -> Option<PrimId> {
    lanes.find_map(|lane| {
        let id = named(block.id(lane), ray);
        let is_there = || B::OCCLUDERS_ARE_SURE || block.occludes(lane, ray, filters);
        let hit = || {
            let found = block.hit(lane, ray, filters, QueryKind::Occluded)?;
            Some(found.placed(interval, ray.inst_id).told())
        };
        occludes(id, condition, is_there, hit).then_some(id)
    })
}

/// Whether a primitive occludes a ray. `hit` is only called where the hit matters, and `is_there` where it does not.
#[inline(always)]
pub(crate) fn occludes(
    id: PrimId,
    condition: &Condition<'_>,
    is_there: impl FnOnce() -> bool,
    hit: impl FnOnce() -> Option<Hit>,
) -> bool {
    condition.may_count(id)
        && match condition.accept {
            None => is_there(),
            Some(accept) => hit().is_some_and(|hit| accept(&hit)),
        }
}

/// A primitive as users know it, where the ray is.
#[inline(always)]
pub(crate) fn named(id: PrimRef, ray: &RaySetup) -> PrimId {
    let PrimRef { geom_id, prim_id } = id.told();
    PrimId {
        inst_id: ray.inst_id,
        geom_id,
        prim_id,
    }
}
