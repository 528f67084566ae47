//! SRDH: a tree for shadow rays, which stop at their first occluder.
//!
//! Source: Feltman, Lee and Fatahalian (2012), "SRDH: Specializing BVH Construction and Traversal Order Using
//! Representative Shadow Ray Sets". The cost of a node whose children are visited left, then right, is
//!
//! ```text
//! C_l→r = C_b + I (C_k + C_l + (1 - H_l) C_r)
//! ```
//!
//! with the costs `C_b` of a box test and `C_k` of a node, the chance `I` of entering its box and the chance
//! `H_l` of being stopped in the left child, counted from representative rays. Of both orders the cheaper one
//! counts, and becomes the order of the children. Choices made here:
//! - The boxes of all children are tested at one go, so `C_b` and `C_k` are the same for every split and left
//!   out, because the chance of entering a child is part of its cost. Equation (1) of Ogaki and
//!   Derouet-Jourdan (2016) for two children is left.
//! - The contents of a child cost, before it is built, what [`antumbra::parts::SplitCost`] says, times the share that a ray
//!   tests before it is stopped there: all, for a ray that is not, and `1 / (1 + k)` for one that hits `k` primitives.
//!   Without that factor large children that stop everything look dear, and small ones are split off one by one.
//! - Chances are blended with areas as in [`crate::builders::ray_driven::rdh`]; the imaginary rays hit nothing.
//! - Their tree is a second one, only for shadow rays. Ours serves any query, since answers are the same.

use crate::builders::ray_driven::rdh::{blended, chance};
use crate::builders::ray_driven::{Measure, SplitCost};
use antumbra::parts::SplitCost as Cost;

/// The cost.
#[derive(Default)]
pub(crate) struct SrdhCost {
    cost: Cost,
}

/// Estimates of a child.
#[derive(Clone, Copy)]
pub(crate) struct Child {
    /// Chance of entering it.
    pub enter: f64,
    /// Chance of being stopped in it.
    pub hit: f64,
    /// Cost of its contents.
    pub cost: f64,
}

/// Cost of visiting two children in this order.
fn in_order(first: Child, second: Child) -> f64 {
    first.enter * first.cost + (1.0 - first.hit) * second.enter * second.cost
}

impl SrdhCost {
    /// Costs of visiting left first and right first.
    fn both(&self, parent: &Measure, left: &Measure, right: &Measure) -> [f64; 2] {
        let [left, right] = [left, right].map(|side| self.child(parent, side));
        [in_order(left, right), in_order(right, left)]
    }

    pub fn child(&self, parent: &Measure, side: &Measure) -> Child {
        let enter = chance(side, parent);
        let hit = blended(side.hits as f64, 0.0, parent);
        let met = enter - hit + blended(side.until_hit, 0.0, parent);
        let share = if enter > 0.0 { met / enter } else { 1.0 };
        Child {
            enter,
            hit,
            cost: share * f64::from(self.cost.weight_of(side.prims)),
        }
    }
}

impl SplitCost for SrdhCost {
    fn of(&self, parent: &Measure, left: &Measure, right: &Measure) -> f64 {
        let [left_first, right_first] = self.both(parent, left, right);
        left_first.min(right_first)
    }

    fn right_first(&self, parent: &Measure, left: &Measure, right: &Measure) -> bool {
        let [left_first, right_first] = self.both(parent, left, right);
        right_first < left_first
    }
}
