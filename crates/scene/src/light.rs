//! Lights without a surface. Emitting surfaces are [`crate::AreaLight`] on a shape.

use std::sync::Arc;

use glam::{Mat3, Mat4, Vec3};
use serde::Serialize;

use crate::{Image, Rgb};

/// A light that is not a surface of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    /// A point light whose intensity differs by direction.
    Goniometric {
        /// Light space to world space: the light sits at the origin of its space.
        world_from_light: Mat4,
        /// Scale of the radiant intensity.
        intensity: Rgb,
        /// Intensity by direction, as in [`Environment::image`] but with y up: pbrt-v3 swaps y and z here. The
        /// same in every direction without it.
        image: Option<Arc<Image>>,
    },
    /// A point light that throws an image, like a slide projector.
    Projection {
        /// Light space to world space: it looks along z from the origin of its space.
        world_from_light: Mat4,
        /// Scale of the radiant intensity.
        intensity: Rgb,
        /// Full angle of view over the shorter side of the image, in degrees.
        fov: f32,
        /// What it throws; white in a square without it.
        image: Option<Arc<Image>>,
    },
    /// Radiance from every direction that leaves the scene: the same everywhere, or by an image.
    Infinite {
        /// Radiance, or scale of the image's.
        radiance: Rgb,
        /// Radiance by direction; the same everywhere without it.
        environment: Option<Environment>,
        /// Samples per shaded point where an integrator asks every light; 0 counts as 1.
        samples: u32,
    },
}

/// Radiance by direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Environment {
    /// Longitude and latitude: column 0 is azimuth 0 from the x axis of light space towards y, row 0 the
    /// direction of its z axis.
    pub image: Arc<Image>,
    /// Light space to world space, a rotation, perhaps mirrored.
    pub world_from_light: Mat3,
}
