//! One node step and one leaf step: everything that traversals are made of.

use antumbra_simd::{Lanes, Scalar, Simd, Width};

use crate::geometry::QueryKind;
use crate::geometry::cutout::Filters;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::{RaySetup, Side};
use crate::geometry::slab_test::NodeSlabs;
use crate::geometry::triangle::LanesOf;
use crate::trace::condition::Condition;
use crate::trace::judge::Owner;
use crate::trace::query::Query;
use crate::trace::view::{View, on_seen_leaf};
use crate::tree::leaves::on_leaf;
use crate::tree::node::Leaf;
use crate::tree::wide::Tree;

/// A vector as wide as a node.
pub(crate) type NodeLanes<S, const N: usize> = <S as Width<N>>::Lanes;
/// A mask as wide as a node.
pub(crate) type NodeMask<S, const N: usize> = <NodeLanes<S, N> as Lanes<N>>::Mask;

/// The test of all boxes of a node, made ready for a ray or for a frustum around several. A ray makes it for every step,
/// which costs nothing but the loads; packets make it once.
#[derive(Clone, Copy)]
pub(crate) struct NodeTest<S: Width<N>, const N: usize> {
    pub slabs: NodeSlabs<S::Lanes>,
    /// Near plane of each axis.
    pub near: [Side; 4],
}

impl<S: Simd + Width<N>, const N: usize> NodeTest<S, N> {
    #[inline(always)]
    pub fn new(simd: S, ray: &RaySetup) -> Self {
        Self {
            slabs: NodeSlabs::of_ray(simd, ray),
            near: ray.near,
        }
    }

    /// Tests N boxes given as planes, `[axis][side][lane]`, up to `tfar`. Returns the lanes hit and the distances at
    /// which their boxes are entered. Conservative: see [`crate::geometry::ray_setup`].
    #[inline(always)]
    pub fn step(
        &self,
        simd: S,
        planes: &[[[f32; N]; 2]; 3],
        tfar: f32,
    ) -> (NodeMask<S, N>, NodeLanes<S, N>) {
        self.step_at(simd, tfar, |axis, side| {
            // A side is 0 or 1, but that is not known here: spares six checks.
            NodeLanes::<S, N>::load(simd, &planes[axis][side & 1])
        })
    }

    /// [`NodeTest::step`] for boxes of which `at` gives the planes, by axis and side.
    #[inline(always)]
    pub fn step_at(
        &self,
        simd: S,
        tfar: f32,
        at: impl Fn(usize, usize) -> NodeLanes<S, N>,
    ) -> (NodeMask<S, N>, NodeLanes<S, N>) {
        let [x, y, z] = [self.near[0], self.near[1], self.near[2]].map(|side| side as usize);
        let near = [at(0, x), at(1, y), at(2, z)];
        let far = [at(0, x ^ 1), at(1, y ^ 1), at(2, z ^ 1)];
        let tfar = NodeLanes::<S, N>::splat(simd, tfar);
        self.slabs.test::<N>(near, far, tfar)
    }
}

/// The leaf step: finds the lanes of a leaf that may count, and judges them. Whether the state has changed.
#[inline(always)]
pub(crate) fn leaf_step<S: Simd, Q: Query, V: View>(
    state: &mut Q::State,
    simd: S,
    seen: (&Tree, V),
    leaf: Leaf,
    ray: &RaySetup,
    owner: Owner<'_>,
) -> bool {
    let lanes = leaf_lanes::<S, Q, V, false>(state, simd, seen, leaf, ray);
    lanes != 0
        && (!Q::JUDGES || judge_lanes::<S, Q, V>(state, simd, seen, (leaf, lanes), ray, owner))
}

/// The lanes of a block that may count, as bits; or, if the query does not [judge](Query::JUDGES), one that does if any do.
#[inline(always)]
fn lanes<S: Simd, Q: Query, B: LeafBlock, const STREAM: bool>(
    state: &Q::State,
    simd: S,
    block: &B,
    ray: &RaySetup,
    filters: &Filters,
) -> u32 {
    if Q::KIND == QueryKind::Intersect {
        return (block.candidates::<S, STREAM>(simd, ray, Q::limit(state, ray))).0;
    }
    let lanes = block.occluders::<S, STREAM>(simd, ray);
    match Q::JUDGES || B::OCCLUDERS_ARE_SURE {
        true => lanes,
        false => {
            let first = block.first_occluder(LanesOf(lanes), ray, filters);
            first.map_or(0, |lane| 1 << lane)
        }
    }
}

/// The first half of the leaf step: the lanes of a leaf that may count, as bits. In a ray stream (`STREAM`) without branches that
/// are hard to predict, even if it takes longer from end to end: other rays fill the gaps, but a wrong guess throws their work
/// away too. Leaves of cut-outs do not come here then.
#[inline(always)]
pub(crate) fn leaf_lanes<S: Simd, Q: Query, V: View, const STREAM: bool>(
    state: &Q::State,
    simd: S,
    (tree, view): (&Tree, V),
    leaf: Leaf,
    ray: &RaySetup,
) -> u32 {
    match leaf.kind {
        PrimKind::Triangle => {
            let block = view.triangles(simd, tree, leaf.index);
            lanes::<S, Q, _, STREAM>(state, simd, &*block, ray, &tree.filters)
        }
        PrimKind::Cutout if !STREAM => {
            let block = &tree.blocks.cutouts[leaf.index];
            lanes::<S, Q, _, STREAM>(state, simd, block, ray, &tree.filters)
        }
        PrimKind::Curve => {
            let block = &tree.blocks.curves[leaf.index];
            lanes::<S, Q, _, STREAM>(state, simd, block, ray, &tree.filters)
        }
        _ => other_lanes::<Q>(state, tree, leaf, ray),
    }
}

/// [`leaf_lanes`] without vectors. Away from the loops, which need their registers for triangles: 2 % of the instructions of
/// occlusion in batches (AVX2).
#[cold]
#[inline(never)]
fn other_lanes<Q: Query>(state: &Q::State, tree: &Tree, leaf: Leaf, ray: &RaySetup) -> u32 {
    on_leaf!(tree, leaf, block => lanes::<Scalar, Q, _, false>(state, Scalar, block, ray, &tree.filters))
}

/// The second half: judges these lanes. Whether the state has changed.
#[inline(always)]
pub(crate) fn judge_lanes<S: Simd, Q: Query, V: View>(
    state: &mut Q::State,
    simd: S,
    (tree, view): (&Tree, V),
    (leaf, lanes): (Leaf, u32),
    ray: &RaySetup,
    owner: Owner<'_>,
) -> bool {
    match (Q::CONDITIONAL, leaf.kind) {
        (true, _) => judge_lanes_when::<Q, V>(state, (tree, view), (leaf, lanes), ray, owner),
        (false, PrimKind::Triangle) => {
            let block = view.triangles(simd, tree, leaf.index);
            let (lanes, condition) = (LanesOf(lanes), &Condition::NONE);
            Q::judge(state, &*block, lanes, ray, &tree.filters, condition)
        }
        (false, _) => judge_others::<Q>(state, tree, (leaf, lanes), ray),
    }
}

/// [`judge_lanes`] for any kind but triangles.
#[cold]
#[inline(never)]
fn judge_others<Q: Query>(
    state: &mut Q::State,
    tree: &Tree,
    (leaf, lanes): (Leaf, u32),
    ray: &RaySetup,
) -> bool {
    on_leaf!(tree, leaf, block => {
        Q::judge(state, block, LanesOf(lanes), ray, &tree.filters, &Condition::NONE)
    })
}

/// [`judge_lanes`] by the condition of the ray.
#[inline(never)]
fn judge_lanes_when<Q: Query, V: View>(
    state: &mut Q::State,
    (tree, view): (&Tree, V),
    (leaf, lanes): (Leaf, u32),
    ray: &RaySetup,
    owner: Owner<'_>,
) -> bool {
    owner.with(|condition| {
        on_seen_leaf!(Scalar, tree, view, leaf, block => {
            Q::judge(state, block, LanesOf(lanes), ray, &tree.filters, condition)
        })
    })
}
