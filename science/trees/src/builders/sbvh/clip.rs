//! Parts of primitives between two planes, and boxes around them.
//!
//! # Why no part of a triangle is lost
//!
//! The kernel's `geometry/ray_setup.rs` shows that a triangle that is hit has a point `P` within `11 u R` of where the ray is
//! at the distance of the hit, and that every widened box with `P` in it is entered at that distance or before, and
//! left there or later. A split triangle is in several leaves, and the boxes of these hold it all: what lies between
//! two planes is found in double precision, rounded outwards, and put into a box that is never larger than what the
//! leaf had before the split. So one of the leaves has a box with `P` in it, and that leaf is visited as the leaf of a
//! whole triangle would be. A test is of the whole triangle, wherever it is made, and gives the same answer.

use antumbra::Aabb;

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
    for (index, from) in corners.iter().enumerate() {
        let to = &corners[(index + 1) % 3];
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
    within(&part.rounded(), bounds)
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

    /// Rounded outwards.
    fn rounded(&self) -> Aabb {
        Aabb {
            min: self.min.map(|x| (x as f32).next_down()),
            max: self.max.map(|x| (x as f32).next_up()),
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
            let corners: [[f32; 3]; 3] = std::array::from_fn(|_| {
                let point = rng.point(size);
                std::array::from_fn(|axis| point[axis] + offset[axis])
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
                let point: [f64; 3] = std::array::from_fn(|axis| {
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
                    let slack = 0.002 * f64::from(size) + 1e-5;
                    let beyond = f64::from(region.min[axis]) - f64::from(bounds.min[axis]);
                    assert!(beyond <= slack, "seed {seed} round {round}: {beyond}");
                }
            }
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
