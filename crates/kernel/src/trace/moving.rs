//! Queries at a time: occlusion and closest hits in trees that move, see [`crate::tree::motion`].
//!
//! Loops, stacks and leaf tests are the same as in static trees. A ray knows its share of the span, and interpolates the
//! boxes of a node and the corners of a leaf before they are tested, and the transform of an instance before it is
//! entered.

use antumbra_simd::{Lanes, Simd, Width, WithSimd};

use crate::geometry::best::Best;
use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::{LanesOf, TriangleBlock, VectorHits};
use crate::prim_id::PrimId;
use crate::trace::condition::Condition;
use crate::trace::query::{Closest, Occlusion, Query, StreamQuery};
use crate::trace::ray_batch::RayBatch;
use crate::trace::single::traverse;
use crate::trace::stack::Stack;
use crate::trace::step::{NodeLanes, NodeMask, NodeTest};
use crate::tree::motion::planes_at;
use crate::tree::node::Leaf;
use crate::tree::wide::WideTree;

/// A query at a time.
pub(crate) struct Moving<Q>(core::marker::PhantomData<Q>);

/// The state of a query, and the share of the span at which it is answered.
#[derive(Clone, Copy)]
pub(crate) struct Timed<T> {
    state: T,
    share: f32,
}

/// Operations of a query on one triangle block.
pub(crate) trait BlockQuery: StreamQuery {
    fn block<S: Simd>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        block: &TriangleBlock,
        ray: &RaySetup,
        filters: &Filters,
    );

    /// [`StreamQuery::leaf_in_stream`] for one block of triangles.
    fn block_in_stream<S: Simd>(
        state: &mut Self::State,
        stack: &mut Stack<'_, Self::Item>,
        simd: S,
        block: &TriangleBlock,
        ray: &RaySetup,
    ) -> u32;

    /// [`StreamQuery::confirm`] for one block of triangles.
    fn confirm_block<S: Simd>(
        _: &mut Self::State,
        _: &mut Stack<'_, Self::Item>,
        _: S,
        _: (&TriangleBlock, u32),
        _: &RaySetup,
        _: &Filters,
    ) -> bool {
        false
    }
}

impl BlockQuery for Occlusion {
    #[inline(always)]
    fn block<S: Simd>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        simd: S,
        block: &TriangleBlock,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        *occluded = block.occluded(simd, ray, filters).is_some();
        stack.clear_if(*occluded);
    }

    #[inline(always)]
    fn block_in_stream<S: Simd>(
        occluded: &mut bool,
        stack: &mut Stack<'_, u32>,
        simd: S,
        block: &TriangleBlock,
        ray: &RaySetup,
    ) -> u32 {
        *occluded = block.occluders::<S, true>(simd, ray) != 0;
        stack.clear_if(*occluded);
        0
    }
}

impl BlockQuery for Closest {
    #[inline(always)]
    fn block<S: Simd>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        block: &TriangleBlock,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        if block.intersect(simd, ray, filters, best) {
            Self::cull(best, stack, simd);
        }
    }

    #[inline(always)]
    fn block_in_stream<S: Simd>(
        best: &mut Best,
        _: &mut Stack<'_, u64>,
        simd: S,
        block: &TriangleBlock,
        ray: &RaySetup,
    ) -> u32 {
        block.candidates::<S, true>(simd, ray, best.limit).0
    }

    #[inline(always)]
    fn confirm_block<S: Simd>(
        best: &mut Best,
        stack: &mut Stack<'_, u64>,
        simd: S,
        (block, lanes): (&TriangleBlock, u32),
        ray: &RaySetup,
        filters: &Filters,
    ) -> bool {
        let improved = block.improve(LanesOf(lanes), ray, filters, best);
        if improved {
            Self::cull(best, stack, simd);
        }
        improved
    }
}

/// The triangle block of a leaf at a share of the span, if it moves.
#[inline(always)]
fn moved_block<S: Simd, const N: usize>(
    simd: S,
    bvh: &WideTree<N>,
    leaf: Leaf,
    share: f32,
) -> Option<TriangleBlock> {
    let motion = bvh.motion.as_deref()?;
    if leaf.kind != PrimKind::Triangle {
        return None;
    }
    let end = motion.blocks.get(leaf.index)?;
    Some(bvh.blocks.triangles[leaf.index].between(simd, end, share))
}

impl<Q: BlockQuery> Query for Moving<Q> {
    type Item = Q::Item;
    type State = Timed<Q::State>;
    type Answer = Q::Answer;

    const IDLE: Timed<Q::State> = Timed {
        state: Q::IDLE,
        share: 0.0,
    };

    #[inline(always)]
    fn begin_in(batch: &RayBatch<'_>, index: usize) -> Self::State {
        Timed {
            state: Q::begin(&batch.rays[index]),
            share: batch.share(index),
        }
    }

    #[inline(always)]
    fn finish(timed: &Self::State) -> Q::Answer {
        Q::finish(&timed.state)
    }

    #[inline(always)]
    fn miss() -> Q::Answer {
        Q::miss()
    }

    #[inline(always)]
    fn limit(timed: &Self::State, ray: &RaySetup) -> f32 {
        Q::limit(&timed.state, ray)
    }

    #[inline(always)]
    fn step<S: Simd + Width<N>, const N: usize>(
        timed: &Self::State,
        simd: S,
        bvh: &WideTree<N>,
        index: usize,
        test: &NodeTest<S, N>,
        limit: f32,
    ) -> (NodeMask<S, N>, NodeLanes<S, N>) {
        let node = &bvh.nodes[index];
        match bvh.moves.get(index) {
            None => test.step(simd, &node.planes, limit),
            Some(moved) => {
                let share = NodeLanes::<S, N>::splat(simd, timed.share);
                let at =
                    |axis: usize, side: usize| planes_at(simd, [node, moved], (axis, side), share);
                let [x, y, z] = [
                    test.near[0] as usize,
                    test.near[1] as usize,
                    test.near[2] as usize,
                ];
                let near = [at(0, x), at(1, y), at(2, z)];
                let far = [at(0, x ^ 1), at(1, y ^ 1), at(2, z ^ 1)];
                let limit = NodeLanes::<S, N>::splat(simd, limit);
                test.slabs.test::<N>(near, far, limit)
            }
        }
    }

    #[inline(always)]
    fn prefetch<S: Simd, const N: usize>(simd: S, bvh: &WideTree<N>, index: usize) {
        simd.prefetch_at(bvh.nodes.as_ptr().wrapping_add(index));
        simd.prefetch_at(bvh.moves.as_ptr().wrapping_add(index));
    }

    #[inline(always)]
    fn leaf<S: Simd, const N: usize>(
        timed: &mut Self::State,
        stack: &mut Stack<'_, Q::Item>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        let Timed { state, share } = timed;
        match moved_block(simd, bvh, leaf, *share) {
            Some(block) => Q::block(state, stack, simd, &block, ray, &bvh.filters),
            None => Q::leaf(state, stack, simd, bvh, leaf, ray),
        }
    }

    #[inline(always)]
    fn place<S: Simd, const N: usize>(
        timed: &Self::State,
        simd: S,
        bvh: &WideTree<N>,
        index: usize,
        world: &RaySetup,
        object: &mut RaySetup,
    ) -> Option<Interval> {
        let motion = bvh.motion.as_deref()?;
        match &motion.placements[index] {
            None => bvh.instances[index].placement.enter(simd, world, object),
            Some(placement) => {
                let planes = placement.planes(timed.share);
                // The box first: a transform takes as long as many nodes.
                Interval::of(simd, world, &planes)?;
                placement
                    .at(timed.share, planes)?
                    .enter(simd, world, object)
            }
        }
    }

    #[inline(always)]
    fn enter<const N: usize>(
        timed: &mut Self::State,
        bvh: &WideTree<N>,
        index: usize,
        interval: Interval,
    ) {
        Q::enter(&mut timed.state, bvh, index, interval);
    }

    #[inline(always)]
    fn exit(timed: &mut Self::State) {
        Q::exit(&mut timed.state);
    }
}

impl<Q: BlockQuery> StreamQuery for Moving<Q> {
    const CONFIRMS: bool = Q::CONFIRMS;

    #[inline(always)]
    fn leaf_in_stream<S: Simd, const N: usize>(
        timed: &mut Self::State,
        stack: &mut Stack<'_, Q::Item>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
        decides: bool,
    ) -> u32 {
        let Timed { state, share } = timed;
        match moved_block(simd, bvh, leaf, *share) {
            Some(block) => Q::block_in_stream(state, stack, simd, &block, ray),
            None => Q::leaf_in_stream(state, stack, simd, bvh, leaf, ray, decides),
        }
    }

    #[inline(always)]
    fn confirm<S: Simd, const N: usize>(
        timed: &mut Self::State,
        stack: &mut Stack<'_, Q::Item>,
        simd: S,
        bvh: &WideTree<N>,
        (leaf, lanes): (Leaf, u32),
        ray: &RaySetup,
    ) -> bool {
        let Timed { state, share } = timed;
        match moved_block(simd, bvh, leaf, *share) {
            Some(block) => Q::confirm_block(state, stack, simd, (&block, lanes), ray, &bvh.filters),
            None => Q::confirm(state, stack, simd, bvh, (leaf, lanes), ray),
        }
    }

    /// Not called: batches at times have no conditions.
    fn confirm_when<const N: usize>(
        timed: &mut Self::State,
        stack: &mut Stack<'_, Q::Item>,
        bvh: &WideTree<N>,
        lanes: (Leaf, u32),
        ray: (&RaySetup, Interval),
        condition: &Condition<'_>,
    ) -> (bool, Option<PrimId>) {
        Q::confirm_when(&mut timed.state, stack, bvh, lanes, ray, condition)
    }

    #[inline(always)]
    fn cutout_hits<S: Simd>(
        timed: &Self::State,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        Q::cutout_hits(&timed.state, simd, block, ray)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        timed: &mut Self::State,
        stack: &mut Stack<'_, Q::Item>,
        simd: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) -> bool {
        Q::settle(&mut timed.state, stack, simd, hit, ray, filters)
    }
}

/// Answers rays one by one, each at its time.
pub(crate) struct SingleMoving<'a, Q: BlockQuery, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    /// Memory of a stack for this tree.
    pub stack: &'a mut [Q::Item],
    pub batch: &'a RayBatch<'a>,
    pub answers: &'a mut [Q::Answer],
}

impl<Q: BlockQuery, const N: usize> WithSimd<N> for SingleMoving<'_, Q, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let mut setup = RaySetup::IDLE;
        let mut object_setup = None;
        for (index, answer) in self.answers.iter_mut().enumerate() {
            *answer = if setup.set(simd, &self.batch.rays[index], self.bvh.reach) {
                let stack = Stack::new(self.stack, 0);
                let setups = (&setup, &mut object_setup);
                let state = Moving::<Q>::begin_in(self.batch, index);
                traverse::<S, N, Moving<Q>>(simd, self.bvh, setups, stack, state)
            } else {
                Q::miss()
            };
        }
    }
}
