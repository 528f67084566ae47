//! Subtrees put together from below, for builders that make no more of it than that.

use antumbra::Aabb;
use antumbra::parts::{BinaryKind, BinaryNode, BinaryTree};

/// A subtree: its nodes in depth-first order, and what its leaves hold, leaf after leaf.
#[derive(Default)]
pub(crate) struct Piece {
    nodes: Vec<BinaryNode>,
    prims: Vec<u32>,
}

impl Piece {
    /// A leaf.
    pub fn leaf(bounds: Aabb, prims: Vec<u32>) -> Self {
        let kind = BinaryKind::Leaf {
            first: 0,
            count: prims.len() as u32,
        };
        Self {
            nodes: vec![BinaryNode { bounds, kind }],
            prims,
        }
    }

    /// A node with two children.
    fn parent(bounds: Aabb, left: Self, right: Self) -> Self {
        let kind = BinaryKind::Inner {
            right: 1 + left.nodes.len() as u32,
        };
        let mut nodes = Vec::with_capacity(1 + left.nodes.len() + right.nodes.len());
        nodes.push(BinaryNode { bounds, kind });
        nodes.extend(left.nodes);
        let before = left.prims.len() as u32;
        nodes.extend(right.nodes.into_iter().map(|mut node| {
            if let BinaryKind::Leaf { first, .. } = &mut node.kind {
                *first += before;
            }
            node
        }));
        let mut prims = left.prims;
        prims.extend(right.prims);
        Self { nodes, prims }
    }

    /// A node whose children are built from two parts, at the same time if these are large.
    pub fn of_parts<T: Send>(
        bounds: Aabb,
        [left, right]: [T; 2],
        are_large: bool,
        build: impl Fn(T) -> Self + Sync,
    ) -> Self {
        let (left, right) = match are_large {
            true => rayon::join(|| build(left), || build(right)),
            false => (build(left), build(right)),
        };
        Self::parent(bounds, left, right)
    }

    /// The whole tree.
    pub fn into_tree(self) -> BinaryTree {
        BinaryTree::new(self.nodes, self.prims)
    }
}

impl From<BinaryTree> for Piece {
    fn from(tree: BinaryTree) -> Self {
        let BinaryTree { nodes, prims, .. } = tree;
        Self { nodes, prims }
    }
}
