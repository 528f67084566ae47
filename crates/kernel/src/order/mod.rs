//! Child orders: in which sequence an occlusion query visits the children of a node.
//!
//! An order is a permutation of slots, worked out once ([`SlotOrder`]) and applied once; it changes the
//! cost of a query, never its answer. Closest-hit queries go front to back and do not notice.
//!
//! - `area`: larger boxes first;  `size`: fewer primitives first
//! - `log`: what sample shadow rays met;  `learned`: orders from a log, and the cost model
//! - `tree_log`: what they meet in the binary tree, which collapses learn from as well
//! - `surface_rays`: rays to learn from when nobody gives any;  `placed_surfaces`: of instances

pub(crate) mod area;
pub(crate) mod learned;
pub(crate) mod log;
mod placed_surfaces;
pub(crate) mod size;
pub(crate) mod surface_rays;
pub(crate) mod tree_log;

use core::fmt;
use core::str::FromStr;

use crate::bvh::Bvh;
use crate::error::Error;
use crate::geometry::BLOCK;
use crate::node::Node;
use crate::primitives::PrimKind;

pub use log::{Log, LogKind};
pub use surface_rays::surface_rays;
pub use tree_log::TreeLog;

/// A published order of visiting children.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Order {
    /// As the collapse left them: unless that learned an order, the depth-first one of the binary tree.
    Simple,
    /// Front to back, by entry distance, decided for every ray.
    Ftob,
    /// Larger surface area first (Nah and Manocha 2014).
    Sato,
    /// Fewer primitives first, as Embree's static order has it.
    Embree,
    /// Learned from leaf hits alone (Ogaki and Derouet-Jourdan 2016, equation 4).
    SortMinus,
    /// Learned from leaf and box hits (their equation 5).
    Sort,
    /// The same, with children shuffled at random while logging.
    SortPlus,
}

impl Order {
    /// Every order there is.
    pub const ALL: [Self; 7] = [
        Self::Simple,
        Self::Ftob,
        Self::Sato,
        Self::Embree,
        Self::SortMinus,
        Self::Sort,
        Self::SortPlus,
    ];

    /// The name used on the command line, in scene files and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Simple => "simple",
            Self::Ftob => "ftob",
            Self::Sato => "sato",
            Self::Embree => "embree",
            Self::SortMinus => "sort-",
            Self::Sort => "sort",
            Self::SortPlus => "sort+",
        }
    }

    /// The log it learns from; `None` if it needs none.
    pub const fn log_kind(self) -> Option<LogKind> {
        match self {
            Self::Simple | Self::Ftob | Self::Sato | Self::Embree => None,
            Self::SortMinus => Some(LogKind {
                boxes: false,
                shuffled: false,
            }),
            Self::Sort => Some(LogKind {
                boxes: true,
                shuffled: false,
            }),
            Self::SortPlus => Some(LogKind {
                boxes: true,
                shuffled: true,
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
#[error("unknown order `{0}`; known are simple, ftob, sato, embree, sort-, sort, sort+")]
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

/// What a step costs, in units of the user's choice: the constants of the paper's equation (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostModel {
    /// `C_mb`: testing the N boxes of a node.
    pub node: f32,
    /// `C_p`: testing one primitive.
    pub prim: f32,
    /// Entering an instance and leaving it again, without what is visited in between.
    pub entry: f32,
    /// The same of a partly transparent triangle.
    pub cutout: f32,
}

impl Default for CostModel {
    /// A node costs 1. A leaf block, of six or seven primitives as a rule, takes 1.0 to 1.4 times as long
    /// as a node. In batches of rays 0.15 is 2 to 4 % faster than 0.25; to cost blocks instead of
    /// primitives changes nothing. A cut-out takes 0.3 with a filter that costs nothing, 0.5 with one that looks
    /// up a bit and 0.8 with one that interpolates texels, all with half of the questions answered before they are
    /// asked (see [`crate::Opacity::coverage`]).
    fn default() -> Self {
        Self {
            node: 1.0,
            prim: 0.15,
            entry: 2.0,
            cutout: 0.5,
        }
    }
}

impl CostModel {
    /// `C_p` of a kind of primitive.
    pub(crate) fn of(&self, kind: PrimKind) -> f32 {
        match kind {
            PrimKind::Triangle | PrimKind::Sphere => self.prim,
            PrimKind::Cutout => self.cutout,
        }
    }
}

/// What a log or an order must have in common with a tree to fit it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Children per node.
    pub width: usize,
    /// How many nodes there are.
    pub nodes: usize,
    /// How many leaf blocks there are.
    pub leaves: usize,
    /// How many instances there are.
    pub instances: usize,
    /// How many objects they place.
    pub objects: usize,
}

impl Shape {
    /// Fails unless this, which something was made for, is the shape of the tree at hand.
    pub(crate) fn check(self, tree: Self) -> Result<(), Error> {
        if self == tree {
            Ok(())
        } else {
            Err(Error::OtherTree {
                expected: tree,
                found: self,
            })
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} nodes of {} children and {} leaves",
            self.nodes, self.width, self.leaves
        )?;
        if self.instances > 0 {
            write!(
                f,
                " with {} instances of {} objects",
                self.instances, self.objects
            )?;
        }
        Ok(())
    }
}

/// A permutation of the slots of every node, and of the primitives of every leaf.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlotOrder {
    /// Of the tree it was planned for.
    pub(crate) shape: Shape,
    /// Per node, N entries: which slot comes to stand here. Empty: leave the nodes as they are.
    pub(crate) slots: Vec<u8>,
    /// Per leaf: which lane comes to stand here. Empty: leave the leaves as they are.
    pub(crate) lanes: Vec<[u8; BLOCK]>,
    /// Pick by entry distance at run time instead.
    pub(crate) front_to_back: bool,
}

impl SlotOrder {
    /// Leaves everything as it is.
    pub(crate) fn as_built(shape: Shape) -> Self {
        Self {
            shape,
            slots: Vec::new(),
            lanes: Vec::new(),
            front_to_back: false,
        }
    }
}

/// Works out an order for a tree whose slots stand as its builder left them.
pub(crate) fn plan<const N: usize>(
    bvh: &Bvh<N>,
    order: Order,
    log: Option<&Log>,
    model: &CostModel,
) -> Result<SlotOrder, Error> {
    match order {
        Order::Simple => Ok(SlotOrder::as_built(bvh.shape())),
        Order::Ftob => Ok(SlotOrder {
            front_to_back: true,
            ..SlotOrder::as_built(bvh.shape())
        }),
        Order::Sato => Ok(area::plan(bvh)),
        Order::Embree => Ok(size::plan(bvh)),
        Order::SortMinus => learned::plan(
            bvh,
            log.ok_or(Error::NeedsLog(order))?,
            model,
            learned::Estimate::Poor,
        ),
        Order::Sort | Order::SortPlus => {
            let log = log.ok_or(Error::NeedsLog(order))?;
            if !log.kind().boxes {
                return Err(Error::NeedsBoxes(order));
            }
            learned::plan(bvh, log, model, learned::Estimate::Precise)
        }
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
