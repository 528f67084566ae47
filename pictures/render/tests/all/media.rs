//! Participating media in whole pictures, against closed forms and each other.

use std::f64::consts::PI;

use crate::support::*;
use antumbra_render::{Error, World};
use antumbra_scene::{
    DensityGrid, Integrator, Light, LightStrategy, Material, Medium, MediumInterface, Rgb, Scene,
};
use glam::{Mat4, Vec3};

fn volume_path(max_depth: u32) -> Integrator {
    Integrator::VolumePath {
        max_depth,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    }
}

fn medium(absorption: f32, scattering: f32, asymmetry: f32) -> Medium {
    Medium {
        absorption: Rgb::splat(absorption),
        scattering: Rgb::splat(scattering),
        asymmetry,
        density: None,
    }
}

/// Density 1 in a cube that is half as large again, so that the body of half-width `half` reaches no border cell.
fn ones(center: Vec3, half: f32) -> DensityGrid {
    DensityGrid {
        size: [12; 3],
        values: vec![1.0; 12 * 12 * 12].into(),
        world_from_grid: Mat4::from_translation(center - Vec3::splat(1.5 * half))
            * Mat4::from_scale(Vec3::splat(3.0 * half)),
    }
}

const INSIDE: Option<MediumInterface> = Some(MediumInterface {
    inside: Some(0),
    outside: None,
});

/// A cube around (0, 0, 5) without a surface, filled with a medium.
fn cube_of(medium: Medium, half: f32, max_depth: u32) -> Scene {
    let mut scene = empty();
    scene.integrator = volume_path(max_depth);
    scene.media.push(medium);
    add(&mut scene, cube(Vec3::Z * 5.0, half), Material::None).media = INSIDE;
    scene
}

/// A walk through a grid takes as many steps as its optical depth.
#[test]
fn grids_that_are_too_dense_are_refused() {
    for (densest, fits) in [(1e4, true), (1e6, false), (f32::MAX, false)] {
        let mut dense = medium(0.2, 0.2, 0.0);
        let mut grid = ones(Vec3::Z * 5.0, 1.5);
        let mut values = grid.values.to_vec();
        values[0] = densest;
        grid.values = values.into();
        dense.density = Some(grid);
        let world = World::new(&cube_of(dense, 1.5, 4));
        let is_refused = matches!(world, Err(Error::Medium { index: 0, .. }));
        assert_eq!(is_refused, !fits, "{densest}");
    }
}

/// Beer and Lambert: an emitter behind a slab that absorbs, seen directly and by light samples.
#[test]
fn a_slab_absorbs_exponentially() {
    let expected = f64::exp(-0.7 * 3.0);
    for grid in [false, true] {
        let mut slab = medium(0.7, 0.0, 0.0);
        slab.density = grid.then(|| ones(Vec3::Z * 5.0, 1.5));
        let mut scene = cube_of(slab.clone(), 1.5, 4);
        add(&mut scene, floor(9.0), matte(0.0)).area_light = emission(1.0);
        let found = estimate(&picture(&scene, 64));
        agree(found, (expected, 1e-4), "an emitter behind a slab");
        // Light of a lamp that crosses the slab on its way to a wall. The lamp is nearly a point.
        let mut scene = cube_of(slab, 1.5, 4);
        scene.camera = look(Vec3::new(0.0, 0.0, 8.0), Vec3::new(0.0, 0.0, 9.0), 0.5);
        add(&mut scene, floor(9.0), matte(0.5));
        scene.lights.push(Light::Point {
            position: Vec3::ZERO,
            intensity: Rgb::splat(81.0),
        });
        let found = estimate(&picture(&scene, 64));
        agree(found, (0.5 / PI * expected, 1e-4), "a lamp behind a slab");
    }
}

/// A medium that absorbs nothing cannot be seen in a world of radiance 1, in a cloud, in glass, and around the camera.
#[test]
fn media_that_only_scatter_vanish_in_a_uniform_world() {
    for (asymmetry, material, grid) in [
        (0.0, Material::None, false),
        (0.8, Material::None, false),
        (-0.5, Material::None, true),
        (0.3, glass(1.4), false),
    ] {
        let is_glass = material != Material::None;
        let mut cloud = medium(0.0, 1.2, asymmetry);
        cloud.density = grid.then(|| ones(Vec3::Z * 5.0, 1.0));
        let mut scene = empty();
        scene.integrator = volume_path(400);
        scene.lights.push(sky(1.0));
        scene.media.push(cloud);
        add(&mut scene, sphere(Vec3::Z * 5.0, 1.0), material).media = INSIDE;
        let found = estimate(&picture(&scene, 256));
        agree(found, (1.0, 1e-3), "a body in a uniform world");
        // From inside.
        scene.camera = look(Vec3::Z * 5.0, Vec3::new(0.3, 0.2, 9.0), 0.5);
        scene.camera.medium = Some(0);
        let found = estimate(&picture(&scene, 256));
        // Radiance grows with the square of the index of refraction.
        let expected = if is_glass { 1.96 } else { 1.0 };
        agree(found, (expected, 1e-3), "a uniform world seen from a body");
    }
}

/// Light that is scattered once: `σ_s p E ∫ exp(-σ_t x (1 + 1 / cos)) dx` over a wide slab.
#[test]
fn light_scattered_once_equals_its_integral() {
    let (sigma_a, sigma_s, depth) = (0.1, 0.3, 2.0);
    for asymmetry in [-0.6, 0.0, 0.7] {
        let mut scene = empty();
        scene.integrator = volume_path(1);
        scene.media.push(medium(sigma_a, sigma_s, asymmetry));
        for (height, media) in [(4.0, [None, Some(0)]), (4.0 + depth, [Some(0), None])] {
            // The normal of the floor points to the camera.
            let [outside, inside] = media;
            add(&mut scene, floor(height), Material::None).media =
                Some(MediumInterface { inside, outside });
        }
        let to_light = Vec3::new(0.6, 0.0, -0.8);
        scene.lights.push(Light::Distant {
            to_light,
            radiance: Rgb::splat(10.0),
        });
        let found = estimate(&picture(&scene, 256));
        // Light travels along -to_light, and on along -z to the camera.
        let (g, cos) = (f64::from(asymmetry), -0.8_f64);
        let phase = (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5));
        let rate = f64::from(sigma_a + sigma_s) * (1.0 + 1.0 / 0.8);
        let integral = (1.0 - f64::exp(-rate * f64::from(depth))) / rate;
        let expected = 10.0 * f64::from(sigma_s) * phase * integral;
        agree(found, (expected, 1e-5), "light scattered once");
    }
}

/// A grid of equal densities is a homogeneous medium, whatever the colours.
#[test]
fn a_constant_grid_equals_a_homogeneous_medium() {
    let colored = Medium {
        absorption: Rgb::new(0.3, 0.1, 0.0),
        scattering: Rgb::new(0.5, 0.9, 1.3),
        asymmetry: 0.5,
        density: None,
    };
    let render = |density| {
        let medium = Medium {
            density,
            ..colored.clone()
        };
        let mut scene = cube_of(medium, 1.0, 20);
        scene.lights.push(sky(1.0));
        add(&mut scene, floor(7.0), matte(0.2)).area_light = emission(2.0);
        picture(&scene, 256)
    };
    let (plain, grid) = (render(None), render(Some(ones(Vec3::Z * 5.0, 1.0))));
    agree(estimate(&plain), estimate(&grid), "red");
    for channel in 1..3 {
        let [a, b] = [&plain, &grid].map(|picture| picture.image.mean()[channel]);
        near(a, b, 0.02, "another colour");
    }
}

/// Without media and with a material on every surface, the integrator is the path tracer.
#[test]
fn nothing_changes_without_media() {
    let mut scene = empty();
    scene.lights.push(sky(1.0));
    add(&mut scene, sphere(Vec3::Z * 5.0, 1.0), matte(0.5));
    add(&mut scene, floor(7.0), glass(1.5));
    let plain = picture(&scene, 16);
    scene.integrator = volume_path(5);
    assert!(plain.image.pixels() == picture(&scene, 16).image.pixels());
    // Opaque surfaces: shadow rays are occlusion queries. A medium that does nothing changes no mean.
    let without = estimate(&picture(&scene, 256));
    scene.media.push(medium(0.0, 0.0, 0.0));
    agree(estimate(&picture(&scene, 256)), without, "an empty medium");
}

/// Light goes through surfaces without a material, and dims in media between them.
#[test]
fn light_samples_pass_surfaces_without_material() {
    let mut scene = empty();
    scene.integrator = volume_path(2);
    add(&mut scene, floor(9.0), matte(0.5));
    add(&mut scene, floor(7.0), Material::None);
    scene.lights.push(Light::Distant {
        to_light: -Vec3::Z,
        radiance: Rgb::splat(2.0),
    });
    near(
        mean(&picture(&scene, 16)),
        1.0 / PI,
        1e-4,
        "through a sheet",
    );
}

#[test]
fn impossible_media_are_refused() {
    let refused = |change: fn(&mut Scene)| {
        let mut scene = cube_of(medium(1.0, 1.0, 0.0), 1.0, 3);
        change(&mut scene);
        antumbra_render::World::new(&scene)
            .expect_err("refused")
            .to_string()
    };
    assert!(refused(|scene| scene.media[0].asymmetry = 1.0).contains("mean cosine"));
    assert!(refused(|scene| scene.media[0].absorption.x = f32::NAN).contains("coefficient"));
    assert!(refused(|scene| scene.media.clear()).contains("medium 0 is named"));
    assert!(refused(|scene| scene.camera.medium = Some(3)).contains("medium 3 is named"));
    assert!(
        refused(|scene| {
            let mut grid = ones(Vec3::ZERO, 1.0);
            grid.size = [12, 12, 11];
            scene.media[0].density = Some(grid);
        })
        .contains("grid")
    );
}
