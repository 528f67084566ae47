//! The two queries, occlusion and closest hit: the decisions in which their traversals differ.

use antumbra_simd::{Scalar, Simd};

use crate::geometry::best::Best;
use crate::geometry::cutout::opacity::QueryKind;
use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::{LanesOf, VectorHits};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::conditional::{improve_when, occluder_when};
use crate::trace::pick::Children;
use crate::trace::stack::Stack;
use crate::trace::step::{leaf_intersect, leaf_occluder, scalar_occluder};
use crate::trace::view::View;
use crate::tree::leaves::on_leaf;
use crate::tree::node::Leaf;
use crate::tree::wide::WideTree;

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

    /// Boxes entered beyond this are of no interest.
    #[inline(always)]
    fn limit(_: &Self::State, ray: &RaySetup) -> f32 {
        ray.tfar
    }

    /// Tests a leaf that the ray has reached, and brings its state and stack up to date.
    fn leaf<S: Simd, V: View, const N: usize>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
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
    /// Whether lanes are left to be confirmed although nobody decides about hits.
    const CONFIRMS: bool;

    /// A leaf is reached in a ray stream. Has no branches that are hard to predict, even if it takes longer from end to end:
    /// other rays fill the gaps, but a wrong guess throws their work away too. Returns the lanes, as bits, that are left to
    /// be [confirmed](StreamQuery::confirm); if each hit is to be decided about (`decides`), these are all that may be hit.
    #[expect(
        clippy::too_many_arguments,
        reason = "all of them are in registers where the call is inlined"
    )]
    fn leaf_in_stream<S: Simd, V: View, const N: usize>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
        decides: bool,
    ) -> u32;

    /// Decides about the lanes of a leaf that were left. Whether the ray goes on with a better hit.
    #[inline(always)]
    fn confirm<S: Simd, V: View, const N: usize>(
        _: &mut Self::State,
        _: &mut Stack<'_, Self::Item>,
        _: S,
        _: &WideTree<N>,
        _: V,
        _: (Leaf, u32),
        _: &RaySetup,
    ) -> bool {
        false
    }

    /// [`StreamQuery::confirm`] for hits that have to fulfil a condition, without vectors: away from the loops. `ray`
    /// comes with the instance interval. The second answer is the occluder.
    fn confirm_when<const N: usize>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        bvh: (&WideTree<N>, impl View),
        lanes: (Leaf, u32),
        ray: (&RaySetup, Interval),
        condition: &Condition<'_>,
    ) -> (bool, Option<PrimId>);

    /// A ray is occluded, if that answers the query.
    #[inline(always)]
    fn occlude(_: &mut Self::State, _: &mut Stack<'_, Self::Item>) {}

    /// Tests a leaf of cut-outs. The hits are deferred.
    fn cutout_hits<S: Simd>(
        state: &Self::State,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S>;

    /// Decides about one of these hits. Whether the ray goes on with a better hit.
    fn settle<S: Simd>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) -> bool;

    /// The hit of a ray at its end, with ids as in the tree, if the query finds hits.
    #[inline(always)]
    fn hit(_: &Self::State) -> Option<Hit> {
        None
    }
}

/// The lanes of a leaf of any kind but triangles that may be hit, as bits. Away from the loops, which need their registers for
/// triangles: 2 % of the instructions of occlusion in batches (AVX2).
#[cold]
#[inline(never)]
fn other_lanes<const N: usize>(bvh: &WideTree<N>, leaf: Leaf, ray: &RaySetup, limit: f32) -> u32 {
    on_leaf!(bvh, leaf, block => block.candidates::<Scalar, false>(Scalar, ray, limit).0)
}

/// The lanes of a leaf in a ray stream that may be hit no farther than `limit`, as bits.
#[inline(always)]
pub(super) fn lanes_in_stream<S: Simd, V: View, const N: usize>(
    simd: S,
    bvh: &WideTree<N>,
    view: V,
    leaf: Leaf,
    ray: &RaySetup,
    limit: f32,
) -> u32 {
    match leaf.kind {
        PrimKind::Triangle => {
            let block = view.triangles(simd, bvh, leaf.index);
            block.candidates::<S, true>(simd, ray, limit).0
        }
        PrimKind::Curve => {
            let block = &bvh.blocks.curves[leaf.index];
            block.candidates::<S, true>(simd, ray, limit).0
        }
        _ => other_lanes(bvh, leaf, ray, limit),
    }
}

/// [`other_lanes`] for occlusion; if nobody decides about hits, those that occlude the ray.
#[cold]
#[inline(never)]
fn other_occluders<const N: usize>(
    bvh: &WideTree<N>,
    leaf: Leaf,
    ray: &RaySetup,
    decides: bool,
) -> u32 {
    if decides {
        return other_lanes(bvh, leaf, ray, ray.tfar);
    }
    scalar_occluder(bvh, leaf, ray).map_or(0, |lane| 1 << lane)
}

/// Replaces `best` by the closest hit in these lanes of a leaf of any kind.
#[cold]
#[inline(never)]
fn improve_other<const N: usize>(
    bvh: &WideTree<N>,
    (leaf, lanes): (Leaf, u32),
    ray: &RaySetup,
    best: &mut Best,
) -> bool {
    on_leaf!(bvh, leaf, block => block.improve(LanesOf(lanes), ray, &bvh.filters, best))
}

/// Query whether anything is in the way. Visits children by ascending slots and stops at the first occluder.
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
    fn leaf<S: Simd, V: View, const N: usize>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        *occluded = leaf_occluder(simd, bvh, view, leaf, ray).is_some();
        stack.clear_if(*occluded);
    }
}

impl StreamQuery for Occlusion {
    const CONFIRMS: bool = false;

    #[inline(always)]
    fn leaf_in_stream<S: Simd, V: View, const N: usize>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
        decides: bool,
    ) -> u32 {
        let lanes = match leaf.kind {
            PrimKind::Triangle => view
                .triangles(simd, bvh, leaf.index)
                .occluders::<S, true>(simd, ray),
            PrimKind::Curve => {
                let block = &bvh.blocks.curves[leaf.index];
                match decides {
                    true => block.occluders::<S, true>(simd, ray),
                    false => (block.occluded(simd, ray, &bvh.filters)).map_or(0, |lane| 1 << lane),
                }
            }
            _ => other_occluders(bvh, leaf, ray, decides),
        };
        let is_left = decides && lanes != 0;
        *occluded = !decides && lanes != 0;
        stack.clear_if(*occluded);
        if is_left { lanes } else { 0 }
    }

    fn confirm_when<const N: usize>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        bvh: (&WideTree<N>, impl View),
        lanes: (Leaf, u32),
        (ray, interval): (&RaySetup, Interval),
        condition: &Condition<'_>,
    ) -> (bool, Option<PrimId>) {
        // Another hit in the same leaf may have decided.
        if *occluded {
            return (false, None);
        }
        let occluder = occluder_when(bvh, lanes, ray, interval, condition);
        *occluded = occluder.is_some();
        stack.clear_if(*occluded);
        (false, occluder)
    }

    #[inline(always)]
    fn occlude(occluded: &mut bool, stack: &mut Stack<'_, u32>) {
        *occluded = true;
        stack.clear_if(true);
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
    ) -> bool {
        // Another hit in the same leaf may have decided: then the filter is not called.
        if !*occluded {
            *occluded = hit.counts(QueryKind::Occluded, ray, filters);
            stack.clear_if(*occluded);
        }
        false
    }
}

/// Query for the closest hit. Goes front to back and drops what begins behind the best hit so far: when a better one is
/// found, so that pops need no thought.
pub(crate) struct Closest;

impl Closest {
    /// Drops what begins behind the best hit.
    #[inline(always)]
    pub(super) fn cull<S: Simd>(best: &Best, stack: &mut Stack<'_, u64>, simd: S) {
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
    fn leaf<S: Simd, V: View, const N: usize>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        if leaf_intersect(simd, bvh, view, leaf, ray, best) {
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
    const CONFIRMS: bool = true;

    /// Many leaves of triangles hold no candidate, and no CPU can guess which. So the others are left for
    /// later, when nearly all have one candidate and improve the best hit.
    #[inline(always)]
    fn leaf_in_stream<S: Simd, V: View, const N: usize>(
        best: &mut Best,
        _: &mut Stack<'_, u64>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        leaf: Leaf,
        ray: &RaySetup,
        _: bool,
    ) -> u32 {
        lanes_in_stream(simd, bvh, view, leaf, ray, best.limit)
    }

    #[inline(always)]
    fn confirm<S: Simd, V: View, const N: usize>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        bvh: &WideTree<N>,
        view: V,
        (leaf, lanes): (Leaf, u32),
        ray: &RaySetup,
    ) -> bool {
        let improved = match leaf.kind {
            PrimKind::Triangle => view.triangles(simd, bvh, leaf.index).improve(
                LanesOf(lanes),
                ray,
                &bvh.filters,
                best,
            ),
            _ => improve_other(bvh, (leaf, lanes), ray, best),
        };
        if improved {
            Self::cull(best, stack, simd);
        }
        improved
    }

    fn confirm_when<const N: usize>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        bvh: (&WideTree<N>, impl View),
        lanes: (Leaf, u32),
        (ray, _): (&RaySetup, Interval),
        condition: &Condition<'_>,
    ) -> (bool, Option<PrimId>) {
        let improved = improve_when(bvh, lanes, ray, best, condition);
        if improved {
            Self::cull(best, stack, Scalar);
        }
        (improved, None)
    }

    #[inline(always)]
    fn hit(best: &Best) -> Option<Hit> {
        best.hit()
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
    ) -> bool {
        let improved = hit.improves(best, ray, filters);
        if improved {
            Self::cull(best, stack, simd);
        }
        improved
    }
}
