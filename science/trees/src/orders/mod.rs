//! Child orders: at random, by areas and by the ray.

pub(crate) mod oracle;
mod random;
mod rtsah;

use antumbra::Error;
use antumbra::parts::{Log, Pick, Plan, SlotOrder, Tree};
use antumbra::recipe::{CostModel, Order, UnknownName};

use crate::{find, rows};

rows! {
    Order;
    RANDOM Random = "random", "A random permutation for each node: what the others have to beat", None;
    FTOB Ftob = "ftob", "Front to back by entry distance, decided for every ray", None;
    RTSAH Rtsah = "rtsah", "Least cost for uniform rays", Some("Ize and Hansen 2011");
}

/// Child orders of the kernel and of this crate.
pub const ORDERS: [Order; 11] = [
    Order::Simple,
    RANDOM,
    FTOB,
    Order::Sato,
    Order::Embree,
    RTSAH,
    Order::SortMinus,
    Order::Sort,
    Order::SortPlus,
    Order::Visits,
    Order::Joint,
];

/// The order of this name among [`ORDERS`].
///
/// # Errors
/// Another name, with those that there are.
pub fn order(name: &str) -> Result<Order, UnknownName> {
    find("order", &ORDERS, Order::name, name)
}

impl Plan for Random {
    fn plan(&self, tree: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
        Ok(random::plan(tree))
    }
}

impl Plan for Rtsah {
    fn plan(&self, tree: &Tree, _: Option<&Log>, costs: &CostModel) -> Result<SlotOrder, Error> {
        Ok(rtsah::plan(tree, costs))
    }
}

impl Plan for Ftob {
    fn plan(&self, tree: &Tree, _: Option<&Log>, _: &CostModel) -> Result<SlotOrder, Error> {
        Ok(SlotOrder::of_nothing(tree))
    }

    fn pick(&self) -> Option<&'static dyn Pick> {
        Some(&Ftob)
    }
}

impl Pick for Ftob {
    /// Boxes that are entered behind the origin count as entered there. Of boxes entered at one distance the lower slot, which
    /// is the upper lane, comes first.
    fn sort(&self, entered: &[f32], lanes: &mut [u32]) {
        let distance = |lane: &u32| entered[*lane as usize].max(0.0);
        // Stable, and lanes ascend: equal ones stay so.
        lanes.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
    }
}
