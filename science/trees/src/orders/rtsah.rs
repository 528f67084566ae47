//! The ray termination surface area heuristic: an order made only of areas, in which a ray that enters one child may
//! have been stopped by another one before.
//!
//! Source: Ize and Hansen (2011), "RTSAH Traversal Order for Occlusion Rays", for two children. Rays are uniform:
//! `I_i`, the chance of entering child i, is the ratio of areas. With `V_i` the chance of passing child i without
//! a hit, and the cost of the box tests shared (as the paper of Ogaki and Derouet-Jourdan restates it),
//!
//! ```text
//! C_l→r = C_mb + I_l C_l + (I_jr + I_lr V_l) C_r
//! V = I_jl V_l + I_jr V_r + I_lr V_l V_r + I_e          0 of a leaf
//! ```
//!
//! where `I_lr` is the chance of entering both, `I_jl = I_l - I_lr` only the left, `I_jr` only the right, and `I_e`
//! none.
//!
//! For N children, `I_r` of a later child is lowered by each of the earlier ones in turn, as if these did not
//! depend on each other given the later one:
//!
//! ```text
//! C = C_mb + Σ_i C_i E_i,   1 - V = Σ_i (1 - V_i) E_i,   E_i = I_i Π_{j<i} (1 - I_ji / I_i (1 - V_j))
//! ```
//!
//! With N = 2 these are the two formulas above; with `I_ji = I_j I_i` the first is the paper's equation (1) for
//! `H = I (1 - V)`. There is no key to sort by: the cheapest order is found by [`arrange()`].
//!
//! Nothing is said above of how `I_ij` is found. Of the lines that cross a convex body of area A, `A_i A_j / (8 π d²)
//! / A` enter two small ones of areas `A_i` and `A_j` far apart at a distance d: the form factor, as their mean
//! projection is a quarter of their area. The form factor is used between centres of boxes, within what is certain for any
//! two boxes: lines through their intersection enter both, no more enter either than enter the box around them, and
//! no more enter both than enter the smaller one. Against counted lines through random boxes it is off by a third
//! of what independence is off by; most for boxes that touch, of which it says up to 1.3 times too many.
//!
//! A tree with instances is treated as others are: the tree of an object has its own uniform rays.

use antumbra::Aabb;
use antumbra::parts::{
    ChildKind, Costs, MAX_WIDTH, NodeRef, PerSlot, SlotOrder, Tree, area_shares, arrange,
};
use antumbra::recipe::CostModel;

/// The order of least cost for uniform rays.
pub(crate) fn plan(tree: &Tree, model: &CostModel) -> SlotOrder {
    let mut planned = SlotOrder::of_nodes(tree);
    // `C` and `V` of every node.
    let mut known = vec![(0.0, 1.0); tree.node_count()];
    // Children follow their parents, so going backwards visits them first.
    for index in (0..tree.node_count()).rev() {
        let node = tree.node(index);
        let [mut costs, mut pass] = [[0.0; MAX_WIDTH]; 2];
        for slot in 0..node.len() {
            (costs[slot], pass[slot]) = match node.kind(slot) {
                ChildKind::Inner(child) => known[child],
                ChildKind::Leaf(leaf) => (tree.leaf_cost(leaf, model), 0.0),
                ChildKind::Instance(instance) => {
                    let (cost, pass) = known[tree.root_of(instance)];
                    (f64::from(model.entry) + cost, pass)
                }
            };
        }
        let children = Uniform::new(node, costs, pass);
        let order = arrange(node.len(), &children);
        known[index] = children.of_parent(&order, f64::from(model.node));
        planned.arrange(index, |place| order.get(place).copied().unwrap_or(place));
    }
    planned
}

/// Children of a node among uniform rays.
struct Uniform<const N: usize> {
    /// `I_i`.
    enter: [f64; N],
    /// `I_ij`.
    both: [[f64; N]; N],
    /// `C_i`.
    costs: [f64; N],
    /// `V_i`.
    pass: [f64; N],
}

impl Uniform<MAX_WIDTH> {
    fn new(node: NodeRef<'_>, costs: PerSlot<f64>, pass: PerSlot<f64>) -> Self {
        let all = node.all_bounds();
        let enter = area_shares(&node.areas(), all.half_area());
        let mut both = [[0.0; MAX_WIDTH]; MAX_WIDTH];
        for i in 0..node.len() {
            for j in 0..i {
                let boxes = [node.bounds(i), node.bounds(j)];
                both[i][j] = enters_both(&boxes, [enter[i], enter[j]], &all);
                both[j][i] = both[i][j];
            }
        }
        Self {
            enter,
            both,
            costs,
            pass,
        }
    }
}

impl<const N: usize> Uniform<N> {
    /// `E_i`: the chance of entering a child and not being stopped by those before it.
    fn reach(&self, child: usize, before: u32) -> f64 {
        let mut reach = self.enter[child];
        if reach <= 0.0 {
            return 0.0;
        }
        for (other, both) in self.both[child].iter().enumerate() {
            if before >> other & 1 == 1 {
                reach *= 1.0 - both / self.enter[child] * (1.0 - self.pass[other]);
            }
        }
        reach
    }

    /// `C` and `V` of the node with its children in this order.
    fn of_parent(&self, order: &[usize], node: f64) -> (f64, f64) {
        let (mut cost, mut stopped, mut before) = (node, 0.0, 0);
        for &child in order {
            let reach = self.reach(child, before);
            cost += self.costs[child] * reach;
            stopped += (1.0 - self.pass[child]) * reach;
            before |= 1 << child;
        }
        (cost, 1.0 - stopped.clamp(0.0, 1.0))
    }
}

impl<const N: usize> Costs for Uniform<N> {
    fn cost(&self, child: usize, before: u32) -> f64 {
        self.costs[child] * self.reach(child, before)
    }

    fn gain(&self, child: usize, before: u32) -> f64 {
        (1.0 - self.pass[child]) * self.reach(child, before)
    }
}

/// The share of the lines through `all` that enter both of two boxes in it, given the shares that enter each. The
/// boxes need not be apart.
fn enters_both(boxes: &[Aabb; 2], enter: [f64; 2], all: &Aabb) -> f64 {
    let [a, b] = boxes;
    let least = enter[0].min(enter[1]);
    let area = f64::from(all.half_area());
    if !(area > 0.0 && area < f64::INFINITY) {
        // Flat to a line, or too large to be measured: all that can be said.
        return least;
    }
    let around = f64::from(a.union(b).half_area()) / area;
    let within = Aabb {
        min: std::array::from_fn(|axis| a.min[axis].max(b.min[axis])),
        max: std::array::from_fn(|axis| a.max[axis].min(b.max[axis])),
    };
    let common = if within.is_empty() {
        0.0
    } else {
        f64::from(within.half_area()) / area
    };
    let center = |bounds: &Aabb, axis: usize| {
        0.5 * f64::from(bounds.min[axis]) + 0.5 * f64::from(bounds.max[axis])
    };
    let distance2: f64 = (0..3)
        .map(|axis| center(a, axis) - center(b, axis))
        .map(|difference| difference * difference)
        .sum();
    // 2 · area is the whole area.
    let form_factor = enter[0] * enter[1] * 2.0 * area / (8.0 * std::f64::consts::PI * distance2);
    let certain = (enter[0] + enter[1] - around).max(common).max(0.0);
    // `min` takes the other one for 0 / 0.
    form_factor.min(least).max(certain.min(least))
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra::parts::{ChildCost, cost_any};
    use antumbra_testkit::Rng;

    /// Children with any chances that there can be: `I_l + I_r - I_lr` is at most 1.
    fn random(rng: &mut Rng) -> Uniform<2> {
        let mut unit = || f64::from(rng.unit());
        let both = 0.5 * unit();
        let only = [(1.0 - both) * 0.5 * unit(), (1.0 - both) * 0.5 * unit()];
        Uniform {
            enter: only.map(|only| only + both),
            both: [[0.0, both], [both, 0.0]],
            costs: [10.0 * unit(), 10.0 * unit()],
            pass: [unit(), unit()],
        }
    }

    #[test]
    fn two_children_give_the_published_formulas() {
        let mut rng = Rng::new(2011);
        for _ in 0..1000 {
            let children = random(&mut rng);
            let Uniform {
                enter: [left, right],
                both,
                costs: [left_cost, right_cost],
                pass: [left_pass, right_pass],
            } = children;
            let both = both[0][1];
            let (only_left, only_right) = (left - both, right - both);
            let none = 1.0 - (only_left + only_right + both);
            let expected_cost =
                1.0 + left * left_cost + (only_right + both * left_pass) * right_cost;
            let expected_pass = only_left * left_pass
                + only_right * right_pass
                + both * left_pass * right_pass
                + none;
            let (cost, pass) = children.of_parent(&[0, 1], 1.0);
            assert!(
                (cost - expected_cost).abs() < 1e-12,
                "{cost} {expected_cost}"
            );
            assert!(
                (pass - expected_pass).abs() < 1e-12,
                "{pass} {expected_pass}"
            );
        }
    }

    /// With `I_ij = I_i I_j`, children are independent: the paper's model with `H = I (1 - V)`, and its rule.
    #[test]
    fn independent_children_give_the_learned_model() {
        let mut rng = Rng::new(2016);
        for _ in 0..300 {
            let enter: [f64; 5] = std::array::from_fn(|_| f64::from(rng.range(0.01, 1.0)));
            let children = Uniform {
                enter,
                both: std::array::from_fn(|i| std::array::from_fn(|j| enter[i] * enter[j])),
                costs: std::array::from_fn(|_| f64::from(rng.range(0.1, 9.0))),
                pass: std::array::from_fn(|_| f64::from(rng.unit())),
            };
            let models: [_; 5] = std::array::from_fn(|i| ChildCost {
                enter: enter[i],
                hit: enter[i] * (1.0 - children.pass[i]),
                cost: children.costs[i],
            });
            let (cost, _) = children.of_parent(&[3, 1, 0, 4, 2], 1.0);
            let expected = cost_any(1.0, [3, 1, 0, 4, 2].map(|i: usize| models[i]));
            assert!((cost - expected).abs() < 1e-12, "{cost} {expected}");
            let mut by_rule = [0, 1, 2, 3, 4];
            by_rule.sort_by(|&a, &b| models[b].key().total_cmp(&models[a].key()));
            assert_eq!(arrange(5, &children), by_rule);
        }
    }

    /// Whether a line hits a box.
    fn meets(org: [f64; 3], dir: [f64; 3], bounds: &Aabb) -> bool {
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let planes = [bounds.min[axis], bounds.max[axis]]
                .map(|plane| (f64::from(plane) - org[axis]) / dir[axis]);
            enter = enter.max(planes[0].min(planes[1]));
            leave = leave.min(planes[0].max(planes[1]));
        }
        enter <= leave
    }

    /// Uniform lines: through points spread evenly over a disc that covers the box, at right angles to it, in all
    /// directions. Counts the lines that hit `all`, and of these the lines that hit the first, the second and both.
    fn count_lines(rng: &mut Rng, all: &Aabb, boxes: &[Aabb; 2], lines: usize) -> [f64; 4] {
        let center: [f64; 3] =
            std::array::from_fn(|axis| 0.5 * f64::from(all.min[axis] + all.max[axis]));
        let radius = (0..3)
            .map(|axis| (0.5 * f64::from(all.max[axis] - all.min[axis])).powi(2))
            .sum::<f64>()
            .sqrt();
        let mut counts = [0.0; 4];
        for _ in 0..lines {
            let dir = rng.direction().map(f64::from);
            let point = loop {
                let point: [f64; 3] =
                    std::array::from_fn(|_| f64::from(rng.range(-1.2, 1.2)) * radius);
                // Projected along the line, the points of a ball would crowd in the middle; points of a disc do not.
                let along: f64 = (0..3).map(|axis| point[axis] * dir[axis]).sum();
                let across: [f64; 3] = std::array::from_fn(|axis| point[axis] - along * dir[axis]);
                let distance2: f64 = across.iter().map(|x| x * x).sum();
                // A cylinder along the line, of the length of its width.
                if along.abs() < radius / 2.0 && distance2 < radius * radius {
                    break across;
                }
            };
            let org = std::array::from_fn(|axis| center[axis] + point[axis]);
            if meets(org, dir, all) {
                let [a, b] = [0, 1].map(|which: usize| meets(org, dir, &boxes[which]));
                counts[0] += 1.0;
                counts[1] += f64::from(u8::from(a));
                counts[2] += f64::from(u8::from(b));
                counts[3] += f64::from(u8::from(a && b));
            }
        }
        counts
    }

    fn random_box(rng: &mut Rng) -> Aabb {
        let min = std::array::from_fn(|_| rng.range(0.0, 0.8));
        Aabb {
            min,
            max: min.map(|x| (x + rng.range(0.02, 0.5)).min(1.0)),
        }
    }

    /// Against counted lines: in the mean over boxes of all sizes and distances, much closer than the assumption of
    /// independence.
    #[test]
    fn the_form_factor_is_about_that_of_lines() {
        let seed = 2013;
        let mut rng = Rng::new(seed);
        let unit = Aabb {
            min: [0.0; 3],
            max: [1.0; 3],
        };
        let share = |bounds: &Aabb| f64::from(bounds.half_area()) / f64::from(unit.half_area());
        // The halves of a box: all lines through it enter one of them, so that what is certain is exact.
        let halves = [0.0, 0.4].map(|min| Aabb {
            min: [min, 0.0, 0.0],
            max: [if min > 0.0 { 1.0 } else { 0.4 }, 1.0, 1.0],
        });
        let counts = count_lines(&mut rng, &unit, &halves, 40_000);
        let certain = share(&halves[0]) + share(&halves[1]) - 1.0;
        let counted = counts[3] / counts[0];
        assert!(
            (certain - counted).abs() < 0.01,
            "{certain}, counted {counted}"
        );
        let found = enters_both(&halves, [share(&halves[0]), share(&halves[1])], &unit);
        assert!(
            found >= certain && found < 1.4 * certain,
            "{found} not {certain}"
        );

        let (mut error, mut independent_error) = (0.0, 0.0);
        for _ in 0..60 {
            let boxes = [random_box(&mut rng), random_box(&mut rng)];
            let counts = count_lines(&mut rng, &unit, &boxes, 8000);
            let counted = counts[3] / counts[0];
            let enter = [share(&boxes[0]), share(&boxes[1])];
            for which in 0..2 {
                let counted = counts[1 + which] / counts[0];
                assert!(
                    (counted - enter[which]).abs() < 0.03,
                    "lines are not uniform"
                );
            }
            error += (enters_both(&boxes, enter, &unit) - counted).abs();
            independent_error += (enter[0] * enter[1] - counted).abs();
        }
        assert!(
            error < 0.6 * independent_error,
            "seed {seed}: off by {error} in sum, independence by {independent_error}"
        );
    }

    #[test]
    fn flat_boxes_and_points_are_no_trouble() {
        let flat = |z: f32| Aabb {
            min: [0.0, 0.0, z],
            max: [1.0, 1.0, z],
        };
        let point = Aabb {
            min: [0.5; 3],
            max: [0.5; 3],
        };
        let huge = Aabb {
            min: [-3e38; 3],
            max: [3e38; 3],
        };
        for a in [flat(0.0), flat(1.0), point, huge] {
            for b in [flat(0.0), flat(0.5), point, huge] {
                let all = a.union(&b);
                let enter = area_shares(&[a.half_area(), b.half_area()], all.half_area());
                let both = enters_both(&[a, b], enter, &all);
                assert!((0.0..=1.0).contains(&both), "{both} for {a:?} and {b:?}");
            }
        }
    }
}
