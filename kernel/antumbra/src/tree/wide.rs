//! The N-wide tree: its nodes, leaf blocks and instances, their numbers, and changes of their order.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Deref;

use crate::aabb::Aabb;
use crate::geometry::cutout::Filters;
use crate::geometry::instance::Placement;
use crate::shape::Shape;
use crate::tree::leaves::LeafBlocks;
use crate::tree::motion::Motion;
use crate::tree::node::{Node, NodeRef};
use crate::tree::nodes::Nodes;
use crate::tree::slot_order::{Pick, SlotOrder, occupied_first};
use crate::tree::width::Width;

/// A tree of nodes with as many children, or one tree over the world and one for each object that instances place
/// in it.
///
/// Node 0 is the root of the world's tree and always exists; the trees of objects are behind it, one after the other.
/// Children follow their parents, also from an instance to the root of its object. Triangle block 0 is empty: empty
/// slots refer to it.
#[derive(Clone, Debug)]
pub struct Tree {
    pub(crate) nodes: Nodes,
    pub(crate) blocks: LeafBlocks,
    /// Filters that decide about the hits of cut-out blocks.
    pub(crate) filters: Arc<Filters>,
    /// In visiting order.
    pub(crate) instances: Vec<PlacedTree>,
    /// The roots of the objects, ascending.
    pub(crate) roots: Vec<u32>,
    /// Bounds of the world.
    pub(crate) bounds: Aabb,
    /// Scene extent: largest absolute coordinate, see [`crate::geometry::ray_setup`].
    pub(crate) reach: f32,
    /// Levels of nodes, the root being one: the levels of the world's tree and of the deepest object together.
    pub(crate) depth: usize,
    /// What looks at the ray in every node; `None` where occlusion queries visit slots in their order.
    pub(crate) pick: Option<&'static dyn Pick>,
    /// Motion during a span, if anything moves. Nodes and leaves are then at the start of the span.
    pub(crate) motion: Option<Arc<Motion>>,
}

/// A tree as queries see it, which are compiled for the width of its nodes.
pub(crate) struct WideTree<'a, const N: usize> {
    pub nodes: &'a [Node<N>],
    /// How far the planes of the nodes of the world move during a span; empty if nothing moves.
    pub moves: &'a [Node<N>],
    pub tree: &'a Tree,
}

impl<const N: usize> Deref for WideTree<'_, N> {
    type Target = Tree;

    #[inline(always)]
    fn deref(&self) -> &Tree {
        self.tree
    }
}

/// An instance in a tree.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct PlacedTree {
    pub placement: Placement,
    /// Index of the root node of its object.
    pub root: u32,
    /// Index of its object in the user's list. In a tree from a file objects have new numbers.
    pub object: u32,
    /// The transform as the user gave it, for queries about points. Rays never look at it.
    pub world_from_object: [[f32; 4]; 3],
}

impl Tree {
    /// A tree over nothing, with these nodes: a root without children comes first.
    pub(crate) fn over_nothing(mut nodes: Nodes, blocks: LeafBlocks) -> Self {
        nodes.push_empty();
        Self {
            nodes,
            blocks,
            filters: Arc::default(),
            instances: Vec::new(),
            roots: Vec::new(),
            bounds: Aabb::EMPTY,
            reach: 0.0,
            depth: 1,
            pick: None,
            motion: None,
        }
    }

    /// A tree over nothing.
    pub(crate) fn empty(width: Width) -> Self {
        Self::over_nothing(Nodes::with_capacity(width, 1), LeafBlocks::empty())
    }

    pub(crate) fn width(&self) -> Width {
        self.nodes.width()
    }

    /// The tree as queries see it that are compiled for its width.
    #[inline(always)]
    pub(crate) fn wide<const N: usize>(&self) -> WideTree<'_, N> {
        WideTree {
            nodes: self.nodes.of_width(),
            moves: (self.motion.as_deref()).map_or(&[], |motion| motion.nodes.of_width()),
            tree: self,
        }
    }

    /// Instances are numbered behind the leaves, where both are counted.
    #[inline(always)]
    pub(crate) fn instance_index(&self, instance: usize) -> usize {
        self.leaf_count() + instance
    }

    /// How many of the nodes belong to the tree of the world; they come first.
    pub(crate) fn top_nodes(&self) -> usize {
        self.roots
            .first()
            .map_or(self.nodes.len(), |root| *root as usize)
    }

    /// Nodes that are room for others: those without children, but for roots.
    pub(crate) fn room(&self) -> usize {
        let top = self.nodes.iter().take(self.top_nodes()).skip(1);
        top.filter(|node| node.len() == 0).count()
    }

    /// Counts that a log or order must have in common with the tree.
    pub(crate) fn shape(&self) -> Shape {
        Shape {
            width: self.width().lanes(),
            nodes: self.nodes.len(),
            leaves: self.leaf_count(),
            instances: self.instances.len(),
            objects: self.roots.len(),
        }
    }

    /// Permutes slots and leaf lanes. The order was made for a tree of this shape.
    pub(crate) fn apply(&mut self, order: &SlotOrder) {
        let mut occupied = vec![0; self.width().lanes()];
        for (index, slots) in order.slots.chunks(occupied.len()).enumerate() {
            occupied.copy_from_slice(slots);
            let mut node = self.nodes.get_mut(index);
            occupied_first(&mut occupied, node.any().len());
            node.permute(&occupied);
        }
        if !order.lanes.is_empty() {
            self.permute_leaves(&order.lanes);
        }
        self.pick = order.pick;
    }

    /// Number of nodes, with the nodes of objects. Children follow their parents, also from an instance to the root of its
    /// object.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// The node of this index.
    ///
    /// # Panics
    /// If there is none.
    pub fn node(&self, index: usize) -> NodeRef<'_> {
        self.nodes.get(index)
    }

    /// The root node of the object that an instance places.
    ///
    /// # Panics
    /// If there is no such instance.
    pub fn root_of(&self, instance: usize) -> usize {
        self.instances[instance].root as usize
    }
}
