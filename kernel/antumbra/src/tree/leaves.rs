//! The leaf blocks of a wide tree, kind by kind, and code that runs on whichever kind a leaf is.

use alloc::vec;
use alloc::vec::Vec;

use super::node::Leaf;
use super::slot_order::occupied_first;
use super::wide::Tree;
use crate::aabb::Aabb;
use crate::geometry::leaf_block::{InBlock, LeafBlock};
use crate::geometry::primitives::PrimKind;
use crate::geometry::primitives::kinds::for_each_kind;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::{BLOCK, PrimRef};
use crate::tree::costs::CostModel;

macro_rules! define_blocks {
    ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
        /// The leaf blocks of a tree.
        #[derive(Clone, Debug, Default)]
        pub(crate) struct LeafBlocks {
            $(pub $list: Vec<<$Type as InBlock>::Block>,)*
        }

        impl LeafBlocks {
            /// How many blocks there are of each kind.
            #[inline(always)]
            pub fn lens(&self) -> [usize; PrimKind::COUNT] {
                [$(self.$list.len()),*]
            }
        }
    };
}
for_each_kind!([define_blocks]);

impl LeafBlocks {
    /// The blocks of an empty tree: the one that empty slots refer to.
    pub fn empty() -> Self {
        Self {
            triangles: vec![TriangleBlock::EMPTY],
            ..Self::default()
        }
    }
}

/// Index of the first block that is a leaf. Triangle block 0 is empty: empty slots refer to it.
pub(crate) fn first_block(kind: PrimKind) -> usize {
    usize::from(kind == PrimKind::Triangle)
}

/// Runs the same code on the list of blocks of every kind, in the numbering of leaves.
macro_rules! on_each_kind {
    ($tree:expr, $blocks:ident => $body:expr) => {
        $crate::geometry::primitives::kinds::for_each_kind! {
            [$crate::tree::leaves::on_each_list] as_slice ($tree) $blocks ($body)
        }
    };
    (mut $tree:expr, $blocks:ident => $body:expr) => {
        $crate::geometry::primitives::kinds::for_each_kind! {
            [$crate::tree::leaves::on_each_list] as_mut_slice ($tree) $blocks ($body)
        }
    };
}
pub(crate) use on_each_kind;

macro_rules! on_each_list {
    (
        $borrow:ident ($tree:expr) $blocks:ident ($body:expr)
        $(($Kind:ident, $list:ident, $Type:ty, $first:literal))*
    ) => {{
        $({
            let $blocks = $tree.blocks.$list.$borrow();
            $body
        })*
    }};
}
pub(crate) use on_each_list;

/// Runs the same code on the block of a leaf, of whatever kind.
macro_rules! on_leaf {
    ($tree:expr, $leaf:expr, $block:ident => $body:expr) => {
        $crate::geometry::primitives::kinds::for_each_kind! {
            [$crate::tree::leaves::on_block] ($tree) ($leaf) $block ($body)
        }
    };
}
pub(crate) use on_leaf;

macro_rules! on_block {
    (
        ($tree:expr) ($leaf:expr) $block:ident ($body:expr)
        $(($Kind:ident, $list:ident, $Type:ty, $first:literal))*
    ) => {{
        let $crate::tree::node::Leaf { kind, index } = $leaf;
        match kind {
            $($crate::geometry::primitives::PrimKind::$Kind => {
                let $block = &$tree.blocks.$list[index];
                $body
            })*
        }
    }};
}
pub(crate) use on_block;

/// A primitive in a leaf.
pub(crate) struct LeafPrim {
    pub id: PrimRef,
    pub bounds: Aabb,
}

impl Tree {
    /// Number of a leaf among the leaves of all kinds: triangle blocks first, the empty one included.
    #[inline(always)]
    pub(crate) fn leaf_index(&self, leaf: Leaf) -> usize {
        let before = &self.blocks.lens()[..leaf.kind as usize];
        before.iter().sum::<usize>() + leaf.index
    }

    /// Number of leaves of all kinds, the empty triangle block included.
    pub(crate) fn leaf_count(&self) -> usize {
        self.blocks.lens().iter().sum()
    }

    /// How many primitives are in a leaf.
    pub fn leaf_len(&self, leaf: Leaf) -> usize {
        on_leaf!(self, leaf, block => block.count())
    }

    /// Names and bounds of the primitives in a leaf.
    pub(crate) fn leaf_prims(&self, leaf: Leaf) -> Vec<LeafPrim> {
        on_leaf!(self, leaf, block => prims_of(block))
    }

    /// `C_p N_p`: cost of testing the primitives of a leaf.
    pub fn leaf_cost(&self, leaf: Leaf, model: &CostModel) -> f64 {
        f64::from(model.of(leaf.kind)) * self.leaf_len(leaf) as f64
    }

    /// Permutes the lanes of every leaf, given in the order of [`Tree::leaf_index`].
    pub(super) fn permute_leaves(&mut self, mut lanes: &[[u8; BLOCK]]) {
        on_each_kind!(mut self, blocks => lanes = permute(blocks, lanes));
        debug_assert!(lanes.is_empty());
    }

    /// Bytes of all leaf blocks.
    pub(super) fn leaf_bytes(&self) -> usize {
        let mut bytes = 0;
        on_each_kind!(self, blocks => bytes += size_of_val(blocks));
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
        let mut lanes = *lanes;
        occupied_first(&mut lanes, block.count());
        block.permute(&lanes);
    }
    others
}
