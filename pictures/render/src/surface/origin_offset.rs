//! Origin offset: how far rays start from their surface, so that rounding does not let them hit it again.
//!
//! # Closed bodies
//!
//! A ray that begins inside a closed body must not begin outside of it. Let `e` be the largest rounding error of a
//! coordinate of the hit. Rays begin at least `8 e` from the edges of their triangle, measured along it, and a quarter
//! of the distance to the nearest edge above it, or less. The least offset, `normal.abs().dot(error)`, is no more than
//! `1.74 e`. Behind an edge at distance `d`, where the surface turns by an inner angle `a` of 30 degrees or more, the
//! next face is at least `d sin a - d/4 cos a` away, which is `2.2 e`. The rounding of the point itself takes `1.74 e` at
//! most. So the origin stays inside.
//!
//! Opposite faces without a common edge are as far away as the ray's own origin was, or farther if the body is convex:
//! the offset is at most half of the height of that origin.
//!
//! Nothing is promised for inner angles below 30 degrees, bodies thinner than the least offset, and faces that cross a
//! triangle instead of sharing its edges. Triangles narrower than some `16 e` have no room: their rays begin as far from
//! the edges as a move by 1/64 of the way to the incentre brings them.

use antumbra::Ray;
use glam::Vec3;

use crate::columns::select;

/// Fraction of a segment that a shadow ray covers, as in pbrt-v3.
pub const SEGMENT_SHARE: f32 = 1.0 - 0.0001;

/// Ray from a point to just before another.
#[inline]
pub fn segment(org: Vec3, target: Vec3) -> Ray {
    Ray {
        org: org.to_array(),
        dir: (target - org).to_array(),
        tnear: 0.0,
        tfar: SEGMENT_SHARE,
    }
}

/// Largest origin offset, in rounding errors of the point. Objects near the origin of a scene with a huge ground keep
/// their contact shadows.
pub const MAX_ERRORS: f32 = 64.0;

/// Distance from the edges of its triangle at which a ray begins, in rounding errors of its point.
pub const EDGE_ERRORS: f32 = 8.0;

/// Largest origin offset as a share of the distance to the nearest edge.
const EDGE_SHARE: f32 = 0.25;

/// Largest origin offset as a share of the height from which the surface was seen.
const HEIGHT_SHARE: f32 = 0.5;

/// Room around a point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// Distance along the surface to the nearest edge of the triangle. Infinite without edges.
    pub edge: f32,
    /// Height above the surface of a point from which it was seen. Infinite if there is none.
    pub height: f32,
}

impl Room {
    /// No limits.
    pub const OPEN: Self = Self {
        edge: f32::INFINITY,
        height: f32::INFINITY,
    };
}

/// Distance along `normal` by which a point leaves its error box (Pharr, Jakob and Humphreys 2016, section 3.9.5).
///
/// `origin_offset`, but no more than [`MAX_ERRORS`] rounding errors and than the `room` allows.
#[inline]
pub fn offset_distance(error: Vec3, normal: Vec3, origin_offset: f32, room: Room) -> f32 {
    let least = normal.abs().dot(error);
    // The error on another axis may be the largest: a floor at height 0 has none of its own.
    let most = MAX_ERRORS * error.max_element();
    let most = most.min(EDGE_SHARE * room.edge);
    let most = most.min(HEIGHT_SHARE * room.height);
    origin_offset.min(most).max(least)
}

/// `point` moved by a distance along the normal, to the side of `dir`. A normal of zero leaves the point in place.
#[inline]
pub fn offset(point: Vec3, normal: Vec3, distance: f32, dir: Vec3) -> Vec3 {
    let step = if dir.dot(normal) < 0.0 {
        normal * -distance
    } else {
        normal * distance
    };
    let moved = point + step;
    Vec3::new(
        away(moved.x, step.x),
        away(moved.y, step.y),
        away(moved.z, step.z),
    )
}

/// Start of a ray along `dir` from a point of a surface with this normal, seen from `wo`, without a branch: `near` on the
/// side of `wo`, and on the other side `start` moved by a distance.
#[inline(always)]
pub fn leave([start, near]: [Vec3; 2], [normal, wo]: [Vec3; 2], distance: f32, dir: Vec3) -> Vec3 {
    let far = offset(start, normal, distance, dir);
    let same = (dir.dot(normal) < 0.0) == (wo.dot(normal) < 0.0);
    select(same, near, far)
}

/// Next number after `value` in the direction of `step`: [`f32::next_up`] or [`f32::next_down`], without a branch
/// that nobody can predict.
#[inline]
fn away(value: f32, step: f32) -> f32 {
    let bits = value.to_bits() as i32;
    // Sign and magnitude become a rank. Ranks of neighbours differ by one.
    let rank = if bits < 0 {
        i32::MIN.wrapping_sub(bits)
    } else {
        bits
    };
    let next = rank + i32::from(step > 0.0) - i32::from(step < 0.0);
    let bits = if next < 0 {
        i32::MIN.wrapping_sub(next)
    } else {
        next
    };
    // Infinities and NaN have no neighbour. A value that stays keeps the sign of its zero.
    if value.is_finite() && step != 0.0 {
        f32::from_bits(bits as u32)
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_those_of_the_standard_library() {
        let small = f32::from_bits(1);
        for value in [0.0, small, 2.0 * small, 1.0, 1.5, 3e38, f32::MAX] {
            for value in [value, -value] {
                let bits = |value: f32| value.to_bits();
                assert_eq!(bits(away(value, 0.0)), bits(value));
                assert_eq!(away(value, 2.0), value.next_up());
                assert_eq!(away(value, -small), value.next_down());
            }
        }
        for step in [1.0, -1.0, 0.0] {
            assert_eq!(away(f32::INFINITY, step), f32::INFINITY);
            assert!(away(f32::NAN, step).is_nan());
        }
    }
}
