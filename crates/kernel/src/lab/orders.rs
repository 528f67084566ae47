//! Orders of the laboratory: what plans the rows of [`Order`] that only the feature `lab` has.

use super::{random, rtsah};
use crate::order::Order;
use crate::tree::costs::CostModel;
use crate::tree::rule::Rule;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::WideTree;

/// Plans an order that [`crate::order::plan`] leaves to the laboratory.
pub(crate) fn plan<const N: usize>(
    bvh: &WideTree<N>,
    order: Order,
    model: &CostModel,
) -> SlotOrder {
    match order {
        Order::Random => random::plan(bvh),
        Order::Ftob => SlotOrder {
            pick: Rule::Distance,
            ..SlotOrder::as_built(bvh.shape())
        },
        Order::Rtsah => rtsah::plan(bvh, model),
        _ => SlotOrder::as_built(bvh.shape()),
    }
}
