//! The arithmetic of the triangle test in vectors: one ray against many triangles, or many rays against one.
//!
//! The arithmetic does not depend on what the lanes stand for, and nothing is fused where that could decide, so both
//! uses give the same bits. The test is described in [`crate::geometry::triangle`], what can be said of a hit without a
//! division in [`crate::geometry::ray_setup`].

use antumbra_simd::Lanes;

use crate::geometry::ray_setup::{DOUBT, SLACK, SMALL};

/// Input of the edge functions: the ray of each lane on the axes of its shear, see
/// [`crate::geometry::ray_setup::RaySetup`].
#[derive(Clone, Copy)]
pub(crate) struct Shear<V> {
    pub org: [V; 3],
    pub shear: [V; 3],
}

impl<V> Shear<V> {
    /// Corners relative to the origin, sheared so that the ray runs along the last axis.
    ///
    /// Takes the origin relative to the corners, not the corners relative to the origin: two signs that cancel,
    /// for the sake of loads that are part of the subtraction.
    #[inline(always)]
    pub fn of<const L: usize>(&self, [xs, ys, zs]: &Corners<V>) -> Corners<V>
    where
        V: Lanes<L>,
    {
        let ([ox, oy, oz], [sx, sy, _]) = (self.org, self.shear);
        let [az, bz, cz] = [oz - zs[0], oz - zs[1], oz - zs[2]];
        [
            [
                (ox - xs[0]) - sx * az,
                (ox - xs[1]) - sx * bz,
                (ox - xs[2]) - sx * cz,
            ],
            [
                (oy - ys[0]) - sy * az,
                (oy - ys[1]) - sy * bz,
                (oy - ys[2]) - sy * cz,
            ],
            [az, bz, cz],
        ]
    }

    /// Factor from coordinates on the last axis to distances.
    #[inline(always)]
    pub fn per_z(&self) -> V
    where
        V: Copy,
    {
        self.shear[2]
    }
}

/// Input of [`Edges::judge`]: the interval of the ray of each lane.
#[derive(Clone, Copy)]
pub(crate) struct Ends<V> {
    pub tnear: V,
    pub tfar: V,
}

/// The part of the test that all lanes go through.
#[derive(Clone, Copy)]
pub(crate) struct Edges<V> {
    /// The edge functions.
    pub u: V,
    pub v: V,
    pub w: V,
    /// Sum of the edge functions.
    pub det: V,
    /// Mean of the distances of the corners, weighted by the edge functions: the distance of the hit times `det`.
    t_det: V,
    /// The largest distance of a corner, by magnitude.
    farthest: V,
    /// The product of the largest sheared coordinates on the first two axes, by magnitude: what the roundings of an edge
    /// function are measured by.
    size: V,
}

/// Hits as far as they can be decided without a division.
pub(crate) struct Verdict<M> {
    /// Lanes that are hit beyond doubt.
    pub sure: M,
    /// Lanes that are hit beyond doubt, and lanes in doubt. All others are missed.
    pub possible: M,
}

/// Corners on three axes: `[axis][corner]`.
pub(crate) type Corners<V> = [[V; 3]; 3];

impl<V> Edges<V> {
    /// From corners as [`Shear::of`] makes them, and what makes distances of their last coordinates.
    #[inline(always)]
    pub fn new<const L: usize>(corners: &Corners<V>, per_z: V) -> Self
    where
        V: Lanes<L>,
    {
        let [[ax, bx, cx], [ay, by, cy], [az, bz, cz]] = *corners;
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let t = [az * per_z, bz * per_z, cz * per_z];
        Self {
            u,
            v,
            w,
            det: (u + v) + w,
            t_det: (u * t[0] + v * t[1]) + w * t[2],
            farthest: t[0].max_size(t[1]).max_size(t[2]),
            size: ax.max_size(bx).max_size(cx) * ay.max_size(by).max_size(cy),
        }
    }

    /// The lanes whose ray may pass through the triangle, at whatever distance.
    #[inline(always)]
    pub fn inside<const L: usize>(&self, zero: V) -> V::Mask
    where
        V: Lanes<L>,
    {
        let least = self.u.min(self.v.min(self.w));
        let most = self.u.max(self.v.max(self.w));
        zero.le(least) | most.le(zero)
    }

    /// Decides nearly all lanes, by the argument in [`crate::geometry::ray_setup`].
    #[inline(always)]
    pub fn judge<const L: usize>(&self, simd: V::Token, ray: &Ends<V>) -> Verdict<V::Mask>
    where
        V: Lanes<L>,
    {
        let zero = V::splat(simd, 0.0);
        // All three of one sign, the sign of their sum, or none of them counts.
        let [u, v, w] = [
            self.u.flip_sign(self.det),
            self.v.flip_sign(self.det),
            self.w.flip_sign(self.det),
        ];
        let least = u.min(v).min(w);

        let det = self.det.flip_sign(self.det);
        let t_det = self.t_det.flip_sign(self.det);
        // In this order: an infinite end times nothing is NaN, and then the other end counts.
        let to_end = (ray.tfar.mul_sub(det, t_det)).min(t_det - ray.tnear * det);
        let sizes = self.size.mul_sub(V::splat(simd, -2.0), det);
        let doubt = (self.farthest * V::splat(simd, -DOUBT)).mul_sub(sizes, V::splat(simd, -SLACK));
        Verdict {
            sure: V::splat(simd, SMALL).lt(least) & doubt.lt(to_end),
            possible: zero.le(least) & zero.le(to_end + doubt),
        }
    }

    /// The barycentrics `u` and `v`, of meaning in lanes that are surely hit. Same values as from
    /// [`crate::geometry::triangle_hit::ShearedTriangle::barycentrics`].
    #[inline(always)]
    pub fn barycentrics<const L: usize>(&self) -> [V; 2]
    where
        V: Lanes<L>,
    {
        [self.v / self.det, self.w / self.det]
    }
}

/// The boxes of triangles with these corners, given as smallest and largest coordinates.
#[inline(always)]
pub(crate) fn boxes<const L: usize, V: Lanes<L>>(corners: &Corners<V>) -> [[V; 3]; 2] {
    let [[ax, bx, cx], [ay, by, cy], [az, bz, cz]] = *corners;
    [
        [ax.min(bx.min(cx)), ay.min(by.min(cy)), az.min(bz.min(cz))],
        [ax.max(bx.max(cx)), ay.max(by.max(cy)), az.max(bz.max(cz))],
    ]
}

#[cfg(test)]
mod tests {
    use antumbra_simd::{Mask, Scalar, Width};
    use antumbra_testkit::Rng;

    use super::*;
    use crate::geometry::triangle_hit::{ShearedRay, ShearedTriangle};

    type One = <Scalar as Width<1>>::Lanes;

    /// A coordinate of one of few values, or any, of this size.
    fn coordinate(rng: &mut Rng, size: f32) -> f32 {
        let whole = rng.below(7) as f32 - 3.0;
        match rng.below(3) {
            0 => whole * size,
            1 => whole * size * (1.0 + rng.range(-1e-6, 1e-6)),
            _ => rng.range(-3.0, 3.0) * size,
        }
    }

    /// Triangles of all sizes and shapes, among them slivers, and intervals that end at the hit or next to it.
    #[test]
    fn no_verdict_is_wrong_and_few_lanes_are_in_doubt() {
        let mut rng = Rng::new(78);
        let (mut sure_hits, mut close, mut far_in_doubt, mut far) = (0, 0, 0, 0);
        for round in 0..300_000 {
            let sizes: [f32; 3] = core::array::from_fn(|_| 10f32.powi(rng.below(16) as i32 - 10));
            let away = [0.0, 1.0, 1e3][rng.below(3)] * sizes[2];
            let corners: [[f32; 3]; 3] = core::array::from_fn(|axis| {
                let offset = if axis == 2 { away } else { 0.0 };
                core::array::from_fn(|_| offset + coordinate(&mut rng, sizes[axis]))
            });
            let per_z = -rng.range(0.5, 2.0) * 10f32.powi(rng.below(7) as i32 - 3);
            let [x, y, z] = corners;
            let unbounded = ShearedRay {
                org: [0.0; 3],
                shear: [0.0, 0.0, per_z],
                tnear: f32::NEG_INFINITY,
                tfar: f32::INFINITY,
            };
            // The ray begins at the origin, so the sheared corners are these, but for the sign of the last axis.
            let seen = ShearedTriangle::new(&[x.map(|x| -x), y.map(|y| -y), z], &unbounded);
            let hit = seen.distance(&unbounded);
            let middle = hit.unwrap_or(rng.range(-1.0, 1.0) * sizes[2] * per_z);
            let end = match rng.below(6) {
                0 => middle,
                1 => middle.next_up(),
                2 => middle.next_down(),
                3 => middle * (1.0 + rng.range(-1e-5, 1e-5)),
                4 => middle * rng.range(-2.0, 2.0),
                _ => 0.0,
            };
            let (tnear, tfar) = if rng.below(2) == 0 {
                (end, f32::INFINITY)
            } else {
                (-1e30, end)
            };

            let one = |x: f32| One::splat(Scalar, x);
            let shear = Shear {
                org: [one(0.0); 3],
                shear: [one(0.0), one(0.0), one(per_z)],
            };
            let edges = Edges::new::<1>(
                &shear.of::<1>(&[x.map(|x| one(-x)), y.map(|y| one(-y)), z.map(one)]),
                one(per_z),
            );
            let ends = Ends {
                tnear: one(tnear),
                tfar: one(tfar),
            };
            let Verdict { sure, possible } = edges.judge::<1>(Scalar, &ends);
            let is_hit = seen
                .distance(&ShearedRay {
                    tnear,
                    tfar,
                    ..unbounded
                })
                .is_some();
            assert!(!sure.any() || is_hit, "round {round}: surely hit, missed");
            assert!(possible.any() || !is_hit, "round {round}: missed, hit");
            sure_hits += u32::from(sure.any());
            close += u32::from(possible.any() && !sure.any());

            // A thousandth of the largest distance away, neither a sliver nor near what underflows: decided.
            let farthest = z.iter().fold(0f32, |most, z| most.max((z * per_z).abs()));
            let edges = [edges.u, edges.v, edges.w].map(|edge| {
                let mut value = [0.0];
                edge.store(&mut value);
                value[0].abs()
            });
            let size = x.iter().fold(0f32, |most, x| most.max(x.abs()))
                * y.iter().fold(0f32, |most, y| most.max(y.abs()));
            let is_small = size < 1e-12 || size * farthest < 1e-12;
            let is_sliver = edges.iter().any(|edge| *edge < 1e-3 * size);
            if let Some(t) = hit
                && !is_small
                && !is_sliver
                && (t - end).abs() > 1e-3 * farthest
            {
                far += 1;
                far_in_doubt += u32::from(possible.any() && !sure.any());
            }
        }
        assert!(sure_hits > 10_000, "{sure_hits}");
        assert!(close > 1000, "{close}");
        assert!(far > 1000 && far_in_doubt == 0, "{far_in_doubt} of {far}");
    }
}
