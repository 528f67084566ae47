//! Luminance of colours, which weighs lights and judges samples.

use glam::Vec3;

/// Relative luminance of linear RGB (Rec. 709 primaries).
#[inline]
pub fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.212_671, 0.715_160, 0.072_169))
}
