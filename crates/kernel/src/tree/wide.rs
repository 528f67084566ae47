//! The N-wide tree: its nodes, leaf blocks and instances, their numbers, and changes of their order.

use alloc::sync::Arc;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::geometry::cutout::Filters;
use crate::geometry::instance::Placement;
use crate::shape::Shape;
use crate::tree::leaves::LeafBlocks;
use crate::tree::motion::Motion;
use crate::tree::node::Node;
use crate::tree::rule::Rule;
use crate::tree::slot_order::{SlotOrder, occupied_first};

/// A tree of nodes with `N` children, or one tree over the world and one for each object that instances place
/// in it.
///
/// Node 0 is the root of the world's tree and always exists; the trees of objects are behind it, one after the other.
/// Children follow their parents, also from an instance to the root of its object. Triangle block 0 is empty: empty
/// slots refer to it.
#[derive(Clone, Debug)]
pub(crate) struct WideTree<const N: usize> {
    pub nodes: Vec<Node<N>>,
    pub blocks: LeafBlocks,
    /// Filters that decide about the hits of cut-out blocks.
    pub filters: Arc<Filters>,
    /// In visiting order.
    pub instances: Vec<PlacedTree>,
    /// The roots of the objects, ascending.
    pub roots: Vec<u32>,
    /// Bounds of the world.
    pub bounds: Aabb,
    /// Scene extent: largest absolute coordinate, see [`crate::geometry::ray_setup`].
    pub reach: f32,
    /// Levels of nodes, the root being one: the levels of the world's tree and of the deepest object together.
    pub depth: usize,
    /// How occlusion queries pick the next child.
    pub pick: Rule,
    /// Motion during a span, if anything moves. Nodes and leaves are then at the start of the span.
    pub motion: Option<Arc<Motion<N>>>,
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

impl<const N: usize> WideTree<N> {
    /// Instances are numbered behind the leaves, where both are counted.
    #[inline(always)]
    pub fn instance_index(&self, instance: usize) -> usize {
        self.leaf_count() + instance
    }

    /// How many of the nodes belong to the tree of the world; they come first.
    pub fn top_nodes(&self) -> usize {
        self.roots
            .first()
            .map_or(self.nodes.len(), |root| *root as usize)
    }

    /// Nodes that are room for others: those without children, but for roots.
    pub fn room(&self) -> usize {
        let top = &self.nodes[1..self.top_nodes()];
        top.iter().filter(|node| node.len() == 0).count()
    }

    /// Counts that a log or order must have in common with the tree.
    pub fn shape(&self) -> Shape {
        Shape {
            width: N,
            nodes: self.nodes.len(),
            leaves: self.leaf_count(),
            instances: self.instances.len(),
            objects: self.roots.len(),
        }
    }

    /// Permutes slots and leaf lanes. The order was made for a tree of this shape.
    pub fn apply(&mut self, order: &SlotOrder) {
        if !order.slots.is_empty() {
            let (permutations, _) = order.slots.as_chunks::<N>();
            for (node, slots) in self.nodes.iter_mut().zip(permutations) {
                node.permute(&occupied_first(slots, node.len()));
            }
        }
        if !order.lanes.is_empty() {
            self.permute_leaves(&order.lanes);
        }
        self.pick = order.pick;
    }
}
