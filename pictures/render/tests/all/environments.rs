//! Light from images, sampled in every way.
//!
//! - over a plane, against closed forms
//! - what the camera sees of it
//! - with light samples, without, and with both
//! - strategies of choice between lights

use std::sync::Arc;

use crate::support::*;
use antumbra_scene::material::{Glass, Plastic};
use antumbra_scene::{
    DirectStrategy, Environment, EnvironmentMapping, Image, Integrator, Light, LightStrategy,
    Material, Pixels, Rgb, Scene,
};
use glam::{Mat3, Quat, Vec3};

fn path(max_depth: u32, light_strategy: LightStrategy) -> Integrator {
    Integrator::Path {
        max_depth,
        rr_threshold: 1.0,
        light_strategy,
    }
}

fn direct(strategy: DirectStrategy) -> Integrator {
    Integrator::DirectLighting {
        strategy,
        max_depth: 1,
    }
}

const STRATEGIES: [LightStrategy; 3] = [
    LightStrategy::Uniform,
    LightStrategy::Power,
    LightStrategy::Spatial,
];

/// An environment of this function of column and row.
fn environment(
    [width, height]: [u32; 2],
    world_from_light: Mat3,
    value: impl Fn(u32, u32) -> [f32; 3],
) -> Light {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let image = Image {
        name: "test".into(),
        width,
        height,
        pixels: Pixels::Rgb32(texels.map(|(x, y)| value(x, y)).collect()),
    };
    Light::Infinite {
        radiance: Rgb::ONE,
        environment: Some(Environment {
            mapping: EnvironmentMapping::LongitudeLatitude,
            image: Arc::new(image),
            world_from_light,
        }),
        samples: 2,
    }
}

/// Half a turn about x: the pole, where row 0 is, looks along -z, towards those who stand on [`floor`].
fn upside_down() -> Mat3 {
    Mat3::from_quat(Quat::from_rotation_x(std::f32::consts::PI))
}

/// Bright in one place, dim elsewhere, black in parts.
fn spotty() -> Light {
    environment([32, 16], upside_down(), |x, y| match (x, y) {
        (9..11, 3..5) => [30.0, 25.0, 20.0],
        (20..28, _) => [0.0; 3],
        _ => [0.2, 0.3, 0.5],
    })
}

#[test]
fn a_plane_reflects_the_integral_of_the_image() {
    let mut scene = empty();
    scene.camera = look(Vec3::new(1.0, 0.5, 1.0), Vec3::Z * 3.0, 0.05);
    add(&mut scene, floor(3.0), matte(0.5));
    // Radiance cos², so the irradiance is 2π ∫ cos³ sin = π / 2.
    scene.lights = vec![environment([4, 256], upside_down(), |_, y| {
        let cos = ((y as f32 + 0.5) / 256.0 * std::f32::consts::PI).cos();
        [cos * cos; 3]
    })];
    for integrator in [
        path(1, LightStrategy::Spatial),
        direct(DirectStrategy::All),
        direct(DirectStrategy::One),
    ] {
        scene.integrator = integrator;
        let found = mean(&picture(&scene, 256));
        near(found, 0.25, 0.005, &format!("{integrator:?}"));
    }
}

/// Radiance cos² on an octahedron of equal areas, by its formula for the polar angle: z = ±(1 - r²), where 1 - r is the distance
/// from the fold.
#[test]
fn a_plane_reflects_the_integral_of_an_octahedron() {
    let side = 128;
    let mut scene = empty();
    scene.camera = look(Vec3::new(1.0, 0.5, 1.0), Vec3::Z * 3.0, 0.05);
    add(&mut scene, floor(3.0), matte(0.5));
    let mut sky = environment([side; 2], upside_down(), |x, y| {
        let part = |k: u32| (2.0 * (k as f32 + 0.5) / side as f32 - 1.0).abs();
        let height = 1.0 - part(x) - part(y);
        let radius = 1.0 - height.abs();
        let cos = 1.0 - radius * radius;
        // The lower half is black, to distinguish the halves.
        [if height > 0.0 { cos * cos } else { 0.0 }; 3]
    });
    if let Light::Infinite {
        environment: Some(environment),
        ..
    } = &mut sky
    {
        environment.mapping = EnvironmentMapping::EqualArea;
    }
    scene.lights = vec![sky];
    for integrator in [
        path(1, LightStrategy::Spatial),
        direct(DirectStrategy::All),
        direct(DirectStrategy::One),
    ] {
        scene.integrator = integrator;
        let found = mean(&picture(&scene, 256));
        near(found, 0.25, 0.005, &format!("{integrator:?}"));
    }
}

#[test]
fn the_camera_sees_the_image() {
    let mut scene = empty();
    let turned = Mat3::from_quat(Quat::from_rotation_y(0.4));
    let texel = |x: u32, y: u32| [x as f32, y as f32, 1.0];
    scene.lights = vec![environment([16, 8], turned, texel)];
    for (x, y) in [(0, 1), (3, 4), (15, 6), (8, 7)] {
        let (azimuth, polar) = (
            (x as f32 + 0.5) / 8.0 * std::f32::consts::PI,
            (y as f32 + 0.5) / 8.0 * std::f32::consts::PI,
        );
        let local = Vec3::new(
            polar.sin() * azimuth.cos(),
            polar.sin() * azimuth.sin(),
            polar.cos(),
        );
        scene.camera = look(Vec3::ONE, Vec3::ONE + turned * local, 0.01);
        let mean = picture(&scene, 4).image.mean();
        for (found, expected) in mean.into_iter().zip(texel(x, y)) {
            let expected = f64::from(expected);
            assert!((found - expected).abs() < 0.02, "{found} {expected}");
        }
    }
}

/// Glossy and rough things under a spotty sky.
fn things() -> Scene {
    let mut scene = empty();
    scene.camera = look(Vec3::new(0.0, -4.0, 1.0), Vec3::new(0.0, 0.0, 2.5), 60.0);
    let plastic = Material::Plastic(Plastic {
        kd: Rgb::splat(0.4).into(),
        ks: Rgb::splat(0.4).into(),
        roughness: 0.3.into(),
        remap_roughness: false,
    });
    let rough = Material::Glass(Glass {
        kr: Rgb::ONE.into(),
        kt: Rgb::ONE.into(),
        eta: 1.4.into(),
        roughness: [0.3.into(), 0.5.into()],
        remap_roughness: false,
    });
    add(&mut scene, floor(3.0), plastic);
    add(&mut scene, cube(Vec3::new(0.8, 0.0, 2.6), 0.4), matte(0.7));
    add(&mut scene, sphere(Vec3::new(-0.8, 0.0, 2.5), 0.5), rough);
    scene.lights.push(spotty());
    scene
}

/// A light beyond the floor that lights nothing, but whose power outshines all. Chosen by power, no other light has
/// samples, and only scattering finds the light of others.
fn decoy() -> Light {
    Light::Point {
        position: Vec3::new(0.0, 0.0, 50.0),
        intensity: Rgb::splat(1e20),
    }
}

#[test]
fn light_samples_and_scattering_agree() {
    let mut scene = things();
    let mut by = |integrator, spp| {
        scene.integrator = integrator;
        estimate(&picture(&scene, spp))
    };
    let both = by(path(1, LightStrategy::Power), 256);
    for strategy in [DirectStrategy::All, DirectStrategy::One] {
        let found = by(direct(strategy), 256);
        agree(found, both, &format!("{strategy:?}"));
    }
    scene.lights.push(decoy());
    scene.integrator = path(1, LightStrategy::Power);
    let scattered = estimate(&picture(&scene, 1024));
    agree(scattered, both, "without light samples");
}

#[test]
fn every_strategy_has_the_same_mean() {
    let mut scene = things();
    let lamp = sphere(Vec3::new(0.0, 1.0, 1.0), 0.3);
    add(&mut scene, lamp, matte(0.2)).area_light = emission(5.0);
    for i in 0..5 {
        scene.lights.push(Light::Point {
            position: Vec3::new(i as f32 - 2.0, 1.5, 1.0),
            intensity: Rgb::splat(0.2),
        });
    }
    let means = STRATEGIES.map(|strategy| {
        scene.integrator = path(3, strategy);
        estimate(&picture(&scene, 256))
    });
    agree(means[1], means[0], "power");
    agree(means[2], means[0], "spatial");
    // A hundred lights more are chosen from in another way.
    for i in 0..100 {
        scene.lights.push(Light::Point {
            position: Vec3::new((i % 10) as f32 - 4.5, (i / 10) as f32 - 4.5, 0.5),
            intensity: Rgb::splat(0.02),
        });
    }
    let means = STRATEGIES.map(|strategy| {
        scene.integrator = path(2, strategy);
        estimate(&picture(&scene, 256))
    });
    agree(means[1], means[0], "many, power");
    agree(means[2], means[0], "many, spatial");
}
