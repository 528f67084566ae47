//! The camera: where it stands and what it sees.

use glam::Mat4;
use serde::Serialize;

/// A perspective camera with an optional thin lens.
///
/// Camera space is pbrt's: x to the right, y up, z into the picture (left-handed). `world_from_camera`
/// may mirror (scenes written with `Scale -1 1 1` do).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Camera {
    /// Camera space to world space.
    pub world_from_camera: Mat4,
    /// Full angle over the *shorter* side of the screen window, in degrees, in (0, 180).
    pub fov: f32,
    /// `[x_min, x_max, y_min, y_max]` on the plane that `fov` scales to ±1 along the shorter side.
    /// `None`: ±1 along the shorter side of the picture, ±aspect along the longer.
    pub screen_window: Option<[f32; 4]>,
    /// Width over height for the default screen window; `None`: that of the film's full resolution.
    pub frame_aspect_ratio: Option<f32>,
    /// Radius of the lens in scene units; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus along z, in scene units. Used when the lens has a radius.
    pub focal_distance: f32,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            world_from_camera: Mat4::IDENTITY,
            fov: 90.0,
            screen_window: None,
            frame_aspect_ratio: None,
            lens_radius: 0.0,
            focal_distance: 1e6,
        }
    }
}
