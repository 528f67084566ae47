//! Sixteen rays side by side, a lane each: what waves and packets work out of many rays at once.

use antumbra_simd::{Lanes, Mask, Simd, Width};

use super::setup::{DOUBT, DOUBT_BY_SPREAD, SANE};
use crate::ray::Ray;

/// How many, on every level: a level with narrower registers takes several.
pub(crate) const RAYS: usize = 16;

/// A ray in one piece, as it lies in memory.
pub(crate) type Row = [f32; 8];

/// A vector with a lane for each ray.
pub(crate) type RayLanes<S> = <S as Width<RAYS>>::Lanes;
/// A mask with a lane for each ray.
pub(crate) type RayMask<S> = <RayLanes<S> as Lanes<RAYS>>::Mask;

/// The ray as a row.
#[inline(always)]
pub(crate) fn row(ray: &Ray) -> Row {
    let [ox, oy, oz] = ray.org;
    let [dx, dy, dz] = ray.dir;
    [ox, oy, oz, ray.tnear, dx, dy, dz, ray.tfar]
}

/// What [`super::setup::RaySetup::set`] works out, the same bits.
pub(super) struct RayColumns<S: Simd> {
    pub org: [RayLanes<S>; 3],
    pub tnear: RayLanes<S>,
    pub dir: [RayLanes<S>; 3],
    pub tfar: RayLanes<S>,
    /// Of the direction on each axis.
    pub magnitude: [RayLanes<S>; 3],
    /// Of them.
    pub largest: RayLanes<S>,
    /// The reciprocal of that.
    pub shortest: RayLanes<S>,
    /// `R`.
    pub reach: RayLanes<S>,
    pub doubt_by_spread: RayLanes<S>,
    pub minus_doubt: RayLanes<S>,
    /// Who can hit something.
    pub valid: RayMask<S>,
    /// Whose lengths are [`SANE`].
    pub sane: RayMask<S>,
}

impl<S: Simd> RayColumns<S> {
    /// Of rays that meet primitives whose coordinates are at most `reach`.
    #[inline(always)]
    pub fn new(simd: S, rows: &[Row; RAYS], reach: f32) -> Self {
        let [ox, oy, oz, tnear, dx, dy, dz, tfar] = simd.columns(rows);
        let zero = RayLanes::<S>::splat(simd, 0.0);

        let magnitude @ [mx, my, mz] = [dx.flip_sign(dx), dy.flip_sign(dy), dz.flip_sign(dz)];
        let largest = mx.max(my).max(mz);
        let shortest = RayLanes::<S>::splat(simd, 1.0) / largest;
        let finite = ((ox * zero + dx * zero) + (oy * zero + dy * zero)) + (oz * zero + dz * zero);
        let infinity = RayLanes::<S>::splat(simd, f32::INFINITY);
        let valid = finite.eq(zero) & shortest.lt(infinity) & tnear.lt(tfar);

        let [ax, ay, az] = [ox.flip_sign(ox), oy.flip_sign(oy), oz.flip_sign(oz)];
        let reach = ax.max(ay).max(az) + RayLanes::<S>::splat(simd, reach);
        let span = reach * shortest;
        let sane = RayLanes::<S>::splat(simd, SANE.0).lt(reach.min(span))
            & reach.max(span).lt(RayLanes::<S>::splat(simd, SANE.1));
        Self {
            org: [ox, oy, oz],
            tnear,
            dir: [dx, dy, dz],
            tfar,
            magnitude,
            largest,
            shortest,
            reach,
            doubt_by_spread: reach * reach * RayLanes::<S>::splat(simd, DOUBT_BY_SPREAD),
            minus_doubt: span * RayLanes::<S>::splat(simd, -DOUBT),
            valid,
            sane,
        }
    }

    /// Bits of the lanes whose direction is largest on x, and of those on y; also where several components are equal.
    #[inline(always)]
    pub fn is_largest(&self) -> [u32; 2] {
        let [x, y, _] = self.magnitude;
        [x.eq(self.largest).bits(), y.eq(self.largest).bits()]
    }

    /// Bits of the lanes that go down each axis.
    #[inline(always)]
    pub fn negative(&self, simd: S) -> [u32; 3] {
        let zero = RayLanes::<S>::splat(simd, 0.0);
        let one = RayLanes::<S>::splat(simd, 1.0);
        let [x, y, z] = self.dir;
        [
            one.copysign(x).lt(zero).bits(),
            one.copysign(y).lt(zero).bits(),
            one.copysign(z).lt(zero).bits(),
        ]
    }
}
