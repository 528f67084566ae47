//! Occlusion of a ray by what meets a condition: anything but the primitive the ray starts on, what its mask shows, what a
//! function of the user accepts.
//!
//! Conditions other than a primitive that is left out are decided lane by lane, in code that is compiled once.

use antumbra_simd::{Simd, Width, WithSimd};

use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::quad::told_id;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::{LanesOf, TriangleBlock, VectorHits};
use crate::geometry::user::UserBlock;
use crate::geometry::{BLOCK, PrimRef, QueryKind};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::query::{Occlusion, Query};
use crate::trace::single::traverse;
use crate::trace::stack::Stack;
use crate::trace::step::{NodeLanes, NodeMask};
use crate::tree::node::{Child, Leaf, Node};
use crate::tree::wide::WideTree;

/// Whether anything that meets a condition occludes a ray.
pub(crate) struct Conditional<'a, const N: usize> {
    pub bvh: &'a WideTree<N>,
    /// Memory of a stack for this tree.
    pub stack: &'a mut [u32],
    pub ray: &'a Ray,
    pub condition: &'a Condition<'a>,
}

impl<const N: usize> WithSimd<N> for Conditional<'_, N> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> bool {
        let mut setup = RaySetup::IDLE;
        let mut object = None;
        setup.set(simd, self.ray, self.bvh.reach) && {
            let stack = Stack::new(self.stack, 0);
            let more = (!self.condition.asks_nothing_else()).then_some(self.condition);
            let state = Known {
                excluded: self.condition.excluded,
                more,
                ..OcclusionIf::IDLE
            };
            let setups = (&setup, &mut object);
            traverse::<S, N, OcclusionIf<'_>>(simd, self.bvh, setups, stack, state)
        }
    }
}

/// [`Occlusion`] by what meets a condition.
struct OcclusionIf<'a>(core::marker::PhantomData<&'a ()>);

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
struct Known<'a> {
    excluded: PrimId,
    /// The whole condition, if it asks for anything else.
    more: Option<&'a Condition<'a>>,
    /// Where hits are reported: the instance interval.
    interval: Interval,
    occluded: bool,
}

impl Known<'_> {
    /// The lanes of a block that hold the excluded primitive, as bits.
    #[inline(always)]
    fn lanes(&self, ray: &RaySetup, block: &TriangleBlock) -> u32 {
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
            let is_it = block.geom_ids[lane] == geom_id && told_id(block.prim_ids[lane]) == prim_id;
            lanes |= u32::from(is_it) << lane;
        }
        lanes
    }

    /// Whether a leaf has an occluder.
    #[inline(always)]
    fn leaf<S: Simd, const N: usize>(
        &self,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> bool {
        match leaf {
            Leaf::Triangles(index) => {
                let block = &bvh.triangle_blocks[index];
                let lanes = block.occluders::<S, false>(simd, ray);
                lanes != 0 && {
                    let lanes = lanes & !self.lanes(ray, block);
                    lanes != 0 && (self.more.is_none() || self.any_triangle(block, lanes, ray))
                }
            }
            Leaf::Spheres(index) => self.any_sphere(&bvh.sphere_blocks[index], ray),
            Leaf::Users(index) => self.any_user(&bvh.user_blocks[index], ray),
            Leaf::Cutouts(index) => {
                let block = &bvh.cutout_blocks[index];
                let left_out = self.lanes(ray, &block.triangles);
                if self.more.is_none() {
                    return block.occluded_but(simd, ray, &bvh.filters, left_out);
                }
                let LanesOf(lanes) = (block.triangles).candidates::<S, false>(simd, ray, ray.tfar);
                self.any_cutout(block, lanes & !left_out, ray, &bvh.filters)
            }
        }
    }

    /// Whether a primitive can count.
    fn may_count(&self, id: PrimRef, ray: &RaySetup) -> bool {
        let PrimRef { geom_id, prim_id } = id.told();
        let id = PrimId {
            inst_id: ray.inst_id,
            geom_id,
            prim_id,
        };
        match self.more {
            Some(condition) => condition.may_count(id),
            None => id != self.excluded,
        }
    }

    /// Whether a hit counts on a primitive that can.
    fn accepts(&self, hit: Hit, ray: &RaySetup) -> bool {
        let accept = self.more.and_then(|condition| condition.accept);
        accept.is_none_or(|accept| {
            let hit = Hit {
                t: self.interval.clamp(hit.t),
                inst_id: ray.inst_id,
                ..hit
            };
            accept(&hit.told())
        })
    }

    #[inline(never)]
    fn any_triangle(&self, block: &TriangleBlock, lanes: u32, ray: &RaySetup) -> bool {
        LanesOf(lanes).any(|lane| {
            self.may_count(LeafBlock::id(block, lane), ray)
                && block
                    .values(lane, ray)
                    .is_some_and(|values| self.accepts(block.hit(lane, values), ray))
        })
    }

    #[inline(never)]
    fn any_cutout(
        &self,
        block: &CutoutBlock,
        lanes: u32,
        ray: &RaySetup,
        filters: &Filters,
    ) -> bool {
        let triangles = &block.triangles;
        LanesOf(lanes).any(|lane| {
            self.may_count(LeafBlock::id(triangles, lane), ray)
                && triangles.values(lane, ray).is_some_and(|values| {
                    let hit = CutoutHit::new(block, lane, values, filters);
                    hit.counts(QueryKind::Occluded, ray, filters)
                        && self.accepts(triangles.hit(lane, values), ray)
                })
        })
    }

    #[inline(never)]
    fn any_sphere(&self, block: &SphereBlock, ray: &RaySetup) -> bool {
        (0..block.count).any(|lane| {
            self.may_count(block.refs[lane], ray)
                && block
                    .hit(lane, ray)
                    .is_some_and(|hit| self.accepts(hit, ray))
        })
    }

    #[inline(never)]
    fn any_user(&self, block: &UserBlock, ray: &RaySetup) -> bool {
        let wants_hits = self
            .more
            .is_some_and(|condition| condition.accept.is_some());
        block.prims().any(|(prim, id)| {
            self.may_count(id, ray)
                && if wants_hits {
                    prim.hit(id, ray).is_some_and(|hit| self.accepts(hit, ray))
                } else {
                    prim.occludes(id, ray)
                }
        })
    }
}

impl<'a> Query for OcclusionIf<'a> {
    type Item = u32;
    type State = Known<'a>;
    type Answer = bool;

    const IDLE: Known<'a> = Known {
        excluded: PrimId::NONE,
        more: None,
        interval: Interval::WORLD,
        occluded: false,
    };

    #[inline(always)]
    fn finish(known: &Known<'a>) -> bool {
        known.occluded
    }

    #[inline(always)]
    fn push<S: Simd + Width<N>, const N: usize>(
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) {
        Occlusion::push::<S, N>(stack, node, mask, entry);
    }

    #[inline(always)]
    fn push_pop<S: Simd + Width<N>, const N: usize>(
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Child {
        Occlusion::push_pop::<S, N>(stack, node, mask, entry)
    }

    #[inline(always)]
    fn leaf<S: Simd, const N: usize>(
        known: &mut Known<'a>,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        known.occluded = known.leaf::<S, N>(simd, bvh, leaf, ray);
        stack.clear_if(known.occluded);
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

    #[inline(always)]
    fn cutout_hits<S: Simd>(
        _: &Known<'a>,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        Occlusion::cutout_hits(&false, simd, block, ray)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        known: &mut Known<'a>,
        stack: &mut Stack<'_, u32>,
        _: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        known.occluded |= known.any_cutout(hit.block, 1 << hit.lane, ray, filters);
        stack.clear_if(known.occluded);
    }
}
