//! Spatial splits: candidates at planes that cut through primitives.
//!
//! Source: the chopped binning of Stich, Friedrich and Dietrich (2009), "Spatial Splits in Bounding Volume
//! Hierarchies", section 4.3.

use crate::builders::sbvh::clip::{box_between, triangle_between};
use antumbra::Aabb;
use antumbra::Primitives;
use antumbra::parts::SplitCost as Cost;

/// Slabs per axis.
const BINS: usize = 16;

/// A primitive or a part of one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reference {
    /// Bounds of the part.
    pub bounds: Aabb,
    pub prim: u32,
}

impl Reference {
    /// The box around what of it lies between two coordinates; empty if nothing does.
    pub fn between(&self, primitives: &Primitives, axis: usize, slab: [f32; 2]) -> Aabb {
        match primitives.corners(self.prim as usize) {
            Some(corners) => triangle_between(corners, &self.bounds, axis, slab),
            None => box_between(&self.bounds, axis, slab),
        }
    }
}

/// A plane, and what is on its sides if what it cuts is on both.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpatialSplit {
    pub axis: usize,
    pub plane: f32,
    pub bounds: [Aabb; 2],
    pub counts: [usize; 2],
    pub cost: f32,
}

/// What is in each slab between two planes of an axis, and how many references begin and end there.
fn slabs(
    primitives: &Primitives,
    references: &[Reference],
    axis: usize,
    (plane, bin): (impl Fn(usize) -> f32, impl Fn(f32) -> usize),
) -> ([Aabb; BINS], [usize; BINS], [usize; BINS]) {
    let mut slabs = [Aabb::EMPTY; BINS];
    let (mut begins, mut ends) = ([0; BINS], [0; BINS]);
    for reference in references {
        let first = bin(reference.bounds.min[axis]);
        let last = bin(reference.bounds.max[axis]);
        begins[first] += 1;
        ends[last] += 1;
        if first == last {
            slabs[first] = slabs[first].union(&reference.bounds);
            continue;
        }
        for slab in first..=last {
            let part = reference.between(primitives, axis, [plane(slab), plane(slab + 1)]);
            slabs[slab] = slabs[slab].union(&part);
        }
    }
    (slabs, begins, ends)
}

/// The plane that costs least, the first of equals; `None` if none leaves fewer references on either side than there
/// are, or areas are too large to be compared.
pub(crate) fn best_plane(
    primitives: &Primitives,
    references: &[Reference],
    bounds: &Aabb,
    cost: &Cost,
) -> Option<SpatialSplit> {
    let mut best: Option<SpatialSplit> = None;
    for axis in 0..3 {
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        let width = (high - low) / BINS as f32;
        if !(width > 0.0 && width < f32::INFINITY) {
            continue;
        }
        let plane = |bin: usize| match bin {
            0 => f32::NEG_INFINITY,
            BINS => f32::INFINITY,
            bin => low + width * bin as f32,
        };
        // The last slab that begins at or before a coordinate.
        let bin = |x: f32| {
            let mut bin = (((x - low) / width) as usize).min(BINS - 1);
            while bin > 0 && plane(bin) > x {
                bin -= 1;
            }
            bin
        };
        let (slabs, begins, ends) = slabs(primitives, references, axis, (&plane, bin));
        let mut rights = [(Aabb::EMPTY, 0); BINS + 1];
        for slab in (0..BINS).rev() {
            let (bounds, count) = rights[slab + 1];
            rights[slab] = (bounds.union(&slabs[slab]), count + ends[slab]);
        }
        let mut left = (Aabb::EMPTY, 0);
        for split in 1..BINS {
            left = (left.0.union(&slabs[split - 1]), left.1 + begins[split - 1]);
            let right = rights[split];
            let counts = [left.1, right.1];
            if counts
                .iter()
                .any(|count| *count == 0 || *count == references.len())
            {
                continue;
            }
            let sum = cost.of_box(&left.0, left.1) + cost.of_box(&right.0, right.1);
            if sum < best.map_or(f32::INFINITY, |best| best.cost) {
                best = Some(SpatialSplit {
                    axis,
                    plane: plane(split),
                    bounds: [left.0, right.0],
                    counts,
                    cost: sum,
                });
            }
        }
    }
    best
}
