//! Orders that depend on where a ray goes: a table of permutations beside the nodes, looked up for every node
//! that a ray visits. See [`crate::trace::pick::Directed`].

use alloc::format;
use alloc::vec::Vec;

use super::saved::is_permutation;
use super::words::{Sink, Words};
use crate::error::Error;

/// How the occlusion queries of a tree pick. Trees are given a rule together with the places of their slots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum Rule {
    /// In the order of slots.
    #[default]
    Slots,
    /// By the distance at which boxes are entered.
    Distance,
    /// By the distance at which boxes are left, the farthest first.
    Far,
    /// By a way that each node has of its own.
    Nodes(Vec<Way>),
    /// By the direction of the ray.
    Direction(DirectedOrder),
}

impl Rule {
    /// Bytes that it needs beside the tree.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Slots | Self::Distance | Self::Far => 0,
            Self::Nodes(ways) => ways.len(),
            Self::Direction(order) => order.bytes(),
        }
    }
}

/// How one node picks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Way {
    /// In the order of slots.
    #[default]
    Slots,
    /// Boxes that are entered first come first.
    Near,
    /// Boxes that are left last come first.
    Far,
}

impl Way {
    pub const ALL: [Self; 3] = [Self::Slots, Self::Near, Self::Far];
}

/// Several orders for each node: one for each of the eight octants of directions, or one for each sign of the direction
/// on an axis that every node chooses for itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DirectedOrder {
    /// How many a node has.
    orders: usize,
    /// Per node, which bit of the octant is the lowest that decides.
    shifts: Vec<u8>,
    /// Per node and order, as many lanes as a node has, the one to be visited first at the end: as they are
    /// pushed.
    lanes: Vec<u8>,
}

impl DirectedOrder {
    /// Memory for two or eight orders of so many nodes.
    pub fn with_capacity(orders: usize, nodes: usize, width: usize) -> Self {
        Self {
            orders,
            shifts: Vec::with_capacity(nodes),
            lanes: Vec::with_capacity(nodes * orders * width),
        }
    }

    /// Adds the next node: its orders, each a permutation of its slots, first the one to be visited first. If there
    /// are two, the sign on `axis` decides; of eight, the octant, and `axis` is 0.
    pub fn push<const N: usize>(&mut self, axis: usize, orders: impl Iterator<Item = [u8; N]>) {
        self.shifts.push(axis as u8);
        for slots in orders {
            let lanes = slots.iter().rev().map(|slot| N as u8 - 1 - slot);
            self.lanes.extend(lanes);
        }
    }

    /// The lanes of a node in the order in which the children that are hit are to be pushed.
    #[inline(always)]
    pub fn lanes<const N: usize>(&self, node: usize, octant: usize) -> &[u8; N] {
        let which = octant >> self.shifts[node] & (self.orders - 1);
        &self.lanes.as_chunks().0[node * self.orders + which]
    }

    /// Writes all orders, node by node.
    pub(super) fn write(&self, sink: &mut dyn Sink) {
        sink.word(self.orders as u32);
        sink.bytes(&self.shifts);
        sink.bytes(&self.lanes);
    }

    /// Orders for so many nodes, as [`DirectedOrder::write`] wrote them.
    pub(super) fn read(words: &mut Words<'_>, nodes: usize, width: usize) -> Result<Self, Error> {
        let orders = words.word()? as usize;
        let most_shift = match orders {
            2 => 2,
            8 => 0,
            _ => return Err(words.error(format!("no node has {orders} orders"))),
        };
        let shifts = words.bytes(nodes)?.to_vec();
        let lanes = words.bytes(nodes.saturating_mul(orders * width))?.to_vec();
        if shifts.iter().any(|shift| *shift > most_shift)
            || !lanes.chunks(width).all(is_permutation)
        {
            return Err(words.error("a node has no order"));
        }
        Ok(Self {
            orders,
            shifts,
            lanes,
        })
    }

    pub fn bytes(&self) -> usize {
        self.shifts.len() + self.lanes.len()
    }
}
