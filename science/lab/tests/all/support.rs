//! A small scene for the tests.

use antumbra::recipe::Engine;
use antumbra::{Bvh, Width};
use antumbra_render::World;
use antumbra_scene::Scene;
use glam::Vec3;

pub use crate::scenes::*;

/// A cube over a floor, under a sky and a small light.
pub fn cube_over_floor() -> Scene {
    let mut scene = empty();
    scene.camera = look(Vec3::new(0.0, 0.0, -8.0), Vec3::ZERO, 60.0);
    scene.film.resolution = [50, 34];
    add(&mut scene, floor(3.0), matte(0.7));
    add(&mut scene, cube(Vec3::ZERO, 1.0), matte(0.5));
    let light = quad(Vec3::new(2.0, 2.0, -3.0), Vec3::X, Vec3::Y);
    add(&mut scene, light, matte(0.0)).area_light = emission(20.0);
    scene.lights.push(sky(0.5));
    scene
}

/// A scene ready to be rendered, and the tree over it.
pub fn world(scene: &Scene) -> (World, Bvh) {
    let world = World::new(scene).expect("a valid scene");
    let bvh = world.bvh(Engine::best(Width::W8));
    (world, bvh)
}
