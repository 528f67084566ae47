//! One order of the children of a node, or several by direction, for the rays that come to it.

use alloc::vec::Vec;

use super::groups::least_cost;
use super::passage::{Passage, by_ratio};
use crate::tree::node::Node;

/// Weight of a ray for the order of another direction.
const OTHERS: f64 = 0.1;

/// How many orders a node has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Directions {
    /// One for all rays.
    One,
    /// One for each sign of the direction on an axis: the axis on which two orders save most.
    Two,
    /// One for each octant of directions.
    Eight,
}

/// The orders of a node: one, or several by the direction of the ray.
#[derive(Clone, Debug)]
pub(super) struct NodeOrders<const N: usize> {
    /// The order for rays of all directions.
    pub all: [u8; N],
    /// The axis whose sign decides, if there are two orders; 0 otherwise.
    pub axis: usize,
    /// Orders by octant. Empty: all are alike.
    octants: Vec<[u8; N]>,
}

impl<const N: usize> NodeOrders<N> {
    /// One order for all rays.
    pub fn one(all: [u8; N]) -> Self {
        Self {
            all,
            axis: 0,
            octants: Vec::new(),
        }
    }

    /// The order for rays of an octant.
    pub fn of(&self, octant: usize) -> [u8; N] {
        self.octants.get(octant).copied().unwrap_or(self.all)
    }
}

/// The orders of a node for these rays, of which there are some.
pub(super) fn node_orders<const N: usize>(
    node: &Node<N>,
    passages: &[Passage<N>],
    directions: Directions,
) -> NodeOrders<N> {
    let ratio = by_ratio(node, passages);
    let all = least_cost(passages, &ratio, &|passage| passage.weight);
    // The order for the rays of some octants, for which the others count a little.
    let own = |is_own: &dyn Fn(u8) -> bool| {
        least_cost(passages, &ratio, &|passage| {
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
