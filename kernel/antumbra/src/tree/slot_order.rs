//! A permutation of the slots of a tree.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use super::node::{AS_THEY_ARE, PerSlot};
use super::wide::Tree;
use crate::geometry::BLOCK;
use crate::shape::Shape;

/// A choice among the children of a node that looks at the ray, in place of the order of slots. Occlusion queries of a tree
/// that has one go ray by ray, and the tree is saved without it.
pub trait Pick: Send + Sync {
    /// Sorts the lanes of a node that a ray hits so that the one to be visited first comes last. They ascend, that is, slots
    /// descend. `entered` has the distance at which the box of each lane of the node is entered.
    fn sort(&self, entered: &[f32], lanes: &mut [u32]);
}

impl fmt::Debug for dyn Pick {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Pick")
    }
}

/// One choice is the same as another if it is the same value in memory.
impl PartialEq for dyn Pick {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::addr_eq(self, other)
    }
}

impl Eq for dyn Pick {}

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
    /// What looks at the ray in every node, if anything does.
    pub(crate) pick: Option<&'static dyn Pick>,
}

impl SlotOrder {
    /// Leaves a tree as it is.
    pub fn of_nothing(tree: &Tree) -> Self {
        Self::as_built(tree.shape())
    }

    /// Leaves everything as it is.
    pub(crate) fn as_built(shape: Shape) -> Self {
        Self {
            shape,
            slots: Vec::new(),
            lanes: Vec::new(),
            pick: None,
        }
    }

    /// Leaves the leaves as they are; a place for every slot, to be set for all nodes.
    pub fn of_nodes(tree: &Tree) -> Self {
        let shape = tree.shape();
        Self {
            slots: vec![0; shape.nodes * shape.width],
            ..Self::as_built(shape)
        }
    }

    /// Sets the order of a node: `from` says which slot moves to each place. Empty slots stay behind the others.
    ///
    /// # Panics
    /// If there is no such node, or it is not a permutation of the slots.
    pub fn arrange(&mut self, node: usize, from: impl Fn(usize) -> usize) {
        let mut slots = AS_THEY_ARE;
        let mut found = 0_u32;
        for (place, slot) in slots.iter_mut().enumerate().take(self.shape.width) {
            let moved = from(place);
            *slot = moved as u8;
            found |= 1_u32.checked_shl(moved as u32).unwrap_or(0);
        }
        assert_eq!(
            found,
            (1 << self.shape.width) - 1,
            "a permutation of the slots"
        );
        self.set(node, &slots);
    }

    /// Which slot moves to each place of a node. Empty if the nodes stay as they are.
    pub fn node(&self, node: usize) -> &[u8] {
        self.slots.chunks(self.shape.width).nth(node).unwrap_or(&[])
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

/// Moves the places from `count` on, which are empty, to the end of a slot order. The kernel's orders have them there.
pub(super) fn occupied_first(places: &mut [u8], count: usize) {
    // Stable.
    places.sort_by_key(|place| usize::from(*place) >= count);
}
