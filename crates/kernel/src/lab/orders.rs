//! Orders of the laboratory: what plans the rows of [`Order`] that only the feature `lab` has.

use super::by_ray::ByRay;
use super::{random, rtsah};
use crate::order::Order;
use crate::tree::costs::CostModel;
use crate::tree::rule::Rule;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;

/// Plans an order that [`crate::order::plan`] leaves to the laboratory.
pub(crate) fn plan(tree: &Tree, order: Order, model: &CostModel) -> SlotOrder {
    match order {
        Order::Random => random::plan(tree),
        Order::Ftob => SlotOrder {
            pick: Rule::ByRay(ByRay::Distance),
            ..SlotOrder::as_built(tree.shape())
        },
        Order::Rtsah => rtsah::plan(tree, model),
        _ => SlotOrder::as_built(tree.shape()),
    }
}
