//! A collapse before it is laid out in memory: which binary nodes become nodes of the wide tree, and in which order they
//! are visited.

use alloc::vec;
use alloc::vec::Vec;

use crate::geometry::primitives::Primitives;
use crate::learn::tree_log::NodeCounts;
use crate::order::ratio::{area_shares, cost_any, precise_chances};
use crate::order::sorted_by_key;
use crate::parallel;
use crate::tree::binary::{BinaryKind, BinaryTree};
use crate::tree::costs::CostModel;

/// Subtrees of at most this many binary nodes are the work of one thread.
const SEQUENTIAL: usize = 2048;

/// Decides which binary nodes become the children of one wide node.
pub(crate) trait Contraction<const N: usize>: Sync {
    /// The children of the wide node made of binary node `binary`, in depth-first order. Children of an inner
    /// node are at least two nodes below it; a leaf, which only the root can be, is its own child.
    fn children(&self, tree: &BinaryTree, binary: usize) -> Children<N>;
}

/// A contraction for rays that are known.
pub(crate) trait ForVisits<const N: usize>: Contraction<N> + Sized {
    /// For rays that visit each inner binary node so often, were it a node of the wide tree: finite and not
    /// negative. Leaves have a number, too, of no meaning.
    fn for_visits(tree: &BinaryTree, visits: &[f32]) -> Self;
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

/// A wide tree made of binary nodes. Its nodes are in the depth-first order of the binary tree, whatever the order of
/// their children.
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
    /// Places from its parent to it among the wide nodes; 0 for a leaf.
    pub offset: u32,
}

impl<const N: usize> SkeletonNode<N> {
    /// The occupied slots.
    pub fn children(&self) -> &[SkeletonChild] {
        &self.children[..self.len]
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

impl<const N: usize> Skeleton<N> {
    /// Collapses a tree of at least one node. Children are in the depth-first order of the binary tree.
    pub fn new(tree: &BinaryTree, contraction: &impl Contraction<N>) -> Self {
        Self::build(tree, contraction, None).0
    }

    /// Collapses with children sorted by falling `H / (I C)`, and `C_any` of the root.
    pub fn sorted(
        tree: &BinaryTree,
        contraction: &impl Contraction<N>,
        sorting: Sorting,
    ) -> (Self, f64) {
        Self::build(tree, contraction, Some(sorting))
    }

    fn build(
        tree: &BinaryTree,
        contraction: &impl Contraction<N>,
        sorting: Option<Sorting>,
    ) -> (Self, f64) {
        let work = Work {
            tree,
            contraction,
            sorting,
        };
        let mut nodes = Vec::with_capacity(tree.nodes.len() / N);
        let cost = work.append(0, tree.nodes.len(), &mut nodes);
        (Self { nodes }, cost)
    }

    /// The nodes as a query that hits every box visits them.
    pub fn visiting_order(&self) -> Vec<usize> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            order.push(index);
            let children = self.nodes[index].children().iter().rev();
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
        for (index, node) in self.nodes.iter().enumerate() {
            for child in node.children().iter().filter(|child| child.offset != 0) {
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
                    let children = self.nodes[index].children().iter().rev();
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
struct Work<'a, C> {
    tree: &'a BinaryTree,
    contraction: &'a C,
    sorting: Option<Sorting<'a>>,
}

impl<C> Work<'_, C> {
    /// Appends the wide node made of `binary` and all below it, which are less than `size` binary nodes. Returns
    /// its cost.
    fn append<const N: usize>(
        &self,
        binary: usize,
        size: usize,
        nodes: &mut Vec<SkeletonNode<N>>,
    ) -> f64
    where
        C: Contraction<N>,
    {
        let found = self.contraction.children(self.tree, binary);
        let found = found.as_slice();
        let mut node = SkeletonNode {
            binary: binary as u32,
            len: found.len(),
            children: [SkeletonChild::default(); N],
        };
        let mut costs = [0.0; N];
        let mut sizes = [0; N];
        for slot in 0..found.len() {
            node.children[slot].binary = found[slot];
            // What is below a child ends where the next one begins, or before.
            let end = found
                .get(slot + 1)
                .map_or(binary + size, |next| *next as usize);
            sizes[slot] = end - found[slot] as usize;
        }
        let place = nodes.len();
        nodes.push(node);
        if size > SEQUENTIAL {
            let parts = parallel::map(found.len(), 1, |slot| {
                let mut nodes = Vec::new();
                let cost = self.append_child(found[slot] as usize, sizes[slot], &mut nodes);
                (nodes, cost)
            });
            for (slot, (mut part, cost)) in parts.into_iter().enumerate() {
                if !part.is_empty() {
                    node.children[slot].offset = (nodes.len() - place) as u32;
                }
                // Children are found by relative places, so subtrees can be moved as they are.
                nodes.append(&mut part);
                costs[slot] = cost;
            }
        } else {
            for slot in 0..found.len() {
                let offset = (nodes.len() - place) as u32;
                costs[slot] = self.append_child(found[slot] as usize, sizes[slot], nodes);
                if nodes.len() > place + offset as usize {
                    node.children[slot].offset = offset;
                }
            }
        }
        let cost = match &self.sorting {
            Some(sorting) => sorting.finish(self.tree, &mut node, &costs),
            None => 0.0,
        };
        nodes[place] = node;
        cost
    }

    /// Appends a child, which may be a leaf. Returns its cost.
    fn append_child<const N: usize>(
        &self,
        binary: usize,
        size: usize,
        nodes: &mut Vec<SkeletonNode<N>>,
    ) -> f64
    where
        C: Contraction<N>,
    {
        match self.tree.nodes[binary].kind {
            BinaryKind::Inner { .. } => self.append(binary, size, nodes),
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

    /// Sorts the children of a node, which have these costs. Returns the cost of the node.
    fn finish<const N: usize>(
        &self,
        tree: &BinaryTree,
        node: &mut SkeletonNode<N>,
        costs: &[f64; N],
    ) -> f64 {
        let SkeletonNode {
            binary,
            len,
            children,
        } = *node;
        let (mut box_hits, mut hits, mut areas) = ([0.0; N], [0.0; N], [0.0; N]);
        for slot in 0..len {
            let binary = children[slot].binary as usize;
            box_hits[slot] = f64::from(self.counts.entered[binary]);
            hits[slot] = f64::from(self.counts.hits[binary]);
            areas[slot] = tree.nodes[binary].bounds.half_area();
        }
        let binary = binary as usize;
        let shares = area_shares(&areas, tree.nodes[binary].bounds.half_area());
        let entered = f64::from(self.counts.entered[binary]);
        let mut chances = precise_chances(len, entered, &box_hits, &hits, &shares);
        for (chance, cost) in chances.iter_mut().zip(costs) {
            chance.cost = *cost;
        }
        if self.sort {
            let keys = core::array::from_fn(|slot| chances[slot].key());
            let order = sorted_by_key(len, &keys, &areas);
            node.children = order.map(|slot| children[usize::from(slot)]);
            chances = order.map(|slot| chances[usize::from(slot)]);
        }
        cost_any(f64::from(self.model.node), chances)
    }
}
