//! Origin offset: how far rays start from their surface, so that rounding does not let them meet it again.

use antumbra::Ray;
use glam::Vec3;

/// Fraction of a segment that a shadow ray covers, as in pbrt-v3.
const SEGMENT_SHARE: f32 = 1.0 - 0.0001;

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

/// `point` moved out of its error box along the normal, to the side of `dir` (Pharr, Jakob and Humphreys 2016,
/// section 3.9.5).
///
/// The distance is `origin_offset`, but at most [`MAX_ERRORS`] rounding errors. A normal of zero leaves the point in
/// place.
#[inline]
pub fn offset(point: Vec3, error: Vec3, normal: Vec3, dir: Vec3, origin_offset: f32) -> Vec3 {
    let least = normal.abs().dot(error);
    // The error on another axis may be the largest: a floor at height 0 has none of its own.
    let most = MAX_ERRORS * error.max_element();
    let distance = origin_offset.min(most).max(least);
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
