//! The binary tree that every builder makes and every collapse starts from.

use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::geometry::primitives::Primitives;
use crate::geometry::primitives::identity::Identity;

/// A binary tree over primitives, with at most [`BLOCK`](crate::parts::BLOCK) of one kind per leaf.
///
/// Every primitive is in one leaf, or in several if a builder has split it. Each of those
/// leaves has a box around a part of it, and together they hold it all.
///
/// Nodes are in depth-first order: a left child follows its parent at once. An instance is a leaf of its own, and every
/// object that is placed has a tree of its own. A tree over nothing has no nodes.
#[derive(Clone, Debug, Default)]
pub struct BinaryTree {
    /// In depth-first order.
    pub nodes: Vec<BinaryNode>,
    /// Indices of primitives, as [`Primitives::bounds_of`] counts them; leaves own ranges of it.
    pub prims: Vec<u32>,
    /// The trees of all objects; empty where no instance needs one.
    pub(crate) objects: Vec<BinaryTree>,
    /// Identity of the primitives that the tree was built over.
    pub(crate) identity: Identity,
}

/// A node of a [`BinaryTree`].
#[derive(Clone, Copy, Debug)]
pub struct BinaryNode {
    /// A box around all that is below.
    pub bounds: Aabb,
    /// A leaf, or an inner node.
    pub kind: BinaryKind,
}

/// Contents of a node.
#[derive(Clone, Copy, Debug)]
pub enum BinaryKind {
    /// Two children: the left one is the next node, the right one is `right` places behind this node.
    Inner {
        /// Places from this node to its right child.
        right: u32,
    },
    /// `count` entries of [`BinaryTree::prims`] from `first`.
    Leaf {
        /// Index of the first.
        first: u32,
        /// How many they are.
        count: u32,
    },
}

impl BinaryTree {
    /// A tree without objects from its nodes, in depth-first order, and the primitives of its leaves.
    pub fn new(nodes: Vec<BinaryNode>, prims: Vec<u32>) -> Self {
        Self {
            nodes,
            prims,
            ..Self::default()
        }
    }

    /// Number of nodes, with leaves and the nodes of objects; 0 of a tree over nothing.
    pub fn node_count(&self) -> usize {
        let objects = self.objects.iter();
        self.nodes.len() + objects.map(Self::node_count).sum::<usize>()
    }

    /// Whether the tree was built over these primitives, or a clone of them.
    pub fn is_of(&self, primitives: &Primitives) -> bool {
        self.identity == primitives.identity
    }

    /// Panics unless the tree was built over these primitives: its leaves would hold wrong ones.
    pub(crate) fn assert_is_of(&self, primitives: &Primitives) {
        assert!(
            self.is_of(primitives),
            "the binary tree was built over other primitives"
        );
    }

    /// The indices of the children of an inner node; `None` for a leaf.
    pub fn children(&self, node: usize) -> Option<[usize; 2]> {
        match self.nodes[node].kind {
            BinaryKind::Inner { right } => Some([node + 1, node + right as usize]),
            BinaryKind::Leaf { .. } => None,
        }
    }
}
