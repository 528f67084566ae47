//! Lights without a surface. Emitting surfaces are [`crate::AreaLight`] on a shape.

use crate::Rgb;
use glam::Vec3;

/// A light that is not a surface of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Emits the same intensity in every direction from one point.
    Point {
        /// World position.
        position: Vec3,
        /// Radiant intensity.
        intensity: Rgb,
    },
    /// A point light limited to a cone, with a smooth edge.
    Spot {
        /// World position.
        position: Vec3,
        /// Unit axis of the cone in world space.
        axis: Vec3,
        /// Radiant intensity on the axis.
        intensity: Rgb,
        /// Cosine of the angle at which the cone ends.
        cos_total_width: f32,
        /// Cosine of the angle at which the falloff begins; at least `cos_total_width`.
        cos_falloff_start: f32,
    },
    /// Parallel light from infinitely far away.
    Distant {
        /// Unit direction *towards* the light in world space.
        to_light: Vec3,
        /// Radiance: irradiance on a surface that faces the light.
        radiance: Rgb,
    },
    /// The same radiance from every direction that leaves the scene.
    Infinite {
        /// Radiance.
        radiance: Rgb,
        /// Samples per shaded point where an integrator asks every light; 0 counts as 1.
        samples: u32,
    },
}
