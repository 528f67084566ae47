//! Boxes as eight planes, which one vector operation unites.

use antumbra_simd::{Lanes, Simd, Width};

use crate::aabb::Aabb;

/// The vector that holds a [`Planes`].
pub(crate) type Lanes8<S> = <S as Width<8>>::Lanes;
/// The vector that holds half of one.
pub(crate) type Lanes4<S> = <S as Width<4>>::Lanes;

/// A box over space and primitive indices: minima of x, y, z and index, then their *negated* maxima, so
/// that the union of two boxes is the lane-wise minimum. As aligned as a vector, so that none straddles
/// cache lines.
///
/// Builders keep a primitive as such a box, its index included: an index is the same on both sides.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Planes(pub [f32; 8]);

/// Added to an index to make the bits of a float that compares as the index does. So large that nothing
/// computed with it is subnormal, which is slow; so small that all 2³⁰ indices stay finite.
const INDEX_BASE: u32 = 0x3000_0000;

impl Planes {
    /// Holds nothing; neutral under union.
    pub const EMPTY: Self = Self([f32::INFINITY; 8]);

    /// A primitive.
    #[inline(always)]
    pub fn new(bounds: &Aabb, index: u32) -> Self {
        let ([x, y, z], [u, v, w]) = (bounds.min, bounds.max);
        let index = Self::key(index);
        Self([x, y, z, index, -u, -v, -w, -index])
    }

    /// A triangle with finite corners: the same, but faster.
    #[inline(always)]
    pub fn of_triangle([a, b, c]: &[[f32; 3]; 3], index: u32) -> Self {
        // None is NaN; see [`f32::min`] for what it takes to care for those.
        let min = |a: f32, b: f32| if a < b { a } else { b };
        let max = |a: f32, b: f32| if a > b { a } else { b };
        let index = Self::key(index);
        let mut planes = [index; 8];
        for axis in 0..3 {
            planes[axis] = min(min(a[axis], b[axis]), c[axis]);
            planes[4 + axis] = -max(max(a[axis], b[axis]), c[axis]);
        }
        planes[7] = -index;
        Self(planes)
    }

    /// A float that compares as the index does.
    #[inline(always)]
    pub fn key(index: u32) -> f32 {
        f32::from_bits(index + INDEX_BASE)
    }

    /// The least of the indices.
    #[inline(always)]
    pub fn index(&self) -> u32 {
        self.0[3].to_bits().wrapping_sub(INDEX_BASE)
    }

    /// Whether all indices lie on one side of the one whose key this is.
    #[inline(always)]
    pub fn on_one_side_of(&self, key: f32) -> bool {
        (self.0[3] < key) == (-self.0[7] < key)
    }

    /// The box in space.
    #[inline(always)]
    pub fn bounds(&self) -> Aabb {
        let [x, y, z, _, u, v, w, _] = self.0;
        Aabb {
            min: [x, y, z],
            max: [-u, -v, -w],
        }
    }

    /// The centre of a primitive on one axis, by halves that cannot overflow when added.
    #[inline(always)]
    pub fn center(&self, axis: usize) -> f32 {
        0.5 * self.0[axis & 3] - 0.5 * self.0[4 + (axis & 3)]
    }

    /// Half the surface area. Of an empty box, and of one that is too large to measure, infinite or NaN.
    #[inline(always)]
    pub fn half_area(&self) -> f32 {
        let [a, b, c, _, u, v, w, _] = self.0;
        // Both factors of a product are negated.
        let (x, y, z) = (a + u, b + v, c + w);
        x * y + y * z + z * x
    }

    /// The box around the items, and around their indices.
    #[inline(always)]
    pub fn around<S: Simd>(simd: S, items: &[Self]) -> Self {
        let mut all = Self::EMPTY.load(simd);
        for item in items {
            all = all.min(item.load(simd));
        }
        let mut bounds = Self::EMPTY;
        bounds.store::<S>(all);
        bounds
    }

    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S) -> Lanes8<S> {
        Lanes8::<S>::load(simd, &self.0)
    }

    #[inline(always)]
    pub fn store<S: Simd>(&mut self, lanes: Lanes8<S>) {
        lanes.store(&mut self.0);
    }

    /// The centre of a primitive on all axes; see [`Planes::center`].
    #[inline(always)]
    pub fn centers<S: Simd>(&self, simd: S) -> Lanes4<S> {
        let (halves, _) = self.0.as_chunks();
        let half = Lanes4::<S>::splat(simd, 0.5);
        Lanes4::<S>::load(simd, &halves[0]) * half - Lanes4::<S>::load(simd, &halves[1]) * half
    }
}

/// The extent of centres, gathered centre by centre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CenterBounds {
    pub min: [f32; 4],
    pub max: [f32; 4],
}

impl CenterBounds {
    /// No centres.
    pub const EMPTY: Self = Self {
        min: [f32::INFINITY; 4],
        max: [f32::NEG_INFINITY; 4],
    };

    /// The extent of the items' centres.
    #[inline(always)]
    pub fn of<S: Simd>(simd: S, items: &[Planes]) -> Self {
        let mut min = Lanes4::<S>::load(simd, &Self::EMPTY.min);
        let mut max = Lanes4::<S>::load(simd, &Self::EMPTY.max);
        for item in items {
            let center = item.centers(simd);
            min = min.min(center);
            max = max.max(center);
        }
        let mut bounds = Self::EMPTY;
        min.store(&mut bounds.min);
        max.store(&mut bounds.max);
        bounds
    }

    /// The planes of the box around both.
    pub fn union(&self, other: &Self) -> Self {
        let mut all = *self;
        for axis in 0..4 {
            all.min[axis] = all.min[axis].min(other.min[axis]);
            all.max[axis] = all.max[axis].max(other.max[axis]);
        }
        all
    }

    /// How far the centres are apart on an axis.
    #[inline(always)]
    pub fn spread(&self, axis: usize) -> f32 {
        self.max[axis] - self.min[axis]
    }
}

/// A set of primitives, measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub bounds: Planes,
    pub centers: CenterBounds,
}

impl Extent {
    pub const EMPTY: Self = Self {
        bounds: Planes::EMPTY,
        centers: CenterBounds::EMPTY,
    };

    /// The extent of the items.
    #[inline(always)]
    pub fn of<S: Simd>(simd: S, items: &[Planes]) -> Self {
        Self {
            bounds: Planes::around(simd, items),
            centers: CenterBounds::of(simd, items),
        }
    }

    /// The extent of both.
    pub fn union(&self, other: &Self) -> Self {
        let mut all = *self;
        for (x, y) in all.bounds.0.iter_mut().zip(other.bounds.0) {
            *x = x.min(y);
        }
        all.centers = all.centers.union(&other.centers);
        all
    }
}
