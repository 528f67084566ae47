//! A permutation of the slots of a tree.

use alloc::vec::Vec;

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
}

/// A slot order with the places from `count` on, which are empty, moved to the end. Planned orders have them there.
/// Orders from a forged file or log may not.
pub(super) fn occupied_first<const N: usize>(places: &[u8; N], count: usize) -> [u8; N] {
    let is_occupied = |place: &u8| usize::from(*place) < count;
    let mut sorted = *places;
    // Stable.
    sorted.sort_by_key(|place| !is_occupied(place));
    sorted
}
