//! VDBVH: primitives that are seen count for more than primitives that are hidden.
//!
//! Source: Vinkler, Havran and Sochor (2012), "Visibility Driven BVH Build Up Algorithm for Ray Tracing": the chance that
//! a ray which enters a node enters a child is the child's share of the visible primitives, mixed with its share of the
//! area, `w O_child / O + (1 - w) A_child / A`. Nodes in which nothing is seen are split by areas. Choices made here:
//! - [`crate::builders::ray_driven::seen`] says which primitives are seen, and how many rays are enough.
//! - [`WEIGHT`] is `w`. The formula is from memory: only the abstract of the paper was available.
//! - The contents of a child cost what [`antumbra::parts::SplitCost`] says, for all primitives, seen or not.
//! - Nodes in which nothing is seen are divided as finely as the others: answers need no visibility.

use super::{MAX_DEPTH, SEQUENTIAL, area};
use crate::builders::candidates::{Candidates, Part, Split, cheapest};
use crate::builders::pieces::Piece;
use antumbra::Aabb;
use antumbra::Primitives;
use antumbra::parts::BLOCK;
use antumbra::parts::BinaryTree;
use antumbra::parts::SplitCost as Cost;
use antumbra::parts::binned_subtree;

/// Weight of visibility against area.
pub(crate) const WEIGHT: f64 = 0.9;

/// Builds the tree; `seen` has an entry for every primitive.
pub(crate) fn build(primitives: &Primitives, seen: &[bool], weight: f64) -> BinaryTree {
    if primitives.is_empty() {
        return BinaryTree::default();
    }
    let prims = (0..primitives.len() as u32).collect();
    let plan = Plan::new(primitives, seen, weight);
    plan.piece(prims, 0).into_tree()
}

/// The first split of some primitives.
#[cfg(test)]
pub(super) fn split_of(
    primitives: &Primitives,
    prims: &[u32],
    seen: &[bool],
    weight: f64,
) -> Option<Split> {
    Plan::new(primitives, seen, weight).best_split(prims, seen)
}

struct Plan<'a> {
    primitives: &'a Primitives,
    seen: &'a [bool],
    weight: f64,
    cost: Cost,
}

impl<'a> Plan<'a> {
    fn new(primitives: &'a Primitives, seen: &'a [bool], weight: f64) -> Self {
        Self {
            primitives,
            seen,
            weight,
            cost: Cost::default(),
        }
    }

    fn piece(&self, prims: Vec<u32>, depth: u32) -> Piece {
        let seen: Vec<_> = prims.iter().map(|prim| self.seen[*prim as usize]).collect();
        let hidden = !seen.contains(&true);
        if prims.len() <= BLOCK || hidden || depth >= MAX_DEPTH {
            return Piece::from(binned_subtree(self.primitives, &prims, depth));
        }
        let Some(split) = self.best_split(&prims, &seen) else {
            return Piece::from(binned_subtree(self.primitives, &prims, depth));
        };
        let is_large = prims.len() > SEQUENTIAL;
        let bounds = split.bounds[0].union(&split.bounds[1]);
        Piece::of_parts(bounds, split.sides(prims), is_large, |side| {
            self.piece(side, depth + 1)
        })
    }

    /// The split that costs least, the first of equals; `None` if there is none of finite cost.
    fn best_split(&self, prims: &[u32], seen: &[bool]) -> Option<Split> {
        let boxes: Vec<_> = prims
            .iter()
            .map(|prim| self.primitives.bounds_of(*prim as usize))
            .collect();
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, one| all.union(one));
        let whole = seen.iter().filter(|seen| **seen).count();
        let split = cheapest(&boxes, |candidates| {
            let left = seen_on_the_left(candidates, seen);
            let side = |part: &Part, seen: usize| {
                let share = area(&part.bounds) / area(&bounds);
                let share = if share.is_finite() { share } else { 1.0 };
                let chance = self.weight * seen as f64 / whole as f64 + (1.0 - self.weight) * share;
                chance * f64::from(self.cost.weight_of(part.count))
            };
            let cost = |split: usize| {
                side(&candidates.left[split], left[split])
                    + side(&candidates.right[split], whole - left[split])
            };
            let splits = candidates.splits();
            splits.map(|split| (cost(split), ())).collect()
        });
        split.map(|(split, ())| split)
    }
}

/// Seen primitives on the left of each split.
fn seen_on_the_left(candidates: &Candidates, seen: &[bool]) -> Vec<usize> {
    let mut left = vec![0; candidates.len() + 1];
    for (bin, seen) in candidates.bins.iter().zip(seen) {
        left[usize::from(*bin) + 1] += usize::from(*seen);
    }
    for split in 1..left.len() {
        left[split] += left[split - 1];
    }
    left
}
