//! Occlusion that tests lifted occluders, a few triangles that occlude many rays, before the root.

use antumbra_simd::{Simd, Width, WithSimd};

use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::VectorHits;
use crate::ray::Ray;
use crate::trace::query::{Occlusion, Query};
use crate::trace::stack::Stack;
use crate::trace::step::{NodeLanes, NodeMask};
use crate::tree::node::{Child, Leaf, Node};
use crate::tree::wide::WideTree;

/// Whether a lifted occluder of the tree occludes the ray.
#[inline(always)]
fn occluded_at_once<S: Simd, const N: usize, const STREAM: bool>(
    simd: S,
    bvh: &WideTree<N>,
    ray: &RaySetup,
) -> bool {
    let mut occluded = false;
    for block in &bvh.lifted {
        occluded |= block.occluded::<S, STREAM>(simd, ray).is_some();
        if !STREAM && occluded {
            break;
        }
    }
    occluded
}

/// [`Occlusion`], lifted occluders first.
pub(crate) struct LiftedFirst;

impl Query for LiftedFirst {
    type Item = u32;
    type State = bool;
    type Answer = bool;

    const IDLE: bool = false;

    #[inline(always)]
    fn ends_at_once<S: Simd, const N: usize, const STREAM: bool>(
        occluded: &mut bool,
        simd: S,
        bvh: &WideTree<N>,
        ray: &RaySetup,
    ) -> bool {
        *occluded = occluded_at_once::<S, N, STREAM>(simd, bvh, ray);
        *occluded
    }

    #[inline(always)]
    fn finish(occluded: &bool) -> bool {
        *occluded
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
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        Occlusion::leaf(occluded, stack, simd, bvh, leaf, ray);
    }

    #[inline(always)]
    fn leaf_in_stream<S: Simd, const N: usize>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> u32 {
        Occlusion::leaf_in_stream(occluded, stack, simd, bvh, leaf, ray)
    }

    #[inline(always)]
    fn cutout_hits<S: Simd>(
        occluded: &bool,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        Occlusion::cutout_hits(occluded, simd, block, ray)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        simd: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        Occlusion::settle(occluded, stack, simd, hit, ray, filters);
    }
}

/// Tests the lifted occluders alone.
pub(crate) struct TestLifted<'a, const N: usize> {
    pub bvh: &'a WideTree<N>,
    pub rays: &'a [Ray],
    /// As long as `rays`.
    pub occluded: &'a mut [bool],
}

impl<const N: usize> WithSimd<N> for TestLifted<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let mut setup = RaySetup::IDLE;
        for (ray, occluded) in self.rays.iter().zip(self.occluded) {
            *occluded = setup.set(simd, ray, self.bvh.reach)
                && occluded_at_once::<S, N, false>(simd, self.bvh, &setup);
        }
    }
}
