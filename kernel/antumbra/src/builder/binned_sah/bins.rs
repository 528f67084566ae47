//! Splits between bins: the candidates of the surface area heuristic.

use antumbra_simd::{Lanes, Mask, Simd, Width};

use crate::builder::binned_sah::planes::{CenterBounds, Lanes4, Planes};
use crate::builder::cost::Weigh;

type Lanes16<S> = <S as Width<16>>::Lanes;

/// Maps centres to `B` bins on each axis; `B` is a power of two.
///
/// The first and the last bin are half as wide as the others, because rounding to the nearest is the
/// cheapest way from a float to an integer: adding 1.5 * 2²³ leaves the integer in the low bits.
#[derive(Clone, Copy)]
pub(crate) struct Binning<const B: usize> {
    origin: [f32; 4],
    /// 0 on axes where the centres coincide, or are too far apart or too close for this to be a number.
    scale: [f32; 4],
}

const ROUND: f32 = 12_582_912.0;

impl<const B: usize> Binning<B> {
    #[inline(always)]
    pub fn new(centers: &CenterBounds) -> Self {
        let mut scale = [0.0; 4];
        for axis in 0..3 {
            let bins_per_unit = (B - 1) as f32 / centers.spread(axis);
            if bins_per_unit < f32::INFINITY {
                scale[axis] = bins_per_unit;
            }
        }
        Self {
            origin: centers.min,
            scale,
        }
    }

    /// The bin of an item on each of three axes.
    #[inline(always)]
    fn bins<S: Simd>(&self, simd: S, item: &Planes) -> [usize; 4] {
        let origin = Lanes4::<S>::load(simd, &self.origin);
        let scale = Lanes4::<S>::load(simd, &self.scale);
        let bins = (item.centers(simd) - origin) * scale + Lanes4::<S>::splat(simd, ROUND);
        let mut out = [0.0; 4];
        bins.store(&mut out);
        let mut bins = [0; 4];
        for axis in 0..3 {
            bins[axis] = out[axis].to_bits() as usize & (B - 1);
        }
        bins
    }
}

/// Contents of the bins of each axis.
#[derive(Clone)]
pub(crate) struct Bins<W: Weigh, const B: usize> {
    bounds: [[Planes; B]; 3],
    sums: [[W::Sum; B]; 3],
}

impl<W: Weigh, const B: usize> Bins<W, B> {
    #[inline(always)]
    pub fn empty() -> Self {
        Self {
            bounds: [[Planes::EMPTY; B]; 3],
            sums: [[W::Sum::default(); B]; 3],
        }
    }

    /// Puts every item into one bin per axis.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, simd: S, items: &[Planes], binning: &Binning<B>, weigh: &W) {
        for item in items {
            let bins = binning.bins(simd, item);
            let weight = weigh.item(item);
            let item = item.load(simd);
            for axis in 0..3 {
                let bounds = &mut self.bounds[axis][bins[axis]];
                bounds.store::<S>(item.min(bounds.load(simd)));
                self.sums[axis][bins[axis]] += weight;
            }
        }
    }

    /// Adds many items. Neighbours often share a bin and would wait for each other, so every
    /// other item goes into bins of its own first.
    #[inline(always)]
    pub fn fill_alternating<S: Simd>(
        &mut self,
        simd: S,
        items: &[Planes],
        binning: &Binning<B>,
        weigh: &W,
    ) {
        let mut others = Self::empty();
        let (pairs, last) = items.as_chunks::<2>();
        for [a, b] in pairs {
            let bins_of_a = binning.bins(simd, a);
            let bins_of_b = binning.bins(simd, b);
            let weights = [weigh.item(a), weigh.item(b)];
            let a = a.load(simd);
            let b = b.load(simd);
            for axis in 0..3 {
                let bounds = &mut self.bounds[axis][bins_of_a[axis]];
                bounds.store::<S>(a.min(bounds.load(simd)));
                self.sums[axis][bins_of_a[axis]] += weights[0];
                let bounds = &mut others.bounds[axis][bins_of_b[axis]];
                bounds.store::<S>(b.min(bounds.load(simd)));
                others.sums[axis][bins_of_b[axis]] += weights[1];
            }
        }
        self.fill(simd, last, binning, weigh);
        self.add(&others);
    }

    /// Adds the contents of other bins.
    pub fn add(&mut self, other: &Self) {
        let bounds = self.bounds.as_flattened_mut().iter_mut();
        for (a, b) in bounds.zip(other.bounds.as_flattened()) {
            for (x, y) in a.0.iter_mut().zip(b.0) {
                *x = x.min(y);
            }
        }
        let sums = self.sums.as_flattened_mut().iter_mut();
        for (a, b) in sums.zip(other.sums.as_flattened()) {
            *a += *b;
        }
    }

    /// The split between bins that costs least, the first of equals; `None` when
    /// no axis has two occupied bins, or the areas are too large to be compared.
    #[inline(always)]
    pub fn best_split<S: Simd>(&self, simd: S, binning: &Binning<B>, weigh: &W) -> Option<Split> {
        let mut costs = [[f32::INFINITY; B]; 3];
        for axis in 0..3 {
            if binning.scale[axis] == 0.0 {
                continue;
            }
            let (bounds, sums) = (&self.bounds[axis], &self.sums[axis]);
            let mut side = Planes::EMPTY;
            let mut right = side.load(simd);
            let mut sum = W::Sum::default();
            for bin in (1..B).rev() {
                right = right.min(bounds[bin].load(simd));
                side.store::<S>(right);
                sum += sums[bin];
                costs[axis][bin] = weigh.of(&side, sum);
            }
            let mut left = Planes::EMPTY.load(simd);
            let mut sum = W::Sum::default();
            for bin in 1..B {
                left = left.min(bounds[bin - 1].load(simd));
                side.store::<S>(left);
                sum += sums[bin - 1];
                // Infinite or NaN, and so never the least, when a side is empty.
                costs[axis][bin] += weigh.of(&side, sum);
            }
        }
        let (axis, bin) = least(simd, &costs)?;
        let (left, right) = self.bounds[axis].split_at(bin);
        Some(Split {
            axis,
            origin: binning.origin[axis],
            scale: binning.scale[axis],
            threshold: ROUND + bin as f32,
            left_bounds: Planes::around(simd, left),
            right_bounds: Planes::around(simd, right),
        })
    }
}

/// Where the least of all costs is, the first of equals; `None` if none is finite. Which it is nobody can guess, so
/// there is no branch on any of them. `B` is a multiple of 16.
#[inline(always)]
pub(crate) fn least<S: Simd, const B: usize>(
    simd: S,
    costs: &[[f32; B]; 3],
) -> Option<(usize, usize)> {
    let (vectors, _) = costs.as_flattened().as_chunks::<16>();
    let mut least = Lanes16::<S>::splat(simd, f32::INFINITY);
    for vector in vectors {
        // In this order a NaN is passed over.
        least = Lanes16::<S>::load(simd, vector).min(least);
    }
    let mut lanes = [0.0; 16];
    least.store(&mut lanes);
    let mut least = f32::INFINITY;
    for lane in lanes {
        least = if lane < least { lane } else { least };
    }
    if least == f32::INFINITY {
        return None;
    }
    let least = Lanes16::<S>::splat(simd, least);
    let mut place = 0;
    for vector in vectors {
        let bits = Lanes16::<S>::load(simd, vector).eq(least).bits();
        if bits != 0 {
            place += bits.trailing_zeros() as usize;
            break;
        }
        place += 16;
    }
    Some((place / B % 3, place % B))
}

/// A plane between two bins, and what is on each side of it.
#[derive(Clone, Copy)]
pub(crate) struct Split {
    axis: usize,
    origin: f32,
    scale: f32,
    threshold: f32,
    pub left_bounds: Planes,
    pub right_bounds: Planes,
}

impl Split {
    /// Whether the item is in a bin before the plane; the same arithmetic as in [`Binning`].
    #[inline(always)]
    fn is_left(&self, item: &Planes) -> bool {
        (item.center(self.axis) - self.origin) * self.scale + ROUND < self.threshold
    }

    /// Moves the items before the plane to the front; returns how many they are.
    #[inline(always)]
    pub fn partition<S: Simd>(&self, simd: S, items: &mut [Planes]) -> usize {
        let mut middle = 0;
        for index in 0..items.len() {
            // Which side an item is on cannot be predicted, so there is no branch: every item is swapped
            // with the first one of the right side, which then begins before or after it.
            let is_left = self.is_left(&items[index]);
            let item = items[index].load(simd);
            items[index].store::<S>(items[middle].load(simd));
            items[middle].store::<S>(item);
            middle += usize::from(is_left);
        }
        middle
    }
}
