//! A binary tree of which subtrees can be cut off and grafted on elsewhere: nodes know their parents.

use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::tree::binary::{BinaryKind, BinaryNode, BinaryTree};

/// The node above the root, which is its left child; there is no right one.
pub(crate) const TOP: u32 = 0;

/// No node.
const NONE: u32 = u32::MAX;

/// The tree. Nodes are named by numbers that they keep wherever they go: inner nodes first, then leaves.
#[derive(Clone)]
pub(crate) struct LinkedTree {
    inner: Vec<Inner>,
    leaves: Vec<Leaf>,
}

/// All that a search needs to know of an inner node and of its children, in one cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Inner {
    /// Bounds of the children.
    pub bounds: [Aabb; 2],
    pub children: [u32; 2],
    parent: u32,
    /// Levels below each child.
    heights: [u16; 2],
}

#[derive(Clone, Copy)]
struct Leaf {
    parent: u32,
    /// In the tree it comes from.
    first: u32,
    count: u32,
}

impl LinkedTree {
    /// Links a tree of at least one node.
    pub fn new(tree: &BinaryTree) -> Self {
        let inner_count = 1 + tree.nodes.len() / 2;
        let mut linked = Self {
            inner: Vec::with_capacity(inner_count),
            leaves: Vec::with_capacity(inner_count),
        };
        linked.inner.push(Inner {
            bounds: [Aabb::EMPTY; 2],
            children: [NONE; 2],
            parent: NONE,
            heights: [0; 2],
        });
        // Where each node hangs: its parent and the side. Parents come before their children.
        let mut places = vec![(TOP, 0); tree.nodes.len()];
        for (index, node) in tree.nodes.iter().enumerate() {
            let (parent, side) = places[index];
            let name = match node.kind {
                BinaryKind::Inner { right } => {
                    let name = linked.inner.len() as u32;
                    places[index + 1] = (name, 0);
                    places[index + right as usize] = (name, 1);
                    linked.inner.push(Inner {
                        parent,
                        ..linked.inner[TOP as usize]
                    });
                    name
                }
                BinaryKind::Leaf { first, count } => {
                    linked.leaves.push(Leaf {
                        parent,
                        first,
                        count,
                    });
                    (inner_count + linked.leaves.len() - 1) as u32
                }
            };
            let parent = &mut linked.inner[parent as usize];
            parent.children[side] = name;
            parent.bounds[side] = node.bounds;
        }
        for index in (1..linked.inner.len()).rev() {
            let parent = linked.inner[index].parent;
            let side = linked.side(parent, index as u32);
            linked.inner[parent as usize].heights[side] = linked.inner[index].height();
        }
        linked
    }

    /// The tree as an array in depth-first order, leaves with their ranges of `prims`, which are put in
    /// that order, too.
    pub fn unlinked(&self, prims: &[u32]) -> BinaryTree {
        let mut tree = BinaryTree {
            nodes: Vec::with_capacity(self.len()),
            prims: Vec::with_capacity(prims.len()),
            ..BinaryTree::default()
        };
        let [root, _] = self.inner[TOP as usize].children;
        // With the parents of which they are the right children.
        let mut open = vec![(root, None)];
        while let Some((node, right_child_of)) = open.pop() {
            let index = tree.nodes.len();
            if let Some(parent) = right_child_of {
                let parent: usize = parent;
                tree.nodes[parent].kind = BinaryKind::Inner {
                    right: (index - parent) as u32,
                };
            }
            let kind = match self.inner(node) {
                Some(inner) => {
                    let [left, right] = inner.children;
                    open.push((right, Some(index)));
                    open.push((left, None));
                    BinaryKind::Inner { right: 0 }
                }
                None => {
                    let Leaf { first, count, .. } = self.leaves[self.leaf(node)];
                    let new_first = tree.prims.len() as u32;
                    tree.prims
                        .extend_from_slice(&prims[first as usize..][..count as usize]);
                    BinaryKind::Leaf {
                        first: new_first,
                        count,
                    }
                }
            };
            let bounds = *self.bounds(node);
            tree.nodes.push(BinaryNode { bounds, kind });
        }
        tree
    }

    /// How many nodes there are. They are named from 1 to this.
    pub fn len(&self) -> usize {
        self.inner.len() - 1 + self.leaves.len()
    }

    /// The links of an inner node; `None` for a leaf.
    #[inline(always)]
    pub fn inner(&self, node: u32) -> Option<&Inner> {
        self.inner.get(node as usize)
    }

    /// The parent of a node; [`TOP`] of the root.
    #[inline(always)]
    pub fn parent(&self, node: u32) -> u32 {
        match self.inner(node) {
            Some(inner) => inner.parent,
            None => self.leaves[self.leaf(node)].parent,
        }
    }

    /// Side of a node below `parent`: 0 for the left child.
    #[inline(always)]
    pub fn side(&self, parent: u32, child: u32) -> usize {
        usize::from(self.inner[parent as usize].children[0] != child)
    }

    /// The box of a node.
    #[inline(always)]
    pub fn bounds(&self, node: u32) -> &Aabb {
        let parent = self.parent(node);
        &self.inner[parent as usize].bounds[self.side(parent, node)]
    }

    /// Moves a subtree next to `to`: `node` and `to` become the children of a new node in the place of `to`,
    /// and the node that was the parent of `node` vanishes. Returns by how much the sum of all areas
    /// shrinks. Does nothing and returns 0 unless that is positive, and also if `to` is where the subtree
    /// is already, or in it, or if nodes would come to be more than `max_depth` below the root.
    pub fn reinsert(&mut self, node: u32, to: u32, max_depth: usize) -> f64 {
        let parent = self.parent(node);
        if parent == TOP || to == parent {
            return 0.0;
        }
        let sibling = self.inner[parent as usize].children[1 - self.side(parent, node)];
        if to == sibling {
            return 0.0;
        }
        let mut growth = self.cut(node);
        if self
            .depth(to)
            .is_some_and(|depth| depth + 1 + self.height(node).max(self.height(to)) <= max_depth)
        {
            growth += self.graft(node, to);
            if growth < 0.0 {
                return -growth;
            }
            self.cut(node);
        }
        self.graft(node, sibling);
        0.0
    }

    /// Takes a subtree out, and its parent with it. Returns the growth of the sum of areas.
    fn cut(&mut self, node: u32) -> f64 {
        let parent = self.parent(node);
        let sides = &self.inner[parent as usize];
        let other = 1 - self.side(parent, node);
        let (sibling, bounds, height) = (
            sides.children[other],
            sides.bounds[other],
            sides.heights[other],
        );
        let gone = area(self.bounds(parent));
        let above = sides.parent;
        let side = self.side(above, parent);
        self.inner[parent as usize].parent = NONE;
        self.hang(sibling, above, side, bounds, height);
        self.refit(above) - gone
    }

    /// Puts back a subtree that was taken out, next to `to`. Returns the growth of the sum of areas.
    fn graft(&mut self, node: u32, to: u32) -> f64 {
        let parent = self.parent(node);
        let (bounds, height) = (*self.bounds(node), self.height(node) as u16);
        let (to_bounds, to_height) = (*self.bounds(to), self.height(to) as u16);
        let above = self.parent(to);
        let side = self.side(above, to);
        self.hang(to, parent, 0, to_bounds, to_height);
        self.hang(node, parent, 1, bounds, height);
        let sides = &self.inner[parent as usize];
        let (bounds, height) = (sides.around(), sides.height());
        self.hang(parent, above, side, bounds, height);
        self.refit(above) + area(&bounds)
    }

    /// Makes a node a child.
    fn hang(&mut self, node: u32, parent: u32, side: usize, bounds: Aabb, height: u16) {
        let inner = &mut self.inner[parent as usize];
        inner.children[side] = node;
        inner.bounds[side] = bounds;
        inner.heights[side] = height;
        match self.inner.get_mut(node as usize) {
            Some(inner) => inner.parent = parent,
            None => {
                let leaf = self.leaf(node);
                self.leaves[leaf].parent = parent;
            }
        }
    }

    /// Measures a node and the nodes above it again, after one of its children has changed. Returns the growth of the
    /// sum of their areas.
    fn refit(&mut self, mut node: u32) -> f64 {
        let mut growth = 0.0;
        while node != TOP {
            let inner = &self.inner[node as usize];
            let (bounds, height, parent) = (inner.around(), inner.height(), inner.parent);
            let side = self.side(parent, node);
            let above = &mut self.inner[parent as usize];
            if above.bounds[side] == bounds && above.heights[side] == height {
                break;
            }
            growth += area(&bounds) - area(&above.bounds[side]);
            above.bounds[side] = bounds;
            above.heights[side] = height;
            node = parent;
        }
        growth
    }

    /// How far a node is below the root; `None` in a subtree that was taken out.
    fn depth(&self, mut node: u32) -> Option<usize> {
        let mut depth = 0;
        loop {
            node = self.parent(node);
            match node {
                TOP => return Some(depth),
                NONE => return None,
                _ => depth += 1,
            }
        }
    }

    /// Levels below a node.
    fn height(&self, node: u32) -> usize {
        self.inner(node).map_or(0, |inner| inner.height().into())
    }

    #[inline(always)]
    fn leaf(&self, node: u32) -> usize {
        node as usize - self.inner.len()
    }
}

impl Inner {
    /// The box of the node.
    fn around(&self) -> Aabb {
        self.bounds[0].union(&self.bounds[1])
    }

    /// Levels below the node.
    fn height(&self) -> u16 {
        1 + self.heights[0].max(self.heights[1])
    }
}

/// Half the surface area of a box that is not empty; in double precision, so that it cannot overflow and
/// hardly anything is lost in sums.
pub(crate) fn area(bounds: &Aabb) -> f64 {
    let [x, y, z]: [f64; 3] =
        core::array::from_fn(|axis| f64::from(bounds.max[axis]) - f64::from(bounds.min[axis]));
    x * y + y * z + z * x
}
