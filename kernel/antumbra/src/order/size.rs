//! Fewest primitives first. Embree's builder sorts children by descending primitive count and its
//! occlusion query goes on with the highest lane hit, so the smallest subtree is visited first. An instance counts as
//! one primitive, as it does there.

use alloc::vec;

use crate::order::sorted_slots;
use crate::tree::node::{ChildKind, MAX_WIDTH};
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;

/// Subtrees with fewer primitives first.
pub(crate) fn plan(tree: &Tree) -> SlotOrder {
    let mut counts = vec![0usize; tree.nodes.len()];
    let mut order = SlotOrder::of_nodes(tree);
    // Children follow their parents, so going backwards visits them first.
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let mut key = [0.0; MAX_WIDTH];
        for (slot, key) in key.iter_mut().enumerate().take(node.len()) {
            let count = match node.child(slot).kind() {
                ChildKind::Inner(child) => counts[child],
                ChildKind::Leaf(leaf) => tree.leaf_len(leaf),
                ChildKind::Instance(_) => 1,
            };
            counts[index] += count;
            *key = -(count as f64);
        }
        order.set(index, &sorted_slots(node, &key));
    }
    order
}
