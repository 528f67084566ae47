//! Eight orders at the price of one: a copy of the nodes for each octant of directions.
//!
//! A table of permutations beside the nodes has to be looked up at every node, and its slots shuffled. Copies need
//! neither: a ray begins at the root of the copy for its octant and stays in that copy, whose children stand in the
//! order for that octant. Leaves and instances are shared. In an instance the ray goes on in the copy for its octant
//! there. Nodes are a seventh of a tree, so eight copies double it.
//!
//! Such a tree answers rays and nothing else: it is not refitted, saved or logged.

use alloc::vec::Vec;

use crate::tree::directed::Rule;
use crate::tree::node::{Child, ChildKind};
use crate::tree::slot_order::occupied_first;
use crate::tree::wide::WideTree;

impl<const N: usize> WideTree<N> {
    /// The tree with a copy of its nodes for each octant; `None` unless its order depends on directions.
    pub fn with_octant_copies(&self) -> Option<Self> {
        let Rule::Direction(orders) = &self.pick else {
            return None;
        };
        let count = self.nodes.len();
        let mut nodes = Vec::with_capacity(8 * count);
        for octant in 0..8 {
            let offset = octant * count;
            for (index, node) in self.nodes.iter().enumerate() {
                let mut copy = node.clone();
                let lanes = orders.lanes::<N>(index, octant);
                // The lane that is pushed last is visited first.
                let slots = core::array::from_fn(|slot| N as u8 - 1 - lanes[N - 1 - slot]);
                copy.permute(&occupied_first(&slots, node.len()));
                for child in &mut copy.children {
                    if let ChildKind::Inner(index) = Child(*child).kind() {
                        *child = Child::inner(index + offset).0;
                    }
                }
                nodes.push(copy);
            }
        }
        Some(Self {
            nodes,
            pick: Rule::Slots,
            copy_len: count as u32,
            ..self.clone()
        })
    }
}
