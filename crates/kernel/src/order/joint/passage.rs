//! Rays of a log in the node that is being sorted.

use crate::order::ratio::{area_shares, precise_chances};
use crate::order::sorted_by_key;
use crate::tree::node::Node;

/// A ray in the node that is being sorted.
pub(crate) struct Passage<const N: usize> {
    /// Its visit, as the log counts them.
    pub visit: usize,
    /// Slots whose boxes it hits.
    pub hit: u16,
    /// Slots of `hit` below which something occludes it.
    pub occluding: u16,
    /// Weight of the ray in the costs of the node.
    pub weight: f64,
    /// Cost of entering each child; 0 for those whose boxes it misses.
    pub costs: [f64; N],
}

impl<const N: usize> Passage<N> {
    /// Cost of visiting the children in this order until one occludes the ray.
    pub fn cost(&self, order: &[u8; N]) -> f64 {
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
pub(super) fn by_ratio<const N: usize>(node: &Node<N>, passages: &[Passage<N>]) -> [u8; N] {
    let (mut hits, mut occluded, mut costs) = ([0.0; N], [0.0; N], [0.0; N]);
    for passage in passages {
        for slot in 0..N {
            hits[slot] += f64::from(passage.hit >> slot & 1);
            occluded[slot] += f64::from(passage.occluding >> slot & 1);
            costs[slot] += passage.costs[slot];
        }
    }
    let areas = core::array::from_fn(|slot| node.bounds(slot).half_area());
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
