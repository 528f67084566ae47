//! A permutation of the slots of a tree.

use alloc::vec;
use alloc::vec::Vec;

use super::node::PerSlot;
use super::rule::Rule;
use crate::geometry::BLOCK;
use crate::shape::Shape;

/// A permutation of the slots of every node, and of the primitives of every leaf.
///
/// Only trees of the shape that it was planned for can be put in this order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlotOrder {
    /// Shape of the tree it was planned for.
    pub(crate) shape: Shape,
    /// Per node, N entries: which slot moves to this place. Empty: leave the nodes as they are.
    pub(crate) slots: Vec<u8>,
    /// Per leaf: which lane moves to this place. Empty: leave the leaves as they are.
    pub(crate) lanes: Vec<[u8; BLOCK]>,
    /// How queries pick; by slot, as a rule.
    pub(crate) pick: Rule,
}

impl SlotOrder {
    /// Leaves everything as it is.
    pub(crate) fn as_built(shape: Shape) -> Self {
        Self {
            shape,
            slots: Vec::new(),
            lanes: Vec::new(),
            pick: Rule::Slots,
        }
    }

    /// Leaves the leaves as they are; a place for every slot, to be [set](Self::set) for all nodes.
    pub(crate) fn of_nodes(shape: Shape) -> Self {
        Self {
            slots: vec![0; shape.nodes * shape.width],
            ..Self::as_built(shape)
        }
    }

    /// Sets the order of a node.
    pub(crate) fn set(&mut self, node: usize, slots: &PerSlot<u8>) {
        let width = self.shape.width;
        self.slots[node * width..][..width].copy_from_slice(&slots[..width]);
    }

    /// Appends the order of the next node.
    pub(crate) fn push(&mut self, slots: &PerSlot<u8>) {
        self.slots.extend_from_slice(&slots[..self.shape.width]);
    }
}

/// Moves the places from `count` on, which are empty, to the end of a slot order. Planned orders have them there.
/// Orders from a forged file or log may not.
pub(super) fn occupied_first(places: &mut [u8], count: usize) {
    // Stable.
    places.sort_by_key(|place| usize::from(*place) >= count);
}
