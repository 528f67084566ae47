//! Whatever generates the samples, pictures have the same mean; low-discrepancy ones have less noise.

use crate::support::*;
use antumbra_scene::{DirectStrategy, Integrator, LightStrategy, SamplerKind, Scene};
use glam::Vec3;

const STRATIFIED: SamplerKind = SamplerKind::Stratified {
    x: 8,
    y: 8,
    jitter: true,
};

const KINDS: [SamplerKind; 5] = [
    STRATIFIED,
    SamplerKind::Halton,
    SamplerKind::Sobol,
    SamplerKind::ZeroTwoSequence,
    SamplerKind::MaxMinDist,
];

/// A ball on a floor under a lamp and a sky, seen through a lens.
fn scene() -> Scene {
    let mut scene = empty();
    scene.camera = look(Vec3::new(0.0, -4.0, 1.0), Vec3::new(0.0, 0.0, 2.5), 50.0);
    scene.camera.lens_radius = 0.1;
    scene.camera.focal_distance = 4.0;
    add(&mut scene, floor(3.0), matte(0.5));
    add(
        &mut scene,
        sphere(Vec3::new(0.0, 0.0, 2.5), 0.5),
        matte(0.8),
    );
    let lamp = quad(Vec3::new(1.0, -1.0, 1.0), Vec3::X, Vec3::Y * 2.0);
    add(&mut scene, lamp, matte(0.0)).area_light =
        emission(3.0).map(|light| antumbra_scene::AreaLight {
            samples: 3,
            ..light
        });
    scene.lights.push(sky(0.5));
    scene
}

#[test]
fn every_sampler_has_the_same_mean() {
    for integrator in [
        Integrator::Path {
            max_depth: 4,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Spatial,
        },
        Integrator::DirectLighting {
            strategy: DirectStrategy::All,
            max_depth: 1,
        },
        Integrator::AmbientOcclusion {
            samples: 4,
            cosine_sampling: true,
            distance: f32::INFINITY,
            open: std::f32::consts::PI,
        },
    ] {
        let mut scene = scene();
        scene.integrator = integrator;
        let mut by = |kind, spp| {
            scene.sampler.kind = kind;
            estimate(&picture(&scene, spp))
        };
        let reference = by(SamplerKind::Random, 512);
        // As many samples as a grid has or two powers of two, and a number that suits none.
        for spp in [64, 50] {
            for kind in KINDS {
                agree(by(kind, spp), reference, &format!("{kind:?}, {spp}"));
            }
        }
    }
}

/// The mean squared difference from a good picture, over the same mean for independent samples.
#[test]
fn stratified_pictures_have_less_noise() {
    let mut scene = scene();
    scene.integrator = Integrator::DirectLighting {
        strategy: DirectStrategy::One,
        max_depth: 1,
    };
    let mut by = |kind, spp| {
        scene.sampler.kind = kind;
        picture(&scene, spp).image
    };
    let reference = by(SamplerKind::ZeroTwoSequence, 4096);
    let mut noise = |kind| {
        let image = by(kind, 64);
        let differences = image.pixels().iter().zip(reference.pixels());
        differences
            .map(|(a, b)| f64::from(a[0] - b[0]).powi(2))
            .sum::<f64>()
    };
    let independent = noise(SamplerKind::Random);
    for kind in KINDS {
        let found = noise(kind) / independent;
        assert!(found < 0.85, "{kind:?}: {found}");
    }
}
