//! The cheapest order of the children of one node for the rays that come to it.

use alloc::vec;
use alloc::vec::Vec;

use super::passage::Passage;
use crate::order::arrange::{Costs, EXACT, arrange};
use crate::tree::node::{AS_THEY_ARE, MAX_WIDTH, PerSlot};

/// The order in which children that occlude any ray come first, as is cheapest, and the others follow in the order of
/// `ratio`.
pub(super) fn least_cost(passages: &[Passage], ratio: &[u8]) -> PerSlot<u8> {
    let any = passages
        .iter()
        .fold(0, |any, passage| any | passage.occluding);
    let mut all = AS_THEY_ARE;
    let order = &mut all[..ratio.len()];
    order.copy_from_slice(ratio);
    order.sort_by_key(|slot| any >> slot & 1 == 0);
    let first = &mut order[..any.count_ones() as usize];
    let groups = Groups::new(passages, first);
    let arranged = if first.len() <= EXACT {
        arrange(first.len(), &groups.table())
    } else {
        arrange(first.len(), &groups)
    };
    let slots: Vec<_> = arranged.into_iter().map(|thing| first[thing]).collect();
    first.copy_from_slice(&slots);
    all
}

/// Rays that the same children occlude stop together, so that it is enough to know the sums of their costs.
/// Children are numbered as they were given.
struct Groups {
    len: usize,
    groups: Vec<Group>,
}

/// Rays that the same children occlude.
struct Group {
    /// The children that occlude them.
    occluding: u32,
    /// Sum of the weights of the rays.
    weight: f64,
    /// Sums of the costs of each child, weighted.
    costs: PerSlot<f64>,
}

impl Groups {
    /// Groups for the order of only these children.
    fn new(passages: &[Passage], children: &[u8]) -> Self {
        // Rays that nothing occludes cost the same in any order; so do those that hit but one box.
        let mut stopped: Vec<_> = passages
            .iter()
            .filter(|passage| passage.occluding != 0 && passage.hit.count_ones() > 1)
            .collect();
        stopped.sort_by_key(|passage| passage.occluding);
        let groups = stopped
            .chunk_by(|a, b| a.occluding == b.occluding)
            .map(|passages| {
                let occluding = children.iter().enumerate().fold(0, |set, (child, slot)| {
                    set | u32::from(passages[0].occluding >> slot & 1) << child
                });
                let mut group = Group {
                    occluding,
                    weight: 0.0,
                    costs: [0.0; MAX_WIDTH],
                };
                for passage in passages {
                    group.weight += passage.weight;
                    for (cost, &slot) in group.costs.iter_mut().zip(children) {
                        *cost += passage.weight * passage.costs[slot as usize];
                    }
                }
                group
            })
            .collect();
        Self {
            len: children.len(),
            groups,
        }
    }

    /// Costs computed beforehand for all sets of at most [`EXACT`] children.
    fn table(&self) -> Table {
        let sets = 1usize << self.len;
        let mut costs = vec![[0.0; EXACT]; sets];
        for group in &self.groups {
            // Those that are not stopped by a set are those that only others occlude.
            let sum = &mut costs[group.occluding as usize];
            for (sum, cost) in sum.iter_mut().zip(&group.costs) {
                *sum += cost;
            }
        }
        // Sums over all subsets, one element after the other.
        for element in 0..self.len {
            for set in (0..sets).filter(|set| set >> element & 1 == 1) {
                let part = costs[set ^ 1 << element];
                for (sum, cost) in costs[set].iter_mut().zip(part) {
                    *sum += cost;
                }
            }
        }
        Table { costs }
    }
}

impl Costs for Groups {
    fn cost(&self, child: usize, before: u32) -> f64 {
        let mut sum = 0.0;
        for group in &self.groups {
            sum += if group.occluding & before == 0 {
                group.costs[child]
            } else {
                0.0
            };
        }
        sum
    }

    /// Weight of the rays that a child stops.
    fn gain(&self, child: usize, before: u32) -> f64 {
        let mut sum = 0.0;
        for group in &self.groups {
            let stops = group.occluding & before == 0 && group.occluding >> child & 1 == 1;
            sum += if stops { group.weight } else { 0.0 };
        }
        sum
    }
}

/// Costs by the set of the children that do *not* come before.
struct Table {
    costs: Vec<[f64; EXACT]>,
}

impl Costs for Table {
    fn cost(&self, child: usize, before: u32) -> f64 {
        self.costs[self.costs.len() - 1 - before as usize][child]
    }

    /// Not called: so few children are arranged exactly.
    fn gain(&self, _: usize, _: u32) -> f64 {
        0.0
    }
}
