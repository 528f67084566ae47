//! Surface area traversal order: larger boxes first.
//!
//! Source: Nah and Manocha (2014), "SATO: Surface Area Traversal Order for Shadow Ray Tracing".

use crate::order::sorted_slots;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::WideTree;

/// Larger boxes first.
pub(crate) fn plan<const N: usize>(bvh: &WideTree<N>) -> SlotOrder {
    let slots = bvh
        .nodes
        .iter()
        .flat_map(|node| sorted_slots(node, &[0.0; N]))
        .collect();
    SlotOrder {
        slots,
        ..SlotOrder::as_built(bvh.shape())
    }
}
