//! Child orders: in which sequence an occlusion query visits the children of a node.
//!
//! An order is a permutation of slots, computed once ([`SlotOrder`]) and applied once. The cost of a query depends on
//! the order, its answer never does. Closest-hit queries go front to back and do not notice.
//!
//! - without rays: `area`: larger boxes first;  `size`: fewer primitives first
//! - learned from a training log: `ratio`: the paper's rule and its cost model;  `joint`: least measured cost
//! - `arrange`: the cheapest order of a few things
//!
//! Rows that the table has only with the feature `lab` are planned in [`crate::lab`].

pub(crate) mod area;
pub(crate) mod arrange;
pub(crate) mod joint;
pub(crate) mod ratio;
pub(crate) mod size;
#[cfg(test)]
mod worked_example;

use crate::error::Error;
use crate::learn::{Log, LogKind};
use crate::tree::costs::CostModel;
use crate::tree::node::{NodeRef, PerSlot};
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;
use antumbra_simd::named_list;

use ratio::Estimate;

named_list! {
    /// Child order: in which sequence an occlusion ray visits the children it hits.
    ///
    /// ```
    /// use antumbra::recipe::Order;
    ///
    /// assert_eq!("sort+".parse(), Ok(Order::SortPlus));
    /// assert_eq!(Order::default(), Order::Joint);
    /// ```
    #[derive(Default)]
    pub enum Order("order"): Properties {
        Simple = "simple",
            "Children stay as the collapse left them",
            None, Properties::WITHOUT_LOG;
        Random if "lab" = "random",
            "A random permutation for each node: what the others have to beat",
            None, Properties::WITHOUT_LOG;
        Ftob if "lab" = "ftob",
            "Front to back by entry distance, decided for every ray",
            None, Properties { picks_by_ray: true, ..Properties::WITHOUT_LOG };
        Sato = "sato",
            "Larger surface area first",
            Some("Nah and Manocha 2014"), Properties::WITHOUT_LOG;
        Embree = "embree",
            "Fewer primitives first, as Embree's static order has it",
            None, Properties::WITHOUT_LOG;
        Rtsah if "lab" = "rtsah",
            "Least cost for uniform rays",
            Some("Ize and Hansen 2011"), Properties::WITHOUT_LOG;
        SortMinus = "sort-",
            "Learned from leaf hits alone (equation 4)",
            Some("Ogaki and Derouet-Jourdan 2016"), Properties::learns(LogKind { boxes: false, shuffled: false, masks: false });
        Sort = "sort",
            "Learned from leaf and box hits (equation 5)",
            Some("Ogaki and Derouet-Jourdan 2016"), Properties::learns(LogKind { boxes: true, shuffled: false, masks: false });
        SortPlus = "sort+",
            "Learned as `sort`, with children shuffled at random while logging",
            Some("Ogaki and Derouet-Jourdan 2016"), Properties::learns(LogKind { boxes: true, shuffled: true, masks: false });
        Visits = "visits",
            "Learned as `sort`, with hits of a child counted against the rays that came to it",
            None, Properties::learns(LogKind { boxes: true, shuffled: false, masks: false });
        #[default]
        Joint = "joint",
            "Least measured cost of the training rays; children need not be independent",
            None, Properties::learns(MASKS);
    }
}

/// What `joint` and its relatives log. Masks are equal whether shuffled or not; shuffled, `sort+` can share the log.
const MASKS: LogKind = LogKind {
    boxes: true,
    shuffled: true,
    masks: true,
};

/// Columns of the table of orders.
pub(crate) struct Properties {
    pub log: Option<LogKind>,
    picks_by_ray: bool,
}

impl Properties {
    /// Learns nothing, and is the same for every ray.
    const WITHOUT_LOG: Self = Self {
        log: None,
        picks_by_ray: false,
    };

    /// Learns from a log of this kind.
    const fn learns(kind: LogKind) -> Self {
        Self {
            log: Some(kind),
            picks_by_ray: false,
        }
    }
}

impl Order {
    /// Kind of log it learns from; `None` if it needs none. A log of a kind that
    /// [covers](LogKind::covers) this one does as well.
    #[cfg(feature = "lab")]
    pub const fn log_kind(self) -> Option<LogKind> {
        self.properties().log
    }

    /// Whether it learns from training rays.
    pub const fn learns(self) -> bool {
        self.properties().log.is_some()
    }

    /// Whether the sequence depends on the ray, of which the paper's cost model knows nothing.
    pub const fn picks_by_ray(self) -> bool {
        self.properties().picks_by_ray
    }
}

/// Computes an order for a tree whose slots are as its builder left them.
pub(crate) fn plan(
    tree: &Tree,
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
        Order::Simple => Ok(SlotOrder::as_built(tree.shape())),
        Order::Sato => Ok(area::plan(tree)),
        Order::Embree => Ok(size::plan(tree)),
        Order::SortMinus => ratio::plan(tree, needed()?, model, Estimate::Poor),
        Order::Sort | Order::SortPlus => ratio::plan(tree, with_boxes()?, model, Estimate::Precise),
        Order::Visits => ratio::plan(tree, with_boxes()?, model, Estimate::Visited),
        Order::Joint => joint::plan(tree, needed()?, model),
        #[cfg(feature = "lab")]
        order => Ok(crate::lab::orders::plan(tree, order, model)),
    }
}

/// Sorts the occupied slots of a node by falling `key`, equal keys by falling area, then by slot.
/// Keys are not NaN.
pub(crate) fn sorted_slots(node: NodeRef<'_>, key: &PerSlot<f64>) -> PerSlot<u8> {
    sorted_by_key(node.len(), key, &node.areas())
}

/// [`sorted_slots`] for `len` occupied slots whose boxes have these areas.
pub(crate) fn sorted_by_key(len: usize, key: &PerSlot<f64>, areas: &PerSlot<f32>) -> PerSlot<u8> {
    let mut slots = AS_THEY_ARE;
    slots[..len].sort_by(|&a, &b| {
        let (a, b) = (a as usize, b as usize);
        key[b]
            .total_cmp(&key[a])
            .then(areas[b].total_cmp(&areas[a]))
    });
    slots
}

/// Every slot in its place.
pub(crate) const AS_THEY_ARE: PerSlot<u8> = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
