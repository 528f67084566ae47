//! RDH: the surface area heuristic with measured rays in place of areas.
//!
//! Source: Bittner and Havran (2009), "RDH: Ray Distribution Heuristics for Construction of Spatial Data
//! Structures": the chance that a ray which enters a node enters a child is the share of the sample rays that do,
//! blended with the share of the area, `w R_child / R + (1 - w) A_child / A`. Here the weight grows with the
//! evidence, `w = R / (R + PRIOR)`, as if [`PRIOR`] more rays had entered boxes by their areas; and what is in a
//! child costs what [`antumbra::parts::SplitCost`] says instead of its number.

use crate::builders::ray_driven::{Measure, SplitCost};
use antumbra::parts::SplitCost as Cost;

/// Weight of the areas, in rays.
const PRIOR: f64 = 16.0;

/// The share of the rays in the parent that do something, if `count` of the sample rays do and `share` of the
/// imaginary ones.
pub(crate) fn blended(count: f64, share: f64, parent: &Measure) -> f64 {
    (count + PRIOR * share) / (parent.entered as f64 + PRIOR)
}

/// The chance that a ray in the parent enters a child.
pub(crate) fn chance(child: &Measure, parent: &Measure) -> f64 {
    blended(child.entered as f64, child.area_share(parent), parent)
}

/// The cost.
#[derive(Default)]
pub(crate) struct RdhCost {
    cost: Cost,
}

impl SplitCost for RdhCost {
    fn of(&self, parent: &Measure, left: &Measure, right: &Measure) -> f64 {
        let side =
            |side: &Measure| chance(side, parent) * f64::from(self.cost.weight_of(side.prims));
        side(left) + side(right)
    }
}
