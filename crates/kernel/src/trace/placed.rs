//! The closest hit and the leaf it is in, ray by ray and without vectors: what streams tell as they go, for machines that have
//! no vectors.

use antumbra_simd::{Scalar, Simd, Width, WithSimd};

use crate::geometry::best::Best;
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::Ray;
use crate::trace::asked::Found;
use crate::trace::condition::Condition;
use crate::trace::conditional::improve_when;
use crate::trace::query::{Closest, Query};
use crate::trace::single::traverse;
use crate::trace::stack::Stack;
use crate::tree::leaves::on_leaf;
use crate::tree::node::{Child, Leaf};
use crate::tree::wide::WideTree;

/// The closest hit that meets a condition, and where it is.
pub(crate) struct ClosestPlace<'a, const N: usize> {
    pub bvh: &'a WideTree<N>,
    /// Memory of a stack for this tree.
    pub stack: &'a mut [u64],
    pub ray: &'a Ray,
    pub condition: &'a Condition<'a>,
}

impl<const N: usize> ClosestPlace<'_, N>
where
    Scalar: Width<N>,
{
    /// Traces the ray.
    pub fn find(self) -> Option<Found> {
        self.with_simd(Scalar)
    }
}

impl<const N: usize> WithSimd<N> for ClosestPlace<'_, N> {
    type Output = Option<Found>;

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> Option<Found> {
        let mut setup = RaySetup::IDLE;
        let mut object = None;
        if !setup.set(simd, self.ray, self.bvh.reach) {
            return None;
        }
        let state = Known {
            best: Best::none(self.ray.tfar),
            condition: Some(self.condition),
            ..Placed::IDLE
        };
        let setups = (&setup, &mut object);
        let stack = Stack::new(self.stack, 0);
        traverse::<S, N, Placed<'_>>(simd, self.bvh, setups, stack, state)
    }
}

/// [`Closest`] that knows where its hit is.
struct Placed<'a>(core::marker::PhantomData<&'a ()>);

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
struct Known<'a> {
    best: Best,
    condition: Option<&'a Condition<'a>>,
    /// Leaf of the best hit, and index of its instance.
    leaf: (Child, u32),
    /// Index of the instance where the ray is, or [`Found::WORLD`].
    here: u32,
}

impl<'a> Query for Placed<'a> {
    type Item = u64;
    type State = Known<'a>;
    type Answer = Option<Found>;

    const IDLE: Known<'a> = Known {
        best: Closest::IDLE,
        condition: None,
        leaf: (Child::EMPTY, Found::WORLD),
        here: Found::WORLD,
    };

    fn finish(known: &Known<'a>) -> Option<Found> {
        let (leaf, instance) = known.leaf;
        known.best.hit().map(|hit| Found {
            hit,
            leaf,
            instance,
        })
    }

    fn limit(known: &Known<'a>, _: &RaySetup) -> f32 {
        known.best.limit
    }

    fn leaf<S: Simd, const N: usize>(
        known: &mut Known<'a>,
        stack: &mut Stack<'_, u64>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        let limit = known.best.limit;
        let lanes = on_leaf!(bvh, leaf, block => block.candidates::<S, false>(simd, ray, limit).0);
        let condition = known.condition.unwrap_or(&Condition::NONE);
        if improve_when(bvh, (leaf, lanes), ray, &mut known.best, condition) {
            known.leaf = (Child::leaf(leaf), known.here);
            Closest::cull(&known.best, stack, simd);
        }
    }

    fn enters(known: &Known<'a>, inst_id: u32) -> bool {
        known
            .condition
            .is_none_or(|condition| condition.enters(inst_id))
    }

    fn enter<const N: usize>(
        known: &mut Known<'a>,
        bvh: &WideTree<N>,
        index: usize,
        interval: Interval,
    ) {
        known
            .best
            .enter(interval, bvh.instances[index].placement.inst_id);
        known.here = index as u32;
    }

    fn exit(known: &mut Known<'a>) {
        known.best.exit();
        known.here = Found::WORLD;
    }
}
