//! Coordinates in double precision: maps, planets and building sites lie so far from their origin that neighbouring
//! points are equal in single precision. Moved to an origin of their own, they are distinct.

use alloc::borrow::Cow;
use alloc::vec::Vec;

use crate::geometry::Geometry;
use crate::ray::Ray;

/// Origin of a tree and its rays: a point of a world in double precision.
///
/// Everything that goes into one tree must be seen from the same origin. Points are subtracted in double precision
/// and then rounded once, so that a coordinate is off by at most 2⁻²⁴ of its distance from the origin.
///
/// ```
/// use antumbra::{Bvh, Geometry, LocalOrigin};
///
/// // A triangle of centimetres, 6371 kilometres away: single precision has steps of half a metre there.
/// let far = 6.371e6;
/// let positions = [[far, 0.0, 0.0], [far + 0.01, 0.0, 0.0], [far, 0.01, 0.0]];
/// let local = LocalOrigin::middle(&positions);
/// let bvh = Bvh::build(&[Geometry::triangles_f64(&positions, vec![[0, 1, 2]], &local)], &Default::default())?;
/// assert!(bvh.occluded(&local.between([far + 0.002, 0.002, -1.0], [far + 0.002, 0.002, 1.0])));
/// assert!(!bvh.occluded(&local.between([far + 0.008, 0.008, -1.0], [far + 0.008, 0.008, 1.0])));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalOrigin {
    /// World coordinates of the local origin.
    pub origin: [f64; 3],
}

impl LocalOrigin {
    /// The middle of the smallest box around the finite ones of these points, the best place for them; the world's
    /// own origin if there is none.
    pub fn middle(points: &[[f64; 3]]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in points.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
            for axis in 0..3 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        if low[0] > high[0] {
            return Self::default();
        }
        // Halved first: the sum of two large coordinates may overflow.
        Self {
            origin: core::array::from_fn(|axis| 0.5 * low[axis] + 0.5 * high[axis]),
        }
    }

    /// A point of the world seen from here. Coordinates that are too far away become infinite, NaN stays NaN. The kernel
    /// drops triangles of such points and counts them.
    #[inline]
    pub fn local(&self, point: [f64; 3]) -> [f32; 3] {
        core::array::from_fn(|axis| (point[axis] - self.origin[axis]) as f32)
    }

    /// World coordinates of `point`, which is relative to this origin: their sum in double precision. NaN stays NaN.
    pub fn world(&self, point: [f32; 3]) -> [f64; 3] {
        core::array::from_fn(|axis| f64::from(point[axis]) + self.origin[axis])
    }

    /// A ray over the interval (0, ∞) from a point of the world. Distances mean the same here and there. A ray with NaN or
    /// too far away to be a number hits nothing.
    #[inline]
    pub fn ray(&self, org: [f64; 3], dir: [f64; 3]) -> Ray {
        Ray::new(self.local(org), dir.map(|x| x as f32))
    }

    /// The segment strictly between two points of the world. Its direction is the difference of the two before they
    /// are rounded, so that short segments far from here keep theirs.
    #[inline]
    pub fn between(&self, from: [f64; 3], to: [f64; 3]) -> Ray {
        Ray {
            tfar: 1.0,
            ..self.ray(from, core::array::from_fn(|axis| to[axis] - from[axis]))
        }
    }
}

impl<'a> Geometry<'a> {
    /// A triangle mesh of points in double precision, seen from `local`. Hits and their ids are the same as for any
    /// mesh; the same origin must be used for the rays.
    pub fn triangles_f64(
        positions: &[[f64; 3]],
        indices: impl Into<Cow<'a, [[u32; 3]]>>,
        local: &LocalOrigin,
    ) -> Self {
        let positions: Vec<_> = positions.iter().map(|&point| local.local(point)).collect();
        Self::triangles(positions, indices)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_is_that_of_the_finite_points() {
        let points = [
            [1.0, -2.0, 1e300],
            [f64::NAN, 0.0, 0.0],
            [3.0, 4.0, 1e300],
            [0.0, f64::INFINITY, 0.0],
        ];
        assert_eq!(LocalOrigin::middle(&points).origin, [2.0, 1.0, 1e300]);
        for none in [&points[1..2], &[]] {
            assert_eq!(LocalOrigin::middle(none), LocalOrigin::default());
        }
        let huge = [[f64::MAX; 3], [f64::MAX; 3]];
        assert_eq!(LocalOrigin::middle(&huge).origin, [f64::MAX; 3]);
    }

    #[test]
    fn points_come_back_as_exactly_as_single_precision_allows() {
        let local = LocalOrigin {
            origin: [6.371e6, -1e7, 0.25],
        };
        for offset in [[0.0; 3], [1e-3, 2e-3, -7e-4], [1e3, 5.0, -2e4]] {
            let point: [f64; 3] = core::array::from_fn(|axis| local.origin[axis] + offset[axis]);
            let back = local.world(local.local(point));
            for axis in 0..3 {
                let bound = offset[axis].abs() * 2f64.powi(-24) + 4e-9;
                assert!(
                    (back[axis] - point[axis]).abs() <= bound,
                    "{back:?} {point:?}"
                );
            }
        }
        assert!(local.local([f64::NAN, 0.0, 0.0])[0].is_nan());
        assert_eq!(local.local([1e60, 0.0, 0.0])[0], f32::INFINITY);
    }
}
