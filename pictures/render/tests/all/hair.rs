//! Hair on curves.

use std::sync::Arc;

use crate::support::*;
use antumbra_render::World;
use antumbra_scene::material::Hair;
use antumbra_scene::{
    CurveProfile, Curves, DirectStrategy, Geometry, Integrator, Light, LightStrategy, Material,
    Pigment, Rgb, Scene,
};
use glam::Vec3;

fn hair(absorption: f32) -> Material {
    Material::Hair(Hair {
        pigment: Pigment::Absorption(Rgb::splat(absorption).into()),
        eta: 1.55.into(),
        roughness: [0.4.into(), 0.5.into()],
        tilt: 0.0.into(),
    })
}

/// A straight hair along x through (0, y, z).
fn strand(y: f32, z: f32, radius: f32, profile: CurveProfile) -> Geometry {
    Geometry::Curves(Arc::new(Curves {
        points: [-10.0, -4.0, 2.0, 10.0].map(|x| [x, y, z, radius]).to_vec(),
        first: vec![0],
        profile,
    }))
}

/// Bent hairs of many directions in a ball around (0, 0, 5).
fn ball(count: u32, radius: f32) -> Geometry {
    let mut curves = Curves::default();
    let mut state = 0x2545_f491_u32;
    let mut number = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    for _ in 0..count {
        let begin = Vec3::new(number(), number(), number()).normalize();
        let bend = Vec3::new(number(), number(), number()) * 0.4;
        let point = |share: f32| begin * (0.4 + 0.6 * share) + bend * (share * share);
        curves.append(&Curves {
            points: [0.0, 0.3, 0.6, 1.0]
                .map(|share| (Vec3::Z * 5.0 + point(share)).extend(radius).to_array())
                .to_vec(),
            first: vec![0],
            profile: CurveProfile::Round,
        });
    }
    Geometry::Curves(Arc::new(curves))
}

fn scene_of(material: Material) -> Scene {
    let mut scene = empty();
    scene.integrator = Integrator::Path {
        max_depth: 60,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    };
    for place in 0..5 {
        let profile = [CurveProfile::Flat, CurveProfile::Round][place % 2];
        let y = 0.22 * (place as f32 - 2.0);
        let strand = strand(y, 5.0 + 0.3 * (place % 2) as f32, 0.1, profile);
        add(&mut scene, strand, material.clone());
    }
    scene.camera = look(Vec3::ZERO, Vec3::new(1.0, 0.02, 5.0), 4.0);
    scene
}

/// White hair in a world of radiance 1.
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

/// Fur of white hair in a world of radiance 1 neither makes nor loses light, however often light is scattered in it.
#[test]
fn white_fur_vanishes_in_a_uniform_world() {
    let mut scene = scene_of(hair(0.0));
    scene.shapes.clear();
    scene.materials.clear();
    add(&mut scene, ball(1500, 0.03), hair(0.0));
    scene.integrator = Integrator::Path {
        max_depth: 500,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    };
    scene.camera = look(Vec3::ZERO, Vec3::new(0.0, 0.02, 5.0), 15.0);
    scene.lights.push(sky(1.0));
    agree(estimate(&picture(&scene, 256)), (1.0, 5e-3), "white fur");
    scene.materials.fill(matte(1.0));
    let found = estimate(&picture(&scene, 64));
    assert!(found.0 < 1.01, "matte fur: {found:?}");
    scene.materials.fill(hair(2.0));
    assert!(mean(&picture(&scene, 64)) < 0.6);
}

/// One strand of a matte under a light from the viewer: flat strands are as bright as a wall, round ones have the mean of
/// the cosine over the angle.
#[test]
fn profiles_shade_as_their_normals() {
    let lights = [CurveProfile::Flat, CurveProfile::Round].map(|profile| {
        let mut scene = empty();
        let strand = strand(0.0, 5.0, 1.0, profile);
        add(&mut scene, strand, matte(std::f32::consts::PI / 4.0));
        scene.lights.push(Light::Distant {
            to_light: -Vec3::Z,
            radiance: Rgb::splat(4.0),
        });
        // From afar, so that all rays and the light have one direction.
        scene.camera = look(Vec3::Z * -195.0, Vec3::new(0.0, 0.0, 5.0), 0.9);
        scene.integrator = Integrator::DirectLighting {
            strategy: DirectStrategy::All,
            max_depth: 1,
        };
        let seen = picture(&scene, 64);
        let red: Vec<f64> = (seen.image.pixels().iter())
            .map(|[red, ..]| f64::from(*red))
            .collect();
        let brightest = red.iter().fold(0.0, |most: f64, x| most.max(*x));
        near(brightest, 1.0, 0.04, "the middle");
        red.iter().sum::<f64>()
    });
    // Both cover the same pixels.
    near(
        lights[1] / lights[0],
        2.0 / std::f64::consts::PI,
        0.03,
        "round over flat",
    );
}

#[test]
fn curves_that_emit_are_refused() {
    let mut scene = empty();
    add(
        &mut scene,
        strand(0.0, 5.0, 0.1, CurveProfile::Flat),
        matte(0.5),
    )
    .area_light = emission(1.0);
    let error = World::new(&scene).expect_err("a curve that emits");
    assert!(
        error
            .to_string()
            .contains("shape 0 is a curve that emits light")
    );
}
