//! One order of the children of a node, or several by direction, for the rays that come to it.

use alloc::vec::Vec;

use super::groups::least_cost;
use super::passage::{Passage, by_ratio};
use crate::tree::node::Node;

/// How many orders a node has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Directions {
    /// One for all rays.
    One,
    /// One for each sign of the direction on an axis: the axis on which two orders save most.
    #[cfg(feature = "lab")]
    Two,
    /// One for each octant of directions.
    #[cfg(feature = "lab")]
    Eight,
}

/// The orders of a node: one, or several by the direction of the ray.
#[derive(Clone, Debug)]
pub(crate) struct NodeOrders<const N: usize> {
    /// The order for rays of all directions.
    pub all: [u8; N],
    /// The axis whose sign decides, if there are two orders; 0 otherwise.
    #[cfg(feature = "lab")]
    pub axis: usize,
    /// Orders by octant. Empty: all are alike.
    pub octants: Vec<[u8; N]>,
}

impl<const N: usize> NodeOrders<N> {
    /// One order for all rays.
    pub fn one(all: [u8; N]) -> Self {
        Self {
            all,
            #[cfg(feature = "lab")]
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
#[cfg_attr(
    not(feature = "lab"),
    expect(unused_variables, reason = "one for all rays")
)]
pub(super) fn node_orders<const N: usize>(
    node: &Node<N>,
    passages: &[Passage<N>],
    directions: Directions,
) -> NodeOrders<N> {
    let ratio = by_ratio(node, passages);
    let all = least_cost(passages, &ratio, &|passage| passage.weight);
    #[cfg(feature = "lab")]
    if directions != Directions::One {
        return crate::lab::orders::by_direction(passages, all, &ratio, directions);
    }
    NodeOrders::one(all)
}
