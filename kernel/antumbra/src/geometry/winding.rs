//! How often a closed surface goes around a point.
//!
//! The winding number is the signed number of crossings of a half-line from the point along the x axis. Half-lines
//! through edges and corners are what makes such counts fragile. Here each side of a triangle is judged by itself, seen
//! along x, by a half-open rule on y and one sign that is computed from its lower end to its upper end, whichever
//! triangle it belongs to. Two triangles that share a side therefore judge it alike, rounded or not, and a half-line
//! crosses a closed surface next to an edge exactly once. (Rounding can only matter to points within some `2⁻⁵⁰` of the
//! size of a triangle from its surface.)

use crate::geometry::instance::{cross, dot};

/// Signed crossing of the half-line from `point` towards larger x with a triangle: 1 where it leaves through the front,
/// -1 where it enters, 0 without a crossing.
#[inline(always)]
pub(crate) fn crossing(corners: &[[f32; 3]; 3], point: [f64; 3]) -> i32 {
    let corners = corners.map(|corner| corner.map(f64::from));
    let [a, b, c] = corners;
    let turn = side(a, b, point) + side(b, c, point) + side(c, a, point);
    let [x, ..] = point;
    if turn == 0 || corners.iter().all(|corner| corner[0] < x) {
        return 0;
    }
    if corners.iter().all(|corner| corner[0] > x) {
        return turn;
    }
    let from_a = |to: [f64; 3]| core::array::from_fn(|axis| to[axis] - a[axis]);
    let height = dot(cross(from_a(b), from_a(c)), from_a(point));
    if f64::from(turn) * height < 0.0 {
        turn
    } else {
        0
    }
}

/// Signed crossing, in the plane of y and z, of the half-line from `point` towards larger z with a side.
#[inline(always)]
fn side(from: [f64; 3], to: [f64; 3], [_, y, z]: [f64; 3]) -> i32 {
    let rises = to[1] > y;
    if (from[1] > y) == rises {
        return 0;
    }
    let (low, high, sign) = if rises { (from, to, 1) } else { (to, from, -1) };
    let is_beyond = if low[2] > z && high[2] > z {
        true
    } else if low[2] <= z && high[2] <= z {
        false
    } else {
        (high[1] - low[1]) * (z - low[2]) < (high[2] - low[2]) * (y - low[1])
    };
    if is_beyond { -sign } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_testkit::{Rng, mesh};

    /// The corners of a sphere are as bad as points can be: all its half-lines run through edges and corners.
    #[test]
    fn half_lines_through_edges_and_corners_count_once() {
        let mut ball = mesh::icosphere(2);
        for index in 0..ball.indices.len() {
            // Counterclockwise from outside.
            let [a, b, c] = ball.triangle(index).map(|corner| corner.map(f64::from));
            let [ab, ac] = [b, c].map(|to| core::array::from_fn(|axis| to[axis] - a[axis]));
            if dot(cross(ab, ac), a) < 0.0 {
                ball.indices[index].reverse();
            }
        }
        let winding = |point: [f64; 3]| -> i32 {
            (0..ball.indices.len())
                .map(|index| crossing(&ball.triangle(index), point))
                .sum()
        };
        let mut rng = Rng::new(303);
        for position in &ball.positions {
            for share in [0.0, 0.25, 0.9, 0.98, 1.02, 1.5] {
                let point = position.map(|x| share * f64::from(x));
                assert_eq!(winding(point), i32::from(share < 1.0), "{point:?}");
            }
            // Level with a corner, so that the half-line runs through it.
            let [_, y, z] = position.map(f64::from);
            for x in [-0.5, 0.0, 0.5, -2.0, 2.0] {
                let point = [x, y, z];
                let length = dot(point, point).sqrt();
                if !(0.9..=1.01).contains(&length) {
                    assert_eq!(winding(point), i32::from(length < 1.0), "{point:?}");
                }
            }
        }
        for _ in 0..1000 {
            let point = rng.point(1.2).map(f64::from);
            let length = dot(point, point).sqrt();
            if !(0.9..=1.01).contains(&length) {
                assert_eq!(winding(point), i32::from(length < 1.0), "{point:?}");
            }
        }
    }
}
