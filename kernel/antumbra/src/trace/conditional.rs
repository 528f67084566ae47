//! Occlusion of a ray by hits that fulfil a condition: anything but the primitive the ray starts on, what its mask
//! shows, what a function of the user accepts.
//!
//! Conditions other than a primitive that is left out are decided lane by lane, in code that is compiled once.

use antumbra_simd::{Scalar, Simd, Width, WithSimd};

use crate::geometry::best::Best;
use crate::geometry::cutout::Filters;
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::quad::told_id;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::LanesOf;
use crate::geometry::{BLOCK, PrimRef, QueryKind};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::query::Query;
use crate::trace::single::traverse;
use crate::trace::stack::Stack;
use crate::trace::view::{View, on_seen_leaf};
use crate::tree::node::Leaf;
use crate::tree::wide::WideTree;

/// Occlusion of a ray by hits that fulfil a condition. The occluder is the first that is found, which depends on the
/// tree.
pub(crate) struct Conditional<'a, V, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    pub view: V,
    /// Memory of a stack for this tree.
    pub stack: &'a mut [u32],
    pub ray: &'a Ray,
    pub condition: &'a Condition<'a>,
}

impl<V: View, const N: usize> WithSimd<N> for Conditional<'_, V, N> {
    type Output = Option<PrimId>;

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> Option<PrimId> {
        let mut setup = RaySetup::IDLE;
        let mut object = None;
        if setup.set(simd, self.ray, self.bvh.reach) {
            let stack = Stack::new(self.stack, 0);
            let more = (!self.condition.asks_nothing_else()).then_some(self.condition);
            let state = Known {
                excluded: self.condition.excluded,
                more,
                ..OcclusionIf::IDLE
            };
            let setups = (&setup, &mut object);
            traverse::<S, N, OcclusionIf<'_>, V>(simd, self.bvh, self.view, setups, stack, state)
        } else {
            None
        }
    }
}

/// The first of these lanes of a leaf that occludes a ray and fulfils a condition. `interval` is the interval of the
/// instance where the ray is.
#[inline(never)]
pub(crate) fn occluder_when<const N: usize>(
    (bvh, view): (&WideTree<N>, impl View),
    (leaf, lanes): (Leaf, u32),
    ray: &RaySetup,
    interval: Interval,
    condition: &Condition<'_>,
) -> Option<PrimId> {
    let known = Known {
        excluded: condition.excluded,
        more: Some(condition),
        interval,
        occluder: None,
    };
    on_seen_leaf!(Scalar, bvh, view, leaf, block => known.first(block, LanesOf(lanes), ray, &bvh.filters))
}

/// Replaces `best` by the closest hit in these lanes of a leaf that fulfils a condition, where that precedes it, and
/// returns whether it did.
#[inline(never)]
pub(crate) fn improve_when<const N: usize>(
    (bvh, view): (&WideTree<N>, impl View),
    (leaf, lanes): (Leaf, u32),
    ray: &RaySetup,
    best: &mut Best,
    condition: &Condition<'_>,
) -> bool {
    on_seen_leaf!(Scalar, bvh, view, leaf, block => improve(block, LanesOf(lanes), ray, &bvh.filters, (best, condition)))
}

fn improve<B: LeafBlock>(
    block: &B,
    lanes: LanesOf,
    ray: &RaySetup,
    filters: &Filters,
    (best, condition): (&mut Best, &Condition<'_>),
) -> bool {
    let mut improved = false;
    for lane in lanes {
        if !condition.may_count(named(block.id(lane), ray)) {
            continue;
        }
        // The condition may cost the most, so it is checked last.
        let hit = block.hit(lane, ray, filters, QueryKind::Intersect);
        if let Some(hit) = hit.and_then(|hit| best.preceded_by(hit))
            && condition.is_behind(&hit)
            && condition.counts(&hit.told())
        {
            best.take(hit);
            improved = true;
        }
    }
    improved
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

/// A hit as users know it, where the ray is: in the instance of this interval, or in the world.
#[inline(always)]
pub(crate) fn reported(hit: Hit, ray: &RaySetup, interval: Interval) -> Hit {
    let hit = Hit {
        t: interval.clamp(hit.t),
        inst_id: ray.inst_id,
        ..hit
    };
    hit.told()
}

/// [Occlusion](crate::trace::query::Occlusion) by hits that fulfil a condition.
struct OcclusionIf<'a>(core::marker::PhantomData<&'a ()>);

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
struct Known<'a> {
    excluded: PrimId,
    /// The whole condition, if there is more to it than the excluded primitive.
    more: Option<&'a Condition<'a>>,
    /// Where hits are reported: the instance interval.
    interval: Interval,
    occluder: Option<PrimId>,
}

impl Known<'_> {
    /// The lanes of a block that hold the excluded primitive, as bits.
    #[inline(always)]
    fn left_out(&self, ray: &RaySetup, block: &impl LeafBlock) -> u32 {
        let PrimId {
            inst_id,
            geom_id,
            prim_id,
        } = self.excluded;
        if inst_id != ray.inst_id {
            return 0;
        }
        let mut lanes = 0;
        for lane in 0..BLOCK {
            let id = block.id(lane);
            let is_it = id.geom_id == geom_id && told_id(id.prim_id) == prim_id;
            lanes |= u32::from(is_it) << lane;
        }
        lanes
    }

    /// The first occluder of a block.
    #[inline(always)]
    fn block<S: Simd, B: LeafBlock>(
        &self,
        simd: S,
        block: &B,
        ray: &RaySetup,
        filters: &Filters,
    ) -> Option<PrimId> {
        let lanes = block.occluders::<S, false>(simd, ray);
        if lanes == 0 {
            return None;
        }
        let lanes = lanes & !self.left_out(ray, block);
        if lanes == 0 {
            return None;
        }
        self.first(block, LanesOf(lanes), ray, filters)
    }

    /// The first of these lanes that has an occluder.
    #[inline(never)]
    fn first<B: LeafBlock>(
        &self,
        block: &B,
        mut lanes: LanesOf,
        ray: &RaySetup,
        filters: &Filters,
    ) -> Option<PrimId> {
        let accept = self.more.and_then(|condition| condition.accept);
        let lane = lanes.find(|&lane| {
            self.may_count(named(block.id(lane), ray))
                && match accept {
                    None => B::OCCLUDERS_ARE_SURE || block.occludes(lane, ray, filters),
                    Some(accept) => {
                        let hit = block.hit(lane, ray, filters, QueryKind::Occluded);
                        hit.is_some_and(|hit| accept(&reported(hit, ray, self.interval)))
                    }
                }
        })?;
        Some(named(block.id(lane), ray))
    }

    /// Whether a primitive can count.
    fn may_count(&self, id: PrimId) -> bool {
        match self.more {
            Some(condition) => condition.may_count(id),
            None => id != self.excluded,
        }
    }
}

impl<'a> Query for OcclusionIf<'a> {
    type Item = u32;
    type State = Known<'a>;
    type Answer = Option<PrimId>;

    const IDLE: Known<'a> = Known {
        excluded: PrimId::NONE,
        more: None,
        interval: Interval::WORLD,
        occluder: None,
    };

    #[inline(always)]
    fn finish(known: &Known<'a>) -> Option<PrimId> {
        known.occluder
    }

    #[inline(always)]
    fn leaf<S: Simd, V: View, const N: usize>(
        known: &mut Known<'a>,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        let filters = &bvh.filters;
        known.occluder =
            on_seen_leaf!(simd, bvh, view, leaf, block => known.block(simd, block, ray, filters));
        stack.clear_if(known.occluder.is_some());
    }

    #[inline(always)]
    fn enters(known: &Known<'a>, inst_id: u32) -> bool {
        known.more.is_none_or(|condition| condition.enters(inst_id))
    }

    #[inline(always)]
    fn enter<const N: usize>(known: &mut Known<'a>, _: &WideTree<N>, _: usize, interval: Interval) {
        known.interval = interval;
    }

    #[inline(always)]
    fn exit(known: &mut Known<'a>) {
        known.interval = Interval::WORLD;
    }
}
