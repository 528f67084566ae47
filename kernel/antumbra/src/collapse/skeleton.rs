//! A collapse before it is laid out in memory: which binary nodes become nodes of the wide tree, and in which order they
//! are visited.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use crate::geometry::primitives::Primitives;
use crate::learn::tree_log::NodeCounts;
use crate::order::ratio::{area_shares, cost_any, precise_chances};
use crate::order::sorted_by_key;
use crate::parallel;
use crate::tree::binary::{BinaryKind, BinaryTree};
use crate::tree::costs::CostModel;
use crate::tree::node::{AS_THEY_ARE, MAX_WIDTH, PerSlot};

/// Subtrees of at most this many binary nodes are the work of one thread.
const SEQUENTIAL: usize = 2048;

/// Decides which binary nodes become the children of one wide node.
pub trait Contraction: Sync {
    /// The children of the wide node made of binary node `binary`, at most `width`, in depth-first order. Children of an inner
    /// node are at least two nodes below it; a leaf, which only the root can be, is its own child.
    fn children(&self, tree: &BinaryTree, binary: usize, width: usize) -> Children;
}

/// The binary nodes that become the children of one wide node, at most 16.
#[derive(Clone, Copy, Debug)]
pub struct Children {
    nodes: PerSlot<u32>,
    len: usize,
}

impl Children {
    /// One node, to be opened.
    pub fn new(node: usize) -> Self {
        let mut nodes = [0; MAX_WIDTH];
        nodes[0] = node as u32;
        Self { nodes, len: 1 }
    }

    /// How many they are.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.len
    }

    /// The nodes in depth-first order.
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

/// A wide tree made of binary nodes. Its nodes are in the depth-first order of the binary tree, whatever the order of
/// their children.
#[derive(Clone, Debug, Default)]
pub(crate) struct Skeleton {
    pub nodes: Vec<SkeletonNode>,
    /// The children of all nodes.
    children: Vec<SkeletonChild>,
}

/// A node of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SkeletonNode {
    /// The binary node it is made of.
    #[cfg(test)]
    pub binary: u32,
    /// Index of its first child.
    first: u32,
    /// How many children it has.
    len: u32,
}

/// A child in it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SkeletonChild {
    /// The binary node it is made of.
    pub binary: u32,
    /// Places from its parent to it among the wide nodes; 0 for a leaf.
    pub offset: u32,
}

impl SkeletonNode {
    fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.len) as usize
    }
}

/// Knowledge by which children are sorted: see [`crate::order::ratio`].
#[derive(Clone, Copy)]
pub(crate) struct Sorting<'a> {
    pub counts: &'a NodeCounts,
    /// Primitives of the leaves.
    pub primitives: &'a Primitives,
    /// Cost of the tree of each object that an instance may place.
    pub objects: &'a [f64],
    pub model: &'a CostModel,
    /// Whether they are sorted; if not, only the cost is computed.
    pub sort: bool,
}

impl Skeleton {
    /// Collapses a tree of at least one node to nodes of `width` children. Children are in the depth-first order of the
    /// binary tree.
    pub fn new(tree: &BinaryTree, contraction: &dyn Contraction, width: usize) -> Self {
        Self::build(tree, contraction, width, None).0
    }

    /// Collapses with children sorted by falling `H / (I C)`, and `C_any` of the root.
    pub fn sorted(
        tree: &BinaryTree,
        contraction: &dyn Contraction,
        width: usize,
        sorting: Sorting,
    ) -> (Self, f64) {
        Self::build(tree, contraction, width, Some(sorting))
    }

    fn build(
        tree: &BinaryTree,
        contraction: &dyn Contraction,
        width: usize,
        sorting: Option<Sorting>,
    ) -> (Self, f64) {
        let work = Work {
            tree,
            contraction,
            width,
            sorting,
        };
        let mut skeleton = Self {
            nodes: Vec::with_capacity(tree.nodes.len() / width),
            children: Vec::with_capacity(tree.nodes.len() / 2),
        };
        let cost = work.append(0, tree.nodes.len(), &mut skeleton);
        (skeleton, cost)
    }

    /// The children of a node, in visiting order.
    pub fn children(&self, node: usize) -> &[SkeletonChild] {
        &self.children[self.nodes[node].range()]
    }

    /// The children of all nodes.
    pub fn all_children(&self) -> &[SkeletonChild] {
        &self.children
    }

    /// Appends a subtree. Its nodes name each other by relative places, its children do not.
    fn append(&mut self, part: Self) {
        let first = self.children.len() as u32;
        self.nodes
            .extend(part.nodes.iter().map(|node| SkeletonNode {
                first: first + node.first,
                ..*node
            }));
        self.children.extend(part.children);
    }

    /// The nodes as a query that hits every box visits them.
    pub fn visiting_order(&self) -> Vec<usize> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            order.push(index);
            let children = self.children(index).iter().rev();
            open.extend(
                children
                    .filter(|child| child.offset != 0)
                    .map(|child| index + child.offset as usize),
            );
        }
        order
    }

    /// Levels of nodes, the root being one.
    pub fn depth(&self) -> usize {
        let mut levels = vec![1; self.nodes.len()];
        for index in 0..self.nodes.len() {
            for child in self
                .children(index)
                .iter()
                .filter(|child| child.offset != 0)
            {
                levels[index + child.offset as usize] = levels[index] + 1;
            }
        }
        levels.into_iter().max().unwrap_or(1)
    }

    /// Rank of each binary leaf in visiting order. An inner node has the rank of the first leaf below it.
    pub fn ranks(&self, tree: &BinaryTree) -> Vec<u32> {
        let mut ranks = vec![u32::MAX; tree.nodes.len()];
        let mut rank = 0;
        // Children with the places of their parents.
        let mut open = vec![(SkeletonChild::default(), 0)];
        while let Some((child, parent)) = open.pop() {
            match tree.nodes[child.binary as usize].kind {
                BinaryKind::Inner { .. } => {
                    let index = parent + child.offset as usize;
                    let children = self.children(index).iter().rev();
                    open.extend(children.map(|child| (*child, index)));
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

/// Constants of the whole collapse.
struct Work<'a> {
    tree: &'a BinaryTree,
    contraction: &'a dyn Contraction,
    width: usize,
    sorting: Option<Sorting<'a>>,
}

impl Work<'_> {
    /// Appends the wide node made of `binary` and all below it, which are less than `size` binary nodes. Returns
    /// its cost.
    fn append(&self, binary: usize, size: usize, skeleton: &mut Skeleton) -> f64 {
        let found = self.contraction.children(self.tree, binary, self.width);
        let found = found.as_slice();
        // What is below a child ends where the next one begins, or before.
        let size_of = |slot: usize| {
            let end = found.get(slot + 1);
            end.map_or(binary + size, |next| *next as usize) - found[slot] as usize
        };
        let place = skeleton.nodes.len();
        let node = SkeletonNode {
            #[cfg(test)]
            binary: binary as u32,
            first: skeleton.children.len() as u32,
            len: found.len() as u32,
        };
        skeleton.nodes.push(node);
        let children = found
            .iter()
            .map(|&binary| SkeletonChild { binary, offset: 0 });
        skeleton.children.extend(children);
        let mut costs = [0.0; MAX_WIDTH];
        let mut add = |slot: usize, skeleton: &mut Skeleton, before: usize, cost: f64| {
            if skeleton.nodes.len() > before {
                skeleton.children[node.first as usize + slot].offset = (before - place) as u32;
            }
            costs[slot] = cost;
        };
        if size > SEQUENTIAL {
            let parts = parallel::map(found.len(), 1, |slot| {
                let mut part = Skeleton::default();
                let cost = self.append_child(found[slot] as usize, size_of(slot), &mut part);
                (part, cost)
            });
            for (slot, (part, cost)) in parts.into_iter().enumerate() {
                let before = skeleton.nodes.len();
                skeleton.append(part);
                add(slot, skeleton, before, cost);
            }
        } else {
            for slot in 0..found.len() {
                let before = skeleton.nodes.len();
                let cost = self.append_child(found[slot] as usize, size_of(slot), skeleton);
                add(slot, skeleton, before, cost);
            }
        }
        self.sorting.map_or(0.0, |sorting| {
            sorting.finish(
                self.tree,
                binary,
                &mut skeleton.children[node.range()],
                &costs,
            )
        })
    }

    /// Appends a child, which may be a leaf. Returns its cost.
    fn append_child(&self, binary: usize, size: usize, skeleton: &mut Skeleton) -> f64 {
        match self.tree.nodes[binary].kind {
            BinaryKind::Inner { .. } => self.append(binary, size, skeleton),
            BinaryKind::Leaf { first, count } => self.sorting.map_or(0.0, |sorting| {
                sorting.leaf_cost(self.tree.prims[first as usize], count)
            }),
        }
    }
}

impl Sorting<'_> {
    /// The cost of a leaf of `count` primitives, or of one instance, that begins with this one.
    pub fn leaf_cost(&self, prim: u32, count: u32) -> f64 {
        let prim = prim as usize;
        match self.primitives.instance(prim) {
            Some(placed) => f64::from(self.model.entry) + self.objects[placed.object as usize],
            None => f64::from(self.model.of(self.primitives.kind(prim))) * f64::from(count),
        }
    }

    /// Sorts the children of the wide node made of `binary`, which have these costs. Returns the cost of the node.
    fn finish(
        &self,
        tree: &BinaryTree,
        binary: usize,
        children: &mut [SkeletonChild],
        costs: &PerSlot<f64>,
    ) -> f64 {
        let len = children.len();
        let [mut box_hits, mut hits] = [[0.0; MAX_WIDTH]; 2];
        let mut areas = [0.0; MAX_WIDTH];
        for (slot, child) in children.iter().enumerate() {
            let binary = child.binary as usize;
            box_hits[slot] = f64::from(self.counts.entered[binary]);
            hits[slot] = f64::from(self.counts.hits[binary]);
            areas[slot] = tree.nodes[binary].bounds.half_area();
        }
        let shares = area_shares(&areas, tree.nodes[binary].bounds.half_area());
        let entered = f64::from(self.counts.entered[binary]);
        let mut chances = precise_chances(len, entered, &box_hits, &hits, &shares);
        for (chance, cost) in chances.iter_mut().zip(costs) {
            chance.cost = *cost;
        }
        let mut order = AS_THEY_ARE;
        if self.sort {
            order = sorted_by_key(len, &chances.map(|chance| chance.key()), &areas);
            let mut unsorted = [SkeletonChild::default(); MAX_WIDTH];
            unsorted[..len].copy_from_slice(children);
            for (child, slot) in children.iter_mut().zip(order) {
                *child = unsorted[usize::from(slot)];
            }
        }
        let sorted = order[..len].iter().map(|slot| chances[usize::from(*slot)]);
        cost_any(f64::from(self.model.node), sorted)
    }
}
