//! Rays for benchmarks: how many, from where, whither, and always the same.

use crate::support::*;
use antumbra::Ray;
use antumbra_lab::{Rays, collect_rays};
use antumbra_scene::{Geometry, Scene};
use glam::Vec3;

fn rays(scene: &Scene, count: usize, seed: u64) -> Rays {
    let (world, bvh) = world(scene);
    collect_rays(&world, &bvh, count, seed)
}

#[test]
fn the_same_rays_for_every_number_of_threads_and_other_ones_for_another_seed() {
    let scene = cube_over_floor();
    let reference = rays(&scene, 3000, 1);
    assert_eq!(reference.primary.len(), 3000);
    assert_eq!(reference.shadow.len(), 3000);
    assert_eq!(reference.diffuse.len(), 3000);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().expect("threads");
        assert_eq!(pool.install(|| rays(&scene, 3000, 1)), reference);
    }
    let other = rays(&scene, 3000, 2);
    let shared = |a: &[Ray], b: &[Ray]| a.iter().filter(|ray| b.contains(ray)).count();
    assert_eq!(shared(&other.primary, &reference.primary), 0);
    assert_eq!(shared(&other.shadow, &reference.shadow), 0);
    assert_eq!(shared(&other.diffuse, &reference.diffuse), 0);
    let fewer = rays(&scene, 500, 1);
    assert_eq!(fewer.primary, reference.primary[..500]);
    assert_eq!(fewer.shadow, reference.shadow[..500]);
    assert_eq!(fewer.diffuse, reference.diffuse[..500]);
}

#[test]
fn every_kind_begins_and_ends_where_it_should() {
    let scene = cube_over_floor();
    let Rays {
        primary,
        shadow,
        diffuse,
    } = rays(&scene, 4000, 5);
    let eye = [0.0, 0.0, -8.0];
    assert!(primary.iter().all(|ray| ray.org == eye));
    // Every point from which light is asked or bounced lies on a shape.
    for ray in shadow.iter().chain(&diffuse) {
        let [x, y, z] = ray.org;
        let cube = x.abs().max(y.abs()).max(z.abs());
        let on = |value: f32, place: f32| (value - place).abs() < 1e-3;
        assert!(on(z, 3.0) || on(z, -3.0) || on(cube, 1.0), "{ray:?}");
        assert!((0.99..=1.01).contains(&Vec3::from(ray.dir).length()) || ray.tfar < 1.0);
    }
    assert!(diffuse.iter().all(|ray| ray.tfar == f32::INFINITY));
    let ends_at_light = |ray: &&Ray| {
        let end = Vec3::from(ray.org) + Vec3::from(ray.dir) * ray.tfar;
        ray.tfar.is_finite() && (end.z + 3.0).abs() < 1e-2
    };
    let to_light = shadow.iter().filter(ends_at_light).count();
    let to_sky = shadow.iter().filter(|ray| ray.tfar.is_infinite()).count();
    assert_eq!(to_light + to_sky, shadow.len());
    assert!(to_light > 500 && to_sky > 500, "{to_light} {to_sky}");
    // Cosine-weighted: on the floor, whose normal is -z, the mean cosine is 2/3.
    let floor = diffuse.iter().filter(|ray| (ray.org[2] - 3.0).abs() < 1e-3);
    let cosines: Vec<f32> = floor.map(|ray| -ray.dir[2]).collect();
    let mean = cosines.iter().sum::<f32>() / cosines.len() as f32;
    assert!((mean - 2.0 / 3.0).abs() < 0.03, "{mean}");
}

#[test]
fn scenes_without_some_kind_of_ray_end_too() {
    let nothing = rays(&empty(), 1000, 0);
    assert_eq!(nothing.primary.len(), 1000);
    assert!(nothing.shadow.is_empty() && nothing.diffuse.is_empty());

    let mut dark = cube_over_floor();
    dark.lights.clear();
    dark.shapes.retain(|shape| shape.area_light.is_none());
    assert!(matches!(dark.shapes[0].geometry, Geometry::Mesh(_)));
    let dark = rays(&dark, 1000, 0);
    assert_eq!((dark.diffuse.len(), dark.shadow.len()), (1000, 0));
    assert_eq!(rays(&cube_over_floor(), 0, 0), Rays::default());
}
