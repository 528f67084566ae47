//! Bodies in which light is scattered, against closed forms.

use crate::support::*;
use antumbra_scene::material::Subsurface;
use antumbra_scene::{
    DirectStrategy, Integrator, Interior, Light, LightStrategy, Material, Rgb, Scene,
};
use glam::Vec3;

fn body(interior: Interior, roughness: f32) -> Material {
    Material::Subsurface(Subsurface {
        kr: Rgb::ONE.into(),
        kt: Rgb::ONE.into(),
        eta: 1.33,
        roughness: [roughness.into(), roughness.into()],
        remap_roughness: false,
        interior,
        asymmetry: 0.2,
    })
}

fn coefficients(absorption: f32, scattering: f32) -> Interior {
    Interior::Coefficients {
        absorption: Rgb::splat(absorption).into(),
        scattering: Rgb::splat(scattering).into(),
        scale: 2.0,
    }
}

/// A cube around (0, 0, 5) in a world of radiance 1.
fn cube_of(material: Material) -> Scene {
    let mut scene = empty();
    scene.integrator = Integrator::Path {
        max_depth: 100,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    };
    scene.lights.push(sky(1.0));
    add(&mut scene, cube(Vec3::Z * 5.0, 1.0), material);
    scene
}

/// Reflectance at normal incidence.
const MIRRORED: f64 = (0.33 / 2.33) * (0.33 / 2.33);

#[test]
fn bodies_that_absorb_nothing_vanish_in_a_uniform_world() {
    for scattering in [0.0, 0.5, 6.0] {
        for angle in [0.0_f32, 0.6] {
            let mut scene = cube_of(body(coefficients(0.0, scattering), 0.0));
            let from = Vec3::new(4.0 * angle.sin(), 0.0, 5.0 - 4.0 * angle.cos());
            scene.camera = look(from, Vec3::new(0.0, 0.1, 4.0), 0.5);
            let found = estimate(&picture(&scene, 256));
            agree(found, (1.0, 2e-3), "a body in a uniform world");
        }
    }
}

/// What enters a body that only absorbs stays there.
#[test]
fn bodies_that_only_absorb_reflect() {
    let scene = cube_of(body(coefficients(40.0, 0.0), 0.0));
    let found = estimate(&picture(&scene, 256));
    agree(found, (MIRRORED, 1e-4), "a body that absorbs");
}

/// The diffusion approximation, by which the albedo is found, is near the walk.
#[test]
fn flat_bodies_have_about_their_diffuse_reflectance() {
    for reflectance in [0.3, 0.6, 0.9] {
        let interior = Interior::Diffuse {
            reflectance: Rgb::splat(reflectance).into(),
            mean_free_path: Rgb::splat(0.02).into(),
            scale: 0.5,
        };
        let found = mean(&picture(&cube_of(body(interior, 0.0)), 256));
        let expected = MIRRORED + (1.0 - MIRRORED) * f64::from(reflectance);
        assert!(
            (found - expected).abs() < 0.06,
            "{reflectance}: {found} {expected}"
        );
    }
}

/// Light samples reach the points where light leaves: a distant light, which no other technique finds.
#[test]
fn small_lights_light_bodies() {
    let mut scene = cube_of(body(coefficients(0.02, 10.0), 0.5));
    scene.lights = vec![Light::Distant {
        to_light: -Vec3::Z,
        radiance: Rgb::splat(1.0),
    }];
    let found = mean(&picture(&scene, 64));
    // Less than a white Lambert reflector, and more than a third of it.
    assert!(found < 0.33 && found > 0.1, "{found}");
}

#[test]
fn bodies_are_refused_where_nobody_follows_the_light() {
    let mut scene = cube_of(body(coefficients(0.0, 1.0), 0.0));
    scene.integrator = Integrator::DirectLighting {
        strategy: DirectStrategy::All,
        max_depth: 5,
    };
    let error = antumbra_render::World::new(&scene).expect_err("refused");
    assert!(error.to_string().contains("directlighting"), "{error}");
}
