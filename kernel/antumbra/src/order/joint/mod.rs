//! The orders of least measured cost: they minimise what the rays of a log would really have cost, without the
//! assumption of the paper's model that hits of different children are independent.
//!
//! The log says of every ray and every node that it comes to which boxes it hits and below which of them something
//! occludes it, whether or not an occlusion query would have come there ([`RayLog`]). Given an order, the ray's cost in
//! the node is the cost of the children hit, up to the first that occludes it, and each child's cost for this very ray
//! follows from the child's own order: nodes are computed bottom-up. The cheapest order of the children is found by
//! [`arrange()`]: exactly for up to eight children that occlude anything, nearly so for more.
//!
//! A child that never occludes is best visited after all that do; which of those comes first does not matter to the
//! log. They, and children in doubt, are sorted by the paper's rule `H / (I C)`, with its chances taken from the same
//! log and blended with a prior as in [`crate::order::ratio`]. Nodes that no ray came to keep area order.
//!
//! Which rays come to a node depends on the orders of the nodes above it, which are not known yet. So the nodes are
//! sorted twice (`ROUNDS`): at first for all rays that hit their boxes, then for those that come to them in the tree so
//! sorted. Rays that something else occludes before count little then, but not nothing (`STOPPED`), so that few rays do
//! not decide by themselves.
//!
//! - `learner`: the walk through all nodes;  `passage`: rays in one node;  `groups`: the cheapest order there

mod groups;
pub(crate) mod learner;
mod passage;
#[cfg(test)]
mod tests;

use crate::error::Error;
use crate::learn::log::Log;
use crate::monitor::BuildMonitor;
use crate::order::Order;
use crate::order::ratio::all_sorted_lanes;
use crate::tree::costs::CostModel;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;

use learner::Learner;

/// Works out the order of least measured cost. If the monitor stops it, the order is of no use.
pub(crate) fn plan(
    tree: &Tree,
    log: &Log,
    model: &CostModel,
    monitor: &dyn BuildMonitor,
) -> Result<SlotOrder, Error> {
    Error::unless_fits(log.shape(), tree.shape())?;
    let rays = log.masks().ok_or(Error::NeedsMasks(Order::Joint.name()))?;
    let mut order = Learner::new(tree, rays, model).learn(monitor);
    order.lanes = all_sorted_lanes(tree, log);
    Ok(order)
}
