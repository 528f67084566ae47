//! Splits between any two of a few primitives: near the leaves this finds what bins miss, such as the
//! split that fills a leaf block to the last place, and takes hardly longer.

use antumbra_simd::{Lanes, Mask, Simd, Width};

use super::cost::Cost;
use super::planes::{CenterBounds, Planes};

/// The most primitives that [`sweep`] takes: as many as the widest vector compares at once.
pub(super) const MAX_SWEEP: usize = 16;

type Lanes16<S> = <S as Width<MAX_SWEEP>>::Lanes;

/// Where on an axis to split sorted items, and what is on each side.
pub(super) struct SweepSplit {
    pub middle: usize,
    pub left_bounds: Planes,
    pub right_bounds: Planes,
}

/// Finds the split by the order of centres on any axis that costs least, and sorts the items
/// accordingly. `None`, with the items untouched, when the centres coincide or the areas
/// are too large to be compared. At most [`MAX_SWEEP`] items.
#[inline(always)]
pub(super) fn sweep<S: Simd>(
    simd: S,
    items: &mut [Planes],
    centers: &CenterBounds,
    cost: &Cost,
) -> Option<SweepSplit> {
    debug_assert!((1..=MAX_SWEEP).contains(&items.len()));
    let mut best = None;
    let mut best_cost = f32::INFINITY;
    let mut best_order = [0; MAX_SWEEP];
    let mut right_sides = [Planes::EMPTY; MAX_SWEEP];
    let mut right_costs = [0.0; MAX_SWEEP];
    for axis in 0..3 {
        if !(centers.spread(axis) > 0.0) {
            continue;
        }
        let order = sorted(simd, items, axis);
        let mut right = Planes::EMPTY.load(simd);
        for middle in (1..items.len()).rev() {
            right = right.min(items[order[middle] as usize].load(simd));
            right_sides[middle].store::<S>(right);
            right_costs[middle] = cost.of(&right_sides[middle], items.len() - middle);
        }
        let mut left = Planes::EMPTY.load(simd);
        let mut left_side = Planes::EMPTY;
        for middle in 1..items.len() {
            left = left.min(items[order[middle - 1] as usize].load(simd));
            left_side.store::<S>(left);
            let sum = cost.of(&left_side, middle) + right_costs[middle];
            if sum < best_cost {
                best_cost = sum;
                best_order = order;
                best = Some(SweepSplit {
                    middle,
                    left_bounds: left_side,
                    right_bounds: right_sides[middle],
                });
            }
        }
    }
    if best.is_some() {
        let mut unsorted = [Planes::EMPTY; MAX_SWEEP];
        unsorted[..items.len()].copy_from_slice(items);
        for (item, from) in items.iter_mut().zip(best_order) {
            *item = unsorted[from as usize];
        }
    }
    best
}

/// The items in ascending order of their centres on an axis, equal ones in the order they have. An item's
/// place is the number of those that precede it.
#[inline(always)]
fn sorted<S: Simd>(simd: S, items: &[Planes], axis: usize) -> [u8; MAX_SWEEP] {
    // Those after the last item precede none.
    let mut keys = [f32::INFINITY; MAX_SWEEP];
    for index in 0..items.len() {
        keys[index % MAX_SWEEP] = items[index].center(axis);
    }
    let all = Lanes16::<S>::load(simd, &keys);
    let mut order = [0; MAX_SWEEP];
    for index in 0..items.len() {
        let key = Lanes16::<S>::splat(simd, keys[index % MAX_SWEEP]);
        let before = (1 << index) - 1;
        let preceding = all.lt(key).bits() | all.eq(key).bits() & before;
        order[preceding.count_ones() as usize % MAX_SWEEP] = index as u8;
    }
    order
}
