//! The closest hit with its leaf, ray by ray and without vectors. Ray streams report leaves where the CPU has vectors.

use antumbra_simd::{Scalar, Simd, Width};

use crate::geometry::best::Best;
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::Ray;
use crate::trace::condition::Condition;
use crate::trace::conditional::improve_when;
use crate::trace::query::{Closest, Query};
use crate::trace::ray_batch::LocatedHit;
use crate::trace::single::traverse;
use crate::trace::stack::Stack;
use crate::trace::view::{View, on_seen_leaf};
use crate::tree::node::{Child, Leaf};
use crate::tree::wide::WideTree;

/// The closest hit that fulfils a condition, with its leaf. `stack` is memory of one for this tree.
pub(crate) fn closest_with_leaf<const N: usize>(
    (bvh, view): (&WideTree<N>, impl View),
    stack: &mut [u64],
    ray: &Ray,
    condition: &Condition<'_>,
) -> Option<LocatedHit>
where
    Scalar: Width<N>,
{
    let mut setup = RaySetup::IDLE;
    let mut object = None;
    if !setup.set(Scalar, ray, bvh.reach) {
        return None;
    }
    let state = Known {
        best: Best::none(ray.tfar),
        condition,
        ..ClosestWithLeaf::IDLE
    };
    let (setups, stack) = ((&setup, &mut object), Stack::new(stack, 0));
    traverse::<Scalar, N, ClosestWithLeaf<'_>, _>(Scalar, bvh, view, setups, stack, state)
}

/// [`Closest`] with the leaf of the hit.
struct ClosestWithLeaf<'a>(core::marker::PhantomData<&'a ()>);

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
struct Known<'a> {
    best: Best,
    condition: &'a Condition<'a>,
    /// Leaf of the best hit, and index of its instance.
    leaf: (Child, u32),
    /// Index of the instance where the ray is, or [`LocatedHit::WORLD`].
    here: u32,
}

impl<'a> Query for ClosestWithLeaf<'a> {
    type Item = u64;
    type State = Known<'a>;
    type Answer = Option<LocatedHit>;

    const IDLE: Known<'a> = Known {
        best: Closest::IDLE,
        condition: &Condition::NONE,
        leaf: (Child::EMPTY, LocatedHit::WORLD),
        here: LocatedHit::WORLD,
    };

    fn finish(known: &Known<'a>) -> Option<LocatedHit> {
        let (leaf, instance) = known.leaf;
        known.best.hit().map(|hit| LocatedHit {
            hit,
            leaf,
            instance,
        })
    }

    fn limit(known: &Known<'a>, _: &RaySetup) -> f32 {
        known.best.limit
    }

    fn leaf<S: Simd, V: View, const N: usize>(
        known: &mut Known<'a>,
        stack: &mut Stack<'_, u64>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        let limit = known.best.limit;
        let lanes = on_seen_leaf!(simd, bvh, view, leaf, block => block.candidates::<S, false>(simd, ray, limit).0);
        if improve_when(
            (bvh, view),
            (leaf, lanes),
            ray,
            &mut known.best,
            known.condition,
        ) {
            known.leaf = (Child::leaf(leaf), known.here);
            Closest::cull(&known.best, stack, simd);
        }
    }

    fn enters(known: &Known<'a>, inst_id: u32) -> bool {
        known.condition.enters(inst_id)
    }

    fn enter<const N: usize>(
        known: &mut Known<'a>,
        bvh: &WideTree<N>,
        index: usize,
        interval: Interval,
    ) {
        Closest::enter(&mut known.best, bvh, index, interval);
        known.here = index as u32;
    }

    fn exit(known: &mut Known<'a>) {
        Closest::exit(&mut known.best);
        known.here = LocatedHit::WORLD;
    }
}
