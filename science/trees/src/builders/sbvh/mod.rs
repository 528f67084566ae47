//! SBVH: nodes are split between primitives or, where their boxes would overlap, at a plane that cuts
//! primitives in two. A primitive may then be in several leaves, each with a box around its own part only.
//!
//! Source: Stich, Friedrich and Dietrich (2009), "Spatial Splits in Bounding Volume Hierarchies", with their
//! [`ALPHA`] and their reference unsplitting. Triangles are clipped (see [`crate::builders::sbvh::clip`]), spheres cut as boxes.
//! Choices made here:
//! - The contents of a child cost what [`antumbra::parts::SplitCost`] says, and a node becomes a leaf when it fits a leaf block,
//!   as with the other builders.
//! - Slivers are not split (see [`crate::builders::sbvh::clip`]).
//! - There are at most twice as many references as primitives, and no more than those in scenes so tiny or huge that
//!   distances are not to be relied on. Additions are divided among subtrees by
//!   their sizes, so the tree does not depend on the number of threads.

pub(crate) mod clip;
mod spatial_bins;

use crate::builders::candidates::{Candidates, Part, Split, center, cheapest};
use crate::builders::pieces::Piece;
use crate::builders::sbvh::clip::within;
use crate::builders::sbvh::spatial_bins::{Reference, SpatialSplit, best_plane};
use antumbra::Aabb;
use antumbra::Primitives;
use antumbra::parts::BLOCK;
use antumbra::parts::BinaryTree;
use antumbra::parts::SplitCost as Cost;
use antumbra::parts::is_sane;

/// Spatial splits are tried where the two sides of the best object split overlap by more than this share of
/// the area of the root.
const ALPHA: f32 = 1e-5;

/// From this depth on references are halved by count, which takes at most 28 more levels.
const MAX_DEPTH: usize = 64;

/// Subtrees of fewer references than this are the work of one thread.
const SEQUENTIAL: usize = 2048;

/// Builds the tree.
pub(crate) fn build(primitives: &Primitives) -> BinaryTree {
    let count = primitives.len();
    if count == 0 {
        return BinaryTree::default();
    }
    let references = (0..count as u32).map(|prim| Reference {
        bounds: primitives.bounds_of(prim as usize),
        prim,
    });
    let plan = Plan {
        primitives,
        cost: Cost::default(),
        least_overlap: primitives.bounds().half_area() * ALPHA,
    };
    // Beyond these lengths distances underflow or overflow, and a hit may be far from where a part is.
    let budget = if is_sane(primitives.bounds().reach()) {
        count
    } else {
        0
    };
    plan.piece(references.collect(), budget, 0).into_tree()
}

struct Plan<'a> {
    primitives: &'a Primitives,
    cost: Cost,
    /// Half of the surface area.
    least_overlap: f32,
}

impl Plan<'_> {
    /// The subtree over some references, to which so many may be added.
    fn piece(&self, references: Vec<Reference>, budget: usize, depth: usize) -> Piece {
        let bounds = around(&references);
        let count = references.len();
        let [left, right] = if count <= BLOCK {
            match self.by_kind(&references) {
                Some(sides) => sides,
                None => {
                    let prims = references.iter().map(|reference| reference.prim);
                    return Piece::leaf(bounds, prims.collect());
                }
            }
        } else if depth >= MAX_DEPTH {
            halves(references)
        } else {
            self.split(references, &bounds, budget)
        };
        let all = left.len() + right.len();
        let rest = (budget + count).saturating_sub(all);
        // Products of two numbers below 2³⁰.
        let left_budget = (rest as u64 * left.len() as u64 / all as u64) as usize;
        let parts = [(left, left_budget), (right, rest - left_budget)];
        Piece::of_parts(bounds, parts, all > SEQUENTIAL, |(part, budget)| {
            self.piece(part, budget, depth + 1)
        })
    }

    /// The first kind and the others; `None` if all are of one kind.
    fn by_kind(&self, references: &[Reference]) -> Option<[Vec<Reference>; 2]> {
        let kind = |reference: &Reference| self.primitives.kind(reference.prim as usize);
        let first = kind(references.first()?);
        let (same, others): (Vec<_>, Vec<_>) = references
            .iter()
            .copied()
            .partition(|reference| kind(reference) == first);
        (!others.is_empty()).then_some([same, others])
    }

    /// Makes the split that costs least.
    fn split(
        &self,
        references: Vec<Reference>,
        bounds: &Aabb,
        budget: usize,
    ) -> [Vec<Reference>; 2] {
        let object = self.object_split(&references);
        let overlap = match &object {
            Some(split) => within(&split.bounds[0], &split.bounds[1]).half_area(),
            None => f32::INFINITY,
        };
        if overlap > self.least_overlap
            && budget > 0
            && let Some(spatial) = best_plane(self.primitives, &references, bounds, &self.cost)
            && f64::from(spatial.cost) < object.as_ref().map_or(f64::INFINITY, |split| split.cost)
            && let Some(sides) = self.spatial_halves(&references, &spatial, budget)
        {
            return sides;
        }
        match object {
            Some(split) => split.sides(references),
            None => halves(references),
        }
    }

    fn object_split(&self, references: &[Reference]) -> Option<Split> {
        let boxes = references.iter().map(|reference| reference.bounds);
        let boxes: Vec<_> = boxes.collect();
        let side = |part: &Part| self.cost.of_box(&part.bounds, part.count);
        let split = cheapest(&boxes, |candidates| {
            let Candidates { left, right, .. } = candidates;
            let cost = |split: usize| side(&left[split]) + side(&right[split]);
            let splits = candidates.splits();
            splits.map(|split| (f64::from(cost(split)), ())).collect()
        });
        split.map(|(split, ())| split)
    }

    /// Divides the references at a plane. One that the plane cuts goes to both sides, or to that one of them where it costs
    /// less than on both. `None` if more would be added than may be, or nothing would be gained.
    fn spatial_halves(
        &self,
        references: &[Reference],
        split: &SpatialSplit,
        budget: usize,
    ) -> Option<[Vec<Reference>; 2]> {
        let SpatialSplit { axis, plane, .. } = *split;
        let [mut left_bounds, mut right_bounds] = split.bounds;
        let [mut left_count, mut right_count] = split.counts;
        let cost = |bounds: &Aabb, count: usize| self.cost.of_box(bounds, count);
        let (mut left, mut right) = (Vec::new(), Vec::new());
        for reference in references {
            let bounds = &reference.bounds;
            if bounds.max[axis] <= plane {
                left.push(*reference);
                continue;
            }
            if bounds.min[axis] >= plane {
                right.push(*reference);
                continue;
            }
            let part = |slab| Reference {
                bounds: reference.between(self.primitives, axis, slab),
                prim: reference.prim,
            };
            let parts = [
                part([f32::NEG_INFINITY, plane]),
                part([plane, f32::INFINITY]),
            ];
            let left_only = left_bounds.union(bounds);
            let right_only = right_bounds.union(bounds);
            let both = cost(&left_bounds, left_count) + cost(&right_bounds, right_count);
            let to_left = cost(&left_only, left_count)
                + cost(&right_bounds, right_count.saturating_sub(1).max(1));
            let to_right = cost(&left_bounds, left_count.saturating_sub(1).max(1))
                + cost(&right_only, right_count);
            if parts[1].bounds.is_empty() || to_left < both && to_left <= to_right {
                left.push(*reference);
                left_bounds = left_only;
                right_count = right_count.saturating_sub(1);
            } else if parts[0].bounds.is_empty() || to_right < both {
                right.push(*reference);
                right_bounds = right_only;
                left_count = left_count.saturating_sub(1);
            } else {
                left.push(parts[0]);
                right.push(parts[1]);
            }
        }
        let useful = |side: &Vec<Reference>| !side.is_empty() && side.len() < references.len();
        let fits = left.len() + right.len() <= references.len() + budget;
        (fits && useful(&left) && useful(&right)).then_some([left, right])
    }
}

fn around(references: &[Reference]) -> Aabb {
    references
        .iter()
        .fold(Aabb::EMPTY, |all, reference| all.union(&reference.bounds))
}

/// Halves references by count, along the axis on which their centres spread most.
fn halves(mut references: Vec<Reference>) -> [Vec<Reference>; 2] {
    let spread = |axis: usize| {
        let centers = references
            .iter()
            .map(|reference| center(&reference.bounds, axis));
        let (low, high) = centers.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        high - low
    };
    let spreads = [spread(0), spread(1), spread(2)];
    let axis = (1..3).fold(0, |best, axis| {
        if spreads[axis] > spreads[best] {
            axis
        } else {
            best
        }
    });
    references.sort_by(|a, b| center(&a.bounds, axis).total_cmp(&center(&b.bounds, axis)));
    let right = references.split_off(references.len() / 2);
    [references, right]
}
