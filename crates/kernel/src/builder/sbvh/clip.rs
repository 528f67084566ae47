//! Parts of primitives between two planes, and boxes around them.
//!
//! # Why no part of a triangle is lost
//!
//! [`crate::geometry::ray_setup`] shows that a triangle that is hit has a point `P` which the ray passes within `8 u R`,
//! and that node boxes are tested wider than that. A split triangle stands in several leaves, and the boxes of these
//! hold it all: what lies between two planes is found in double precision, rounded outwards, and put into a
//! box that is wider by [`SLACK`] of the triangle's size, but never wider than what the leaf had before the split. So one
//! of the leaves has a box around `P`, the ray enters it and all above it where it passes `P`, and the triangle is tested.
//! A test is of the whole triangle, wherever it is made, and gives the same answer.
//!
//! One question is left: *where* the ray is when the triangle is hit. For an unsplit triangle the distance is clamped into the interval
//! of its box, and nothing above it is entered later. For a split one, distance and entry are compared across
//! rounding: the distance is off by about `u R` over the sine of the angle between ray and triangle, the box
//! is wider by [`SLACK`] of the size. Which of two surfaces is nearer, or whether one lies before the end of a ray, could
//! therefore come out otherwise than without splits only where a ray meets a triangle edge-on to about a
//! ten-thousandth of its size and in the same small part of it both another surface and the plane of a split.
//! Two kinds of triangles have shown it, and [`crate::builder::sbvh`] splits neither: those of scenes so tiny that distances underflow,
//! and slivers, whose corners lie on a line but for rounding ([`is_sliver`]), for they are met edge-on by every ray.

use crate::aabb::Aabb;
use crate::geometry::instance::{cross, dot};

/// Triangles less high than this share of the largest coordinate of the scene are slivers: `2¹⁰ u`. Where the ray is in a
/// triangle is off by up to `16 u R` over its height, as a share of its size.
const SLIVER: f64 = 1.0 / (1 << 14) as f64;

/// Boxes of parts are wider by this share of the primitive's size.
const SLACK: f64 = 1.0 / 1024.0;

/// The box around the part of a triangle between two coordinates on an axis, as far as it is in `bounds`, which is around
/// some part of it already. Empty if there is nothing.
pub(crate) fn triangle_between(
    corners: &[[f32; 3]; 3],
    bounds: &Aabb,
    axis: usize,
    [low, high]: [f32; 2],
) -> Aabb {
    let corners = corners.map(|corner| corner.map(f64::from));
    let (low, high) = (f64::from(low), f64::from(high));
    let mut part = Around::EMPTY;
    let mut whole = Around::EMPTY;
    for (index, from) in corners.iter().enumerate() {
        let to = &corners[(index + 1) % 3];
        whole.add(from);
        if (low..=high).contains(&from[axis]) {
            part.add(from);
        }
        for plane in [low, high] {
            let (before, after) = (plane - from[axis], plane - to[axis]);
            // One end on either side.
            if before * after < 0.0 {
                let share = before / (before - after);
                let mut crossing = [0.0; 3];
                for other in 0..3 {
                    crossing[other] = from[other] + share * (to[other] - from[other]);
                }
                crossing[axis] = plane;
                part.add(&crossing);
            }
        }
    }
    if part.min[axis] > part.max[axis] {
        return Aabb::EMPTY;
    }
    let size = (0..3).fold(0.0, |size, axis| {
        f64::max(size, whole.max[axis] - whole.min[axis])
    });
    within(&part.widened(size * SLACK), bounds)
}

/// Whether a triangle is so thin that where a ray is when it meets it is not to be relied on; also when that cannot be
/// worked out. `extent` is the scene extent.
pub(crate) fn is_sliver([a, b, c]: &[[f32; 3]; 3], extent: f32) -> bool {
    let vector = |from: &[f32; 3], to: &[f32; 3]| -> [f64; 3] {
        core::array::from_fn(|axis| f64::from(to[axis]) - f64::from(from[axis]))
    };
    let length = |vector: [f64; 3]| dot(vector, vector).sqrt();
    let twice_area = length(cross(vector(a, b), vector(a, c)));
    let longest = [vector(a, b), vector(b, c), vector(c, a)].map(length);
    let longest = longest.into_iter().fold(0.0, f64::max);
    !(twice_area > SLIVER * f64::from(extent) * longest)
}

/// The box around the part between two coordinates of anything that is only known by its box.
pub(crate) fn box_between(bounds: &Aabb, axis: usize, [low, high]: [f32; 2]) -> Aabb {
    let mut part = *bounds;
    part.min[axis] = part.min[axis].max(low);
    part.max[axis] = part.max[axis].min(high);
    if part.is_empty() { Aabb::EMPTY } else { part }
}

/// The common part of two boxes.
pub(crate) fn within(a: &Aabb, b: &Aabb) -> Aabb {
    let mut both = *a;
    for axis in 0..3 {
        both.min[axis] = a.min[axis].max(b.min[axis]);
        both.max[axis] = a.max[axis].min(b.max[axis]);
    }
    if both.is_empty() { Aabb::EMPTY } else { both }
}

/// A box around points, in double precision.
struct Around {
    min: [f64; 3],
    max: [f64; 3],
}

impl Around {
    const EMPTY: Self = Self {
        min: [f64::INFINITY; 3],
        max: [f64::NEG_INFINITY; 3],
    };

    fn add(&mut self, point: &[f64; 3]) {
        for (axis, x) in point.iter().enumerate() {
            self.min[axis] = self.min[axis].min(*x);
            self.max[axis] = self.max[axis].max(*x);
        }
    }

    /// Wider on all sides by so much and by what rounding takes away.
    fn widened(&self, by: f64) -> Aabb {
        Aabb {
            min: self.min.map(|x| ((x - by) as f32).next_down()),
            max: self.max.map(|x| ((x + by) as f32).next_up()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_testkit::Rng;

    /// Slabs one after the other: every point of the triangle is in the part of its slab, whatever was cut off
    /// before, and the parts are hardly larger than need be.
    #[test]
    fn parts_hold_every_point_and_little_else() {
        let seed = 91;
        let mut rng = Rng::new(seed);
        for round in 0..2000 {
            let size = 10f32.powi(rng.below(9) as i32 - 4);
            let offset = rng.point(3.0);
            let corners: [[f32; 3]; 3] = core::array::from_fn(|_| {
                let point = rng.point(size);
                core::array::from_fn(|axis| point[axis] + offset[axis])
            });
            let whole = Aabb::around(&corners);
            let mut bounds = whole;
            let mut region = whole;
            for _ in 0..3 {
                let axis = rng.below(3);
                let plane = region.min[axis] + rng.unit() * (region.max[axis] - region.min[axis]);
                let slab = if rng.below(2) == 0 {
                    [f32::NEG_INFINITY, plane]
                } else {
                    [plane, f32::INFINITY]
                };
                bounds = triangle_between(&corners, &bounds, axis, slab);
                region = box_between(&region, axis, slab);
            }
            let mut exact = Around::EMPTY;
            for _ in 0..300 {
                let (mut u, mut v) = (f64::from(rng.unit()), f64::from(rng.unit()));
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let [a, b, c] = corners.map(|corner| corner.map(f64::from));
                let point: [f64; 3] = core::array::from_fn(|axis| {
                    a[axis] + u * (b[axis] - a[axis]) + v * (c[axis] - a[axis])
                });
                let inside = |bounds: &Aabb| {
                    (0..3).all(|axis| {
                        f64::from(bounds.min[axis]) <= point[axis]
                            && point[axis] <= f64::from(bounds.max[axis])
                    })
                };
                if inside(&region) {
                    assert!(
                        inside(&bounds),
                        "seed {seed} round {round}: {point:?} {bounds:?}"
                    );
                    exact.add(&point);
                }
            }
            assert!(whole.contains(&bounds));
            if exact.min[0] <= exact.max[0] {
                for axis in 0..3 {
                    let slack = 0.003 * f64::from(size) * 2.0 + 1e-5;
                    let beyond = f64::from(region.min[axis]) - f64::from(bounds.min[axis]);
                    assert!(beyond <= slack, "seed {seed} round {round}: {beyond}");
                }
            }
        }
    }

    /// Triangles that are thin in themselves, thin where coordinates are large, without any height, and doubtful ones.
    #[test]
    fn slivers_are_told() {
        let high = |height: f32| [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.5, 0.5, height]];
        for (height, reach, expected) in [
            (1e-2, 1.0, false),
            (1e-3, 1.0, false),
            (1e-5, 1.0, true),
            (1e-2, 1e3, true),
            (0.0, 1.0, true),
            (f32::NAN, 1.0, true),
        ] {
            let found = is_sliver(&high(height), reach);
            assert_eq!(found, expected, "{height} within {reach}");
        }
    }

    /// A diagonal needle: the parts are short on all axes.
    #[test]
    fn parts_are_short_on_every_axis() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0, 0.001, 0.0]];
        let part = triangle_between(&corners, &Aabb::around(&corners), 0, [0.25, 0.5]);
        for axis in 0..3 {
            assert!(part.min[axis] > 0.24 && part.max[axis] < 0.51, "{part:?}");
        }
        assert!(triangle_between(&corners, &part, 0, [2.0, 3.0]).is_empty());
    }
}
