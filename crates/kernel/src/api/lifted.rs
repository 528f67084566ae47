//! Lifted occluders: the few triangles that occlude many rays, tested before the root or put at the top of the tree, and
//! leaves that nodes above refer to.

use alloc::vec;
use alloc::vec::Vec;

use antumbra_simd::Dispatch;

use super::bvh::Bvh;
use super::learn::BinaryStage;
use crate::collapse::lift_leaves::{Addition, Gains, Lift};
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::Primitives;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::{BLOCK, PrimRef};
use crate::prim_id::PrimId;
use crate::ray::{INVALID_ID, Ray};
use crate::trace::lifted::TestLifted;
use crate::trace::pick::Pick;
use crate::tree::any::{Tree, on_tree};
use crate::tree::costs::CostModel;
use crate::tree::node::{ChildKind, Leaf};
use crate::tree::wide::WideTree;

/// Names of opaque triangles that lie in the world itself, the most useful first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrequentOccluders(Vec<PrimRef>);

impl FrequentOccluders {
    /// At most `count` triangles that together occlude many of these rays: each is the one that occludes most of the rays
    /// that those before it let pass. Of equals the smaller (geom_id, prim_id) comes first.
    ///
    /// Cut-outs, quads, spheres, user geometry and what lies in instances are left out. Fewer triangles if they occlude all
    /// rays that any triangle occludes.
    pub fn new(bvh: &Bvh, rays: &[Ray], count: usize) -> Self {
        let mut known = on_tree!(&bvh.tree, tree => opaque_triangles(tree));
        known.sort_unstable();
        let lists = bvh.batch(rays).all_hits();
        let mut met = Vec::with_capacity(lists.hits.len());
        for ray in 0..lists.len() {
            let hits = lists.of(ray).iter();
            for hit in hits.filter(|hit| hit.inst_id == INVALID_ID) {
                let id = PrimRef {
                    geom_id: hit.geom_id,
                    prim_id: hit.prim_id,
                };
                if known.binary_search(&id).is_ok() {
                    met.push((id, ray));
                }
            }
        }
        met.sort_unstable();
        let mut passes = vec![true; rays.len()];
        let mut chosen = Vec::new();
        while chosen.len() < count {
            let groups = met.chunk_by(|(a, _), (b, _)| a == b);
            let occluded = |group: &[(PrimRef, usize)]| {
                let rays = group.iter().filter(|(_, ray)| passes[*ray]);
                rays.count()
            };
            // The first of equals.
            let best = groups.rev().max_by_key(|group| occluded(group));
            let Some(best) = best.filter(|group| occluded(group) > 0) else {
                break;
            };
            chosen.push(best[0].0);
            for (_, ray) in best {
                passes[*ray] = false;
            }
        }
        Self(chosen)
    }

    /// Names of the triangles.
    pub fn ids(&self) -> impl Iterator<Item = PrimId> + '_ {
        self.0.iter().map(|id| PrimId {
            inst_id: INVALID_ID,
            geom_id: id.geom_id,
            prim_id: id.prim_id,
        })
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Numbers of these triangles among the primitives of a world; of those that it has.
    fn numbers(&self, primitives: &Primitives) -> Vec<u32> {
        let [opaque, ..] = primitives.kind_starts();
        let place = |id: &PrimRef| {
            let ids = &primitives.triangle_refs[..opaque];
            ids.iter().position(|other| other == id)
        };
        self.0
            .iter()
            .filter_map(place)
            .map(|place| place as u32)
            .collect()
    }
}

/// Names of the opaque triangles that lie in the world itself.
fn opaque_triangles<const N: usize>(bvh: &WideTree<N>) -> Vec<PrimRef> {
    let mut ids = Vec::new();
    for block in world_blocks(bvh) {
        ids.extend((0..block.count()).map(|lane| LeafBlock::id(block, lane)));
    }
    ids
}

/// Blocks of opaque triangles that lie in the world itself.
fn world_blocks<const N: usize>(bvh: &WideTree<N>) -> impl Iterator<Item = &TriangleBlock> {
    let nodes = bvh.nodes[..bvh.top_nodes()].iter();
    let children = nodes.flat_map(|node| (0..node.len()).map(|slot| node.child(slot)));
    children.filter_map(|child| match child.kind() {
        ChildKind::Leaf(Leaf::Triangles(index)) => Some(&bvh.triangle_blocks[index]),
        _ => None,
    })
}

/// Copies of triangles as leaf blocks.
fn copies<const N: usize>(bvh: &WideTree<N>, ids: &[PrimRef]) -> Vec<TriangleBlock> {
    let mut blocks = vec![TriangleBlock::EMPTY; ids.len().div_ceil(BLOCK)];
    let mut missing = vec![true; ids.len()];
    for block in world_blocks(bvh) {
        for lane in 0..block.count() {
            let id = LeafBlock::id(block, lane);
            if let Some(place) = ids.iter().position(|other| *other == id)
                && core::mem::take(&mut missing[place])
            {
                blocks[place / BLOCK].set(place % BLOCK, &block.triangle(lane), id);
            }
        }
    }
    blocks
}

/// A tree whose occlusion queries test copies of frequent occluders before the root. All answers are those of the tree.
#[derive(Clone, Debug)]
pub struct LiftedFirstBvh {
    bvh: Bvh,
    blocks: Vec<TriangleBlock>,
}

impl LiftedFirstBvh {
    /// A copy of a tree, and copies of triangles of it.
    pub fn new(bvh: &Bvh, occluders: &FrequentOccluders) -> Self {
        Self {
            bvh: bvh.clone(),
            blocks: on_tree!(&bvh.tree, tree => copies(tree, &occluders.0)),
        }
    }

    /// [`Bvh::occluded`].
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut occluded = [false];
        self.occluded_at_once(core::slice::from_ref(ray), &mut occluded);
        occluded[0] || self.bvh.occluded(ray)
    }

    /// [`Bvh::occluded_batch`] on the calling thread.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_at_once(rays, occluded);
        let passes = |index: &usize| !occluded[*index];
        let left: Vec<_> = (0..rays.len()).filter(passes).collect();
        let rest: Vec<_> = left.iter().map(|index| rays[*index]).collect();
        let mut answers = vec![false; rest.len()];
        self.bvh
            .batch(&rest)
            .on_this_thread()
            .occluded(&mut answers);
        for (index, answer) in left.into_iter().zip(answers) {
            occluded[index] = answer;
        }
    }

    /// Whether a lifted occluder occludes each ray.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_at_once(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        self.bvh.isa().dispatch(TestLifted {
            reach: on_tree!(&self.bvh.tree, tree => tree.reach),
            blocks: &self.blocks,
            rays,
            occluded,
        });
    }
}

impl BinaryStage {
    /// The stage with frequent occluders at the top of the tree of the world: one leaf block of them after the other if
    /// `in_blocks`, else one leaf for each.
    ///
    /// # Panics
    /// If the tree was built over other primitives.
    pub fn with_lifted(
        &self,
        primitives: &Primitives,
        occluders: &FrequentOccluders,
        in_blocks: bool,
    ) -> Self {
        self.tree().assert_is_of(primitives);
        let prims = occluders.numbers(primitives);
        let per_leaf = if in_blocks { BLOCK } else { 1 };
        Self::of_tree(self.tree().with_lifted(primitives, &prims, per_leaf))
    }
}

impl Bvh {
    /// The tree with leaves lifted for these rays, in the order of [`Bvh::relearn`], and how many were lifted. Copies by
    /// octant answer as they are.
    fn with_lifted_leaves(&self, rays: &[Ray], costs: &CostModel, lift: Lift) -> (Self, usize) {
        if rays.is_empty() || self.has_copies() {
            return (self.clone(), 0);
        }
        let (tree, count) = match &self.tree {
            Tree::W4(tree) => {
                let (tree, count) = self.lifted(tree, rays, costs, lift);
                (Tree::W4(tree), count)
            }
            Tree::W8(tree) => {
                let (tree, count) = self.lifted(tree, rays, costs, lift);
                (Tree::W8(tree), count)
            }
            Tree::W16(tree) => {
                let (tree, count) = self.lifted(tree, rays, costs, lift);
                (Tree::W16(tree), count)
            }
        };
        let mut bvh = Self {
            tree,
            ..self.clone()
        };
        bvh.relearn(rays, costs);
        (bvh, count)
    }

    fn lifted<const N: usize>(
        &self,
        tree: &WideTree<N>,
        rays: &[Ray],
        costs: &CostModel,
        lift: Lift,
    ) -> (WideTree<N>, usize) {
        let mut gains = Gains::new(tree, costs, lift);
        self.observe(Pick::Slots, &mut gains, rays, &mut vec![false; rays.len()]);
        let additions = gains.additions();
        let count = additions.iter().map(Addition::len).sum();
        (tree.with_additions(&additions, lift), count)
    }

    /// The tree with leaves that occlude many of these rays moved to nodes above, where that costs the rays less, and the
    /// number of these leaves. Its order is that of [`Bvh::relearn`].
    pub(super) fn moved_up(&self, rays: &[Ray], costs: &CostModel) -> (Self, usize) {
        self.with_lifted_leaves(rays, costs, Lift::Move)
    }
}

/// A tree in which nodes above refer to leaves that occlude many rays as well. It answers occlusion and nothing else: other
/// queries would come to primitives twice.
#[derive(Clone, Debug)]
pub struct DuplicatesBvh {
    bvh: Bvh,
    count: usize,
}

impl DuplicatesBvh {
    /// A copy of a tree with references that pay for these rays, in the order of [`Bvh::relearn`].
    pub fn new(bvh: &Bvh, rays: &[Ray], costs: &CostModel) -> Self {
        let (bvh, count) = bvh.with_lifted_leaves(rays, costs, Lift::Duplicate);
        Self { bvh, count }
    }

    /// Number of references added.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The tree. Occlusion queries alone give right answers.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }
}
