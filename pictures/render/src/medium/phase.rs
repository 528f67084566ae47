//! Phase function of Henyey and Greenstein (1941).

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use crate::surface::Frame;

/// Density per solid angle of scattering by an angle of this cosine. It integrates to 1 over the sphere.
///
/// `asymmetry` is the mean cosine, in (-1, 1).
#[inline]
pub fn density(asymmetry: f32, cos: f32) -> f32 {
    let g = asymmetry;
    let base = (1.0 + g * g - 2.0 * g * cos).max(f32::MIN_POSITIVE);
    (1.0 - g * g) / (4.0 * PI * base * base.sqrt())
}

/// Unit direction after scattering of light that travels along `dir`, for `u` in `[0, 1)²`, drawn with [`density`].
pub fn sample(asymmetry: f32, dir: Vec3, [u, v]: [f32; 2]) -> Vec3 {
    let g = asymmetry;
    let cos = if g.abs() < 1e-3 {
        1.0 - 2.0 * u
    } else {
        let ratio = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
        ((1.0 + g * g - ratio * ratio) / (2.0 * g)).clamp(-1.0, 1.0)
    };
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (y, x) = (libm::sinf(TAU * v), libm::cosf(TAU * v));
    let local = Vec3::new(sin * x, sin * y, cos);
    Frame::around(dir).to_world(local).normalize()
}
