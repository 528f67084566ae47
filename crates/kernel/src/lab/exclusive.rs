//! A cost model for events that exclude each other, and the order that it makes cheapest.
//!
//! Equation (1) of Ogaki and Derouet-Jourdan (2016) takes the events at different children as independent: of the
//! rays that hit child i, the share `Π (1 - H_j)` is left over by the children before it. Few rays are occluded below
//! more than one child, though, and whether they are depends on which boxes they hit. Counted in pairs,
//!
//! ```text
//! C_any = C_mb + Σ_i I_i C_i (1 - Σ_{j<i} P(j occludes | i is hit))
//! ```
//!
//! where the sum of the probabilities is cut off at 1. That is exact where no ray is occluded below two children, and
//! too low otherwise, by what the events overlap. [`Events::Overlapping`] therefore counts how many rays are occluded
//! below both of two children, too, and takes off each probability the largest share of it that another child has (the
//! bound of Hunter 1976 on a union of events, with a chain of the largest overlaps as its tree). A node needs `2 N²`
//! counts. The cheapest order is found by [`arrange()`], exactly for up to eight children that occlude anything.
//!
//! [`Events::Paired`] takes the same counts for a product, `Π (1 - P(j occludes | i is hit))`: children are independent
//! of each other, but not of whether the box of child i is hit.

use alloc::vec;
use alloc::vec::Vec;

use crate::error::Error;
use crate::learn::log::Log;
use crate::learn::ray_log::{RayLog, Visit};
use crate::order::Order;
use crate::order::arrange::{Costs, arrange};
use crate::order::ratio::sorted_lanes;
use crate::order::sorted_slots;
use crate::tree::costs::CostModel;
use crate::tree::node::{ChildKind, Node};
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::WideTree;

/// How the events at the children of a node depend on each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// Not at all: equation (1), from the same counts.
    Independent,
    /// Exclusive: a ray is occluded below at most one child, so the shares of occluded rays add up.
    Exclusive,
    /// Overlapping: counts of pairs of children say how many rays are occluded below both, and the sum leaves these out
    /// (Hunter's bound).
    Overlapping,
    /// Children do not depend on each other, but on which child a ray hits.
    Paired,
}

impl Events {
    /// All models.
    pub const ALL: [Self; 4] = [
        Self::Independent,
        Self::Exclusive,
        Self::Overlapping,
        Self::Paired,
    ];

    /// Name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Independent => "independent",
            Self::Exclusive => "exclusive",
            Self::Overlapping => "overlapping",
            Self::Paired => "paired",
        }
    }
}

/// The cheapest order by [`Events::Overlapping`].
pub(crate) fn plan<const N: usize>(
    bvh: &WideTree<N>,
    order: Order,
    log: &Log,
    model: &CostModel,
) -> Result<SlotOrder, Error> {
    Error::unless_fits(log.shape(), bvh.shape())?;
    let rays = log.masks().ok_or(Error::NeedsMasks(order.name()))?;
    let mut slots = vec![0; bvh.nodes.len() * N];
    walk(
        bvh,
        rays,
        model,
        Events::Overlapping,
        |index, node, pairs| {
            let order = pairs.cheapest(node);
            slots[index * N..][..N].copy_from_slice(&order);
            order
        },
    );
    let lanes = (0..bvh.leaf_count())
        .map(|leaf| sorted_lanes(log.prim_hits(leaf)))
        .collect();
    Ok(SlotOrder {
        slots,
        lanes,
        ..SlotOrder::as_built(bvh.shape())
    })
}

/// Cost of the root with the slots as they are, by a model whose counts come from a log of masks.
pub(crate) fn predicted_cost<const N: usize>(
    bvh: &WideTree<N>,
    log: &Log,
    model: &CostModel,
    events: Events,
) -> Result<f64, Error> {
    Error::unless_fits(log.shape(), bvh.shape())?;
    let rays = log.masks().ok_or(Error::NeedsMasks(Order::Pairs.name()))?;
    let as_they_stand = core::array::from_fn(|slot| slot as u8);
    Ok(walk(bvh, rays, model, events, |_, _, _| as_they_stand))
}

/// Counts of the rays in one node, and what its children cost.
struct Pairs<const N: usize> {
    events: Events,
    len: usize,
    /// Rays that hit the node's box.
    entered: f64,
    /// Of these, how many hit the box of each child.
    hits: [f64; N],
    /// By child hit and child that occludes: how many rays.
    occluded: [[f64; N]; N],
    /// By two children: how many rays are occluded below both.
    both: [[f64; N]; N],
    /// How many rays are occluded below each child.
    stopped: [f64; N],
    /// Cost of entering each child.
    costs: [f64; N],
}

impl<const N: usize> Pairs<N> {
    fn new(events: Events, len: usize, costs: [f64; N]) -> Self {
        Self {
            events,
            len,
            entered: 0.0,
            hits: [0.0; N],
            occluded: [[0.0; N]; N],
            both: [[0.0; N]; N],
            stopped: [0.0; N],
            costs,
        }
    }

    fn add(&mut self, visit: &Visit) {
        self.entered += 1.0;
        for slot in (0..self.len).filter(|slot| visit.hit >> slot & 1 == 1) {
            self.hits[slot] += 1.0;
            for other in 0..self.len {
                self.occluded[slot][other] += f64::from(visit.occluding >> other & 1);
            }
        }
        for slot in (0..self.len).filter(|slot| visit.occluding >> slot & 1 == 1) {
            self.stopped[slot] += 1.0;
            for other in 0..self.len {
                self.both[slot][other] += f64::from(visit.occluding >> other & 1);
            }
        }
    }

    /// Share of the rays that hit a child and are not occluded below any of the others.
    fn left_over(&self, child: usize, before: u32) -> f64 {
        let (mut sum, mut product) = (0.0, 1.0);
        for other in (0..self.len).filter(|other| before >> other & 1 == 1) {
            let share = match self.events {
                Events::Independent => self.stopped[other] / self.entered,
                _ => self.occluded[child][other] / self.hits[child],
            };
            sum += share * (1.0 - self.overlap(other, before));
            product *= 1.0 - share;
        }
        match self.events {
            Events::Exclusive | Events::Overlapping => f64::max(1.0 - sum, 0.0),
            Events::Independent | Events::Paired => product,
        }
    }

    /// Largest share of the rays occluded below a child that are also occluded below one of those before it by number.
    fn overlap(&self, child: usize, before: u32) -> f64 {
        if self.events != Events::Overlapping || self.stopped[child] == 0.0 {
            return 0.0;
        }
        let others = (0..child).filter(|other| before >> other & 1 == 1);
        let most = others.fold(0.0, |most, other| f64::max(most, self.both[child][other]));
        most / self.stopped[child]
    }

    /// The order of least cost. Children that occlude nothing come last, those that are hit least first among them.
    fn cheapest(&self, node: &Node<N>) -> [u8; N] {
        let by_ratio = core::array::from_fn(|slot| {
            let work = self.hits[slot] * self.costs[slot];
            if self.stopped[slot] > 0.0 {
                // Above all that occlude nothing.
                1.0 + self.stopped[slot] / work.max(f64::MIN_POSITIVE)
            } else {
                0.0
            }
        });
        let mut order = sorted_slots(node, &by_ratio);
        let occluding = self.stopped.iter().filter(|rays| **rays > 0.0).count();
        let first = &mut order[..occluding];
        let arranged = arrange(
            occluding,
            &Arranged {
                pairs: self,
                slots: first,
            },
        );
        let slots: Vec<_> = arranged.into_iter().map(|place| first[place]).collect();
        first.copy_from_slice(&slots);
        order
    }

    /// Cost of the node in an order.
    fn cost(&self, order: &[u8; N], node_cost: f64) -> f64 {
        if self.entered == 0.0 {
            return node_cost;
        }
        let mut before = 0;
        let mut sum = 0.0;
        for slot in order.iter().map(|slot| usize::from(*slot)) {
            if slot < self.len && self.hits[slot] > 0.0 {
                sum += self.hits[slot] * self.costs[slot] * self.left_over(slot, before);
            }
            before |= 1 << slot;
        }
        node_cost + sum / self.entered
    }
}

/// Some of the children, numbered from 0, to be arranged.
struct Arranged<'a, const N: usize> {
    pairs: &'a Pairs<N>,
    slots: &'a [u8],
}

impl<const N: usize> Arranged<'_, N> {
    /// The slots of a set.
    fn set(&self, before: u32) -> u32 {
        self.slots
            .iter()
            .enumerate()
            .fold(0, |set, (place, slot)| set | (before >> place & 1) << slot)
    }
}

impl<const N: usize> Costs for Arranged<'_, N> {
    fn cost(&self, thing: usize, before: u32) -> f64 {
        let slot = usize::from(self.slots[thing]);
        let left = self.pairs.left_over(slot, self.set(before));
        self.pairs.hits[slot] * self.pairs.costs[slot] * left
    }

    fn gain(&self, thing: usize, before: u32) -> f64 {
        let slot = usize::from(self.slots[thing]);
        self.pairs.stopped[slot] * self.pairs.left_over(slot, self.set(before))
    }
}

/// Goes through the nodes bottom-up, gets the visiting order of each from `order`, and returns the cost of the root.
fn walk<const N: usize>(
    bvh: &WideTree<N>,
    log: &RayLog,
    model: &CostModel,
    events: Events,
    mut order: impl FnMut(usize, &Node<N>, &Pairs<N>) -> [u8; N],
) -> f64 {
    let visits = log.visits();
    // Visits by node: counts do not depend on their order.
    let mut firsts = vec![0; bvh.nodes.len() + 1];
    for visit in visits {
        firsts[visit.node as usize + 1] += 1;
    }
    for node in 0..bvh.nodes.len() {
        firsts[node + 1] += firsts[node];
    }
    let mut ends = firsts.clone();
    let mut places = vec![0_u32; visits.len()];
    for (place, visit) in visits.iter().enumerate() {
        let end = &mut ends[visit.node as usize];
        places[*end] = place as u32;
        *end += 1;
    }
    let mut costs = vec![0.0; bvh.nodes.len()];
    // Children follow their parents, so going backwards visits them first.
    for (index, node) in bvh.nodes.iter().enumerate().rev() {
        let mut below = [0.0; N];
        for (slot, cost) in below.iter_mut().enumerate().take(node.len()) {
            *cost = match node.child(slot).kind() {
                ChildKind::Inner(child) => costs[child],
                ChildKind::Leaf(leaf) => bvh.leaf_cost(leaf, model),
                ChildKind::Instance(instance) => {
                    f64::from(model.entry) + costs[bvh.instances[instance].root as usize]
                }
            };
        }
        let mut pairs = Pairs::new(events, node.len(), below);
        for &place in &places[firsts[index]..firsts[index + 1]] {
            pairs.add(&visits[place as usize]);
        }
        let order = order(index, node, &pairs);
        costs[index] = pairs.cost(&order, f64::from(model.node));
    }
    costs[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_testkit::{Rng, permutations};

    /// Rays of which none is occluded below two children.
    fn exclusive_rays(rng: &mut Rng, children: usize) -> Vec<Visit> {
        (0..200)
            .map(|_| {
                let hit = 1 + rng.below((1 << children) - 1) as u16;
                let mut occluding = 0;
                let slot = rng.below(2 * children);
                if slot < children && hit >> slot & 1 == 1 {
                    occluding = 1 << slot;
                }
                Visit {
                    node: 0,
                    len: 1,
                    hit,
                    occluding,
                    followed: 0,
                    octant: 0,
                }
            })
            .collect()
    }

    /// For events that exclude each other the model computes the cost exactly, and finds the cheapest of all orders.
    #[test]
    fn exclusive_events_are_predicted_exactly() {
        let mut rng = Rng::new(2031);
        for _ in 0..60 {
            let len = 1 + rng.below(5);
            let costs: [f64; 8] = core::array::from_fn(|_| f64::from(rng.range(0.2, 9.0)));
            let rays = exclusive_rays(&mut rng, len);
            let mut pairs = Pairs::<8>::new(Events::Exclusive, len, costs);
            rays.iter().for_each(|ray| pairs.add(ray));
            let measured = |order: &[u8]| {
                let mut sum = 0.0;
                for ray in &rays {
                    for &slot in order {
                        if ray.hit >> slot & 1 == 1 {
                            sum += costs[usize::from(slot)];
                        }
                        if ray.occluding >> slot & 1 == 1 {
                            break;
                        }
                    }
                }
                1.0 + sum / rays.len() as f64
            };
            let mut node = Node::<8>::EMPTY;
            for slot in 0..len {
                let bounds = crate::aabb::Aabb {
                    min: [0.0; 3],
                    max: [1.0; 3],
                };
                node.set(slot, crate::tree::node::Child::inner(1 + slot), &bounds);
            }
            let found = pairs.cheapest(&node);
            let predicted = pairs.cost(&found, 1.0);
            assert!((predicted - measured(&found[..len])).abs() < 1e-9);
            let mut best = f64::INFINITY;
            let mut slots: Vec<u8> = (0..len as u8).collect();
            permutations(&mut slots, &mut |order| best = best.min(measured(order)));
            assert!(predicted <= best + 1e-9, "{predicted} instead of {best}");
        }
    }
}
