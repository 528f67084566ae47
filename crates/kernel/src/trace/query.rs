//! What makes the one traversal an occlusion query or a closest-hit query.

use antumbra_simd::{Mask, Simd, Width};

use super::observe::Observer;
use super::pick::{Pick, push_by_entry};
use super::setup::RaySetup;
use super::stack::Stack;
use super::step::{NodeLanes, NodeMask, leaf_intersect, leaf_occluded};
use crate::bvh::Bvh;
use crate::node::{Child, Leaf, Node};
use crate::ray::Hit;

/// The decisions of a traversal.
pub(crate) trait Query {
    /// Boxes entered beyond this are of no interest.
    fn limit(&self, ray: &RaySetup) -> f32;

    /// The next child to visit.
    fn pop(&self, stack: &mut Stack) -> Option<u32>;

    /// A node was tested: `mask` are the lanes hit, `entry` their distances. Returns the child to visit
    /// next and pushes the others.
    fn node<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack,
        index: usize,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Option<Child>;

    /// A leaf is reached; returns whether the ray is done.
    fn leaf<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> bool;
}

/// Is there anything? Stops at the first occluder.
pub(crate) struct Occlusion<'a, P, O> {
    pub pick: &'a mut P,
    pub observer: &'a mut O,
    pub occluded: bool,
}

impl<P: Pick, O: Observer> Query for Occlusion<'_, P, O> {
    #[inline(always)]
    fn limit(&self, ray: &RaySetup) -> f32 {
        ray.tfar
    }

    #[inline(always)]
    fn pop(&self, stack: &mut Stack) -> Option<u32> {
        P::pop(stack)
    }

    #[inline(always)]
    fn node<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack,
        index: usize,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Option<Child> {
        self.observer.node(index, mask.bits());
        self.pick
            .push::<N, NodeLanes<S, N>>(stack, node, mask, entry)
    }

    #[inline(always)]
    fn leaf<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> bool {
        self.occluded = leaf_occluded(simd, bvh, leaf, ray, self.observer);
        self.occluded
    }
}

/// Which hit is the closest? Goes front to back and drops what begins behind the best hit so far.
pub(crate) struct Closest {
    pub best: Option<Hit>,
}

impl Query for Closest {
    #[inline(always)]
    fn limit(&self, ray: &RaySetup) -> f32 {
        // Boxes entered exactly at the best distance are kept: they may hold an equally near primitive
        // of a smaller id.
        self.best.map_or(ray.tfar, |best| best.t)
    }

    #[inline(always)]
    fn pop(&self, stack: &mut Stack) -> Option<u32> {
        stack.pop_within(self.best.map_or(f32::INFINITY, |best| best.t))
    }

    #[inline(always)]
    fn node<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack,
        _index: usize,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Option<Child> {
        push_by_entry::<N, NodeLanes<S, N>>(stack, node, mask, entry)
    }

    #[inline(always)]
    fn leaf<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> bool {
        leaf_intersect(simd, bvh, leaf, ray, &mut self.best);
        false
    }
}
