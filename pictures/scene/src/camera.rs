//! Camera: position, projection, field of view and lens.

use std::sync::Arc;

use glam::Mat4;
use serde::Serialize;

/// Camera, perspective by default, with an optional thin lens.
///
/// Camera space is left-handed as in pbrt: x to the right, y up, z into the picture. `world_from_camera` may
/// contain a reflection, as in scenes with `Scale -1 1 1`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Camera {
    /// Camera space to world space.
    pub world_from_camera: Mat4,
    /// Camera space to world space at time 1, if the camera moves. `world_from_camera` is then its place at time 0. Between,
    /// the camera moves as an [`Instance`](crate::Instance) does.
    pub end: Option<Mat4>,
    /// Times at which the shutter opens and closes. Times before 0 count as 0, and times after 1 as 1.
    pub shutter: [f32; 2],
    /// How directions become points of the picture.
    pub projection: Projection,
    /// Full angle of view over the *shorter* side of the screen window, in degrees, in (0, 180). Of perspective only.
    pub fov: f32,
    /// Screen window `[x_min, x_max, y_min, y_max]` on the plane that `fov` scales to ±1 along the shorter side, or in units of
    /// camera space if the projection is orthographic.
    ///
    /// `None` means ±1 along the shorter side of the picture and ±aspect along the longer.
    pub screen_window: Option<[f32; 4]>,
    /// Width over height of the default screen window; `None` takes both from the film's full resolution.
    pub frame_aspect_ratio: Option<f32>,
    /// Radius of the lens in scene units; 0 means a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus along z, in scene units. Ignored for a pinhole.
    pub focal_distance: f32,
    /// Lenses of [`Projection::Realistic`], whose size is in the metres of camera space. `None` for other cameras.
    pub lenses: Option<Arc<LensSystem>>,
    /// Index into [`Scene::media`](crate::Scene::media) of the medium around the camera. `None` is vacuum.
    pub medium: Option<u32>,
}

/// How directions become points of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum Projection {
    /// From one point through a plane.
    #[default]
    Perspective,
    /// Along z, from the plane of the camera.
    Orthographic,
    /// All directions by longitude, along x, and latitude. The upper edge is y, the left edge x, and the second quarter z.
    Spherical,
    /// All directions on an octahedron of equal areas, whose middle is y.
    EqualArea,
    /// Through the lenses of the camera onto a film. Field of view, screen window and thin lens count for nothing.
    Realistic,
}

impl Projection {
    /// Whether the picture shows all directions around the camera. Lens and screen window count for nothing then.
    pub fn is_all_around(self) -> bool {
        matches!(self, Self::Spherical | Self::EqualArea)
    }
}

/// System of spherical lenses in front of a film.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LensSystem {
    /// Surfaces from the scene to the film. The distance of the last from the film is adjusted to focus.
    pub elements: Vec<LensElement>,
    /// Distance of the film from what is in focus, in metres.
    pub focus_distance: f32,
    /// Diagonal of the film in millimetres.
    pub film_diagonal: f32,
    /// Time of exposure, as which light is added up. `None` weights light relative to the middle of the film.
    pub exposure: Option<f32>,
}

/// Surface of a [`LensSystem`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LensElement {
    /// Radius of curvature in millimetres, positive if the surface bulges towards the scene. 0 is the aperture stop.
    pub radius: f32,
    /// Distance from the next surface towards the film, in millimetres.
    pub thickness: f32,
    /// Index of refraction behind the surface. 0 counts as 1.
    pub eta: f32,
    /// Diameter of the opening in millimetres.
    pub diameter: f32,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            world_from_camera: Mat4::IDENTITY,
            end: None,
            shutter: [0.0, 1.0],
            projection: Projection::Perspective,
            fov: 90.0,
            screen_window: None,
            frame_aspect_ratio: None,
            lens_radius: 0.0,
            focal_distance: 1e6,
            lenses: None,
            medium: None,
        }
    }
}
