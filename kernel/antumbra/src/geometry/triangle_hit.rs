//! The definition of a hit on a triangle: one ray, one triangle, in plain scalar code that every level shares.
//!
//! The corners are translated to the ray's origin and sheared so that the ray runs along z (Woop, Benthin and Wald 2013,
//! "Watertight Ray/Triangle Intersection", JCGT 2(1)), in single precision. All that follows is in double precision,
//! where products of single precision are exact. So the edge functions have the exact signs for the sheared corners, and
//! triangles that share an edge or a corner see the same ones. Zero counts as inside, on both sides. The distance is a
//! mean of the corners' distances with weights of one sign, and is rounded once at the end: hits on thin triangles are
//! as exact as others, and a ray inside a closed mesh hits it, however thin the mesh is.
//!
//! What vectors can say sooner is in [`crate::geometry::edge_test`], why no tree loses a hit in
//! [`crate::geometry::ray_setup`].

use antumbra_simd::{Doubles, Lanes};

use crate::geometry::edge_test::Corners;

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

    /// The barycentrics `u` and `v` of the hit, in single precision, where vectors compute the same bits. In double
    /// precision if that gives none.
    #[inline(always)]
    pub fn barycentrics(&self) -> [f32; 2] {
        let ([ax, bx, cx], [ay, by, cy]) = (self.x, self.y);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let det = (u + v) + w;
        if (det != 0.0) & det.is_finite() {
            [v / det, w / det]
        } else {
            self.precise_barycentrics()
        }
    }

    /// The barycentrics of a triangle that is a line in single precision, or out of its range.
    #[cold]
    fn precise_barycentrics(&self) -> [f32; 2] {
        let [u, v, w] = self.edges();
        let det = u + v + w;
        [(v / det) as f32, (w / det) as f32]
    }

    /// The edge functions: each is rounded once, so its sign is exact.
    #[inline(always)]
    fn edges(&self) -> [f64; 3] {
        let ([ax, bx, cx], [ay, by, cy]) = (self.x.map(f64::from), self.y.map(f64::from));
        [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax]
    }
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
