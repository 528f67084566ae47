//! The collapse of least cost, given what visiting each node costs: for rays that were seen, or for random lines.
//!
//! Source: the dynamic programme of Ylitie, Karras and Laine (2017), "Efficient Incoherent Ray Traversal on
//! GPUs Through Compressed Wide BVHs", section 3.1. Theirs minimises the surface area heuristic; for rays that
//! were seen, their weight takes the place of a node's area. Let `F(x, k)` be the least cost of what is below binary
//! node `x` when `k` slots of its parent are given to it:
//!
//! ```text
//! D(x, k) = min over 0 < i < k of F(left, i) + F(right, k - i)
//! F(x, 1) = w(x) + D(x, N)                   x becomes a node of its own
//! F(x, k) = min(F(x, 1), D(x, k))            or its children take the slots
//! ```
//!
//! Leaves are the same in every collapse, so they cost nothing here.

use alloc::vec;
use alloc::vec::Vec;

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};

use crate::collapse::skeleton::{Children, Contraction};
use crate::parallel::join;
use crate::tree::binary::{BinaryKind, BinaryTree};
use crate::tree::node::MAX_WIDTH;

/// Subtrees of at most this many nodes are computed by one thread.
const SEQUENTIAL: usize = 2048;

/// For each binary node `x` and number of slots `k`, how many of them its left child is best given, in
/// `splits[width x + k - 1]`; 0 where `x` is best a node of its own.
pub(crate) struct CheapestCollapse {
    width: usize,
    splits: Vec<u8>,
}

impl CheapestCollapse {
    /// Finds the cheapest collapse to nodes of `width` children. `weights` has, per binary node, the cost of visiting an
    /// inner one, were it a node of the wide tree: finite and not negative.
    pub fn new(tree: &BinaryTree, weights: &[f32], width: usize) -> Self {
        match width {
            4 => Self::of::<4>(tree, weights),
            8 => Self::of::<8>(tree, weights),
            _ => Self::of::<16>(tree, weights),
        }
    }

    /// For nodes of `N` children.
    fn of<const N: usize>(tree: &BinaryTree, weights: &[f32]) -> Self {
        let mut splits = vec![[0; N]; tree.nodes.len()];
        if !splits.is_empty() {
            let search = Search {
                tree,
                weights,
                isa: Isa::best(),
            };
            search.cheapest(0, &mut splits);
        }
        Self {
            width: N,
            splits: splits.into_flattened(),
        }
    }
}

impl Contraction for CheapestCollapse {
    fn children(&self, tree: &BinaryTree, binary: usize, width: usize) -> Children {
        let mut children = Children::new(binary);
        let mut slots = [0; MAX_WIDTH];
        slots[0] = width;
        let mut place = 0;
        while place < children.len() {
            let node = children.as_slice()[place] as usize;
            let left = usize::from(self.splits[node * self.width + slots[place] - 1]);
            match tree.children(node) {
                Some(pair) if left > 0 => {
                    slots.copy_within(place + 1..children.len(), place + 2);
                    children.open(place, pair);
                    slots[place + 1] = slots[place] - left;
                    slots[place] = left;
                }
                _ => place += 1,
            }
        }
        children
    }
}

/// The result of the recursion for a node.
#[derive(Clone, Copy)]
struct Cheapest<const N: usize> {
    /// `F(x, 1..=N)`.
    costs: [f32; N],
    /// Leaves below it, or N if they are more: further slots gain nothing.
    leaves: usize,
}

impl<const N: usize> Cheapest<N> {
    const LEAF: Self = Self {
        costs: [0.0; N],
        leaves: 1,
    };
}

/// Input of the recursion, the same for all nodes.
struct Search<'a> {
    tree: &'a BinaryTree,
    weights: &'a [f32],
    isa: Isa,
}

impl Search<'_> {
    /// The recursion for `node`. Fills in `splits`, which has an entry for the node and for each node below it.
    fn cheapest<const N: usize>(&self, node: usize, splits: &mut [[u8; N]]) -> Cheapest<N> {
        let Some([left, right]) = self.tree.children(node) else {
            return Cheapest::LEAF;
        };
        if splits.len() <= SEQUENTIAL {
            let subtree = Subtree {
                search: self,
                node,
                splits,
            };
            return Dispatch::<8>::dispatch(self.isa, subtree);
        }
        let (own, below) = splits.split_first_mut().expect("begin at the node");
        // Depth-first order: everything below the left child comes before the right one.
        let (below_left, below_right) = below.split_at_mut(right - left);
        let (left, right) = join(
            || self.cheapest(left, below_left),
            || self.cheapest(right, below_right),
        );
        combine(self.weights[node], &left, &right, own)
    }
}

/// A subtree for one thread.
struct Subtree<'a, 'b, const N: usize> {
    search: &'a Search<'b>,
    node: usize,
    splits: &'a mut [[u8; N]],
}

impl<const N: usize> WithSimd<8> for Subtree<'_, '_, N> {
    type Output = Cheapest<N>;

    /// Goes from the last node to the first, so that children come before their parents. A loop with a stack, because a
    /// recursive function cannot be inlined and so not be compiled for the instruction set.
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, _: S) -> Cheapest<N> {
        let Self {
            search,
            node: first,
            splits,
        } = self;
        // Subtrees that have no parent yet, those standing first in the tree on top.
        let mut done: Vec<Cheapest<N>> = Vec::new();
        for (place, split) in splits.iter_mut().enumerate().rev() {
            let node = first + place;
            let found = match search.tree.nodes[node].kind {
                BinaryKind::Leaf { .. } => Cheapest::LEAF,
                BinaryKind::Inner { .. } => {
                    let (left, right) = (done.pop(), done.pop());
                    let (left, right) = (left.expect("a child"), right.expect("a child"));
                    combine(search.weights[node], &left, &right, split)
                }
            };
            done.push(found);
        }
        done.pop().expect("at least one node")
    }
}

/// One step of the recursion.
#[inline(always)]
fn combine<const N: usize>(
    weight: f32,
    left: &Cheapest<N>,
    right: &Cheapest<N>,
    splits: &mut [u8; N],
) -> Cheapest<N> {
    let left_is_smaller = left.leaves <= right.leaves;
    let (small, large) = if left_is_smaller {
        (left, right)
    } else {
        (right, left)
    };
    // `D(k)` in place `k - 1`. All places are computed at once, as vectors; what is impossible is made infinite by what
    // comes before the costs of the larger child.
    let mut padded = [[f32::INFINITY; N], large.costs];
    let padded = padded.as_flattened_mut();
    let mut divided = [f32::INFINITY; N];
    let mut to_small = [0u32; N];
    for slots in 1..=small.leaves.min(N - 1) {
        let rest = &padded[N - slots..][..N];
        for place in 0..N {
            let cost = small.costs[slots - 1] + rest[place];
            let better = cost < divided[place];
            divided[place] = if better { cost } else { divided[place] };
            to_small[place] = if better {
                slots as u32
            } else {
                to_small[place]
            };
        }
    }
    // With all N slots, opening is never worse, so that a node of its own always has children.
    let alone = weight + divided[N - 1];
    let mut costs = [0.0; N];
    for place in 0..N {
        let to_small = to_small[place] as u8;
        let to_left = if left_is_smaller {
            to_small
        } else {
            place as u8 + 1 - to_small
        };
        let open = divided[place] <= alone;
        costs[place] = if open { divided[place] } else { alone };
        splits[place] = if open { to_left } else { 0 };
    }
    Cheapest {
        costs,
        leaves: (left.leaves + right.leaves).min(N),
    }
}

#[cfg(test)]
mod tests {
    use alloc::format;

    use super::*;
    use crate::aabb::Aabb;
    use crate::collapse::skeleton::Skeleton;
    use crate::tree::binary::{BinaryKind, BinaryNode};
    use antumbra_testkit::Rng;

    /// A tree with this number of leaves, of any shape.
    fn random_tree(rng: &mut Rng, leaves: usize, tree: &mut BinaryTree) {
        let node = tree.nodes.len();
        let bounds = Aabb::EMPTY;
        let kind = BinaryKind::Leaf { first: 0, count: 1 };
        tree.nodes.push(BinaryNode { bounds, kind });
        if leaves > 1 {
            let left = 1 + rng.below(leaves - 1);
            random_tree(rng, left, tree);
            let right = (tree.nodes.len() - node) as u32;
            tree.nodes[node].kind = BinaryKind::Inner { right };
            random_tree(rng, leaves - left, tree);
        }
    }

    /// Nodes below `node` that are leaves or chosen, seen from it: its children in the wide tree.
    fn children(tree: &BinaryTree, chosen: &[bool], node: usize) -> usize {
        let Some(pair) = tree.children(node) else {
            return 1;
        };
        pair.into_iter()
            .map(|child| {
                if chosen[child] {
                    1
                } else {
                    children(tree, chosen, child)
                }
            })
            .sum()
    }

    /// The least sum of weights over every choice of inner nodes that gives at most N children each.
    fn best_of_all<const N: usize>(tree: &BinaryTree, weights: &[f32]) -> f32 {
        let inner: Vec<_> = (1..tree.nodes.len())
            .filter(|&node| tree.children(node).is_some())
            .collect();
        let mut best = f32::INFINITY;
        for choice in 0..1u32 << inner.len() {
            let mut chosen = vec![false; tree.nodes.len()];
            chosen[0] = true;
            for (bit, &node) in inner.iter().enumerate() {
                chosen[node] = choice >> bit & 1 == 1;
            }
            let nodes = || (0..tree.nodes.len()).filter(|&node| chosen[node]);
            if nodes().all(|node| children(tree, &chosen, node) <= N) {
                best = best.min(nodes().map(|node| weights[node]).sum());
            }
        }
        best
    }

    fn is_cheapest<const N: usize>(seed: u64) {
        let mut rng = Rng::new(seed);
        for round in 0..400 {
            let mut tree = BinaryTree::default();
            let leaves = 2 + rng.below(7);
            random_tree(&mut rng, leaves, &mut tree);
            // Small whole numbers: sums are exact, ties and zeros frequent.
            let weights: Vec<_> = tree.nodes.iter().map(|_| rng.below(9) as f32).collect();
            let collapse = CheapestCollapse::of::<N>(&tree, &weights);
            let skeleton = Skeleton::new(&tree, &collapse, N);
            let cost: f32 = skeleton
                .nodes
                .iter()
                .map(|node| weights[node.binary as usize])
                .sum();
            let children = skeleton.all_children().iter();
            let leaves_found = children.filter(|child| child.offset == 0).count();
            let place = format!("seed {seed} round {round} width {N}");
            assert_eq!(leaves_found, leaves, "{place}");
            assert_eq!(cost, best_of_all::<N>(&tree, &weights), "{place}");
        }
    }

    #[test]
    fn no_collapse_is_cheaper() {
        is_cheapest::<2>(41);
        is_cheapest::<3>(42);
        is_cheapest::<4>(43);
        is_cheapest::<8>(44);
    }
}
