//! The leaf blocks of a wide tree, kind by kind: the only list of kinds that a tree has.

use alloc::vec::Vec;

use super::node::Leaf;
use super::slot_order::occupied_first;
use super::wide::WideTree;
use crate::aabb::Aabb;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::{BLOCK, PrimRef};
use crate::tree::costs::CostModel;

/// Runs the same code on the list of blocks of every kind, in the numbering of leaves.
macro_rules! on_each_kind {
    ($tree:expr, $blocks:ident => $body:expr) => {{
        {
            let $blocks = &$tree.triangle_blocks;
            $body
        }
        {
            let $blocks = &$tree.sphere_blocks;
            $body
        }
        {
            let $blocks = &$tree.cutout_blocks;
            $body
        }
        {
            let $blocks = &$tree.user_blocks;
            $body
        }
    }};
    (mut $tree:expr, $blocks:ident => $body:expr) => {{
        {
            let $blocks = &mut $tree.triangle_blocks;
            $body
        }
        {
            let $blocks = &mut $tree.sphere_blocks;
            $body
        }
        {
            let $blocks = &mut $tree.cutout_blocks;
            $body
        }
        {
            let $blocks = &mut $tree.user_blocks;
            $body
        }
    }};
}

/// Runs the same code on the list of blocks that a leaf belongs to, given its index there.
macro_rules! on_leaf {
    ($tree:expr, $leaf:expr, ($blocks:ident, $index:ident) => $body:expr) => {
        match $leaf {
            Leaf::Triangles($index) => {
                let $blocks = &$tree.triangle_blocks;
                $body
            }
            Leaf::Spheres($index) => {
                let $blocks = &$tree.sphere_blocks;
                $body
            }
            Leaf::Cutouts($index) => {
                let $blocks = &$tree.cutout_blocks;
                $body
            }
            Leaf::Users($index) => {
                let $blocks = &$tree.user_blocks;
                $body
            }
        }
    };
}

/// A primitive in a leaf.
pub(crate) struct LeafPrim {
    pub id: PrimRef,
    pub bounds: Aabb,
}

impl<const N: usize> WideTree<N> {
    /// Number of a leaf among those of all kinds: triangle blocks first, the empty one included.
    #[inline(always)]
    pub fn leaf_index(&self, leaf: Leaf) -> usize {
        match leaf {
            Leaf::Triangles(index) => index,
            Leaf::Spheres(index) => self.triangle_blocks.len() + index,
            Leaf::Cutouts(index) => self.triangle_blocks.len() + self.sphere_blocks.len() + index,
            Leaf::Users(index) => {
                let others = [self.sphere_blocks.len(), self.cutout_blocks.len()];
                self.triangle_blocks.len() + others[0] + others[1] + index
            }
        }
    }

    /// How many numbers [`WideTree::leaf_index`] gives.
    pub fn leaf_count(&self) -> usize {
        let mut count = 0;
        on_each_kind!(self, blocks => count += blocks.len());
        count
    }

    /// How many primitives are in a leaf; `None` if the tree has no such leaf.
    pub fn leaf_len_checked(&self, leaf: Leaf) -> Option<usize> {
        on_leaf!(self, leaf, (blocks, index) => blocks.get(index).map(LeafBlock::count))
    }

    /// How many primitives are in a leaf.
    pub fn leaf_len(&self, leaf: Leaf) -> usize {
        on_leaf!(self, leaf, (blocks, index) => LeafBlock::count(&blocks[index]))
    }

    /// Names and bounds of the primitives in a leaf.
    pub fn leaf_prims(&self, leaf: Leaf) -> Vec<LeafPrim> {
        on_leaf!(self, leaf, (blocks, index) => prims_of(&blocks[index]))
    }

    /// `C_p N_p`: cost of testing the primitives of a leaf.
    pub fn leaf_cost(&self, leaf: Leaf, model: &CostModel) -> f64 {
        f64::from(model.of(leaf.kind())) * self.leaf_len(leaf) as f64
    }

    /// Permutes the lanes of every leaf, given in the order of [`WideTree::leaf_index`].
    pub(super) fn permute_leaves(&mut self, mut lanes: &[[u8; BLOCK]]) {
        on_each_kind!(mut self, blocks => lanes = permute(blocks, lanes));
        debug_assert!(lanes.is_empty());
    }

    /// Bytes of all leaf blocks.
    pub(super) fn leaf_bytes(&self) -> usize {
        let mut bytes = 0;
        on_each_kind!(self, blocks => bytes += size_of_val(&blocks[..]));
        bytes
    }
}

fn prims_of<B: LeafBlock>(block: &B) -> Vec<LeafPrim> {
    (0..block.count())
        .map(|lane| LeafPrim {
            id: block.id(lane),
            bounds: block.bounds(lane),
        })
        .collect()
}

/// Permutes the blocks of one kind and returns the permutations of the others.
fn permute<'a, B: LeafBlock>(blocks: &mut [B], lanes: &'a [[u8; BLOCK]]) -> &'a [[u8; BLOCK]] {
    let (own, others) = lanes.split_at(blocks.len());
    for (block, lanes) in blocks.iter_mut().zip(own) {
        block.permute(&occupied_first(lanes, block.count()));
    }
    others
}
