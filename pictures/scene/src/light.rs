//! Lights without a surface. Emitting surfaces are shapes with an [`AreaLight`](crate::AreaLight).

use std::sync::Arc;

use glam::{Mat3, Mat4, Vec3};
use serde::Serialize;

use crate::{Image, Rgb};

/// Light that is not a surface of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Light {
    /// Point light with equal intensity in every direction.
    Point {
        /// Position in world space.
        position: Vec3,
        /// Radiant intensity, equal in every direction.
        intensity: Rgb,
    },
    /// Point light limited to a cone with a smooth edge.
    Spot {
        /// Position in world space.
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
    /// Parallel light from an infinite distance.
    Distant {
        /// Unit direction *towards* the light in world space.
        to_light: Vec3,
        /// Irradiance on a surface that faces the light; called radiance in pbrt.
        radiance: Rgb,
    },
    /// Point light whose intensity depends on the direction.
    Goniometric {
        /// Light space to world space. The light is at the origin of light space.
        world_from_light: Mat4,
        /// Scale of the radiant intensity.
        intensity: Rgb,
        /// Intensity by direction, by longitude and latitude, but with y up: pbrt-v3 swaps y and z here.
        ///
        /// `None` means equal intensity in every direction.
        image: Option<Arc<Image>>,
    },
    /// Point light that projects an image, like a slide projector.
    Projection {
        /// Light space to world space. The light is at the origin and looks along z.
        world_from_light: Mat4,
        /// Scale of the radiant intensity.
        intensity: Rgb,
        /// Full angle of view over the shorter side of the image, in degrees.
        fov: f32,
        /// Projected image; `None` projects a white square.
        image: Option<Arc<Image>>,
    },
    /// Environment light: radiance for rays that leave the scene, constant or from an image.
    Infinite {
        /// Radiance, or factor of the image's radiance.
        radiance: Rgb,
        /// Radiance by direction; `None` means equal radiance from every direction.
        environment: Option<Environment>,
        /// Samples per shaded point, for integrators that sample every light; 0 counts as 1.
        samples: u32,
    },
}

/// Radiance by direction, as an image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Environment {
    /// Radiance by direction, in the layout of `mapping`.
    pub image: Arc<Image>,
    /// How directions are laid out in the image.
    pub mapping: EnvironmentMapping,
    /// Light space to world space: a rotation, perhaps with a reflection.
    pub world_from_light: Mat3,
}

/// Layout of the directions of a sphere in an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum EnvironmentMapping {
    /// Longitude and latitude. Columns begin at the x axis of light space and turn towards y. Row 0 is the direction of the
    /// z axis. Texels are interpolated.
    LongitudeLatitude,
    /// Octahedron of equal areas (Clarberg 2008): the middle of the square is the z axis of light space, its corners are the
    /// opposite direction, columns go along x and rows along y. A texel has one colour.
    EqualArea,
}
