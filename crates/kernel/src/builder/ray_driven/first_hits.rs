//! `first-hits`: what sample rays hit first decides where a node is split. A sketch of VDBVH, and not that method.
//!
//! After Vinkler, Havran and Sochor (2012), "Visibility Driven BVH Build Up Algorithm for Ray Tracing": the chance that a
//! ray which enters a node enters a child is the child's share of the *visible* primitives, blended with its share of
//! the area, `w O_child / O + (1 - w) A_child / A`; nodes without anything visible are split by areas. Theirs is the
//! visibility of a whole picture. Here a primitive is visible if it is the first that one of at most 2¹⁴ sample rays hits,
//! so most primitives of a large scene are not. [`WEIGHT`] is 0.9, and what is in a child costs what
//! [`crate::builder::cost`] says. Where no sample ray comes, binned SAH goes on.

use crate::builder::cost::Cost;
use crate::builder::ray_driven::{Measure, SplitCost};

/// How much visibility counts against area.
const WEIGHT: f64 = 0.9;

/// The cost.
pub(crate) struct FirstHits {
    cost: Cost,
}

impl FirstHits {
    pub fn new() -> Self {
        Self { cost: Cost::new() }
    }
}

impl SplitCost for FirstHits {
    fn of(&self, parent: &Measure, left: &Measure, right: &Measure) -> f64 {
        let side = |side: &Measure| {
            let area = side.area_share(parent);
            let chance = if parent.seen > 0 {
                WEIGHT * side.seen as f64 / parent.seen as f64 + (1.0 - WEIGHT) * area
            } else {
                area
            };
            chance * f64::from(self.cost.weight_of(side.prims))
        };
        side(left) + side(right)
    }
}
