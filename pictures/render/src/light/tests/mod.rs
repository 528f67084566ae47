//! Irradiance of every light against its closed form, and samples against their densities.
//!
//! - this file: emitting shapes, points, spots, skies
//! - `block.rs`: samples of many points at once
//! - `environment.rs`: environments by an image
//! - `profiles.rs`: point lights with a profile by an image, and their power

mod block;
mod environment;
mod profiles;

use std::sync::Arc;

use antumbra_scene::{
    AreaLight, Geometry, Image, Param, Pixels, Shape, Sphere, Texture, TriangleMesh,
};
use glam::{Mat3, Mat4, Quat};

use super::distribution::SphereDistribution;
use super::*;
use crate::sampler::warp::uniform_sphere;
use crate::sampler::{Method, Sampler};
use crate::texture::Textures;

fn points(count: u32) -> impl Iterator<Item = [f32; 2]> {
    let sampler = Sampler::new(Method::OwenSobol, 23);
    (0..count).map(move |i| sampler.stream(0, 0, i).pair(0))
}

fn receiver(point: Vec3, normal: Vec3) -> Receiver {
    Receiver {
        point,
        normal,
        both_sides: false,
    }
}

/// Monte Carlo irradiance of an unblocked light.
fn irradiance(light: &Light, at: &Receiver) -> f64 {
    let count = 1 << 15;
    points(count)
        .filter_map(|u| light.sample(at, u))
        .map(|s| f64::from(s.radiance.x * s.wi.dot(at.normal).max(0.0) / s.pdf))
        .sum::<f64>()
        / f64::from(count)
}

fn area(geometry: Geometry, two_sided: bool) -> Light {
    textured_area(geometry, two_sided, None)
}

fn textured_area(geometry: Geometry, two_sided: bool, texture: Option<Param<Vec3>>) -> Light {
    let shape = Shape {
        geometry,
        material: 0,
        area_light: Some(AreaLight {
            radiance: Vec3::ONE,
            texture,
            two_sided,
            samples: 1,
        }),
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    };
    let emitter = Emitter::new(&shape, &mut Textures::default());
    Light::Area(emitter.expect("it has an area"))
}

/// A square of half-width 1 at height z = 1 that faces down.
fn ceiling() -> Geometry {
    Geometry::Mesh(Arc::new(TriangleMesh {
        positions: vec![
            [-1.0, -1.0, 1.0],
            [1.0, -1.0, 1.0],
            [1.0, 1.0, 1.0],
            [-1.0, 1.0, 1.0],
        ],
        indices: vec![[0, 2, 1], [0, 3, 2]],
        ..TriangleMesh::default()
    }))
}

fn near(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() < 0.01 * expected.max(0.01),
        "{what}: {found} {expected}"
    );
}

#[test]
fn irradiance_of_a_square_is_its_form_factor() {
    // Four corners with a = b = 1 over a point at distance 1: E = 4 * (1/2) * 2 (1/√2) atan(1/√2).
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let expected = 4.0 * half * half.atan();
    let up = receiver(Vec3::ZERO, Vec3::Z);
    near(irradiance(&area(ceiling(), false), &up), expected, "below");
    let above = receiver(Vec3::Z * 2.0, -Vec3::Z);
    near(
        irradiance(&area(ceiling(), false), &above),
        0.0,
        "above, one-sided",
    );
    near(
        irradiance(&area(ceiling(), true), &above),
        expected,
        "above, two-sided",
    );
}

#[test]
fn irradiance_of_a_sphere() {
    for (radius, distance) in [(1.0_f32, 3.0_f32), (1.0, 1.01), (0.01, 100.0)] {
        let sphere = Sphere::new(Vec3::Z * distance, radius);
        let light = area(Geometry::Sphere(sphere), false);
        let expected = std::f64::consts::PI * f64::from(radius / distance).powi(2);
        let found = irradiance(&light, &receiver(Vec3::ZERO, Vec3::Z));
        assert!(
            (found - expected).abs() < 0.01 * expected,
            "{radius} {distance}: {found} {expected}"
        );
    }
}

#[test]
fn irradiance_of_plain_lights() {
    use antumbra_scene::Light as Scene;
    let up = receiver(Vec3::ZERO, Vec3::Z);
    let intensity = Vec3::splat(5.0);
    let position = Vec3::new(0.0, 0.0, 2.0);
    let point = Light::new(&Scene::Point {
        position,
        intensity,
    });
    near(irradiance(&point, &up), 1.25, "point");
    let spot = |axis: Vec3| {
        Light::new(&Scene::Spot {
            position,
            axis: axis.normalize(),
            intensity,
            cos_total_width: 0.5,
            cos_falloff_start: 0.9,
        })
    };
    near(irradiance(&spot(-Vec3::Z), &up), 1.25, "spot, centre");
    near(irradiance(&spot(Vec3::X), &up), 0.0, "spot, outside");
    // Cosine 0.7 is halfway through the falloff.
    let edge = spot(Vec3::new((1.0_f32 - 0.49).sqrt(), 0.0, -0.7));
    near(irradiance(&edge, &up), 1.25 / 16.0, "spot, edge");
    let distant = Light::new(&Scene::Distant {
        to_light: Vec3::new(0.6, 0.0, 0.8),
        radiance: Vec3::ONE,
    });
    near(irradiance(&distant, &up), 0.8, "distant");
    let sky = Light::new(&Scene::Infinite {
        radiance: Vec3::ONE,
        environment: None,
        samples: 1,
    });
    near(irradiance(&sky, &up), std::f64::consts::PI, "sky");
    let samples = |samples| {
        let radiance = Vec3::ONE;
        Light::new(&Scene::Infinite {
            radiance,
            environment: None,
            samples,
        })
        .samples()
    };
    assert_eq!([samples(0), samples(1), samples(9)], [1, 1, 9]);
    let both = Receiver {
        both_sides: true,
        ..up
    };
    near(
        irradiance(&sky, &both),
        std::f64::consts::PI,
        "sky, both sides sampled",
    );
}

/// The densities of the elements of a mesh add up: sampling each costs as much as sampling all.
#[test]
fn elements_add_up_to_the_light() {
    let light = area(ceiling(), false);
    let at = receiver(Vec3::new(0.4, -0.3, 0.0), Vec3::Z);
    let count = 1 << 14;
    let by_element: f64 = (0..light.elements())
        .flat_map(|element| points(count).map(move |u| (element, u)))
        .filter_map(|(element, u)| light.sample_element(&at, element, u))
        .map(|s| f64::from(s.radiance.x * s.wi.z / s.pdf) / f64::from(count))
        .sum();
    let whole = irradiance(&light, &at);
    near(by_element, whole, "elements");
}

/// The density that a hit reports is the one its sample had.
#[test]
fn hits_report_the_density_of_samples() {
    let sphere = Sphere::new(Vec3::new(0.5, 0.2, 2.0), 0.7);
    let at = receiver(Vec3::new(0.1, 0.2, -0.3), Vec3::Z);
    for light in [area(ceiling(), true), area(Geometry::Sphere(sphere), true)] {
        let Light::Area(emitter) = &light else {
            unreachable!("area makes area lights")
        };
        for u in points(300) {
            let Some(sample) = light.sample(&at, u) else {
                panic!("two-sided emitters always have a sample")
            };
            let End::Surface { point, normal, .. } = sample.end else {
                panic!("emitters are surfaces")
            };
            let hit = Surface {
                point,
                start: point,
                distance: 0.0,
                origin_offset: 0.0,
                origin: point,
                normal,
                shading_normal: normal,
                wo: -sample.wi,
                shape: 0,
                inst_id: antumbra::INVALID_ID,
                primitive: 0,
            };
            let pdf = emitter.pdf(&at, &hit);
            assert!(
                (pdf - sample.pdf).abs() < 1e-3 * pdf,
                "{pdf} {}",
                sample.pdf
            );
        }
    }
    let sky = Light::new(&antumbra_scene::Light::Infinite {
        radiance: Vec3::ONE,
        environment: None,
        samples: 1,
    });
    for both_sides in [false, true] {
        let at = Receiver { both_sides, ..at };
        let count = 1 << 15;
        let mean: f64 = points(count)
            .map(|u| f64::from(sky.escaped(&at, uniform_sphere(u)).1))
            .sum::<f64>()
            / f64::from(count);
        near(mean * 4.0 * std::f64::consts::PI, 1.0, "density of the sky");
        for u in points(300) {
            let sample = sky.sample(&at, u).expect("a sky is everywhere");
            assert_eq!(sample.pdf, sky.escaped(&at, sample.wi).1);
        }
    }
}

#[test]
fn shapes_without_area_are_no_lights() {
    let flat = Geometry::Mesh(Arc::new(TriangleMesh {
        positions: vec![[f32::NAN; 3], [1.0; 3], [2.0; 3]],
        indices: vec![[0, 1, 2], [1, 1, 2]],
        ..TriangleMesh::default()
    }));
    let shape = Shape {
        geometry: flat,
        material: 0,
        area_light: Some(AreaLight {
            radiance: Vec3::ONE,
            texture: None,
            two_sided: false,
            samples: 1,
        }),
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    };
    assert!(Emitter::new(&shape, &mut Textures::default()).is_none());
}

/// An image of this function of column and row.
fn image(width: u32, height: u32, value: impl Fn(u32, u32) -> [f32; 3]) -> Arc<Image> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    Arc::new(Image {
        name: "test".into(),
        width,
        height,
        pixels: Pixels::Rgb32(pixels.map(|(x, y)| value(x, y)).collect()),
    })
}

/// A texture emits as much as its parts together, and samples have the density that hits get.
#[test]
fn textured_emission_is_the_sum_of_its_parts() {
    // Twice as bright where u is below one half: one of the two halves of a square.
    let corner = |x: f32, y: f32| [x, y, 1.0];
    let mesh = |left: f32, right: f32| {
        let uv = |x: f32| glam::Vec2::new(0.5 * (x + 1.0), 0.5);
        Geometry::Mesh(Arc::new(TriangleMesh {
            positions: vec![
                corner(left, -1.0),
                corner(right, -1.0),
                corner(right, 1.0),
                corner(left, 1.0),
            ],
            indices: vec![[0, 2, 1], [0, 3, 2]],
            uvs: vec![uv(left), uv(right), uv(right), uv(left)],
            ..TriangleMesh::default()
        }))
    };
    let halves = |low: f32, high: f32| {
        Some(Param::Texture(Arc::new(Texture::Checkerboard {
            squares: [Vec3::splat(low).into(), Vec3::splat(high).into()],
            mapping: antumbra_scene::Mapping::Uv {
                scale: glam::Vec2::new(2.0, 1.0),
                offset: glam::Vec2::ZERO,
            },
            smooth: false,
        })))
    };
    let at = receiver(Vec3::new(0.3, -0.2, 0.0), Vec3::Z);
    let whole = textured_area(mesh(-1.0, 1.0), false, halves(2.0, 0.5));
    let left = irradiance(&area(mesh(-1.0, 0.0), false), &at);
    let right = irradiance(&area(mesh(0.0, 1.0), false), &at);
    near(
        irradiance(&whole, &at),
        2.0 * left + 0.5 * right,
        "textured",
    );
    let Light::Area(emitter) = &whole else {
        panic!("an area light");
    };
    // Mean 1.25 over an area of 4.
    near(f64::from(emitter.strength().x), 5.0, "strength");
    for u in points(100) {
        let sample = emitter.sample(&at, u).expect("light");
        let End::Surface { point, normal, .. } = sample.end else {
            panic!("a surface");
        };
        let primitive = u32::from(point.y - 1.0 > point.x - 1.0 && point.y > point.x);
        let radiance = if point.x < 0.0 { 2.0 } else { 0.5 };
        assert_eq!(sample.radiance.x, radiance, "{point}");
        let hit = Surface {
            point,
            start: point,
            distance: 0.0,
            origin_offset: 0.0,
            origin: point,
            normal,
            shading_normal: normal,
            wo: -sample.wi,
            shape: 0,
            inst_id: antumbra::INVALID_ID,
            primitive,
        };
        let pdf = emitter.pdf(&at, &hit);
        assert!(
            (pdf - sample.pdf).abs() < 1e-4 * pdf,
            "{pdf} {}",
            sample.pdf
        );
        if point.x.abs() > 1e-3 {
            assert_eq!(emitter.radiance_of(&hit).x, radiance, "{point}");
        }
    }
    let shape = Shape {
        geometry: mesh(-1.0, 1.0),
        material: 0,
        area_light: Some(AreaLight {
            radiance: Vec3::ONE,
            texture: halves(0.0, 0.0),
            two_sided: false,
            samples: 1,
        }),
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    };
    assert!(
        Emitter::new(&shape, &mut Textures::default()).is_none(),
        "black"
    );
}
