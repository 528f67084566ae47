//! Cameras as a page moves them: eye, target and up vector.

use antumbra_scene::Camera;
use glam::{Mat3, Mat4, Vec3};
use serde::{Deserialize, Serialize};

/// A camera as eye, target and up vector, in the coordinates of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Look {
    /// Position of the camera.
    pub eye: [f32; 3],
    /// Point in the middle of the picture.
    pub at: [f32; 3],
    /// Direction that is up in the picture. Not parallel to the line of sight.
    pub up: [f32; 3],
    /// Angle of view over the shorter side of the picture, in degrees.
    pub fov: f32,
}

impl Look {
    /// A scene's camera, as if it looked at a point `distance` away.
    ///
    /// If the camera is upright by an axis of the scene, `up` is that axis.
    pub fn of(camera: &Camera, distance: f32) -> Self {
        let matrix = camera.world_from_camera;
        let eye = matrix.transform_point3(Vec3::ZERO);
        let forward = matrix.transform_vector3(Vec3::Z).normalize_or(Vec3::Z);
        let above = matrix.transform_vector3(Vec3::Y).normalize_or(Vec3::Y);
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        let axes = axes.into_iter().flat_map(|axis| [axis, -axis]);
        let upright = axes
            .max_by(|a, b| a.dot(above).total_cmp(&b.dot(above)))
            .filter(|axis| {
                let seen = axis.reject_from(forward).normalize_or_zero();
                // A roll of a twentieth of a degree.
                seen.cross(above).length() < 1e-3 && seen.dot(above) > 0.0
            });
        Self {
            eye: eye.into(),
            at: (eye + forward * distance).into(),
            up: upright.unwrap_or(above).into(),
            fov: camera.fov,
        }
    }

    /// Camera of a scene whose own is `own`: its lens, its screen window, and mirrored if that is. `None` if the vectors
    /// span no picture or are not finite.
    pub fn camera(&self, own: &Camera) -> Option<Camera> {
        let [eye, at, up] = [self.eye, self.at, self.up].map(Vec3::from);
        let forward = (at - eye).try_normalize()?;
        let right = up.try_normalize()?.cross(forward);
        let right = (right.length() > 1e-5).then(|| right.normalize())?;
        let axes = Mat3::from_cols(right, forward.cross(right), forward);
        let mut matrix = Mat4::from_translation(eye) * Mat4::from_mat3(axes);
        if is_mirrored(own) {
            matrix *= Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        }
        let good = matrix.is_finite() && self.fov > 0.1 && self.fov < 170.0;
        good.then(|| Camera {
            world_from_camera: matrix,
            end: None,
            fov: self.fov,
            ..own.clone()
        })
    }
}

/// Whether a camera makes mirror images, as in scenes with `Scale -1 1 1`.
pub fn is_mirrored(camera: &Camera) -> bool {
    camera.world_from_camera.determinant() < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: Mat4, b: Mat4) -> bool {
        a.abs_diff_eq(b, 1e-5)
    }

    #[test]
    fn a_camera_becomes_a_look_and_a_camera_again() {
        for mirror in [1.0, -1.0] {
            let look = Look {
                eye: [1.0, 2.0, -5.0],
                at: [0.0, 1.0, 0.0],
                up: [0.0, 1.0, 0.0],
                fov: 40.0,
            };
            let own = Camera {
                world_from_camera: Mat4::from_scale(Vec3::new(mirror, 1.0, 1.0)),
                ..Camera::default()
            };
            let camera = look.camera(&own).expect("a camera");
            assert_eq!(is_mirrored(&camera), mirror < 0.0);
            let distance = Vec3::from(look.eye).distance(look.at.into());
            let again = Look::of(&camera, distance);
            assert_eq!(again.up, look.up);
            let again = again.camera(&camera).expect("a camera");
            assert!(close(again.world_from_camera, camera.world_from_camera));
        }
    }

    #[test]
    fn a_rolled_camera_keeps_its_roll() {
        let matrix = Mat4::from_rotation_z(0.3);
        let camera = Camera {
            world_from_camera: matrix,
            ..Camera::default()
        };
        let again = Look::of(&camera, 3.0).camera(&camera).expect("a camera");
        assert!(close(again.world_from_camera, matrix));
    }

    #[test]
    fn vectors_that_span_no_picture_are_refused() {
        let good = Look {
            eye: [0.0; 3],
            at: [0.0, 0.0, 1.0],
            up: [0.0, 1.0, 0.0],
            fov: 40.0,
        };
        let own = Camera::default();
        assert!(good.camera(&own).is_some());
        for bad in [
            Look {
                at: good.eye,
                ..good
            },
            Look {
                up: good.at,
                ..good
            },
            Look {
                up: [0.0; 3],
                ..good
            },
            Look { fov: 180.0, ..good },
            Look {
                fov: f32::NAN,
                ..good
            },
            Look {
                eye: [f32::NAN, 0.0, 0.0],
                ..good
            },
            Look {
                at: [f32::INFINITY, 0.0, 0.0],
                ..good
            },
        ] {
            assert!(bad.camera(&own).is_none(), "{bad:?}");
        }
    }
}
