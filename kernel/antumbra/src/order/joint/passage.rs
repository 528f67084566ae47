//! Rays of a log in the node that is being sorted.

use crate::order::ratio::{area_shares, precise_chances};
use crate::order::sorted_by_key;
use crate::tree::node::{MAX_WIDTH, NodeRef, PerSlot};

/// A ray in the node that is being sorted.
pub(crate) struct Passage {
    /// Its visit, as the log counts them.
    pub visit: usize,
    /// Slots whose boxes it hits.
    pub hit: u16,
    /// Slots of `hit` below which something occludes it.
    pub occluding: u16,
    /// Weight of the ray in the costs of the node.
    pub weight: f64,
    /// Cost of entering each child; 0 for those whose boxes it misses.
    pub costs: PerSlot<f64>,
}

impl Passage {
    /// Cost of visiting the children in this order until one occludes the ray.
    pub fn cost(&self, order: &[u8]) -> f64 {
        let mut cost = 0.0;
        for &slot in order {
            cost += self.costs[slot as usize];
            if self.occluding >> slot & 1 == 1 {
                break;
            }
        }
        cost
    }
}

/// The order of the children of a node by the paper's rule, see [`crate::order::ratio`], for the rays in it.
pub(super) fn by_ratio(node: NodeRef<'_>, passages: &[Passage]) -> PerSlot<u8> {
    let [mut hits, mut occluded, mut costs] = [[0.0; MAX_WIDTH]; 3];
    for passage in passages {
        for slot in 0..node.width() {
            hits[slot] += f64::from(passage.hit >> slot & 1);
            occluded[slot] += f64::from(passage.occluding >> slot & 1);
            costs[slot] += passage.costs[slot];
        }
    }
    let areas = node.areas();
    let shares = area_shares(&areas, node.all_bounds().half_area());
    let entered = passages.len() as f64;
    let mut chances = precise_chances(node.len(), entered, &hits, &occluded, &shares);
    for (slot, chance) in chances.iter_mut().enumerate() {
        if hits[slot] > 0.0 {
            chance.cost = costs[slot] / hits[slot];
        }
    }
    sorted_by_key(node.len(), &chances.map(|chance| chance.key()), &areas)
}
