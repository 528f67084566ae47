//! Which binary nodes the nodes of a wide tree are, and in which order they are visited: a collapse
//! before it is laid out in memory.

use super::binary::{BinaryKind, BinaryTree};
use crate::order::learned::{area_shares, cost_any, precise_chances};
use crate::order::tree_log::NodeCounts;
use crate::order::{CostModel, sorted_by_key};

/// Decides which binary nodes become the children of one wide node.
pub(crate) trait Contraction<const N: usize> {
    /// The children of the wide node made of binary node `binary`, in depth-first order. Those of an inner
    /// node are at least two nodes below it; a leaf, which only the root can be, is its own child.
    fn children(&self, tree: &BinaryTree, binary: usize) -> Children<N>;
}

/// Knows what leaves cost.
pub(crate) trait LeafCosts {
    /// The cost of a leaf of `count` primitives, or of one instance, that begins with this one.
    fn of(&self, prim: u32, count: u32) -> f64;
}

/// Up to `N` binary nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Children<const N: usize> {
    nodes: [u32; N],
    len: usize,
}

impl<const N: usize> Children<N> {
    /// One node, to be opened.
    pub fn new(node: usize) -> Self {
        let mut nodes = [0; N];
        nodes[0] = node as u32;
        Self { nodes, len: 1 }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    pub fn as_slice(&self) -> &[u32] {
        &self.nodes[..self.len]
    }

    /// Replaces the node at `place` by its two children. There is room for one more.
    pub fn open(&mut self, place: usize, pair: [usize; 2]) {
        self.nodes.copy_within(place + 1..self.len, place + 2);
        self.nodes[place] = pair[0] as u32;
        self.nodes[place + 1] = pair[1] as u32;
        self.len += 1;
    }
}

/// A wide tree made of binary nodes. Node 0 is the root; children follow their parents.
#[derive(Clone, Debug)]
pub(crate) struct Skeleton<const N: usize> {
    pub nodes: Vec<SkeletonNode<N>>,
}

/// A node of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SkeletonNode<const N: usize> {
    /// The binary node it is made of.
    pub binary: u32,
    /// How many children it has.
    pub len: usize,
    /// The children, in visiting order.
    pub children: [SkeletonChild; N],
}

/// A child in it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SkeletonChild {
    /// The binary node it is made of.
    pub binary: u32,
    /// Its index among the wide nodes; 0, which is no child's, for a leaf.
    pub index: u32,
}

impl<const N: usize> SkeletonNode<N> {
    /// The occupied slots.
    pub fn children(&self) -> &[SkeletonChild] {
        &self.children[..self.len]
    }
}

impl<const N: usize> Skeleton<N> {
    /// Collapses a tree of at least one node. Children are in the depth-first order of the binary tree.
    pub fn new(tree: &BinaryTree, contraction: &impl Contraction<N>) -> Self {
        let mut nodes = vec![SkeletonNode {
            binary: 0,
            len: 0,
            children: [SkeletonChild::default(); N],
        }];
        let mut next = 0;
        while let Some(&SkeletonNode { binary, .. }) = nodes.get(next) {
            let found = contraction.children(tree, binary as usize);
            nodes[next].len = found.len();
            for (slot, &binary) in found.as_slice().iter().enumerate() {
                let inner = matches!(tree.nodes[binary as usize].kind, BinaryKind::Inner { .. });
                let index = if inner { nodes.len() as u32 } else { 0 };
                nodes[next].children[slot] = SkeletonChild { binary, index };
                if inner {
                    nodes.push(SkeletonNode {
                        binary,
                        len: 0,
                        children: [SkeletonChild::default(); N],
                    });
                }
            }
            next += 1;
        }
        Self { nodes }
    }

    /// Sorts children by falling `H / (I C)`, if `sort` says so, and returns `C_any` of the root: see
    /// [`crate::order::learned`].
    pub fn sort(
        &mut self,
        tree: &BinaryTree,
        counts: &NodeCounts,
        model: &CostModel,
        leaf_costs: &impl LeafCosts,
        sort: bool,
    ) -> f64 {
        let mut costs = vec![0.0; self.nodes.len()];
        for index in (0..self.nodes.len()).rev() {
            let SkeletonNode {
                binary,
                len,
                children,
            } = self.nodes[index];
            let (mut box_hits, mut hits, mut areas) = ([0.0; N], [0.0; N], [0.0; N]);
            for slot in 0..len {
                let binary = children[slot].binary as usize;
                box_hits[slot] = f64::from(counts.entered[binary]);
                hits[slot] = f64::from(counts.hits[binary]);
                areas[slot] = tree.nodes[binary].bounds.half_area();
            }
            let binary = binary as usize;
            let shares = area_shares(&areas, tree.nodes[binary].bounds.half_area());
            let entered = f64::from(counts.entered[binary]);
            let mut chances = precise_chances(len, entered, &box_hits, &hits, &shares);
            for slot in 0..len {
                let child = children[slot];
                chances[slot].cost = match tree.nodes[child.binary as usize].kind {
                    BinaryKind::Inner { .. } => costs[child.index as usize],
                    BinaryKind::Leaf { first, count } => {
                        leaf_costs.of(tree.prims[first as usize], count)
                    }
                };
            }
            if sort {
                let keys = core::array::from_fn(|slot| chances[slot].key());
                let order = sorted_by_key(len, &keys, &areas);
                self.nodes[index].children = order.map(|slot| children[usize::from(slot)]);
                chances = order.map(|slot| chances[usize::from(slot)]);
            }
            costs[index] = cost_any(f64::from(model.node), chances);
        }
        costs[0]
    }

    /// The nodes as a query that hits every box visits them.
    pub fn visiting_order(&self) -> Vec<usize> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            order.push(index);
            let inner = self.nodes[index].children().iter().rev();
            open.extend(
                inner
                    .map(|child| child.index as usize)
                    .filter(|&index| index != 0),
            );
        }
        order
    }

    /// Levels of nodes, the root being one.
    pub fn depth(&self) -> usize {
        let mut levels = vec![1; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate() {
            for child in node.children().iter().filter(|child| child.index != 0) {
                levels[child.index as usize] = levels[index] + 1;
            }
        }
        levels.into_iter().max().unwrap_or(1)
    }

    /// When an occlusion query comes to each binary leaf; for an inner node, to the first leaf below it.
    pub fn ranks(&self, tree: &BinaryTree) -> Vec<u32> {
        let mut ranks = vec![u32::MAX; tree.nodes.len()];
        let mut rank = 0;
        let mut open = vec![SkeletonChild::default()];
        while let Some(child) = open.pop() {
            match tree.nodes[child.binary as usize].kind {
                BinaryKind::Inner { .. } => {
                    let node = &self.nodes[child.index as usize];
                    open.extend(node.children().iter().rev());
                }
                BinaryKind::Leaf { .. } => {
                    ranks[child.binary as usize] = rank;
                    rank += 1;
                }
            }
        }
        for node in (0..tree.nodes.len()).rev() {
            if let Some([left, right]) = tree.children(node) {
                ranks[node] = ranks[left].min(ranks[right]);
            }
        }
        ranks
    }
}
