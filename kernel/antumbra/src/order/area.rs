//! Surface area traversal order: larger boxes first.
//!
//! Source: Nah and Manocha (2014), "SATO: Surface Area Traversal Order for Shadow Ray Tracing".

use crate::order::sorted_slots;
use crate::tree::node::MAX_WIDTH;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;

/// Larger boxes first.
pub(crate) fn plan(tree: &Tree) -> SlotOrder {
    let mut order = SlotOrder::of_nothing(tree);
    for node in tree.nodes.iter() {
        order.push(&sorted_slots(node, &[0.0; MAX_WIDTH]));
    }
    order
}
