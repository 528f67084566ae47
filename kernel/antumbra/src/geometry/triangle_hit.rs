//! The definition of a hit on a triangle: one ray, one triangle, in plain scalar code that every level shares.
//!
//! The corners are translated to the ray's origin and sheared so that the ray runs along z (Woop, Benthin and Wald 2013,
//! "Watertight Ray/Triangle Intersection", JCGT 2(1)), in single precision. All that follows is in double precision,
//! where products of single precision are exact. So the edge functions have the exact signs for the sheared corners, and
//! triangles that share an edge or a corner see the same ones. Zero counts as inside, on both sides. The distance is a
//! mean of the corners' distances with weights of one sign, and is rounded once at the end, so a ray inside a closed mesh
//! hits it, however thin the mesh is. This distance decides which hit is the closest.
//!
//! # What is reported of a hit
//!
//! The sheared corners are off by some `10 u R`, see [`crate::geometry::ray_setup`]. On a wall of 10,000 by 0.1 that is as
//! much as the wall is high, and the distance that decides is off by as much as a mean with wrong weights can be. So
//! [`refined`] computes `t`, `u` and `v` of a hit once more, from the ray and the corners as they are stored. With the edges
//! `e` and `f` from the first corner `a`, `s = org - a`, `n = e × f` and `r = s × dir`:
//!
//! ```text
//! t = -s·n / dir·n      u = -f·r / dir·n      v = e·r / dir·n
//! ```
//!
//! Let `ε = 2⁻⁵³`, and let `c` be the cosine between ray and normal. Differences of two numbers of single precision are
//! exact in double precision unless one is 2²⁹ times the other, and so are products of such differences of 26 bits and
//! of coordinates. Then every component of `n` and `r` is rounded once, which is a relative error of `ε`, and a scalar
//! product of them has an error of at most `4 ε` of the sum of its terms, by magnitude. That sum is at most `√3` times the
//! product of the lengths. With `|dir·n| = |dir| |n| c` this gives
//!
//! ```text
//! |δt| ≤ 7 ε (|s| / |dir| + |t|) / c + 2 ε |t|
//! |δu|, |δv| ≤ 7 ε (|e| or |f|) |s| / (|n| c) + 7 ε / c + 2 ε
//! ```
//!
//! before the result is rounded to single precision. For a ray that grazes the triangle at a hundredth of a degree, `7 ε / c`
//! is less than `10⁻¹¹`. So `t` is right to half a unit in the last place and `10⁻¹¹` of the way from the first corner. On
//! the wall `u` and `v`, whose bound is `10⁵` times as large, are right to half a unit and `10⁻¹⁰` for rays that do not graze
//! it. Where edges have more bits, `n` is off by at most `4 ε |e| |f|`, and the bounds are as many times larger as `|e| |f|` is
//! larger than `|n|`.
//!
//! Where the ray passes beside the triangle, by no more than the sheared corners are off, the distance is brought to where the
//! triangle is along the ray, so that a ray that grazes it is not said to hit far behind it, and the point by weights is the
//! nearest one of the triangle. A distance that is not in the interval of the ray stays the one that decides.
//!
//! What vectors can say sooner is in [`crate::geometry::edge_test`], why no tree loses a hit in
//! [`crate::geometry::ray_setup`].

use antumbra_simd::{Doubles, Lanes};

use crate::geometry::edge_test::Corners;
use crate::geometry::instance::{cross, dot};
use crate::geometry::nearest::Place;
use crate::ray::Ray;

/// A ray on the axes of its shear, see [`crate::geometry::ray_setup::RaySetup`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    pub org: [f32; 3],
    pub shear: [f32; 3],
    pub tnear: f32,
    pub tfar: f32,
}

/// The corners of a triangle as a ray sees them, `[axis][corner]` on the axes of the shear. The ray runs through the
/// origin along the last one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedTriangle {
    x: [f32; 3],
    y: [f32; 3],
    z: [f32; 3],
    /// Factor from coordinates on the last axis to distances.
    per_z: f32,
}

impl ShearedTriangle {
    /// `corners` are `[axis][corner]`, on the axes of the shear.
    #[inline(always)]
    pub fn new([xs, ys, zs]: &[[f32; 3]; 3], ray: &ShearedRay) -> Self {
        let ([ox, oy, oz], [sx, sy, per_z]) = (ray.org, ray.shear);
        let z = zs.map(|z| oz - z);
        Self {
            x: core::array::from_fn(|corner| (ox - xs[corner]) - sx * z[corner]),
            y: core::array::from_fn(|corner| (oy - ys[corner]) - sy * z[corner]),
            z,
            per_z,
        }
    }

    /// The distance of the hit, if the ray passes through the triangle between `tnear` and `tfar`. None for a triangle that
    /// is seen as a line, for NaN, and where single precision has no number for what is sheared.
    #[inline(always)]
    pub fn distance(&self, ray: &ShearedRay) -> Option<f32> {
        let [u, v, w] = self.edges();
        // Of one sign where this is not negative. Products of four numbers of single precision neither overflow nor underflow
        // in double precision, and where one is no number, neither is the distance.
        let inside = least(u, least(v, w)) * most(u, most(v, w)) >= 0.0;
        let [a, b, c] = self.z.map(f64::from);
        let along = (u * a + v * b + w * c) / (u + v + w);
        // Adding 0 makes a zero positive.
        let t = (along * f64::from(self.per_z)) as f32 + 0.0;
        (inside & (ray.tnear < t) & (t < ray.tfar)).then_some(t)
    }

    /// The barycentrics `u` and `v` by which cut-outs look up whether a hit counts: in single precision, where vectors compute
    /// the same bits. None if that gives none.
    #[inline(always)]
    pub fn barycentrics(&self) -> Option<[f32; 2]> {
        let ([ax, bx, cx], [ay, by, cy]) = (self.x, self.y);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let det = (u + v) + w;
        ((det != 0.0) & det.is_finite()).then(|| [v / det, w / det])
    }

    /// The edge functions: each is rounded once, so its sign is exact.
    #[inline(always)]
    fn edges(&self) -> [f64; 3] {
        let ([ax, bx, cx], [ay, by, cy]) = (self.x.map(f64::from), self.y.map(f64::from));
        [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax]
    }
}

/// What is reported of a hit on a triangle with these corners, decided at the distance `t`: distance and barycentrics in
/// double precision, see above. Ray and corners are in the same space.
#[inline(always)]
pub(crate) fn refined(corners: &[[f32; 3]; 3], ray: &Ray, t: f32) -> [f32; 3] {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let from_a = |[x, y, z]: [f64; 3]| [x - a[0], y - a[1], z - a[2]];
    let (e, f, s) = (from_a(b), from_a(c), from_a(ray.org.map(f64::from)));
    let dir = ray.dir.map(f64::from);
    let (n, r) = (cross(e, f), cross(s, dir));
    let per = 1.0 / dot(dir, n);
    let exact = -dot(s, n) * per;
    let [u, v] = [-dot(f, r) * per, dot(e, r) * per];
    let is_inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0);
    let [exact, u, v] = match is_inside {
        true => [exact, u, v],
        false => beside(corners, ray, exact, t),
    };
    // Adding 0 makes a zero positive.
    let [exact, u, v] = [exact as f32 + 0.0, u as f32 + 0.0, v as f32 + 0.0];
    let is_there = (ray.tnear < exact) & (exact < ray.tfar);
    [if is_there { exact } else { t }, u, v]
}

/// [`refined`] for a ray that crosses the triangle's plane beside the triangle, or nowhere: the distance is brought to where
/// the triangle is along the ray, and the weights belong to the point of the triangle that is nearest there.
#[cold]
#[inline(never)]
fn beside(corners: &[[f32; 3]; 3], ray: &Ray, exact: f64, t: f32) -> [f64; 3] {
    let (org, dir) = (ray.org.map(f64::from), ray.dir.map(f64::from));
    let [a, b, c] = corners.map(|corner| {
        let way = core::array::from_fn(|axis| f64::from(corner[axis]) - org[axis]);
        dot(way, dir) / dot(dir, dir)
    });
    let (first, last) = (least(a, least(b, c)), most(a, most(b, c)));
    let t = match exact.is_finite() {
        true => most(first, least(exact, last)),
        false => f64::from(t),
    };
    let place = Place {
        point: core::array::from_fn(|axis| org[axis] + t * dir[axis]),
        affine: None,
    };
    let [u, v] = place.triangle(corners).uv;
    [t, u, v]
}

/// The smaller one; `b` if either is NaN.
#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The larger one; `b` if either is NaN.
#[inline(always)]
fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// [`ShearedTriangle::distance`] in vectors, for lanes whose coordinates are finite: the distances, and which lanes pass
/// through their triangle. The intervals of the rays are left to the caller.
#[inline(always)]
pub(crate) fn distances<const L: usize, V: Lanes<L>>(
    simd: V::Token,
    sheared: &Corners<V>,
    per_z: V,
) -> (V, V::Mask) {
    // One by one: a closure would not be compiled for the level.
    let [x, y, z] = *sheared;
    let [ax, bx, cx] = [x[0].widen(), x[1].widen(), x[2].widen()];
    let [ay, by, cy] = [y[0].widen(), y[1].widen(), y[2].widen()];
    let [az, bz, cz] = [z[0].widen(), z[1].widen(), z[2].widen()];
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    // As above, and so much larger that they do not underflow in single precision.
    let least = u.min(v.min(w));
    let most = u.max(v.max(w));
    /// 2⁵⁰⁰.
    const LARGE: f64 = f64::from_bits(0x5f30_0000_0000_0000);
    let sign = V::narrow((least * most).times(LARGE));
    let along = (u * az + v * bz + w * cz) / (u + v + w);
    let zero = V::splat(simd, 0.0);
    (V::narrow(along * per_z.widen()) + zero, zero.le(sign))
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_simd::{Mask, Scalar};
    use antumbra_testkit::Rng;

    /// Few coordinates, so that rays often hit edges and corners.
    #[test]
    fn vectors_say_the_same() {
        type Four = <Scalar as antumbra_simd::Width<4>>::Lanes;
        let mut rng = Rng::new(77);
        let mut hits = 0;
        for round in 0..20_000 {
            let scale = 10f32.powi(rng.below(9) as i32 - 6);
            let mut coordinate =
                || (rng.below(7) as f32 - 3.0) * scale * (1.0 + 1e-7 * rng.below(2) as f32);
            let sheared: [[[f32; 4]; 3]; 3] = core::array::from_fn(|_| {
                core::array::from_fn(|_| core::array::from_fn(|_| coordinate()))
            });
            let per_z = -0.7;
            let vectors = sheared.map(|axis| axis.map(|lanes| Four::load(Scalar, &lanes)));
            let (t, inside) = distances::<4, Four>(Scalar, &vectors, Four::splat(Scalar, per_z));
            let mut found = [0.0; 4];
            t.store(&mut found);
            for lane in 0..4 {
                let [x, y, z] = sheared.map(|axis| axis.map(|lanes| lanes[lane]));
                let ray = ShearedRay {
                    org: [0.0; 3],
                    shear: [0.0, 0.0, per_z],
                    tnear: f32::NEG_INFINITY,
                    tfar: f32::INFINITY,
                };
                let expected = ShearedTriangle { x, y, z, per_z }.distance(&ray);
                let is_hit = inside.bits() >> lane & 1 == 1 && !found[lane].is_nan();
                assert_eq!(is_hit.then_some(found[lane]), expected, "round {round}");
                hits += u32::from(is_hit);
            }
        }
        assert!(hits > 1000, "{hits}");
    }
}
