//! Splits between any two of a few primitives: near the leaves this finds what bins miss, such as the
//! split that fills a leaf block to the last place, and takes hardly longer.

use antumbra_simd::{Lanes, Mask, Simd, Width};

use crate::builder::binned_sah::bins::least;
use crate::builder::binned_sah::planes::{CenterBounds, Planes};
use crate::builder::cost::Weigh;

/// The most primitives that [`sweep`] takes: as many as the widest vector compares at once.
pub(crate) const MAX_SWEEP: usize = 16;

type Lanes16<S> = <S as Width<MAX_SWEEP>>::Lanes;

/// Where on an axis to split sorted items, and what is on each side.
pub(crate) struct SweepSplit {
    pub middle: usize,
    pub left_bounds: Planes,
    pub right_bounds: Planes,
}

/// Finds the split by the order of centres on any axis that costs least, and sorts the items
/// accordingly. `None`, with the items untouched, when the centres coincide or the areas
/// are too large to be compared. At most [`MAX_SWEEP`] items.
#[inline(always)]
pub(crate) fn sweep<S: Simd, W: Weigh>(
    simd: S,
    items: &mut [Planes],
    centers: &CenterBounds,
    weigh: &W,
) -> Option<SweepSplit> {
    debug_assert!((1..=MAX_SWEEP).contains(&items.len()));
    let mut costs = [[f32::INFINITY; MAX_SWEEP]; 3];
    let mut orders = [[0; MAX_SWEEP]; 3];
    for axis in 0..3 {
        if !(centers.spread(axis) > 0.0) {
            continue;
        }
        let order = sorted(simd, items, axis);
        let mut side = Planes::EMPTY;
        let mut right = side.load(simd);
        let mut sum = W::Sum::default();
        for middle in (1..items.len()).rev() {
            let item = &items[order[middle] as usize];
            right = right.min(item.load(simd));
            side.store::<S>(right);
            sum += weigh.item(item);
            costs[axis][middle] = weigh.of(&side, sum);
        }
        let mut left = Planes::EMPTY.load(simd);
        let mut sum = W::Sum::default();
        for middle in 1..items.len() {
            let item = &items[order[middle - 1] as usize];
            left = left.min(item.load(simd));
            side.store::<S>(left);
            sum += weigh.item(item);
            costs[axis][middle] += weigh.of(&side, sum);
        }
        orders[axis] = order;
    }
    let (axis, middle) = least(simd, &costs)?;
    let mut unsorted = [Planes::EMPTY; MAX_SWEEP];
    unsorted[..items.len()].copy_from_slice(items);
    for (item, from) in items.iter_mut().zip(orders[axis]) {
        *item = unsorted[from as usize];
    }
    let (left, right) = items.split_at(middle);
    Some(SweepSplit {
        middle,
        left_bounds: Planes::around(simd, left),
        right_bounds: Planes::around(simd, right),
    })
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
