//! A mesh on its own as a scene: matte grey, lit by sun and sky, seen from the upper front right.

use std::sync::Arc;

use antumbra_scene::{
    Camera, Film, Geometry, Integrator, Light, Material, Rgb, Sampler, SamplerKind, Scene, Shape,
    TriangleMesh,
};
use glam::{Mat4, Vec3};

/// Direction from the middle of the mesh to the camera; y is up, as in most meshes.
const TO_CAMERA: Vec3 = Vec3::new(0.55, 0.42, 1.0);
const TO_SUN: Vec3 = Vec3::new(0.75, 1.0, 0.45);
/// Full angle of view over the shorter side, in degrees.
const FOV: f32 = 35.0;

/// A scene that shows a grey mesh as large as fits the picture, under sun and sky.
///
/// Vertices that are not finite are ignored. A mesh without finite vertices is framed like a cube of size 1 around
/// the origin.
pub fn scene_of_mesh(name: String, mesh: TriangleMesh) -> Scene {
    let shape = Shape {
        geometry: Geometry::Mesh(Arc::new(mesh)),
        material: 0,
        area_light: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    };
    let grey = Material::Matte {
        kd: Rgb::splat(0.6).into(),
        sigma: 0.0.into(),
    };
    scene_of_shapes(name, vec![shape], vec![grey])
}

/// A scene that shows shapes with materials of their own, framed and lit as by [`scene_of_mesh`].
pub fn scene_of_shapes(name: String, shapes: Vec<Shape>, materials: Vec<Material>) -> Scene {
    let camera = camera(&shapes);
    Scene {
        name,
        shapes,
        objects: Vec::new(),
        instances: Vec::new(),
        materials,
        lights: vec![
            Light::Distant {
                to_light: TO_SUN.normalize(),
                radiance: Rgb::new(2.4, 2.2, 1.9),
            },
            Light::Infinite {
                radiance: Rgb::new(0.42, 0.48, 0.56),
                environment: None,
                samples: 1,
            },
        ],
        camera,
        film: Film::default(),
        sampler: Sampler {
            kind: SamplerKind::ZeroTwoSequence,
            pixel_samples: 16,
        },
        integrator: Integrator::default(),
        accelerator: Default::default(),
    }
}

/// A camera that has the sphere around the bounding box just inside its view.
fn camera(shapes: &[Shape]) -> Camera {
    let (low, high) = bounds(shapes);
    // Halved first: the sum of two large coordinates may overflow.
    let center = 0.5 * low + 0.5 * high;
    let radius = (0.5 * high - 0.5 * low).length();
    let radius = if radius > 0.0 && radius.is_finite() {
        radius
    } else {
        1.0
    };
    let distance = radius / (0.5 * FOV).to_radians().sin();
    let forward = -TO_CAMERA.normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let eye = center - distance * forward;
    Camera {
        world_from_camera: Mat4::from_cols(
            right.extend(0.0),
            up.extend(0.0),
            forward.extend(0.0),
            eye.extend(1.0),
        ),
        fov: FOV,
        ..Camera::default()
    }
}

fn bounds(shapes: &[Shape]) -> (Vec3, Vec3) {
    let mut bounds: Option<(Vec3, Vec3)> = None;
    for shape in shapes {
        if let Geometry::Mesh(mesh) = &shape.geometry {
            for point in mesh.positions.iter().map(|&point| Vec3::from(point)) {
                if point.is_finite() {
                    let (low, high) = bounds.unwrap_or((point, point));
                    bounds = Some((low.min(point), high.max(point)));
                }
            }
        }
    }
    bounds.unwrap_or((Vec3::splat(-0.5), Vec3::splat(0.5)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: Vec<[f32; 3]>) -> TriangleMesh {
        TriangleMesh {
            positions,
            ..Default::default()
        }
    }

    #[test]
    fn every_vertex_is_in_view() {
        for scale in [1e-3, 1.0, 1e6] {
            let corner = |i: u32| {
                std::array::from_fn(|axis| {
                    scale * (((i >> axis) & 1) as f32 * (1 + axis) as f32 + 7.0)
                })
            };
            let mut positions: Vec<_> = (0..8).map(corner).collect();
            positions.push([f32::NAN, 0.0, f32::INFINITY]);
            let scene = scene_of_mesh("box".into(), mesh(positions.clone()));
            let camera_from_world = scene.camera.world_from_camera.inverse();
            let slope = (0.5 * FOV).to_radians().tan();
            for point in &positions[..8] {
                let seen = camera_from_world.transform_point3(Vec3::from(*point));
                assert!(seen.z > 0.0);
                assert!(seen.x.abs() < seen.z * slope * 1.001, "{seen}");
                assert!(seen.y.abs() < seen.z * slope * 1.001, "{seen}");
            }
        }
    }

    #[test]
    fn meshes_without_size_have_a_camera_too() {
        for positions in [vec![], vec![[1.0; 3]], vec![[f32::NAN; 3]]] {
            let camera = scene_of_mesh("none".into(), mesh(positions)).camera;
            assert!(camera.world_from_camera.is_finite());
        }
    }
}
