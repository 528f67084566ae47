//! City: blocks of towers, houses and parks between streets, seen from the air on a clear day.
//!
//! Blocks are generated from the centre outwards until there are enough triangles. A larger city therefore
//! contains every smaller one. All values come from integer hashes and from arithmetic that rounds equally on every
//! machine, without transcendental functions. z is up, and the unit is the metre.
//!
//! - `random`: hashed random numbers, and smooth noise over the plan of the city
//! - `brush`: boxes, prisms and blobs added to one mesh per material
//! - `paint`: the materials
//! - `block`: one block with its lots, and the streets around it
//! - `building`: tiers, setbacks and roofs
//! - `facade`: the walls of a tier
//! - `park`: lawns and trees

mod block;
mod brush;
mod building;
mod facade;
mod paint;
mod park;
mod random;

use glam::{Mat4, Vec3, Vec4};

use crate::{Camera, Film, Integrator, Light, Rgb, Sampler, SamplerKind, Scene};
use block::{PITCH, build_block};
use brush::{Brushes, Rect};
use paint::Paint;

/// Procedural city of at least `triangles` triangles, with the same bits on every machine.
///
/// The last block may exceed the number by up to 25 000 triangles. A city has at least one block, even for 0.
pub fn city(triangles: usize) -> Scene {
    let mut brushes = Brushes::default();
    let mut radius = 0.0f32;
    for [column, row] in spiral(triangles) {
        build_block(&mut brushes, column, row);
        let [x, y] = block::center(column, row);
        radius = radius.max((x * x + y * y).sqrt() + 0.5 * PITCH[0]);
        if brushes.triangles() >= triangles {
            break;
        }
    }
    let ground = Rect::around([0.0, 0.0], [4.0 * radius, 4.0 * radius]);
    brushes.plate(Paint::Grass, ground, -0.3);

    let (shapes, materials) = brushes.into_shapes();
    Scene {
        name: "builtin:city".to_owned(),
        shapes,
        objects: Vec::new(),
        instances: Vec::new(),
        materials,
        media: Vec::new(),
        lights: vec![
            Light::Distant {
                to_light: Vec3::new(-0.62, -0.34, 0.56).normalize(),
                radiance: Rgb::new(3.3, 2.85, 2.2),
            },
            Light::Infinite {
                radiance: Rgb::new(0.34, 0.46, 0.66),
                environment: None,
                samples: 1,
            },
        ],
        camera: camera(radius),
        film: Film {
            resolution: [960, 540],
            file_name: Some("city.exr".to_owned()),
            ..Film::default()
        },
        sampler: Sampler {
            kind: SamplerKind::ZeroTwoSequence,
            pixel_samples: 16,
        },
        integrator: Integrator::default(),
        accelerator: Default::default(),
        origin: Default::default(),
    }
}

/// Camera above the south-western quarter of a city of the given radius, which looks down at the centre.
///
/// Over a small city, the camera stays far enough out to clear the towers.
fn camera(radius: f32) -> Camera {
    let radius = radius.max(420.0);
    let eye = Vec3::new(-0.44, -0.72, 0.62) * radius;
    let target = Vec3::new(0.03, -0.05, 0.0) * radius;
    let forward = (target - eye).normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let up = right.cross(forward);
    Camera {
        world_from_camera: Mat4::from_cols(
            right.extend(0.0),
            up.extend(0.0),
            forward.extend(0.0),
            Vec4::new(eye.x, eye.y, eye.z, 1.0),
        ),
        fov: 36.0,
        ..Camera::default()
    }
}

/// Cells of the street grid by distance from the centre, enough for a city of `triangles` triangles.
fn spiral(triangles: usize) -> Vec<[i32; 2]> {
    let blocks = triangles / block::FEWEST_TRIANGLES + 1;
    let half = ((blocks as f32).sqrt() as i32) + 2;
    let mut cells: Vec<_> = (-half..=half)
        .flat_map(|row| (-half..=half).map(move |column| [column, row]))
        .collect();
    let distance = |&[column, row]: &[i32; 2]| {
        let [x, y] = block::center(column, row);
        (x * x + y * y) as u32
    };
    cells.sort_by_key(|cell| (distance(cell), cell[1], cell[0]));
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Geometry;

    fn meshes(scene: &Scene) -> impl Iterator<Item = &crate::TriangleMesh> {
        scene.shapes.iter().map(|shape| match &shape.geometry {
            Geometry::Mesh(mesh) => &**mesh,
            Geometry::Sphere(_) | Geometry::Curves(_) => panic!("the city is made of triangles"),
        })
    }

    #[test]
    fn the_count_is_met_and_hardly_exceeded() {
        for asked in [0, 1, 20_000, 100_000, 500_000, 1_000_000] {
            let found = city(asked).triangle_count();
            assert!(found >= asked.max(1), "{found} of {asked}");
            assert!(found < asked + 25_000, "{found} of {asked}");
        }
    }

    #[test]
    fn every_block_has_its_fewest_triangles() {
        for row in -20..20 {
            for column in -20..20 {
                let mut brushes = Brushes::default();
                build_block(&mut brushes, column, row);
                let found = brushes.triangles();
                assert!(
                    found >= block::FEWEST_TRIANGLES,
                    "block {column}, {row}: {found}"
                );
            }
        }
    }

    #[test]
    fn the_same_bits_twice() {
        assert_eq!(city(100_000), city(100_000));
    }

    #[test]
    fn geometry_is_sound() {
        let scene = city(200_000);
        assert!(scene.shapes.len() >= 8, "several geom_ids");
        for shape in &scene.shapes {
            assert!(shape.material < scene.materials.len());
        }
        for mesh in meshes(&scene) {
            assert!(!mesh.indices.is_empty());
            let vertices = mesh.positions.len() as u32;
            for triangle in &mesh.indices {
                assert!(triangle.iter().all(|&index| index < vertices));
                let [a, b, c] = triangle.map(|i| Vec3::from(mesh.positions[i as usize]));
                let area = (b - a).cross(c - a).length();
                assert!(area > 0.0, "a triangle without area: {a} {b} {c}");
            }
            for &[x, y, z] in &mesh.positions {
                assert!(x.abs() < 5000.0 && y.abs() < 5000.0, "{x} {y}");
                assert!((-0.31..600.0).contains(&z), "{z}");
            }
        }
    }

    #[test]
    fn the_camera_is_above_the_roofs_and_looks_down() {
        let camera = city(100_000).camera.world_from_camera;
        assert!(camera.w_axis.z > 50.0);
        assert!(camera.z_axis.z < -0.3);
        assert!((camera.determinant().abs() - 1.0).abs() < 1e-5);
    }
}
