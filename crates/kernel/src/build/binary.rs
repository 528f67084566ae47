//! The binary tree that every builder makes and every collapse starts from.

use super::{Builder, binned_sah, parallel, reinsertion, two_levels};
use crate::aabb::Aabb;
use crate::primitives::Primitives;

/// A binary tree over primitives, with at most [`crate::BLOCK`] of one kind per leaf.
///
/// Nodes stand in depth-first order: a left child follows its parent at once. An instance is a leaf of its
/// own, and every object that is placed has a tree of its own.
#[derive(Clone, Debug, Default)]
pub struct BinaryTree {
    pub(crate) nodes: Vec<BinaryNode>,
    /// Indices of primitives, as `Primitives::bounds_of` counts them; leaves own ranges of it.
    pub(crate) prims: Vec<u32>,
    /// The trees of all objects; empty where no instance needs one.
    pub(crate) objects: Vec<BinaryTree>,
}

/// A node of a [`BinaryTree`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryNode {
    pub bounds: Aabb,
    pub kind: BinaryKind,
}

/// What is below a node.
#[derive(Clone, Copy, Debug)]
pub(crate) enum BinaryKind {
    /// The left child is the next node; the right one so many places further than this node.
    Inner { right: u32 },
    /// `count` entries of [`BinaryTree::prims`] from `first`.
    Leaf { first: u32, count: u32 },
}

impl BinaryTree {
    /// Builds a tree over all primitives; empty for none. Uses the rayon pool that is current, if the
    /// `parallel` feature is on; the tree does not depend on the number of threads.
    pub fn build(primitives: &Primitives, builder: Builder) -> Self {
        let build = |primitives: &Primitives| match builder {
            Builder::BinnedSah => binned_sah::build(primitives),
            Builder::Reinsertion => reinsertion::build(primitives),
        };
        if primitives.instances.is_empty() {
            return build(primitives);
        }
        let (mut tree, objects) = parallel::join(
            || {
                let tree = two_levels::with_instances(&build(primitives), primitives);
                match builder {
                    Builder::BinnedSah => tree,
                    Builder::Reinsertion => reinsertion::improved(&tree),
                }
            },
            || {
                parallel::map(primitives.objects.len(), 1, |object| {
                    build(&primitives.objects[object])
                })
            },
        );
        tree.objects = objects;
        tree
    }

    /// How many nodes it has, leaves included and those of objects.
    pub fn node_count(&self) -> usize {
        let objects = self.objects.iter();
        self.nodes.len() + objects.map(Self::node_count).sum::<usize>()
    }

    /// The indices of the children of an inner node; `None` for a leaf.
    pub(crate) fn children(&self, node: usize) -> Option<[usize; 2]> {
        match self.nodes[node].kind {
            BinaryKind::Inner { right } => Some([node + 1, node + right as usize]),
            BinaryKind::Leaf { .. } => None,
        }
    }
}
