//! Child orders: in which sequence an occlusion query visits the children of a node.
//!
//! An order is a permutation of slots, worked out once ([`SlotOrder`]) and applied once. The cost of a query depends on
//! the order, its answer never does. Closest-hit queries go front to back and do not notice.
//!
//! - without rays: `random`: any order;  `area`: larger boxes first;  `size`: fewer primitives first;  `rtsah`: for
//!   uniform rays
//! - learned from a training log: `ratio`: the paper's rule and its cost model;  `joint`: least measured cost
//! - `arrange`: the cheapest order of a few things;  `oracle`: a bound for every order

pub(crate) mod area;
mod arrange;
mod joint;
pub(crate) mod oracle;
mod random;
pub(crate) mod ratio;
mod rtsah;
pub(crate) mod size;
#[cfg(test)]
mod worked_example;

use core::fmt;
use core::str::FromStr;

use crate::error::Error;
use crate::learn::{Log, LogKind};
use crate::tree::costs::CostModel;
use crate::tree::directed::Rule;
use crate::tree::node::Node;
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Bvh;

use joint::Directions;
use ratio::Estimate;

pub use oracle::Visits;

/// An order of visiting children: published ones, bounds to compare them with, and what else a log can teach.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Order {
    /// As the collapse left them: unless that learned an order, the depth-first one of the binary tree.
    Simple,
    /// At random, one permutation for each node: what others have to beat.
    Random,
    /// Front to back, by entry distance, decided for every ray.
    Ftob,
    /// Larger surface area first (Nah and Manocha 2014).
    Sato,
    /// Fewer primitives first, as Embree's static order has it.
    Embree,
    /// Least cost for uniform rays (Ize and Hansen 2011).
    Rtsah,
    /// Learned from leaf hits alone (Ogaki and Derouet-Jourdan 2016, equation 4).
    SortMinus,
    /// Learned from leaf and box hits (their equation 5).
    Sort,
    /// The same, with children shuffled at random while logging.
    SortPlus,
    /// The same without shuffling: hits of a child are counted against the rays that came to it.
    Visits,
    /// Least measured cost of the rays in the log, without the assumption that children are independent.
    Joint,
    /// The same with two orders for each node, chosen by the sign of the ray's direction on one axis.
    TwoWay,
    /// The same with eight orders for each node, one for each octant of directions.
    Octants,
}

impl Order {
    /// Every order there is.
    pub const ALL: [Self; 13] = [
        Self::Simple,
        Self::Random,
        Self::Ftob,
        Self::Sato,
        Self::Embree,
        Self::Rtsah,
        Self::SortMinus,
        Self::Sort,
        Self::SortPlus,
        Self::Visits,
        Self::Joint,
        Self::TwoWay,
        Self::Octants,
    ];

    /// The name used on the command line, in scene files and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Simple => "simple",
            Self::Random => "random",
            Self::Ftob => "ftob",
            Self::Sato => "sato",
            Self::Embree => "embree",
            Self::Rtsah => "rtsah",
            Self::SortMinus => "sort-",
            Self::Sort => "sort",
            Self::SortPlus => "sort+",
            Self::Visits => "visits",
            Self::Joint => "joint",
            Self::TwoWay => "two-way",
            Self::Octants => "octants",
        }
    }

    /// The names of all, separated by commas.
    pub fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }

    /// The log it learns from; `None` if it needs none. A log of a kind that covers this one does as well, see
    /// [`LogKind::covers`].
    pub const fn log_kind(self) -> Option<LogKind> {
        let kind = LogKind {
            boxes: true,
            shuffled: false,
            masks: false,
        };
        match self {
            Self::Simple | Self::Random | Self::Ftob | Self::Sato | Self::Embree | Self::Rtsah => {
                None
            }
            Self::SortMinus => Some(LogKind {
                boxes: false,
                ..kind
            }),
            Self::Sort | Self::Visits => Some(kind),
            Self::SortPlus => Some(LogKind {
                shuffled: true,
                ..kind
            }),
            // Masks are the same whether shuffled or not; so that sort+ and these share a log, it is.
            Self::Joint | Self::TwoWay | Self::Octants => Some(LogKind {
                shuffled: true,
                masks: true,
                ..kind
            }),
        }
    }
}

impl fmt::Display for Order {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no [`Order`] has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown order `{0}`; known are {known}", known = Order::names())]
pub struct UnknownOrder(pub String);

impl FromStr for Order {
    type Err = UnknownOrder;

    fn from_str(name: &str) -> Result<Self, UnknownOrder> {
        Self::ALL
            .into_iter()
            .find(|order| order.name() == name)
            .ok_or_else(|| UnknownOrder(name.to_owned()))
    }
}

/// Works out an order for a tree whose slots stand as its builder left them.
pub(crate) fn plan<const N: usize>(
    bvh: &Bvh<N>,
    order: Order,
    log: Option<&Log>,
    model: &CostModel,
) -> Result<SlotOrder, Error> {
    let needed = || log.ok_or(Error::NeedsLog(order.name()));
    let with_boxes = || {
        let log = needed()?;
        if log.kind().boxes {
            Ok(log)
        } else {
            Err(Error::NeedsBoxes(order.name()))
        }
    };
    match order {
        Order::Simple => Ok(SlotOrder::as_built(bvh.shape())),
        Order::Random => Ok(random::plan(bvh)),
        Order::Ftob => Ok(SlotOrder {
            pick: Rule::Distance,
            ..SlotOrder::as_built(bvh.shape())
        }),
        Order::Sato => Ok(area::plan(bvh)),
        Order::Embree => Ok(size::plan(bvh)),
        Order::Rtsah => Ok(rtsah::plan(bvh, model)),
        Order::SortMinus => ratio::plan(bvh, needed()?, model, Estimate::Poor),
        Order::Sort | Order::SortPlus => ratio::plan(bvh, with_boxes()?, model, Estimate::Precise),
        Order::Visits => ratio::plan(bvh, with_boxes()?, model, Estimate::Visited),
        Order::Joint => joint::plan(bvh, order, needed()?, model, Directions::One),
        Order::TwoWay => joint::plan(bvh, order, needed()?, model, Directions::Two),
        Order::Octants => joint::plan(bvh, order, needed()?, model, Directions::Eight),
    }
}

/// Sorts the occupied slots of a node by falling `key`, equal keys by falling area, then by slot.
/// Keys are not NaN.
pub(crate) fn sorted_slots<const N: usize>(node: &Node<N>, key: &[f64; N]) -> [u8; N] {
    let areas = core::array::from_fn(|slot| node.bounds(slot).half_area());
    sorted_by_key(node.len(), key, &areas)
}

/// [`sorted_slots`] for `len` occupied slots whose boxes have these areas.
pub(crate) fn sorted_by_key<const N: usize>(
    len: usize,
    key: &[f64; N],
    areas: &[f32; N],
) -> [u8; N] {
    let mut slots: [u8; N] = core::array::from_fn(|slot| slot as u8);
    slots[..len].sort_by(|&a, &b| {
        let (a, b) = (a as usize, b as usize);
        key[b]
            .total_cmp(&key[a])
            .then(areas[b].total_cmp(&areas[a]))
    });
    slots
}
