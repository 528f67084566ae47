//! Orders of the laboratory: what plans the rows of [`Order`] that only the feature `lab` has.

use alloc::vec::Vec;

use super::by_ray::{ByRay, DirectedOrder};
use super::{random, rtsah};
use crate::error::Error;
use crate::learn::Log;
use crate::order::Order;
use crate::order::joint::groups::least_cost;
use crate::order::joint::passage::Passage;
use crate::order::joint::{self, Directions, NodeOrders};
use crate::tree::costs::CostModel;
use crate::tree::rule::Rule;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::WideTree;

/// Weight of a ray for the order of another direction.
const OTHERS: f64 = 0.1;

/// Plans an order that [`crate::order::plan`] leaves to the laboratory.
pub(crate) fn plan<const N: usize>(
    bvh: &WideTree<N>,
    order: Order,
    log: Option<&Log>,
    model: &CostModel,
) -> Result<SlotOrder, Error> {
    let needed = || log.ok_or(Error::NeedsLog(order.name()));
    let by_ray = |rule| SlotOrder {
        pick: Rule::ByRay(rule),
        ..SlotOrder::as_built(bvh.shape())
    };
    match order {
        Order::Random => Ok(random::plan(bvh)),
        Order::Ftob => Ok(by_ray(ByRay::Distance)),
        Order::Far => Ok(by_ray(ByRay::Far)),
        Order::Rtsah => Ok(rtsah::plan(bvh, model)),
        Order::TwoWay => joint::plan(bvh, order, needed()?, model, Directions::Two),
        Order::Octants => joint::plan(bvh, order, needed()?, model, Directions::Eight),
        _ => Ok(SlotOrder::as_built(bvh.shape())),
    }
}

/// The table of the orders by direction, in a tree whose slots are in the order for all.
pub(crate) fn directed<const N: usize>(nodes: &[NodeOrders<N>], count: usize) -> ByRay {
    let mut table = DirectedOrder::with_capacity(count, nodes.len(), N);
    for orders in nodes {
        let mut moved = [0; N];
        for (now, &before) in orders.all.iter().enumerate() {
            moved[before as usize] = now as u8;
        }
        let slots = (0..count).map(|which| {
            let octant = which << orders.axis;
            orders.of(octant).map(|slot| moved[slot as usize])
        });
        table.push(orders.axis, slots);
    }
    ByRay::Direction(table)
}

/// The orders of a node by the direction of the ray, given the order for all rays and the order by the paper's rule.
pub(crate) fn by_direction<const N: usize>(
    passages: &[Passage<N>],
    all: [u8; N],
    ratio: &[u8; N],
    directions: Directions,
) -> NodeOrders<N> {
    // The order for the rays of some octants, for which the others count a little.
    let own = |is_own: &dyn Fn(u8) -> bool| {
        least_cost(passages, ratio, &|passage| {
            let share = if is_own(passage.octant) { 1.0 } else { OTHERS };
            share * passage.weight
        })
    };
    let (axis, octants) = match directions {
        Directions::One => (0, Vec::new()),
        Directions::Two => best_axis(passages, own),
        Directions::Eight => {
            let octants = (0..8).map(|octant| own(&|other| other == octant));
            (0, octants.collect())
        }
    };
    NodeOrders { all, axis, octants }
}

/// The axis on which two orders, one for each sign, cost least, and the order for each octant.
fn best_axis<const N: usize>(
    passages: &[Passage<N>],
    own: impl Fn(&dyn Fn(u8) -> bool) -> [u8; N],
) -> (usize, Vec<[u8; N]>) {
    let (mut least, mut best) = (f64::INFINITY, (0, Vec::new()));
    for axis in 0..3 {
        let sides = [0, 1].map(|negative| own(&|octant| octant >> axis & 1 == negative));
        let octants: [_; 8] = core::array::from_fn(|octant| sides[octant >> axis & 1]);
        let cost = passages
            .iter()
            .map(|passage| passage.weight * passage.cost(&octants[passage.octant as usize]))
            .sum();
        if cost < least {
            (least, best) = (cost, (axis, octants.to_vec()));
        }
    }
    best
}
