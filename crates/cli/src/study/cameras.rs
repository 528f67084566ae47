//! Cameras of the command line, and the one that looks the other way.

use std::f64::consts::PI;

use antumbra_scene::{Camera, Scene};
use glam::{DMat3, DMat4, DVec3};

use crate::args::CameraChoice;
use crate::exit::Failure;
use crate::source;

/// A choice of the command line, made once for all scenes.
pub enum Chosen {
    /// Eye, target and up vector.
    LookAt([f64; 9]),
    /// Another scene's camera, with its field of view.
    Whole(Box<Camera>),
}

impl Chosen {
    /// Reads the scene that has the camera, if it is one of a scene.
    pub fn new(choice: &CameraChoice) -> Result<Self, Failure> {
        match choice {
            CameraChoice::LookAt(numbers) => {
                look_at(numbers)?;
                Ok(Self::LookAt(*numbers))
            }
            CameraChoice::OfScene(path) => {
                let loaded = source::load(path)?;
                Ok(Self::Whole(Box::new(loaded.scene.camera)))
            }
        }
    }

    /// The camera for a scene: its own put elsewhere, or another one.
    pub fn camera(&self, scene: &Scene) -> Result<Camera, Failure> {
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
                    ..own.clone()
                })
            }
        }
    }
}

/// Camera to world, as pbrt's `LookAt` has it: x to the right, y up, z into the picture, left-handed.
fn look_at(numbers: &[f64; 9]) -> Result<DMat4, Failure> {
    let [ex, ey, ez, tx, ty, tz, ux, uy, uz] = *numbers;
    let eye = DVec3::new(ex, ey, ez);
    let forward = (DVec3::new(tx, ty, tz) - eye).try_normalize();
    let matrix = forward.and_then(|forward| {
        let up = DVec3::new(ux, uy, uz).try_normalize()?;
        let right = up.cross(forward).try_normalize()?;
        let axes = DMat3::from_cols(right, forward.cross(right), forward);
        Some(DMat4::from_translation(eye) * DMat4::from_mat3(axes))
    });
    matrix.ok_or_else(|| {
        Failure::usage(format!(
            "a camera at {ex},{ey},{ez} cannot look at {tx},{ty},{tz} with {ux},{uy},{uz} upwards"
        ))
    })
}

/// The same eye, looking the other way.
pub fn turned(camera: &Camera) -> Camera {
    let turn = DMat4::from_rotation_y(PI);
    Camera {
        world_from_camera: (camera.world_from_camera.as_dmat4() * turn).as_mat4(),
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
        let chosen = Chosen::LookAt([0.0, -10.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 5.0]);
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
