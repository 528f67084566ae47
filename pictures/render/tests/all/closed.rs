//! Closed is closed: a camera inside a dark body sees black, however bright the sky outside.

use std::sync::Arc;

use crate::support::*;
use antumbra_scene::{
    DirectStrategy, Geometry, Instance, Integrator, LightStrategy, Object, Scene, TriangleMesh,
};
use glam::{Affine3, Mat4, Quat, Vec3};

fn integrators() -> [Integrator; 3] {
    [
        Integrator::Path {
            max_depth: 5,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Spatial,
        },
        Integrator::DirectLighting {
            strategy: DirectStrategy::All,
            max_depth: 5,
        },
        Integrator::AmbientOcclusion {
            samples: 64,
            cosine_sampling: true,
            distance: f32::INFINITY,
            open: std::f32::consts::PI,
        },
    ]
}

/// A camera in the middle of what will be around 0, under a bright sky.
fn inside(turn: Quat) -> Scene {
    let mut scene = empty();
    scene.film.resolution = [64, 64];
    scene.camera = look(Vec3::ZERO, turn * Vec3::new(1.0, 0.3, 0.2), 100.0);
    scene.lights.push(sky(1.0));
    scene
}

/// A matte cube of half-width 1/2, transformed by a matrix.
fn transformed(matrix: Mat4) -> Geometry {
    let Geometry::Mesh(mesh) = cube(Vec3::ZERO, 0.5) else {
        panic!("a cube is a mesh")
    };
    let moved = |&p: &[f32; 3]| matrix.transform_point3(p.into()).to_array();
    Geometry::Mesh(Arc::new(TriangleMesh {
        positions: mesh.positions.iter().map(moved).collect(),
        indices: mesh.indices.clone(),
        ..TriangleMesh::default()
    }))
}

#[track_caller]
fn is_black(mut scene: Scene, what: &str) {
    for integrator in integrators() {
        scene.integrator = integrator;
        let rendering = picture(&scene, 16);
        let lit = rendering.image.pixels().iter().filter(|p| **p != [0.0; 3]);
        assert_eq!(lit.count(), 0, "{what}, {integrator:?}");
        assert_eq!(rendering.stats.dropped_samples, 0);
    }
}

/// Some turn, another one for every number.
fn turn(number: u32) -> Quat {
    let angle = 1.0 + 2.4 * number as f32;
    let axis = Vec3::new(angle.sin(), angle.cos(), 0.5 + (3.0 * angle).sin());
    Quat::from_axis_angle(axis.normalize(), angle)
}

#[test]
fn a_bar_is_black_inside() {
    for (number, width) in [1e-1, 1e-2, 1e-3, 3e-4, 1e-4].into_iter().enumerate() {
        for number in [number as u32, number as u32 + 10] {
            let turn = turn(number);
            let mut scene = inside(turn);
            let size = Vec3::new(1.0, width, width);
            let matrix = Mat4::from_quat(turn) * Mat4::from_scale(size);
            add(&mut scene, transformed(matrix), matte(0.8));
            is_black(scene, &format!("bar of {width}, turn {number}"));
        }
    }
}

#[test]
fn an_instance_of_a_cube_is_black_inside() {
    for (number, width) in [1e-1, 1e-2, 1e-3, 1e-4].into_iter().enumerate() {
        let turn = turn(number as u32);
        let mut scene = inside(turn);
        add(&mut scene, cube(Vec3::ZERO, 0.5), matte(0.8));
        let shapes = std::mem::take(&mut scene.shapes);
        scene.objects.push(Object {
            name: "cube".into(),
            shapes,
        });
        let size = Vec3::new(1.0, width, width);
        let matrix = Mat4::from_quat(turn) * Mat4::from_scale(size);
        scene.instances.push(Instance {
            object: 0,
            world_from_object: Affine3::from_mat4(matrix),
            end: None,
        });
        is_black(scene, &format!("instance of {width}"));
    }
}
