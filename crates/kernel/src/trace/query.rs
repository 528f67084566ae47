//! The two queries, occlusion and closest hit: the decisions in which their traversals differ.

use antumbra_simd::Simd;

use crate::geometry::best::Best;
use crate::geometry::cutout::opacity::QueryKind;
use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::{LanesOf, VectorHits};
use crate::ray::{Hit, Ray};
use crate::trace::pick::Children;
use crate::trace::stack::Stack;
use crate::trace::step::{leaf_intersect, leaf_occluder};
use crate::tree::node::Leaf;
use crate::tree::wide::WideTree;

/// The decisions of a traversal. Every ray has a state of its own that grows as the ray goes on.
pub(crate) trait Query {
    /// An item on the stacks.
    type Item: Children;
    /// The knowledge of a ray on its way.
    type State: Copy;
    /// The knowledge of a ray at its end.
    type Answer: Default;

    /// The state of a ray that no query has begun for.
    const IDLE: Self::State;

    /// A ray begins.
    #[inline(always)]
    fn begin(_: &Ray) -> Self::State {
        Self::IDLE
    }

    /// A ray is at its end.
    fn finish(state: &Self::State) -> Self::Answer;

    /// The answer for a ray that can hit nothing.
    #[inline(always)]
    fn miss() -> Self::Answer {
        Self::Answer::default()
    }

    /// Boxes entered beyond this are of no interest.
    #[inline(always)]
    fn limit(_: &Self::State, ray: &RaySetup) -> f32 {
        ray.tfar
    }

    /// A leaf is reached.
    fn leaf<S: Simd, const N: usize>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    );

    /// Whether the ray goes into the instance of this number at all.
    #[inline(always)]
    fn enters(_: &Self::State, _: u32) -> bool {
        true
    }

    /// The ray goes into instance `index`.
    #[inline(always)]
    fn enter<const N: usize>(_: &mut Self::State, _: &WideTree<N>, _: usize, _: Interval) {}

    /// The ray comes back into the world.
    #[inline(always)]
    fn exit(_: &mut Self::State) {}
}

/// The decisions of a ray stream, where leaves take several phases.
pub(crate) trait StreamQuery: Query {
    /// A leaf is reached in a ray stream. Has no branches that are hard to predict, even if it takes longer from end to end:
    /// other rays fill the gaps, but a wrong guess throws their work away too. Returns the lanes, as bits, that are left to
    /// be [confirmed](StreamQuery::confirm).
    #[inline(always)]
    fn leaf_in_stream<S: Simd, const N: usize>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> u32 {
        Self::leaf(state, stack, simd, bvh, leaf, ray);
        0
    }

    /// Decides about the lanes of a leaf that were left.
    #[inline(always)]
    fn confirm<S: Simd, const N: usize>(
        _: &mut Self::State,
        _: &mut Stack<'_, Self::Item>,
        _: S,
        _: &WideTree<N>,
        _: (Leaf, u32),
        _: &RaySetup,
    ) {
    }

    /// Tests a leaf of cut-outs. The hits are deferred.
    fn cutout_hits<S: Simd>(
        state: &Self::State,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S>;

    /// Decides about one of these hits.
    fn settle<S: Simd>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    );
}

/// Is there anything? Visits children by ascending slots and stops at the first occluder.
pub(crate) struct Occlusion;

impl Query for Occlusion {
    type Item = u32;
    type State = bool;
    type Answer = bool;

    const IDLE: bool = false;

    #[inline(always)]
    fn finish(occluded: &bool) -> bool {
        *occluded
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
        *occluded = leaf_occluder::<S, N, false>(simd, bvh, leaf, ray).is_some();
        stack.clear_if(*occluded);
    }
}

impl StreamQuery for Occlusion {
    #[inline(always)]
    fn leaf_in_stream<S: Simd, const N: usize>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> u32 {
        *occluded = leaf_occluder::<S, N, true>(simd, bvh, leaf, ray).is_some();
        stack.clear_if(*occluded);
        0
    }

    #[inline(always)]
    fn cutout_hits<S: Simd>(
        _: &bool,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        block.triangles.vector_occluders(simd, ray)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        _: S,
        hit: &CutoutHit<'_>,
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

/// Which hit is the closest? Goes front to back and drops what begins behind the best hit so far: when a better one
/// is found, so that pops need no thought.
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

    /// Children entered at the distance of the best hit are kept: they may hold an equally near primitive of
    /// a smaller id.
    #[inline(always)]
    fn leaf<S: Simd, const N: usize>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        if leaf_intersect(simd, bvh, leaf, ray, best) {
            Self::cull(best, stack, simd);
        }
    }

    #[inline(always)]
    fn enter<const N: usize>(best: &mut Best, bvh: &WideTree<N>, index: usize, interval: Interval) {
        best.enter(interval, bvh.instances[index].placement.inst_id);
    }

    #[inline(always)]
    fn exit(best: &mut Best) {
        best.exit();
    }
}

impl StreamQuery for Closest {
    /// Many leaves of triangles hold no candidate, and no CPU can guess which. So the others are left for
    /// later, when nearly all have one candidate and improve the best hit.
    #[inline(always)]
    fn leaf_in_stream<S: Simd, const N: usize>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> u32 {
        if leaf.kind == PrimKind::Triangle {
            let block = &bvh.blocks.triangles[leaf.index];
            return block.candidates::<S, true>(simd, ray, best.limit).0;
        }
        Self::leaf(best, stack, simd, bvh, leaf, ray);
        0
    }

    #[inline(always)]
    fn confirm<S: Simd, const N: usize>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        bvh: &WideTree<N>,
        (leaf, lanes): (Leaf, u32),
        ray: &RaySetup,
    ) {
        let blocks = &bvh.blocks.triangles;
        if leaf.kind == PrimKind::Triangle
            && blocks[leaf.index].improve(LanesOf(lanes), ray, &bvh.filters, best)
        {
            Self::cull(best, stack, simd);
        }
    }

    #[inline(always)]
    fn cutout_hits<S: Simd>(
        best: &Best,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        block.triangles.vector_hits(simd, ray, best.limit)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        if hit.improves(best, ray, filters) {
            Self::cull(best, stack, simd);
        }
    }
}
