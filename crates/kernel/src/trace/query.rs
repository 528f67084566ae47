//! What makes the one traversal an occlusion query or a closest-hit query.

use antumbra_simd::{Mask, Simd, Width};

use super::observe::Observer;
use super::pick::{Pick, push_sorted};
use super::setup::RaySetup;
use super::stack::{Entry, Item, Stack};
use super::step::{NodeLanes, NodeMask, leaf_intersect, leaf_occluded};
use crate::bvh::Bvh;
use crate::node::{Child, Leaf, Node};
use crate::ray::{Hit, Ray};

/// The decisions of a traversal. One query serves many rays, each with an answer of its own that grows as
/// the ray goes on.
///
/// `WAVE` is as in [`Pick::next`].
pub(crate) trait Query {
    /// What lies on the stacks.
    type Item: Item;
    /// What is known of a ray; at the end, the answer.
    type Answer: Copy + Default;

    /// A ray begins, number `index` of its batch.
    fn begin(&mut self, index: usize, ray: &Ray);

    /// Boxes entered beyond this are of no interest.
    fn limit(answer: &Self::Answer, ray: &RaySetup) -> f32;

    /// A node was tested: `mask` are the lanes hit, `entry` their distances. Returns what to visit next.
    fn node<S: Simd + Width<N>, const N: usize, const WAVE: bool>(
        &mut self,
        answer: &Self::Answer,
        stack: &mut Stack<'_, Self::Item>,
        index: usize,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Child;

    /// A leaf is reached. Returns what to visit next.
    fn leaf<S: Simd, const N: usize, const WAVE: bool>(
        &mut self,
        answer: &mut Self::Answer,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> Child;
}

/// Is there anything? Stops at the first occluder.
pub(crate) struct Occlusion<P, O> {
    pub pick: P,
    pub observer: O,
}

impl<P: Pick, O: Observer> Query for Occlusion<P, O> {
    type Item = P::Item;
    type Answer = bool;

    #[inline(always)]
    fn begin(&mut self, index: usize, ray: &Ray) {
        self.observer.begin(index);
        self.pick.begin(ray);
    }

    #[inline(always)]
    fn limit(_: &bool, ray: &RaySetup) -> f32 {
        ray.tfar
    }

    #[inline(always)]
    fn node<S: Simd + Width<N>, const N: usize, const WAVE: bool>(
        &mut self,
        _: &bool,
        stack: &mut Stack<'_, P::Item>,
        index: usize,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Child {
        self.observer.node(index, mask.bits());
        self.pick
            .next::<N, WAVE, NodeLanes<S, N>>(stack, node, mask, entry)
    }

    #[inline(always)]
    fn leaf<S: Simd, const N: usize, const WAVE: bool>(
        &mut self,
        occluded: &mut bool,
        stack: &mut Stack<'_, P::Item>,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> Child {
        *occluded = leaf_occluded::<S, N, WAVE>(simd, bvh, leaf, ray, &mut self.observer);
        // All bits set is `Child::DONE`; a select would become a branch that half of the rays guess wrong.
        Child(stack.pop().child().0 | u32::from(*occluded).wrapping_neg())
    }
}

/// Which hit is the closest? Goes front to back and drops what begins behind the best hit so far.
pub(crate) struct Closest;

impl Closest {
    /// The top child that is entered no farther than the best hit. One entered at the same distance is
    /// kept: it may hold an equally near primitive of a smaller id.
    #[inline(always)]
    fn pop(best: &Option<Hit>, stack: &mut Stack<'_, Entry>) -> Child {
        let limit = best.as_ref().map_or(f32::INFINITY, |best| best.t);
        loop {
            let entry = stack.pop();
            if entry.within(limit) {
                return entry.child();
            }
        }
    }
}

impl Query for Closest {
    type Item = Entry;
    type Answer = Option<Hit>;

    #[inline(always)]
    fn begin(&mut self, _: usize, _: &Ray) {}

    #[inline(always)]
    fn limit(best: &Option<Hit>, ray: &RaySetup) -> f32 {
        best.as_ref().map_or(ray.tfar, |best| best.t)
    }

    #[inline(always)]
    fn node<S: Simd + Width<N>, const N: usize, const WAVE: bool>(
        &mut self,
        best: &Option<Hit>,
        stack: &mut Stack<'_, Entry>,
        _: usize,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Child {
        push_sorted::<N, NodeLanes<S, N>>(stack, node, mask, entry);
        Self::pop(best, stack)
    }

    #[inline(always)]
    fn leaf<S: Simd, const N: usize, const WAVE: bool>(
        &mut self,
        best: &mut Option<Hit>,
        stack: &mut Stack<'_, Entry>,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> Child {
        leaf_intersect(simd, bvh, leaf, ray, best);
        Self::pop(best, stack)
    }
}
