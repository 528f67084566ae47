//! The order learned from a log, and the cost model it minimises.
//!
//! Source: Ogaki and Derouet-Jourdan (2016), "An N-ary BVH Child Node Sorting Technique for Occlusion
//! Tests", JCGT 5(2). The cost of an occlusion query that enters a node is, with children in visiting
//! order,
//!
//! ```text
//! C_any = C_mb + Σ_i I_i C_i Π_{j<i} (1 - H_j)        (1)
//! ```
//!
//! `I_i` being the chance of hitting the box of child i, `H_i` the chance of hitting a primitive below it, and
//! `C_p N_p` the cost of a leaf. The cost is least when children are sorted by falling `H_i / (I_i C_i)` (appendix A).
//! Costs of children depend on their own order, so nodes are sorted bottom-up. Below an instance is the tree of its
//! object, sorted by the rays of all its instances together; the cost of the instance is what it takes to enter it and
//! the cost of that tree.
//!
//! A log that visits children in only one order is biased by it: a frequent occluder that is always reached after
//! another one is hardly ever counted. Shuffling while logging is the paper's remedy. Another one, not in the paper,
//! needs none: of the `V_i` rays that really came to child i, the share that it occluded stands for all that hit its
//! box, `H_i = N_i / N · L_i / V_i`. (Rays that hit child i and came to it are the rays that children before it did not
//! occlude; that these are occluded by it as often as the others is the model's own assumption.)
//!
//! Deviations, all for scarce evidence:
//! - `N`, the rays that intersect the node, counts those that tested it: a ray that ended before it came
//!   to the node says nothing of the children.
//! - Equation (5) is blended with [`PRIOR`] imaginary rays that hit boxes by area and primitives at the
//!   node's mean rate.
//! - A child whose box was never hit has `I = H = 0` and comes last; a node never tested keeps its
//!   children by area, with chances by area and no hits.

use alloc::vec;
use alloc::vec::Vec;

use crate::error::Error;
use crate::geometry::BLOCK;
use crate::learn::log::Log;
use crate::order::sorted_slots;
use crate::tree::costs::CostModel;
use crate::tree::node::{AS_THEY_ARE, ChildKind, MAX_WIDTH, NodeRef, PerSlot};
use crate::tree::slot_order::SlotOrder;
use crate::tree::wide::Tree;

/// Weight of the area prior, in rays.
const PRIOR: f64 = 1.0;

/// How `I` and `H` are estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Estimate {
    /// Equation (4): `I = 1`, `H_i = L_i / Σ L_k`.
    Poor,
    /// Equation (5): `I_i = N_i / N`, `H_i = L_i / N`.
    Precise,
    /// `I_i = N_i / N`, `H_i = N_i / N · L_i / V_i`.
    Visited,
}

impl Estimate {
    /// The best that a log allows.
    pub fn of(log: &Log) -> Self {
        if log.kind().boxes {
            Self::Precise
        } else {
            Self::Poor
        }
    }
}

/// Chances and cost of one child.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChildCost {
    /// `I`: chance that a ray in the node hits the child's box.
    pub enter: f64,
    /// `H`: chance that a ray in the node hits a primitive below the child.
    pub hit: f64,
    /// `C`: cost of entering the child.
    pub cost: f64,
}

impl ChildCost {
    /// A child whose cost is not known yet.
    fn of_chances(enter: f64, hit: f64) -> Self {
        Self {
            enter,
            hit,
            cost: 0.0,
        }
    }

    /// Key to sort by, largest first; never NaN.
    pub fn key(&self) -> f64 {
        let work = self.enter * self.cost;
        if self.enter <= 0.0 {
            -1.0
        } else if self.hit <= 0.0 {
            0.0
        } else if !(work > 0.0) {
            // Free.
            f64::INFINITY
        } else {
            self.hit / work
        }
    }
}

/// Equation (1) for children in visiting order.
pub fn cost_any(node: f64, children: impl IntoIterator<Item = ChildCost>) -> f64 {
    let mut cost = node;
    let mut unoccluded = 1.0;
    for child in children {
        cost += child.enter * child.cost * unoccluded;
        unoccluded *= 1.0 - child.hit;
    }
    cost
}

/// The learned order.
pub(crate) fn plan(
    tree: &Tree,
    log: &Log,
    model: &CostModel,
    estimate: Estimate,
) -> Result<SlotOrder, Error> {
    Error::unless_fits(log.shape(), tree.shape())?;
    let mut planned = SlotOrder::of_nodes(tree);
    walk(tree, log, model, estimate, |index, node, children| {
        let order = sorted_slots(node, &children.map(|child| child.key()));
        planned.set(index, &order);
        order
    });
    planned.lanes = all_sorted_lanes(tree, log);
    Ok(planned)
}

/// `C_any` of the root with the slots as `order` would put them. An order that picks at run time is
/// costed as the slots are: the model does not know distances.
pub(crate) fn predicted_cost(
    tree: &Tree,
    log: &Log,
    model: &CostModel,
    order: Option<&SlotOrder>,
) -> Result<f64, Error> {
    Error::unless_fits(log.shape(), tree.shape())?;
    let slots = match order {
        Some(order) => {
            Error::unless_fits(order.shape, tree.shape())?;
            &order.slots[..]
        }
        None => &[],
    };
    Ok(walk(
        tree,
        log,
        model,
        Estimate::of(log),
        |index, node, _| {
            let mut order = AS_THEY_ARE;
            if let Some(slots) = slots.chunks(node.width()).nth(index) {
                order[..slots.len()].copy_from_slice(slots);
            }
            order
        },
    ))
}

/// Primitives that ended more rays first. The empty lanes, which ended none, stay last: sorting is
/// stable.
pub(crate) fn sorted_lanes(hits: &[u32; BLOCK]) -> [u8; BLOCK] {
    let mut lanes: [u8; BLOCK] = core::array::from_fn(|lane| lane as u8);
    lanes.sort_by_key(|&lane| core::cmp::Reverse(hits[lane as usize]));
    lanes
}

/// [`sorted_lanes`] of all leaves.
pub(crate) fn all_sorted_lanes(tree: &Tree, log: &Log) -> Vec<[u8; BLOCK]> {
    let leaves = 0..tree.leaf_count();
    leaves
        .map(|leaf| sorted_lanes(log.prim_hits(leaf)))
        .collect()
}

/// Goes through the nodes bottom-up, gets the visiting order of each from `order`, and returns the cost of the root.
fn walk(
    tree: &Tree,
    log: &Log,
    model: &CostModel,
    estimate: Estimate,
    mut order: impl FnMut(usize, NodeRef<'_>, &PerSlot<ChildCost>) -> PerSlot<u8>,
) -> f64 {
    let mut costs = vec![0.0; tree.nodes.len()];
    let mut hits = vec![0u64; tree.nodes.len()];
    // Children follow their parents, so going backwards visits them first.
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let mut child_hits = [0u64; MAX_WIDTH];
        let mut child_visits = [0u32; MAX_WIDTH];
        let mut child_costs = [0.0; MAX_WIDTH];
        for slot in 0..node.len() {
            (child_hits[slot], child_costs[slot]) = match node.child(slot).kind() {
                ChildKind::Inner(child) => (hits[child], costs[child]),
                ChildKind::Leaf(leaf) => (
                    log.prim_hits(tree.leaf_index(leaf))
                        .iter()
                        .map(|hits| u64::from(*hits))
                        .sum(),
                    tree.leaf_cost(leaf, model),
                ),
                ChildKind::Instance(instance) => {
                    let root = tree.instances[instance].root as usize;
                    (
                        u64::from(log.prim_hits(tree.instance_index(instance))[0]),
                        f64::from(model.entry) + costs[root],
                    )
                }
            };
        }
        hits[index] = child_hits.iter().sum();
        for (slot, visits) in child_visits.iter_mut().enumerate().take(node.len()) {
            *visits = match node.child(slot).kind() {
                ChildKind::Inner(child) => log.node_entered(child),
                ChildKind::Leaf(leaf) => log.leaf_entered(tree.leaf_index(leaf)),
                ChildKind::Instance(instance) => log.leaf_entered(tree.instance_index(instance)),
            };
        }
        let mut children = chances(node, index, log, estimate, &child_hits, &child_visits);
        for (child, cost) in children.iter_mut().zip(child_costs) {
            child.cost = cost;
        }
        let order = order(index, node, &children);
        costs[index] = cost_any(
            f64::from(model.node),
            order[..node.len()]
                .iter()
                .map(|slot| children[usize::from(*slot)]),
        );
    }
    costs[0]
}

/// `I` and `H` of the children of a node; costs are left at 0.
fn chances(
    node: NodeRef<'_>,
    index: usize,
    log: &Log,
    estimate: Estimate,
    child_hits: &PerSlot<u64>,
    child_visits: &PerSlot<u32>,
) -> PerSlot<ChildCost> {
    let len = node.len();
    let shares = area_shares(&node.areas(), node.all_bounds().half_area());
    let entered = f64::from(log.node_entered(index));
    let hits = child_hits.map(|hits| hits as f64);
    let mut box_hits = [0.0; MAX_WIDTH];
    for (slot, hits) in box_hits.iter_mut().enumerate().take(node.width()) {
        *hits = f64::from(log.lane_hits(index, node.lane(slot)));
    }
    match estimate {
        Estimate::Precise => precise_chances(len, entered, &box_hits, &hits, &shares),
        Estimate::Visited => visited_chances(
            &precise_chances(len, entered, &box_hits, &hits, &shares),
            &hits,
            &child_visits.map(f64::from),
            &shares,
        ),
        Estimate::Poor => {
            let all_hits: f64 = hits.iter().sum();
            core::array::from_fn(|slot| {
                let (enter, hit) = match slot {
                    _ if slot >= len => (0.0, 0.0),
                    _ if all_hits == 0.0 => (shares[slot], 0.0),
                    _ => (1.0, hits[slot] / all_hits),
                };
                ChildCost::of_chances(enter, hit)
            })
        }
    }
}

/// Areas of children relative to their parent's.
pub fn area_shares<const N: usize>(areas: &[f32; N], parent: f32) -> [f64; N] {
    areas.map(|area| {
        let share = f64::from(area) / f64::from(parent);
        // 0 / 0 for flat nodes without area, ∞ / ∞ for overflowing ones: no preference.
        if share.is_finite() { share } else { 1.0 }
    })
}

/// Equation (5) for the `len` children of a node, blended with the prior: of `entered` rays, `box_hits`
/// hit the box of each child, `hits` a primitive below it. Costs are left at 0.
pub(crate) fn precise_chances<const N: usize>(
    len: usize,
    entered: f64,
    box_hits: &[f64; N],
    hits: &[f64; N],
    shares: &[f64; N],
) -> [ChildCost; N] {
    let rate = hits.iter().sum::<f64>() / box_hits.iter().sum::<f64>();
    core::array::from_fn(|slot| {
        let (enter, hit) = match slot {
            _ if slot >= len => (0.0, 0.0),
            _ if entered == 0.0 => (shares[slot], 0.0),
            _ if box_hits[slot] == 0.0 => (0.0, 0.0),
            _ => {
                let prior = PRIOR * shares[slot];
                (
                    (box_hits[slot] + prior) / (entered + PRIOR),
                    (hits[slot] + prior * rate) / (entered + PRIOR),
                )
            }
        };
        ChildCost::of_chances(enter, hit)
    })
}

/// The estimate corrected for visits, `H_i = I_i L_i / V_i`: children of these chances were visited by `visits`
/// rays, of which `hits` hit a primitive. Blended with the prior, too.
pub(crate) fn visited_chances<const N: usize>(
    chances: &[ChildCost; N],
    hits: &[f64; N],
    visits: &[f64; N],
    shares: &[f64; N],
) -> [ChildCost; N] {
    let all_visits: f64 = visits.iter().sum();
    let rate = if all_visits > 0.0 {
        hits.iter().sum::<f64>() / all_visits
    } else {
        0.0
    };
    core::array::from_fn(|slot| {
        let prior = PRIOR * shares[slot];
        let visits = visits[slot] + prior;
        let share = if visits > 0.0 {
            (hits[slot] + prior * rate) / visits
        } else {
            0.0
        };
        let ChildCost { enter, .. } = chances[slot];
        ChildCost::of_chances(enter, enter * share.min(1.0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_testkit::{Rng, permutations};

    fn random_children(rng: &mut Rng, count: usize) -> Vec<ChildCost> {
        (0..count)
            .map(|_| {
                let enter = f64::from(rng.unit());
                // Some children are never hit, some are free, some never entered.
                let hit = if rng.below(5) == 0 {
                    0.0
                } else {
                    enter * f64::from(rng.unit())
                };
                let cost = if rng.below(9) == 0 {
                    0.0
                } else {
                    f64::from(rng.range(0.1, 20.0))
                };
                if rng.below(9) == 0 {
                    ChildCost {
                        enter: 0.0,
                        hit: 0.0,
                        cost,
                    }
                } else {
                    ChildCost { enter, hit, cost }
                }
            })
            .collect()
    }

    #[test]
    fn the_learned_order_is_the_best_of_all_permutations() {
        let seed = 2016;
        let mut rng = Rng::new(seed);
        for round in 0..3000 {
            let count = 1 + rng.below(6);
            let mut children = random_children(&mut rng, count);
            let mut sorted = children.clone();
            sorted.sort_by(|a, b| b.key().total_cmp(&a.key()));
            let learned = cost_any(1.0, sorted.iter().copied());
            let mut best = f64::INFINITY;
            permutations(&mut children, &mut |order| {
                best = best.min(cost_any(1.0, order.iter().copied()));
            });
            assert!(
                learned <= best * (1.0 + 1e-12),
                "seed {seed} round {round}: {learned} instead of {best} for {sorted:?}"
            );
        }
    }

    /// With two children, shared box cost and no kernel cost, SRDH (Feltman, Lee and Fatahalian 2012) is
    /// `C_l→r = C_mb + I_l C_l + (1 - H_l) I_r C_r`: equation (2) of the paper.
    #[test]
    fn two_children_give_the_srdh_formula() {
        let mut rng = Rng::new(2012);
        for _ in 0..1000 {
            let [l, r] = [(); 2].map(|()| random_children(&mut rng, 1)[0]);
            let left_first = 1.0 + l.enter * l.cost + (1.0 - l.hit) * r.enter * r.cost;
            let right_first = 1.0 + r.enter * r.cost + (1.0 - r.hit) * l.enter * l.cost;
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b;
            assert!(close(cost_any(1.0, [l, r]), left_first));
            assert!(close(cost_any(1.0, [r, l]), right_first));
            let learned = if l.key() >= r.key() {
                left_first
            } else {
                right_first
            };
            assert!(
                learned <= left_first.min(right_first) * (1.0 + 1e-12),
                "{l:?} {r:?}"
            );
        }
    }

    /// Rays drawn from the model: children are hit and occlude independently. What they cost is what equation (1)
    /// says. Visited in one order, the straight estimate of `H` loses what earlier children stop, and the one
    /// corrected for visits does not.
    #[test]
    fn rays_drawn_from_the_model_cost_what_it_says() {
        let seed = 2020;
        let mut rng = Rng::new(seed);
        for _ in 0..5 {
            let children: [ChildCost; 4] = core::array::from_fn(|_| {
                let enter = f64::from(rng.range(0.3, 0.9));
                ChildCost {
                    enter,
                    hit: enter * f64::from(rng.range(0.2, 0.8)),
                    cost: f64::from(rng.range(1.0, 9.0)),
                }
            });
            let count = 200_000;
            let (mut box_hits, mut visits, mut hits) = ([0.0; 4], [0.0; 4], [0.0; 4]);
            let mut cost = 0.0;
            for _ in 0..count {
                let mut stopped = false;
                cost += 1.0;
                for (slot, child) in children.iter().enumerate() {
                    let draw = f64::from(rng.unit());
                    if draw >= child.enter {
                        continue;
                    }
                    box_hits[slot] += 1.0;
                    if !stopped {
                        visits[slot] += 1.0;
                        cost += child.cost;
                        stopped = draw < child.hit;
                        hits[slot] += f64::from(u8::from(stopped));
                    }
                }
            }
            let count = f64::from(count);
            let predicted = cost_any(1.0, children);
            let measured = cost / count;
            assert!(
                (measured / predicted - 1.0).abs() < 0.01,
                "seed {seed}: {measured} instead of {predicted}"
            );
            let shares = [1.0; 4];
            let straight = precise_chances(4, count, &box_hits, &hits, &shares);
            let corrected = visited_chances(&straight, &hits, &visits, &shares);
            for (slot, child) in children.iter().enumerate() {
                let [straight, corrected] = [straight[slot], corrected[slot]];
                assert!((corrected.enter - child.enter).abs() < 0.01);
                assert!(
                    (corrected.hit - child.hit).abs() < 0.01,
                    "seed {seed} slot {slot}: {corrected:?} instead of {child:?}"
                );
                let passed: f64 = children[..slot]
                    .iter()
                    .map(|other| 1.0 - other.hit)
                    .product();
                assert!((straight.hit - child.hit * passed).abs() < 0.01);
            }
        }
    }

    #[test]
    fn children_without_visits_get_the_mean_rate() {
        let chances = [0.8, 0.5, 0.0].map(|enter| ChildCost::of_chances(enter, 0.0));
        let found = visited_chances(&chances, &[30.0, 0.0, 0.0], &[60.0, 0.0, 0.0], &[0.5; 3]);
        assert_eq!(found.map(|child| child.hit), [0.4, 0.25, 0.0]);
        let found = visited_chances(&chances, &[0.0; 3], &[0.0; 3], &[0.0; 3]);
        assert_eq!(found.map(|child| child.hit), [0.0; 3]);
    }

    #[test]
    fn keys_are_never_nan() {
        let chances = [0.0, 1e-300, 1.0];
        for enter in chances {
            for hit in chances {
                for cost in [0.0, 1e-300, 1.0, f64::INFINITY] {
                    assert!(
                        !ChildCost { enter, hit, cost }.key().is_nan(),
                        "{enter} {hit} {cost}"
                    );
                }
            }
        }
    }

    #[test]
    fn frequent_occluders_come_first_in_a_leaf() {
        assert_eq!(
            sorted_lanes(&[0, 3, 9, 3, 0, 1, 0, 0]),
            [2, 1, 3, 5, 0, 4, 6, 7]
        );
    }
}
