//! Some primitives taken out of a binary tree and put at its top.

use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::geometry::primitives::Primitives;
use crate::tree::binary::{BinaryKind, BinaryNode, BinaryTree};

/// What is left of a node without the primitives that are taken out.
#[derive(Clone, Copy)]
struct Left {
    bounds: Aabb,
    /// The node that stands in its place: itself, or the only one that is left below it. `None` if nothing is.
    node: Option<usize>,
}

impl BinaryTree {
    /// The tree with primitives of the world taken out and put at its top: below the root is a leaf of the first `per_leaf`
    /// of them and a node, below that the next leaf and a node, and below the last of these nodes the rest. Objects stay.
    ///
    /// All of these primitives are of one kind, and each of them is in the tree.
    pub(crate) fn with_lifted(
        &self,
        primitives: &Primitives,
        prims: &[u32],
        per_leaf: usize,
    ) -> Self {
        let left = self.left_without(primitives, prims);
        let mut tree = Self {
            nodes: Vec::with_capacity(self.nodes.len() + 2 * prims.len()),
            prims: Vec::with_capacity(self.prims.len()),
            objects: self.objects.clone(),
            identity: self.identity.clone(),
        };
        let is_empty = left.first().is_none_or(|root| root.node.is_none());
        let rest = left.first().map_or(Aabb::EMPTY, |root| root.bounds);
        let bounds = |prims: &[u32]| {
            let bounds = prims
                .iter()
                .map(|prim| primitives.bounds_of(*prim as usize));
            bounds.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds))
        };
        let leaves: Vec<_> = prims.chunks(per_leaf).collect();
        for (place, leaf) in leaves.iter().enumerate() {
            if !is_empty || place + 1 < leaves.len() {
                let below = leaves[place..].iter().map(|leaf| bounds(leaf));
                tree.nodes.push(BinaryNode {
                    bounds: below.fold(rest, |all, bounds| all.union(&bounds)),
                    kind: BinaryKind::Inner { right: 2 },
                });
            }
            let kind = tree.leaf(leaf.iter().copied());
            tree.nodes.push(BinaryNode {
                bounds: bounds(leaf),
                kind,
            });
        }
        tree.push_left(self, &left, prims);
        tree
    }

    /// What is left of each node.
    fn left_without(&self, primitives: &Primitives, prims: &[u32]) -> Vec<Left> {
        let nothing = Left {
            bounds: Aabb::EMPTY,
            node: None,
        };
        let mut left = vec![nothing; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate().rev() {
            left[index] = match (node.kind, self.children(index)) {
                (_, Some(children)) => {
                    let [a, b] = children.map(|child| left[child]);
                    Left {
                        bounds: a.bounds.union(&b.bounds),
                        node: match (a.node, b.node) {
                            (Some(_), Some(_)) => Some(index),
                            (one, other) => one.or(other),
                        },
                    }
                }
                (BinaryKind::Leaf { first, count }, _) => {
                    let all = &self.prims[first as usize..(first + count) as usize];
                    if all.iter().all(|prim| !prims.contains(prim)) {
                        Left {
                            bounds: node.bounds,
                            node: Some(index),
                        }
                    } else {
                        let stays = all.iter().filter(|prim| !prims.contains(prim));
                        let bounds = stays.map(|prim| primitives.bounds_of(*prim as usize));
                        bounds.fold(nothing, |all, bounds| Left {
                            bounds: all.bounds.union(&bounds),
                            node: Some(index),
                        })
                    }
                }
                (BinaryKind::Inner { .. }, None) => unreachable!("an inner node has children"),
            };
        }
        left
    }

    /// Appends what is left of another tree.
    fn push_left(&mut self, other: &Self, left: &[Left], without: &[u32]) {
        // Where nodes of the other tree stand in this one.
        let mut places = vec![usize::MAX; other.nodes.len()];
        for (index, node) in other.nodes.iter().enumerate() {
            if left[index].node != Some(index) {
                continue;
            }
            places[index] = self.nodes.len();
            let kind = match node.kind {
                BinaryKind::Inner { right } => BinaryKind::Inner { right },
                BinaryKind::Leaf { first, count } => {
                    let all = &other.prims[first as usize..(first + count) as usize];
                    self.leaf(all.iter().copied().filter(|prim| !without.contains(prim)))
                }
            };
            self.nodes.push(BinaryNode {
                bounds: left[index].bounds,
                kind,
            });
        }
        for (index, &place) in places.iter().enumerate() {
            if place != usize::MAX
                && let Some([_, right]) = other.children(index)
                && let Some(right) = left[right].node
            {
                let right = (places[right] - place) as u32;
                self.nodes[place].kind = BinaryKind::Inner { right };
            }
        }
    }

    /// Appends the primitives of a leaf.
    fn leaf(&mut self, prims: impl Iterator<Item = u32>) -> BinaryKind {
        let first = self.prims.len() as u32;
        self.prims.extend(prims);
        BinaryKind::Leaf {
            first,
            count: self.prims.len() as u32 - first,
        }
    }
}
