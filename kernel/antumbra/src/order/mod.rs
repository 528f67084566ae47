//! Child orders: in which sequence an occlusion query visits the children of a node.
//!
//! An order is a permutation of slots, computed once ([`SlotOrder`]) and applied once. The cost of a query depends on
//! the order, its answer never does. Closest-hit queries go front to back and do not notice.
//!
//! - without rays: `area`: larger boxes first;  `size`: fewer primitives first
//! - learned from a training log: `ratio`: the paper's rule and its cost model;  `joint`: least measured cost
//! - `arrange`: the cheapest order of a few things
//!
//! Other orders plug in through [`Plan`].

pub(crate) mod area;
pub(crate) mod arrange;
pub(crate) mod joint;
pub(crate) mod ratio;
pub(crate) mod size;

use crate::error::Error;
use crate::learn::{Log, LogKind};
use crate::monitor::BuildMonitor;
use crate::tree::costs::CostModel;
use crate::tree::node::{AS_THEY_ARE, NodeRef, PerSlot};
use crate::tree::slot_order::{Pick, SlotOrder};
use crate::tree::wide::Tree;
use antumbra_simd::{Row, named_list};

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
    pub enum Order("order"): Properties, open Plan {
        Simple = "simple",
            "Children stay as the collapse left them",
            None, Properties::WITHOUT_LOG;
        Sato = "sato",
            "Larger surface area first",
            Some("Nah and Manocha 2014"), Properties::WITHOUT_LOG;
        Embree = "embree",
            "Fewer primitives first, as Embree's static order has it",
            None, Properties::WITHOUT_LOG;
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
    /// The kind of log that it learns from.
    pub log: Option<LogKind>,
    picks_by_ray: bool,
}

impl Properties {
    /// Needs no rays.
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

    fn of(plan: &dyn Plan) -> Self {
        Self {
            log: plan.log(),
            picks_by_ray: plan.pick().is_some(),
        }
    }
}

impl Order {
    /// Kind of log it learns from; `None` if it needs none. A log of a kind that
    /// [covers](LogKind::covers) this one does as well.
    pub fn log_kind(self) -> Option<LogKind> {
        self.properties().log
    }

    /// Whether it learns from training rays.
    pub fn learns(self) -> bool {
        self.properties().log.is_some()
    }

    /// Whether the sequence depends on the ray, of which the paper's cost model knows nothing.
    pub fn picks_by_ray(self) -> bool {
        self.properties().picks_by_ray
    }
}

/// A child order of your own, for [`Order::Other`].
///
/// An order is a permutation of the slots of every node, or a look at the ray in every node. It changes the cost of
/// occlusion queries and never an answer.
///
/// ```
/// use antumbra::parts::{Log, Plan, Row, SlotOrder, Tree};
/// use antumbra::recipe::{CostModel, Order};
/// use antumbra::{Bvh, Error, Geometry, Recipe};
///
/// /// Children in the reverse of the order in which the collapse left them.
/// struct Reverse;
///
/// impl Row for Reverse {
///     fn name(&self) -> &'static str { "reverse" }
///     fn sentence(&self) -> &'static str { "The last child first" }
///     fn source(&self) -> Option<&'static str> { None }
/// }
///
/// impl Plan for Reverse {
///     fn plan(&self, tree: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
///         let mut order = SlotOrder::of_nodes(tree);
///         for index in 0..tree.node_count() {
///             let len = tree.node(index).len();
///             order.arrange(index, |slot| if slot < len { len - 1 - slot } else { slot });
///         }
///         Ok(order)
///     }
/// }
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let bvh = Bvh::build(&geometry, &Recipe::default().order(Order::Other(&Reverse)))?;
/// # bvh.validate().unwrap();
/// # Ok::<(), antumbra::Error>(())
/// ```
pub trait Plan: Row {
    /// The kind of log that it learns from; `None`, as here, if it needs no rays.
    fn log(&self) -> Option<LogKind> {
        None
    }

    /// Computes the order of a tree whose slots are as its collapse left them. There is a log, of the kind requested, if it
    /// learns from one and there were rays.
    ///
    /// # Errors
    /// What the log lacks. Builds return it, and [`Bvh::relearn`](crate::Bvh::relearn) panics.
    fn plan(&self, tree: &Tree, log: Option<&Log>, costs: &CostModel) -> Result<SlotOrder, Error>;

    /// What looks at the ray in every node, for an order that is no permutation of slots.
    fn pick(&self) -> Option<&'static dyn Pick> {
        None
    }
}

/// Computes an order for a tree whose slots are as its builder left them.
pub(crate) fn plan(
    tree: &Tree,
    order: Order,
    log: Option<&Log>,
    model: &CostModel,
    monitor: &dyn BuildMonitor,
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
        Order::Simple => Ok(SlotOrder::of_nothing(tree)),
        Order::Sato => Ok(area::plan(tree)),
        Order::Embree => Ok(size::plan(tree)),
        Order::SortMinus => ratio::plan(tree, needed()?, model, Estimate::Poor),
        Order::Sort | Order::SortPlus => ratio::plan(tree, with_boxes()?, model, Estimate::Precise),
        Order::Visits => ratio::plan(tree, with_boxes()?, model, Estimate::Visited),
        Order::Joint => joint::plan(tree, needed()?, model, monitor),
        Order::Other(other) => other.plan(tree, log, model).map(|planned| SlotOrder {
            pick: other.pick(),
            ..planned
        }),
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
