//! Checkerboards: kind of the square or cube at a point, and share of the second kind in the footprint of a pixel.

use glam::{Vec2, Vec3};

use super::mapping::Coordinates;

/// Whether the sum of the whole parts is odd.
fn is_odd(whole: impl IntoIterator<Item = f32>) -> bool {
    let sum: i64 = whole.into_iter().map(|x| x.floor() as i64 & 1).sum();
    sum & 1 == 1
}

/// Whether a point of the plane lies in a square of the second kind.
pub fn square_is_second(st: Vec2) -> bool {
    is_odd(st.to_array())
}

/// Whether a point of space lies in a cube of the second kind.
pub fn cube_is_second(point: Vec3) -> bool {
    is_odd(point.to_array())
}

/// Share of the second kind in the box around a point that reaches the neighbouring samples on either side. One half
/// if they are more than a square away.
pub fn share_of_second(at: &Coordinates) -> f32 {
    let reach = at.steps[0].abs().max(at.steps[1].abs());
    let (low, high) = (at.st - reach, at.st + reach);
    if low.floor() == high.floor() {
        return f32::from(u8::from(square_is_second(at.st)));
    }
    if !(reach.max_element() <= 1.0) {
        return 0.5;
    }
    let s = odd_share(low.x, high.x);
    let t = odd_share(low.y, high.y);
    s + t - 2.0 * s * t
}

/// Share of an interval where the whole part is odd.
fn odd_share(low: f32, high: f32) -> f32 {
    // Integral from 0 of the indicator.
    let odd = |x: f32| {
        let pairs = (x / 2.0).floor();
        pairs + 2.0 * (x / 2.0 - pairs - 0.5).max(0.0)
    };
    if low < high {
        (odd(high) - odd(low)) / (high - low)
    } else {
        f32::from(u8::from(is_odd([low])))
    }
}
