//! Hair as closed tubes.

use std::sync::Arc;

use crate::support::*;
use antumbra_scene::{
    Geometry, Integrator, Light, LightStrategy, Material, Pigment, Rgb, Scene, TriangleMesh,
};
use glam::{Vec2, Vec3};

fn hair(absorption: f32) -> Material {
    Material::Hair {
        pigment: Pigment::Absorption(Rgb::splat(absorption).into()),
        eta: 1.55.into(),
        roughness: [0.4.into(), 0.5.into()],
        tilt: 0.0.into(),
    }
}

/// A tube of 8 sides along x through (0, y, z), with smooth normals that point outward.
fn tube(y: f32, z: f32, radius: f32) -> Geometry {
    const SIDES: u32 = 8;
    let mut mesh = TriangleMesh::default();
    for end in 0..2 {
        for side in 0..=SIDES {
            let turn = side as f32 / SIDES as f32;
            let (sin, cos) = (std::f32::consts::TAU * turn).sin_cos();
            let normal = Vec3::new(0.0, cos, sin);
            let middle = Vec3::new(20.0 * end as f32 - 10.0, y, z);
            mesh.positions.push((middle + normal * radius).to_array());
            mesh.normals.push(normal);
            mesh.uvs.push(Vec2::new(end as f32, turn));
        }
    }
    for side in 0..SIDES {
        let [a, b] = [side, side + SIDES + 1];
        mesh.indices.extend([[a, b, a + 1], [b, b + 1, a + 1]]);
    }
    Geometry::Mesh(Arc::new(mesh))
}

fn scene_of(material: Material) -> Scene {
    let mut scene = empty();
    scene.integrator = Integrator::Path {
        max_depth: 60,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    };
    for place in 0..5 {
        let tube = tube(
            0.22 * (place as f32 - 2.0),
            5.0 + 0.3 * (place % 2) as f32,
            0.1,
        );
        add(&mut scene, tube, material.clone());
    }
    scene.camera = look(Vec3::ZERO, Vec3::new(1.0, 0.02, 5.0), 4.0);
    scene
}

/// White hair in a world of radiance 1: light that goes through a hair does not hit the hair again.
#[test]
fn white_hair_vanishes_in_a_uniform_world() {
    let mut scene = scene_of(hair(0.0));
    scene.lights.push(sky(1.0));
    let found = estimate(&picture(&scene, 256));
    agree(found, (1.0, 5e-3), "white hair");
    scene.materials.fill(hair(2.0));
    assert!(mean(&picture(&scene, 64)) < 0.7);
}

/// Light samples and sampled directions have one mean: a lamp behind hair as a point, and as a bright sphere.
#[test]
fn light_behind_hair_passes() {
    let render = |is_point: bool| {
        let mut scene = scene_of(hair(0.3));
        let place = Vec3::new(3.0, 4.0, 15.0);
        if is_point {
            scene.lights.push(Light::Point {
                position: place,
                intensity: Rgb::splat(100.0),
            });
        } else {
            let radiance = 100.0 / std::f32::consts::PI;
            add(&mut scene, sphere(place, 1.0), matte(0.0)).area_light = emission(radiance);
        }
        estimate(&picture(&scene, 256))
    };
    let (point, ball) = (render(true), render(false));
    assert!(point.0 > 0.01, "{point:?}");
    // The ball is large enough to differ a little.
    near(point.0, ball.0, 0.1, "light from behind");
}
