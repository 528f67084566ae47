//! The queries, occlusion and closest hit: the decisions in which their traversals differ.
//!
//! | query | finds | under the condition of the ray |
//! |---|---|---|
//! | [`Occlusion`] | whether anything is in the way | no |
//! | [`Occluder`] | what is in the way | yes |
//! | [`Closest`] | the closest hit | no |
//! | [`Located`] | the closest hit and its leaf | no or yes |
//! | [`Nearest`](crate::trace::several::Nearest) | the nearest hits | yes |

use antumbra_simd::Simd;

use crate::geometry::best::Best;
use crate::geometry::cutout::opacity::QueryKind;
use crate::geometry::cutout::{CutoutHit, Filters};
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::LanesOf;
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::judge;
use crate::trace::pick::Children;
use crate::trace::ray_batch::{LocatedHit, RayBatch};
use crate::trace::stack::Stack;
use crate::tree::node::Child;

/// The decisions of a traversal. Every ray has a state of its own that grows as the ray goes on.
pub(crate) trait Query {
    /// Item on the stacks: a child, with or without a distance.
    type Item: Children;
    /// The knowledge of a ray on its way.
    type State: Copy;
    /// The knowledge of a ray at its end.
    type Answer: Default;

    /// The state of a ray that no query has begun for.
    const IDLE: Self::State;
    /// Whether any hit will do, or the closest ones are sought.
    const KIND: QueryKind;
    /// Whether hits count by the condition of their ray. Otherwise all do.
    const CONDITIONAL: bool;
    /// Whether the lanes of leaves are judged; in a ray stream, when all leaves of a round are tested: many leaves hold no
    /// candidate, and no CPU can guess which; nearly all others have one that is taken. Otherwise any lane found decides.
    const JUDGES: bool = true;

    /// State with which a ray begins.
    #[inline(always)]
    fn begin(_: &Ray) -> Self::State {
        Self::IDLE
    }

    /// Answer of a ray that is at its end.
    fn finish(state: &Self::State) -> Self::Answer;

    /// The answer for a ray that can hit nothing.
    #[inline(always)]
    fn miss() -> Self::Answer {
        Self::Answer::default()
    }

    /// Boxes entered and primitives hit beyond this are of no interest.
    #[inline(always)]
    fn limit(_: &Self::State, ray: &RaySetup) -> f32 {
        ray.tfar
    }

    /// Takes what counts in these lanes of a block. Whether anything did. The condition only matters to
    /// [conditional](Query::CONDITIONAL) queries.
    #[inline(always)]
    fn judge<B: LeafBlock>(
        _: &mut Self::State,
        _: &B,
        lanes: LanesOf,
        _: &RaySetup,
        _: &Filters,
        _: &Condition<'_>,
    ) -> bool {
        lanes.0 != 0
    }

    /// [`Query::judge`] for a hit on a cut-out, which was found before.
    #[inline(always)]
    fn settle(
        state: &mut Self::State,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
        condition: &Condition<'_>,
    ) -> bool {
        let lanes = LanesOf(1 << hit.lane);
        Self::judge(state, hit.block, lanes, ray, filters, condition)
    }

    /// Notes the leaf and drops from the stack what it has made needless, if it has `changed` what the ray goes on with.
    fn prune<S: Simd>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        leaf: Child,
        changed: bool,
    );

    /// The ray goes into the instance of this number and place in the tree.
    #[inline(always)]
    fn enter(_: &mut Self::State, _inst_id: u32, _index: usize, _: Interval) {}

    /// The ray comes back into the world.
    #[inline(always)]
    fn exit(_: &mut Self::State) {}

    /// Reports what a ray of a batch has found.
    #[inline(always)]
    fn report(_: &Self::State, _: &RayBatch<'_>, _index: usize) {}
}

/// Query whether anything is in the way. Visits children by ascending slots and stops at the first occluder.
pub(crate) struct Occlusion;

impl Query for Occlusion {
    type Item = u32;
    type State = bool;
    type Answer = bool;

    const IDLE: bool = false;
    const KIND: QueryKind = QueryKind::Occluded;
    const CONDITIONAL: bool = false;
    const JUDGES: bool = false;

    #[inline(always)]
    fn finish(occluded: &bool) -> bool {
        *occluded
    }

    #[inline(always)]
    fn settle(
        occluded: &mut bool,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
        _: &Condition<'_>,
    ) -> bool {
        // Another hit in the same leaf may have decided: then the filter is not called.
        *occluded || hit.counts(QueryKind::Occluded, ray, filters)
    }

    #[inline(always)]
    fn prune<S: Simd>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        _: S,
        _: Child,
        changed: bool,
    ) {
        *occluded = changed;
        stack.clear_if(changed);
    }
}

/// [`Occlusion`] under a condition, which finds the occluder. Which one depends on the tree.
pub(crate) struct Occluder;

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
pub(crate) struct Blocked {
    occluder: Option<PrimId>,
    /// Where hits are reported: the instance interval.
    interval: Interval,
}

impl Query for Occluder {
    type Item = u32;
    type State = Blocked;
    type Answer = bool;

    const IDLE: Blocked = Blocked {
        occluder: None,
        interval: Interval::WORLD,
    };
    const KIND: QueryKind = QueryKind::Occluded;
    const CONDITIONAL: bool = true;

    #[inline(always)]
    fn finish(blocked: &Blocked) -> bool {
        blocked.occluder.is_some()
    }

    #[inline(always)]
    fn judge<B: LeafBlock>(
        blocked: &mut Blocked,
        block: &B,
        lanes: LanesOf,
        ray: &RaySetup,
        filters: &Filters,
        condition: &Condition<'_>,
    ) -> bool {
        // Another hit in the same leaf of cut-outs may have decided.
        if blocked.occluder.is_none() {
            let ray = (ray, blocked.interval);
            blocked.occluder = judge::occluder(block, lanes, ray, filters, condition);
        }
        blocked.occluder.is_some()
    }

    #[inline(always)]
    fn prune<S: Simd>(_: &mut Blocked, stack: &mut Stack<'_, u32>, _: S, _: Child, occluded: bool) {
        stack.clear_if(occluded);
    }

    #[inline(always)]
    fn enter(blocked: &mut Blocked, _: u32, _: usize, interval: Interval) {
        blocked.interval = interval;
    }

    #[inline(always)]
    fn exit(blocked: &mut Blocked) {
        blocked.interval = Interval::WORLD;
    }

    fn report(blocked: &Blocked, batch: &RayBatch<'_>, index: usize) {
        if let Some(occluder) = blocked.occluder {
            batch.report_occluder(index, occluder);
        }
    }
}

/// Query for the closest hit. Goes front to back and drops what begins behind the best hit so far: when a better one is
/// found, so that pops need no thought.
pub(crate) struct Closest;

impl Query for Closest {
    type Item = u64;
    type State = Best;
    type Answer = Option<Hit>;

    const IDLE: Best = Best::none(0.0);
    const KIND: QueryKind = QueryKind::Intersect;
    const CONDITIONAL: bool = false;

    #[inline(always)]
    fn begin(ray: &Ray) -> Best {
        Best::none(ray.tfar)
    }

    #[inline(always)]
    fn finish(best: &Best) -> Option<Hit> {
        best.found()
    }

    #[inline(always)]
    fn limit(best: &Best, _: &RaySetup) -> f32 {
        best.limit
    }

    #[inline(always)]
    fn judge<B: LeafBlock>(
        best: &mut Best,
        block: &B,
        lanes: LanesOf,
        ray: &RaySetup,
        filters: &Filters,
        _: &Condition<'_>,
    ) -> bool {
        block.improve(lanes, ray, filters, best)
    }

    #[inline(always)]
    fn settle(
        best: &mut Best,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
        _: &Condition<'_>,
    ) -> bool {
        hit.improves(best, ray, filters)
    }

    /// Children entered at the distance of the best hit are kept: they may hold an equally near primitive of
    /// a smaller id.
    #[inline(always)]
    fn prune<S: Simd>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        _: Child,
        better: bool,
    ) {
        if better {
            // What is entered behind the origin lies on the stack as entered at 0. That is also where the exit
            // from an instance lies.
            let limit = if best.limit > 0.0 { best.limit } else { 0.0 };
            stack.cull(simd, limit);
        }
    }

    #[inline(always)]
    fn enter(best: &mut Best, inst_id: u32, _: usize, interval: Interval) {
        best.enter(interval, inst_id);
    }

    #[inline(always)]
    fn exit(best: &mut Best) {
        best.exit();
    }
}

/// [`Closest`] with the leaf of the hit, under a condition if it is `CONDITIONAL`.
pub(crate) struct Located<const CONDITIONAL: bool>;

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
pub(crate) struct Found {
    best: Best,
    /// Leaf of the best hit, and index of its instance.
    leaf: Child,
    instance: u32,
    /// Index of the instance where the ray is, or [`LocatedHit::WORLD`].
    here: u32,
}

impl<const CONDITIONAL: bool> Query for Located<CONDITIONAL> {
    type Item = u64;
    type State = Found;
    type Answer = Option<Hit>;

    const IDLE: Found = Found {
        best: Closest::IDLE,
        leaf: Child::EMPTY,
        instance: LocatedHit::WORLD,
        here: LocatedHit::WORLD,
    };
    const KIND: QueryKind = QueryKind::Intersect;
    const CONDITIONAL: bool = CONDITIONAL;

    #[inline(always)]
    fn begin(ray: &Ray) -> Found {
        Found {
            best: Closest::begin(ray),
            ..Self::IDLE
        }
    }

    #[inline(always)]
    fn finish(found: &Found) -> Option<Hit> {
        Closest::finish(&found.best)
    }

    #[inline(always)]
    fn limit(found: &Found, ray: &RaySetup) -> f32 {
        Closest::limit(&found.best, ray)
    }

    #[inline(always)]
    fn judge<B: LeafBlock>(
        found: &mut Found,
        block: &B,
        lanes: LanesOf,
        ray: &RaySetup,
        filters: &Filters,
        condition: &Condition<'_>,
    ) -> bool {
        match CONDITIONAL {
            true => judge::offer(block, lanes, ray, filters, condition, &mut found.best),
            false => block.improve(lanes, ray, filters, &mut found.best),
        }
    }

    #[inline(always)]
    fn settle(
        found: &mut Found,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
        condition: &Condition<'_>,
    ) -> bool {
        let lanes = LanesOf(1 << hit.lane);
        match CONDITIONAL {
            true => Self::judge(found, hit.block, lanes, ray, filters, condition),
            false => hit.improves(&mut found.best, ray, filters),
        }
    }

    #[inline(always)]
    fn prune<S: Simd>(
        found: &mut Found,
        stack: &mut Stack<'_, u64>,
        simd: S,
        leaf: Child,
        better: bool,
    ) {
        if better {
            (found.leaf, found.instance) = (leaf, found.here);
        }
        Closest::prune(&mut found.best, stack, simd, leaf, better);
    }

    #[inline(always)]
    fn enter(found: &mut Found, inst_id: u32, index: usize, interval: Interval) {
        found.best.enter(interval, inst_id);
        found.here = index as u32;
    }

    #[inline(always)]
    fn exit(found: &mut Found) {
        found.best.exit();
        found.here = LocatedHit::WORLD;
    }

    fn report(found: &Found, batch: &RayBatch<'_>, index: usize) {
        if let Some(hit) = found.best.hit() {
            let &Found { leaf, instance, .. } = found;
            let found = LocatedHit {
                hit,
                leaf,
                instance,
            };
            batch.report_surface(index, &found);
        }
    }
}
