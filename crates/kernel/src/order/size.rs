//! Fewest primitives first. Embree's builder sorts children by descending primitive count and its
//! occlusion query goes on with the highest lane hit, so the smallest subtree is visited first. An instance counts as
//! one primitive, as it does there.

use alloc::vec;

use crate::order::sorted_slots;
use crate::tree::node::ChildKind;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::WideTree;

/// Subtrees with fewer primitives first.
pub(crate) fn plan<const N: usize>(bvh: &WideTree<N>) -> SlotOrder {
    let mut counts = vec![0usize; bvh.nodes.len()];
    let mut slots = vec![0; bvh.nodes.len() * N];
    // Children follow their parents, so going backwards visits them first.
    for (index, node) in bvh.nodes.iter().enumerate().rev() {
        let mut key = [0.0; N];
        for (slot, key) in key.iter_mut().enumerate().take(node.len()) {
            let count = match node.child(slot).kind() {
                ChildKind::Inner(child) => counts[child],
                ChildKind::Leaf(leaf) => bvh.leaf_len(leaf),
                ChildKind::Instance(_) => 1,
            };
            counts[index] += count;
            *key = -(count as f64);
        }
        slots[index * N..][..N].copy_from_slice(&sorted_slots(node, &key));
    }
    SlotOrder {
        slots,
        ..SlotOrder::as_built(bvh.shape())
    }
}
