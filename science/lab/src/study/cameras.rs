//! Cameras of a study other than the scene's own.

use std::f64::consts::PI;

use antumbra_scene::{Camera, Scene};
use glam::{DMat3, DMat4, DVec3, Mat4};

use crate::Error;

/// A camera chosen for all scenes of a study.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Viewpoint {
    /// Eye, target and up vector, as in pbrt's `LookAt`, with the field of view of each scene. See
    /// [`Viewpoint::look_at`].
    LookAt([f64; 9]),
    /// The camera of another scene, with its field of view.
    Whole(Box<Camera>),
}

impl Viewpoint {
    /// The viewpoint of eye, target and up vector.
    ///
    /// # Errors
    /// [`Error::LookAt`] if they span no camera.
    pub fn look_at(numbers: [f64; 9]) -> Result<Self, Error> {
        look_at(&numbers)?;
        Ok(Self::LookAt(numbers))
    }

    /// The camera for a scene: the scene's own put elsewhere, or the other one.
    ///
    /// # Errors
    /// [`Error::LookAt`].
    pub fn camera(&self, scene: &Scene) -> Result<Camera, Error> {
        match self {
            Self::Whole(camera) => Ok((**camera).clone()),
            Self::LookAt(numbers) => {
                let own = &scene.camera;
                let mut matrix = look_at(numbers)?;
                if own.world_from_camera.determinant() < 0.0 {
                    // Of a scene that mirrors its pictures.
                    matrix *= DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
                }
                Ok(Camera {
                    world_from_camera: matrix.as_mat4(),
                    end: None,
                    ..own.clone()
                })
            }
        }
    }
}

/// Camera to world, as pbrt's `LookAt` has it: x to the right, y up, z into the picture, left-handed.
fn look_at(numbers: &[f64; 9]) -> Result<DMat4, Error> {
    let [ex, ey, ez, tx, ty, tz, ux, uy, uz] = *numbers;
    let eye = DVec3::new(ex, ey, ez);
    let forward = (DVec3::new(tx, ty, tz) - eye).try_normalize();
    let matrix = forward.and_then(|forward| {
        let up = DVec3::new(ux, uy, uz).try_normalize()?;
        let right = up.cross(forward).try_normalize()?;
        let axes = DMat3::from_cols(right, forward.cross(right), forward);
        Some(DMat4::from_translation(eye) * DMat4::from_mat3(axes))
    });
    matrix.ok_or(Error::LookAt(*numbers))
}

/// A camera at the same place, looking the other way.
pub fn turned(camera: &Camera) -> Camera {
    let turn = |matrix: Mat4| (matrix.as_dmat4() * DMat4::from_rotation_y(PI)).as_mat4();
    Camera {
        world_from_camera: turn(camera.world_from_camera),
        end: camera.end.map(turn),
        ..camera.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::builtin;

    #[test]
    fn a_camera_looks_where_it_is_told() {
        let scene = builtin::by_name("city:1000").expect("a scene");
        let chosen = Viewpoint::LookAt([0.0, -10.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 5.0]);
        let camera = chosen.camera(&scene).expect("a camera");
        let to_world = |p: [f32; 3]| camera.world_from_camera.transform_point3(p.into());
        assert_eq!(to_world([0.0; 3]).to_array(), [0.0, -10.0, 2.0]);
        assert!((to_world([0.0, 0.0, 10.0]) - glam::vec3(0.0, 0.0, 2.0)).length() < 1e-5);
        assert!((to_world([0.0, 1.0, 0.0]) - glam::vec3(0.0, -10.0, 3.0)).length() < 1e-5);
        // Of a scene that mirrors its pictures, as this one does, x is to the right.
        assert!(scene.camera.world_from_camera.determinant() < 0.0);
        assert!((to_world([1.0, 0.0, 0.0]) - glam::vec3(1.0, -10.0, 2.0)).length() < 1e-5);
        let back = turned(&camera);
        let behind = back.world_from_camera.transform_point3(glam::Vec3::Z);
        assert!((behind - glam::vec3(0.0, -11.0, 2.0)).length() < 1e-5);
        for bad in [
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        ] {
            assert!(look_at(&bad).is_err(), "{bad:?}");
        }
    }
}
