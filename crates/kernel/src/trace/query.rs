//! What makes the one traversal an occlusion query or a closest-hit query.

use antumbra_simd::{Simd, Width};

use crate::geometry::best::Best;
use crate::geometry::cutout::opacity::QueryKind;
use crate::geometry::cutout::{CutoutBlock, Filters};
use crate::geometry::instance_ray::Stay;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::VectorHits;
use crate::ray::{Hit, Ray};
use crate::trace::observe::Observer;
use crate::trace::pick::{Pick, push_sorted};
use crate::trace::stack::{Item, Stack};
use crate::trace::step::{NodeLanes, NodeMask, leaf_intersect, leaf_occluded};
use crate::trace::waiting::WaitingHit;
use crate::tree::node::{Child, Leaf, Node};
use crate::tree::wide::Bvh;

/// The decisions of a traversal. One query serves many rays, each with a state of its own that grows as the
/// ray goes on.
pub(crate) trait Query {
    /// What lies on the stacks.
    type Item: Item;
    /// What is known of a ray.
    type State: Copy;
    /// What is known at the end.
    type Answer;

    /// The state of a ray that no query has begun for.
    const IDLE: Self::State;

    /// A ray begins, number `index` of its batch.
    fn begin(&mut self, index: usize, ray: &Ray) -> Self::State;

    /// A ray is at its end.
    fn finish(state: &Self::State) -> Self::Answer;

    /// The answer for a ray that can hit nothing.
    fn miss() -> Self::Answer;

    /// Boxes entered beyond this are of no interest.
    fn limit(state: &Self::State, ray: &RaySetup) -> f32;

    /// A node was tested against `ray`: `mask` are the lanes hit, `entry` their distances. Pushes them so that
    /// the child to be visited next is on top.
    fn push<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack<'_, Self::Item>,
        index: usize,
        node: &Node<N>,
        ray: &RaySetup,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    );

    /// A leaf is reached. `WAVE` asks for code without branches that are hard to predict, even if it takes
    /// longer from end to end: other rays fill the gaps, but a wrong guess throws their work away too.
    fn leaf<S: Simd, const N: usize, const WAVE: bool>(
        &mut self,
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    );

    /// The ray goes into instance `index`.
    fn enter<const N: usize>(
        &mut self,
        state: &mut Self::State,
        bvh: &Bvh<N>,
        index: usize,
        stay: Stay,
    );

    /// The ray comes back into the world.
    fn exit(&mut self, state: &mut Self::State);

    /// [`Query::push`], then a pop, by the shortest way: for a ray that has the CPU to itself.
    #[inline(always)]
    fn push_pop<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack<'_, Self::Item>,
        index: usize,
        node: &Node<N>,
        ray: &RaySetup,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Child {
        self.push::<S, N>(stack, index, node, ray, mask, entry);
        stack.pop().child()
    }
}

/// A query that can be asked in waves, where hits of cut-outs wait.
pub(crate) trait WaveQuery: Query {
    /// A leaf of cut-outs is reached in a wave: what is hit there is to wait.
    fn vector_hits<S: Simd>(
        state: &Self::State,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S>;

    /// One of those hits has waited.
    fn settle<S: Simd>(
        &mut self,
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        hit: &WaitingHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    );
}

/// Is there anything? Stops at the first occluder.
pub(crate) struct Occlusion<P, O> {
    pub pick: P,
    pub observer: O,
}

impl<P: Pick, O: Observer> Query for Occlusion<P, O> {
    type Item = P::Item;
    type State = bool;
    type Answer = bool;

    const IDLE: bool = false;

    #[inline(always)]
    fn begin(&mut self, index: usize, ray: &Ray) -> bool {
        self.observer.begin(index);
        self.pick.begin(ray);
        false
    }

    #[inline(always)]
    fn finish(occluded: &bool) -> bool {
        *occluded
    }

    #[inline(always)]
    fn miss() -> bool {
        false
    }

    #[inline(always)]
    fn limit(_: &bool, ray: &RaySetup) -> f32 {
        ray.tfar
    }

    #[inline(always)]
    fn push<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack<'_, P::Item>,
        index: usize,
        node: &Node<N>,
        ray: &RaySetup,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) {
        use antumbra_simd::Mask;
        self.observer.node(index, mask.bits());
        self.pick
            .push::<N, NodeLanes<S, N>>(stack, index, node, ray, mask, entry);
    }

    #[inline(always)]
    fn push_pop<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack<'_, P::Item>,
        index: usize,
        node: &Node<N>,
        ray: &RaySetup,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Child {
        use antumbra_simd::Mask;
        self.observer.node(index, mask.bits());
        self.pick
            .push_pop::<N, NodeLanes<S, N>>(stack, index, node, ray, mask, entry)
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
    ) {
        *occluded = leaf_occluded::<S, N, WAVE>(simd, bvh, leaf, ray, &mut self.observer);
        stack.clear_if(*occluded);
    }

    #[inline(always)]
    fn enter<const N: usize>(&mut self, _: &mut bool, bvh: &Bvh<N>, index: usize, _: Stay) {
        self.observer.enter(bvh.instance_index(index));
    }

    #[inline(always)]
    fn exit(&mut self, _: &mut bool) {
        self.observer.exit();
    }
}

impl<P: Pick, O: Observer> WaveQuery for Occlusion<P, O> {
    #[inline(always)]
    fn vector_hits<S: Simd>(
        _: &bool,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        block
            .triangles
            .vector_hits::<S, false>(simd, ray, f32::INFINITY)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        &mut self,
        occluded: &mut bool,
        stack: &mut Stack<'_, P::Item>,
        _: S,
        hit: &WaitingHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        // Another hit in the same leaf may have decided: a filter is not asked in vain.
        if !*occluded {
            *occluded = hit.counts(QueryKind::Occluded, ray, filters);
            stack.clear_if(*occluded);
        }
    }
}

/// Which hit is the closest? Goes front to back and drops what begins behind the best hit so far: when it
/// finds a better one, so that pops need no thought.
pub(crate) struct Closest;

impl Closest {
    /// Drops what begins behind the best hit.
    #[inline(always)]
    fn cull<S: Simd>(best: &Best, stack: &mut Stack<'_, u64>, simd: S) {
        // What is entered behind the origin lies on the stack as entered at 0. That is also where the exit
        // from an instance lies.
        let limit = if best.limit > 0.0 { best.limit } else { 0.0 };
        stack.cull(simd, limit);
    }
}

impl Query for Closest {
    type Item = u64;
    type State = Best;
    type Answer = Option<Hit>;

    const IDLE: Best = Best::none(0.0);

    #[inline(always)]
    fn begin(&mut self, _: usize, ray: &Ray) -> Best {
        Best::none(ray.tfar)
    }

    #[inline(always)]
    fn finish(best: &Best) -> Option<Hit> {
        best.found()
    }

    #[inline(always)]
    fn miss() -> Option<Hit> {
        None
    }

    #[inline(always)]
    fn limit(best: &Best, _: &RaySetup) -> f32 {
        best.limit
    }

    #[inline(always)]
    fn push<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack<'_, u64>,
        _: usize,
        node: &Node<N>,
        _: &RaySetup,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) {
        push_sorted::<N, NodeLanes<S, N>>(stack, node, mask, entry);
    }

    /// Children entered at the distance of the best hit are kept: they may hold an equally near primitive of
    /// a smaller id.
    #[inline(always)]
    fn leaf<S: Simd, const N: usize, const WAVE: bool>(
        &mut self,
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        if leaf_intersect::<S, N, WAVE>(simd, bvh, leaf, ray, best) {
            Self::cull(best, stack, simd);
        }
    }

    #[inline(always)]
    fn enter<const N: usize>(&mut self, best: &mut Best, bvh: &Bvh<N>, index: usize, stay: Stay) {
        best.enter(stay, bvh.instances[index].placement.inst_id);
    }

    #[inline(always)]
    fn exit(&mut self, best: &mut Best) {
        best.exit();
    }
}

impl WaveQuery for Closest {
    #[inline(always)]
    fn vector_hits<S: Simd>(
        best: &Best,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        block
            .triangles
            .vector_hits::<S, true>(simd, ray, best.limit)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        &mut self,
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        hit: &WaitingHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        // The filter costs the most.
        if best.offer_if(hit.hit(), || hit.counts(QueryKind::Intersect, ray, filters)) {
            Self::cull(best, stack, simd);
        }
    }
}
