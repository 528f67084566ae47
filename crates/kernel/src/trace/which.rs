//! An occlusion query that also tells which leaf occludes.

use antumbra_simd::{Simd, Width};

use crate::geometry::cutout::opacity::QueryKind;
use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::instance_ray::Interval;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::VectorHits;
use crate::trace::query::{Occlusion, Query};
use crate::trace::stack::Stack;
use crate::trace::step::{NodeLanes, NodeMask, leaf_occluder};
use crate::tree::node::{Child, Leaf, Node};
use crate::tree::wide::WideTree;

/// A leaf of a tree, and the instance it was met in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Occluder {
    /// The leaf as a [`Child`]; 0, the root, for none.
    pub leaf: u32,
    /// Index of the instance plus 1; 0 for none.
    pub instance: u32,
    /// Address of a block of cut-outs, which a stream knows in place of the leaf; 0 otherwise.
    block: usize,
}

impl Occluder {
    /// The leaf, if there is one.
    pub fn leaf_of<const N: usize>(&self, bvh: &WideTree<N>) -> Option<Child> {
        if self.block == 0 {
            return (self.leaf != Child::ROOT.0).then_some(Child(self.leaf));
        }
        let first = bvh.cutout_blocks.as_ptr() as usize;
        let index = (self.block - first) / size_of::<CutoutBlock>();
        Some(Child::leaf(Leaf::Cutouts(index)))
    }

    /// Takes a leaf over if it occludes.
    #[inline(always)]
    fn found(&mut self, occluded: bool, leaf: Leaf) {
        let child = Child::leaf(leaf).0;
        self.leaf = core::hint::select_unpredictable(occluded, child, self.leaf);
    }

    /// Whether there is one.
    pub fn is_some(&self) -> bool {
        self.leaf != Child::ROOT.0 || self.block != 0
    }
}

/// Which leaf occludes? Goes the way of [`Occlusion`].
pub(crate) struct Which;

impl Query for Which {
    type Item = u32;
    type State = Occluder;
    type Answer = Occluder;

    const IDLE: Occluder = Occluder {
        leaf: Child::ROOT.0,
        instance: 0,
        block: 0,
    };

    #[inline(always)]
    fn finish(occluder: &Occluder) -> Occluder {
        *occluder
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
        occluder: &mut Occluder,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        let occluded = leaf_occluder::<S, N, false>(simd, bvh, leaf, ray).is_some();
        occluder.found(occluded, leaf);
        stack.clear_if(occluded);
    }

    #[inline(always)]
    fn leaf_in_stream<S: Simd, const N: usize>(
        occluder: &mut Occluder,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> u32 {
        let occluded = leaf_occluder::<S, N, true>(simd, bvh, leaf, ray).is_some();
        occluder.found(occluded, leaf);
        stack.clear_if(occluded);
        0
    }

    #[inline(always)]
    fn enter<const N: usize>(occluder: &mut Occluder, _: &WideTree<N>, index: usize, _: Interval) {
        occluder.instance = index as u32 + 1;
    }

    #[inline(always)]
    fn exit(occluder: &mut Occluder) {
        occluder.instance = 0;
    }

    #[inline(always)]
    fn cutout_hits<S: Simd>(
        _: &Occluder,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        block.triangles.vector_occluders(simd, ray)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        occluder: &mut Occluder,
        stack: &mut Stack<'_, u32>,
        _: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        if !occluder.is_some() && hit.counts(QueryKind::Occluded, ray, filters) {
            occluder.block = core::ptr::from_ref(hit.block) as usize;
            stack.clear_if(true);
        }
    }
}
