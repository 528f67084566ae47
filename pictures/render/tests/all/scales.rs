//! Scenes tiny, huge and far from the origin: no surface shades itself, none leaks.
//!
//! - a scene scaled by a power of two gives the same picture, bit for bit
//! - a convex body sees all of its sky, wherever it is and however large it is
//! - furnaces at every scale
//! - samples that are not finite are counted and leave their pixel alone

use std::f64::consts::PI;
use std::sync::Arc;

use crate::support::*;
use antumbra_scene::material::Mirror;
use antumbra_scene::{
    Geometry, Instance, Integrator, Light, LightStrategy, Material, Object, Scene, TriangleMesh,
};
use glam::{Affine3, Mat4, Vec3};

fn path(max_depth: u32) -> Integrator {
    Integrator::Path {
        max_depth,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    }
}

/// Everything that a scale could break: curved, flat and instanced surfaces, mirrors, glass, area lights.
fn gallery() -> Scene {
    let mut scene = empty();
    scene.film.resolution = [24, 16];
    scene.camera = look(Vec3::new(1.0, -6.0, 2.5), Vec3::new(0.0, 0.0, 0.5), 45.0);
    scene.camera.lens_radius = 0.0625;
    scene.camera.focal_distance = 6.0;
    let ground = quad(Vec3::new(-8.0, -8.0, -1.0), Vec3::X * 16.0, Vec3::Y * 16.0);
    add(&mut scene, ground, matte(0.5));
    add(
        &mut scene,
        sphere(Vec3::new(-1.5, 0.0, 0.0), 1.0),
        matte(0.7),
    );
    add(
        &mut scene,
        sphere(Vec3::new(1.5, 0.5, 0.0), 0.75),
        glass(1.5),
    );
    let mirror = Material::Mirror(Mirror {
        kr: Vec3::splat(0.9).into(),
    });
    add(&mut scene, cube(Vec3::new(0.25, 2.0, 0.0), 0.75), mirror);
    let lamp = quad(Vec3::new(-1.0, -1.0, 4.0), Vec3::Y * 2.0, Vec3::X * 2.0);
    add(&mut scene, lamp, matte(0.0)).area_light = emission(8.0);
    add(
        &mut scene,
        sphere(Vec3::new(3.0, -1.0, 2.0), 0.25),
        matte(0.0),
    )
    .area_light = emission(9.0);
    scene.lights.push(sky(0.25));
    scene.lights.push(Light::Distant {
        to_light: Vec3::new(0.6, 0.0, 0.8),
        radiance: Vec3::splat(0.5),
    });
    let mut object = empty();
    add(&mut object, cube(Vec3::ZERO, 0.5), matte(0.6));
    let mut shape = object.shapes.remove(0);
    shape.material = 0;
    scene.objects.push(Object {
        name: "o".into(),
        shapes: vec![shape],
    });
    let turn = glam::Quat::from_rotation_z(0.7);
    scene.instances.push(Instance {
        object: 0,
        world_from_object: Affine3::from_rotation_translation(turn, Vec3::new(0.0, -1.0, -0.5)),
        end: None,
    });
    scene
}

/// All lengths of a scene times a power of two, which no mantissa notices.
fn scaled(scene: &Scene, scale: f32) -> Scene {
    let mut scene = scene.clone();
    let objects = scene.objects.iter_mut().flat_map(|o| &mut o.shapes);
    for shape in scene.shapes.iter_mut().chain(objects) {
        match &mut shape.geometry {
            Geometry::Mesh(mesh) => {
                let positions = Arc::make_mut(mesh).positions.as_flattened_mut();
                positions.iter_mut().for_each(|x| *x *= scale);
            }
            Geometry::Sphere(sphere) => {
                sphere.center *= scale;
                sphere.radius *= scale;
            }
            Geometry::Curves(curves) => {
                let numbers = Arc::make_mut(curves).points.as_flattened_mut();
                numbers.iter_mut().for_each(|x| *x *= scale);
            }
        }
    }
    for instance in &mut scene.instances {
        instance.world_from_object.translation *= scale;
    }
    let camera = &mut scene.camera;
    camera.world_from_camera.w_axis *= glam::Vec4::new(scale, scale, scale, 1.0);
    camera.lens_radius *= scale;
    camera.focal_distance *= scale;
    scene
}

#[test]
fn the_scale_of_a_scene_changes_no_bit() {
    let scene = gallery();
    let ambient = Integrator::AmbientOcclusion {
        samples: 4,
        cosine_sampling: true,
        distance: f32::INFINITY,
        open: std::f32::consts::PI,
    };
    for integrator in [path(5), ambient] {
        let mut scene = scene.clone();
        scene.integrator = integrator;
        let reference = picture(&scene, 8);
        assert!(mean(&reference) > 0.1);
        // 2⁻²³ is about 10⁻⁷, 2²³ about 10⁷. At 2⁴⁰ products of areas leave the range of single precision.
        for power in [-40, -23, -10, 10, 23] {
            let other = picture(&scaled(&scene, 2f32.powi(power)), 8);
            assert_eq!(
                other.stats.image_hash,
                reference.stats.image_hash,
                "2^{power}, {integrator:?}: {} instead of {}",
                mean(&other),
                mean(&reference)
            );
        }
    }
}

/// A tetrahedron: convex however its corners are rounded.
fn tetrahedron(center: Vec3, size: f32) -> Geometry {
    let corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]];
    let positions = corners.map(|c| (center + size * Vec3::from(c.map(|x| x as f32))).to_array());
    Geometry::Mesh(Arc::new(TriangleMesh {
        positions: positions.to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
        ..TriangleMesh::default()
    }))
}

/// Places of bodies: centre and size.
fn places() -> Vec<(Vec3, f32)> {
    let mut places: Vec<_> = [1e-7, 1e-5, 1e-2, 1.0, 1e3, 1e5, 1e7]
        .map(|size| (Vec3::ZERO, size))
        .to_vec();
    // Far from the origin, down to sizes of some dozen steps between neighbouring numbers.
    for direction in [
        Vec3::X,
        Vec3::new(1.0, -1.0, 0.5),
        Vec3::new(-0.3, 0.2, 1.0),
    ] {
        for (distance, size) in [
            (1e7, 1e6),
            (1e7, 1e4),
            (1e7, 1e2),
            (1e3, 1e-2),
            (1.0, 1e-5),
            (1e-3, 1e-8),
        ] {
            places.push((direction * distance, size));
        }
    }
    places
}

/// A camera that sees nothing but the body.
fn close_up(scene: &mut Scene, center: Vec3, size: f32) {
    let from = center + size * Vec3::new(2.0, 3.0, 4.0);
    scene.camera = look(from, center, 4.0);
}

/// All samples of ambient occlusion are π then, however many there are.
#[track_caller]
fn sees_all_of_its_sky(scene: &mut Scene, what: &str) {
    scene.integrator = Integrator::AmbientOcclusion {
        samples: 16,
        cosine_sampling: true,
        distance: f32::INFINITY,
        open: std::f32::consts::PI,
    };
    let rendering = picture(scene, 4);
    for pixel in rendering.image.pixels() {
        near(pixel[0].into(), PI, 1e-5, what);
    }
}

#[test]
fn a_convex_body_sees_all_of_its_sky_at_every_scale() {
    for (center, size) in places() {
        for (name, geometry) in [
            ("sphere", sphere(center, size)),
            ("cube", cube(center, size)),
            ("tetrahedron", tetrahedron(center, size)),
        ] {
            let mut scene = empty();
            close_up(&mut scene, center, size);
            add(&mut scene, geometry, matte(0.5));
            sees_all_of_its_sky(&mut scene, &format!("{name} of {size:e} at {center}"));
        }
    }
}

/// Bodies that an instance moves to their place, from objects of other sizes and from far away.
#[test]
fn an_instance_sees_all_of_its_sky_at_every_scale() {
    for (center, size) in places() {
        for (object_center, object_size) in [
            (Vec3::ZERO, 1.0),
            (Vec3::ZERO, size),
            (Vec3::new(100.0, 200.0, -300.0), 10.0),
        ] {
            for (name, geometry) in [
                ("sphere", sphere(object_center, object_size)),
                ("cube", cube(object_center, object_size)),
                ("tetrahedron", tetrahedron(object_center, object_size)),
            ] {
                let mut scene = empty();
                close_up(&mut scene, center, size);
                add(&mut scene, geometry, matte(0.5));
                let shapes = std::mem::take(&mut scene.shapes);
                scene.objects.push(Object {
                    name: "body".into(),
                    shapes,
                });
                let scale = size / object_size;
                let turn = glam::Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.0);
                let matrix = Mat4::from_translation(center)
                    * Mat4::from_quat(turn)
                    * Mat4::from_scale(Vec3::splat(scale))
                    * Mat4::from_translation(-object_center);
                scene.instances.push(Instance {
                    object: 0,
                    world_from_object: Affine3::from_mat4(matrix),
                    end: None,
                });
                sees_all_of_its_sky(
                    &mut scene,
                    &format!(
                        "{name} of {size:e} at {center} from {object_size} at {object_center}"
                    ),
                );
            }
        }
    }
}

/// A plane of triangles from 10⁻² to 10², each next to some twice as large, far above and below the origin. Not
/// of needles: the test of a triangle a thousand times longer than wide is less exact than rays are offset.
#[test]
fn a_plane_of_mixed_scales_sees_all_of_its_sky() {
    const CORNERS: [[f32; 2]; 8] = [
        [1.0, 0.0],
        [1.0, 1.0],
        [0.0, 1.0],
        [-1.0, 1.0],
        [-1.0, 0.0],
        [-1.0, -1.0],
        [0.0, -1.0],
        [1.0, -1.0],
    ];
    let rings = 14;
    for height in [0.0, 1.0, -1e3, 1e7] {
        let mut positions = vec![[0.0, 0.0, height]];
        for ring in 0..rings {
            let radius = 0.01 * 2f32.powi(ring);
            positions.extend(CORNERS.map(|[x, y]| [radius * x, radius * y, height]));
        }
        let vertex = |ring: u32, corner: u32| 1 + 8 * ring + corner % 8;
        let mut indices: Vec<_> = (0..8)
            .map(|i| [0, vertex(0, i), vertex(0, i + 1)])
            .collect();
        for ring in 1..rings as u32 {
            for i in 0..8 {
                let [a, b] = [vertex(ring - 1, i), vertex(ring - 1, i + 1)];
                let [c, d] = [vertex(ring, i + 1), vertex(ring, i)];
                indices.extend([[a, d, c], [a, c, b]]);
            }
        }
        let mesh = TriangleMesh {
            positions,
            indices,
            ..TriangleMesh::default()
        };
        for distance in [0.1, 1.0, 20.0] {
            let mut scene = empty();
            let target = Vec3::new(0.003, 0.001, height);
            let from = target + distance * Vec3::new(1.0, -0.5, 1.0);
            if from.z <= height {
                continue; // Too close to be above it.
            }
            scene.camera = look(from, target, 10.0);
            add(
                &mut scene,
                Geometry::Mesh(Arc::new(mesh.clone())),
                matte(0.5),
            );
            sees_all_of_its_sky(&mut scene, &format!("{height} from {distance}"));
        }
    }
}

/// Of at least some thousand steps between neighbouring numbers: with fewer, cosines and distances are a matter of
/// rounding.
#[test]
fn furnaces_keep_their_light_at_every_scale() {
    let reflectance = 0.6;
    let series: f64 = (0..=4).map(|n| f64::from(reflectance).powi(n)).sum();
    let is_fine = |&(center, size): &(Vec3, f32)| size > 9e-4 * center.abs().max_element();
    for (center, size) in places().into_iter().filter(is_fine) {
        for (name, geometry) in [
            ("sphere", sphere(center, size)),
            ("cube", cube(center, size)),
            ("tetrahedron", tetrahedron(center, size)),
        ] {
            let mut scene = empty();
            scene.camera = look(center, center + size * Vec3::new(0.3, -0.5, 0.8), 90.0);
            let shape = add(&mut scene, geometry, matte(reflectance));
            shape.area_light = emission(1.0);
            shape.reverse_orientation = true;
            scene.integrator = path(4);
            let what = format!("{name} of {size:e} at {center}");
            near(mean(&picture(&scene, 64)), series, 0.012, &what);
        }
    }
}

/// An emitter of infinite radiance gives infinite samples: they are counted, and the pixels that have others keep
/// those.
#[test]
fn samples_that_are_not_finite_are_counted_and_dropped() {
    let mut scene = empty();
    scene.camera = look(Vec3::ZERO, Vec3::Z, 90.0);
    scene.lights.push(sky(1.0));
    let lamp = quad(Vec3::new(-0.5, -0.5, 1.0), Vec3::Y * 0.53, Vec3::X * 0.53);
    let shape = add(&mut scene, lamp, matte(0.0));
    shape.area_light = emission(f32::INFINITY);
    scene.integrator = path(0);
    let rendering = picture_with(
        &scene,
        &antumbra_render::Options {
            spp: Some(16),
            ..Default::default()
        },
    );
    let dropped = rendering.stats.dropped_samples;
    assert!(dropped > 16, "{dropped}");
    let [x, y] = rendering.stats.dropped_at.expect("one is the first");
    assert_eq!(rendering.image.pixels()[(y * 16 + x) as usize], [0.0; 3]);
    for pixel in rendering.image.pixels() {
        // Behind the lamp nothing is known and the pixel is black.
        assert!(*pixel == [0.0; 3] || *pixel == [1.0; 3], "{pixel:?}");
    }
}
