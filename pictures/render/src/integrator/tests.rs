//! Queues stay short, however many rays one point sends. The time at which they are traced changes nothing.

use antumbra::recipe::Engine;
use std::sync::Arc;

use antumbra::Isa;
use antumbra_scene::material::Matte;
use antumbra_scene::{
    AreaLight, DirectStrategy, Geometry, Integrator as Settings, Light, Material, Scene, Shape,
    Sphere, TriangleMesh,
};

use super::*;
use crate::integrator::Observe;
use crate::sampler::{Method as Random, Sampler};

/// Far more than a queue holds.
const MANY: u32 = 5 * ENOUGH as u32 + 7;

/// A ball in front of the camera and a lamp that half of it sees, under a sky.
fn scene(integrator: Settings) -> Scene {
    let ball = |z: f32, emission: Option<AreaLight>| Shape {
        geometry: Geometry::Sphere(Sphere::new(Vec3::new(0.0, 0.0, z), 1.0)),
        material: 0,
        area_light: emission,
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    };
    let lamp = AreaLight {
        radiance: Vec3::ONE,
        texture: None,
        two_sided: false,
        samples: MANY,
    };
    Scene {
        name: String::new(),
        shapes: vec![ball(5.0, None), ball(-5.0, Some(lamp))],
        objects: Vec::new(),
        instances: Vec::new(),
        materials: vec![Material::Matte(Matte {
            kd: Vec3::splat(0.5).into(),
            sigma: 0.0.into(),
        })],
        media: Vec::new(),
        lights: vec![Light::Infinite {
            radiance: Vec3::new(0.1, 0.2, 0.3),
            environment: None,
            samples: 2 * MANY,
        }],
        camera: Default::default(),
        film: Default::default(),
        sampler: Default::default(),
        integrator,
        accelerator: Default::default(),
        origin: Default::default(),
    }
}

/// Rays towards the ball.
fn batch(numbers: std::ops::Range<u32>) -> Batch {
    let mut batch = Batch::default();
    let sampler = Sampler::new(Random::Independent, 3);
    for number in numbers {
        let dir = Vec3::new(0.05 * number as f32, 0.02, 1.0).normalize();
        let ray = Ray::new([0.0; 3], dir.to_array());
        batch.rays.push(ray);
        batch.streams.push(sampler.stream(0, 0, number));
    }
    batch
}

#[test]
fn queues_are_bounded_and_when_they_are_traced_changes_no_bit() {
    let direct = |strategy| Settings::DirectLighting {
        strategy,
        max_depth: 1,
    };
    let ambient = |cosine_sampling| Settings::AmbientOcclusion {
        samples: MANY,
        cosine_sampling,
        distance: f32::INFINITY,
        open: std::f32::consts::PI,
    };
    for settings in [
        ambient(true),
        ambient(false),
        direct(DirectStrategy::All),
        direct(DirectStrategy::One),
    ] {
        let world = World::new(&scene(settings)).expect("a valid scene");
        let isa = Isa::best();
        let bvh = world.bvh(Engine::of(isa));
        let trace = |mut batch: Batch| {
            let mut integrator = Integrator::new(&world);
            let mut tracer = Tracer::new(&bvh, Observe::Nothing);
            integrator.trace(&world, &mut tracer, &mut batch, false);
            assert!(integrator.shadows.longest() <= ENOUGH, "{settings:?}");
            if let Method::Direct(direct) = &integrator.method {
                assert!(direct.most_probes() <= ENOUGH, "{settings:?}");
            }
            let counts = tracer.finish().0;
            (batch, counts)
        };
        let (together, counts) = trace(batch(0..3));
        match settings {
            Settings::AmbientOcclusion { .. } => {
                assert_eq!(counts.shadow_rays, 3 * u64::from(MANY))
            }
            Settings::DirectLighting {
                strategy: DirectStrategy::All,
                ..
            } => {
                // Half of the sky's samples are below the horizon at most, and every probe that may see the sky is
                // a shadow ray, too.
                assert!(counts.shadow_rays > 4 * u64::from(MANY));
            }
            _ => {}
        }
        for number in 0..3 {
            let (alone, _) = trace(batch(number..number + 1));
            let [one, other] = [alone.radiance(0), together.radiance(number as usize)];
            assert!(one.min_element() > 0.0, "{settings:?}");
            assert_eq!(
                one.to_array().map(f32::to_bits),
                other.to_array().map(f32::to_bits)
            );
        }
    }
}

/// A floor of one Lambert and one rough half, under a lamp of four triangles, a ball that shines and a sky.
fn lit_floor() -> Scene {
    let mut scene = scene(Settings::DirectLighting {
        strategy: DirectStrategy::All,
        max_depth: 2,
    });
    let square = |z: f32, half: f32| {
        Geometry::Mesh(Arc::new(TriangleMesh {
            positions: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]| [half * x, half * y, z])
                .to_vec(),
            indices: vec![[0, 1, 2], [0, 2, 3]],
            ..TriangleMesh::default()
        }))
    };
    for shape in &mut scene.shapes {
        if let Some(light) = &mut shape.area_light {
            light.samples = 3;
        }
    }
    let like = |shape: &Shape, geometry, material| Shape {
        geometry,
        material,
        ..shape.clone()
    };
    scene
        .shapes
        .push(like(&scene.shapes[0], square(7.0, 9.0), 1));
    scene
        .shapes
        .push(like(&scene.shapes[1], square(-1.0, 2.0), 0));
    scene.materials.push(Material::Matte(Matte {
        kd: Vec3::splat(0.7).into(),
        sigma: 20.0.into(),
    }));
    scene.lights = vec![Light::Infinite {
        radiance: Vec3::new(0.1, 0.2, 0.3),
        environment: None,
        samples: 70,
    }];
    scene
}

#[test]
fn light_samples_in_columns_change_no_bit() {
    let world = World::new(&lit_floor()).expect("a valid scene");
    for isa in Isa::available() {
        let bvh = world.bvh(Engine::of(isa));
        let radiance = |in_columns: bool| {
            let mut integrator = Integrator::new(&world);
            if let Method::Direct(direct) = &mut integrator.method
                && !in_columns
            {
                assert!(direct.leave_columns());
            }
            let mut tracer = Tracer::new(&bvh, Observe::Nothing);
            let mut batch = batch(0..12);
            integrator.trace(&world, &mut tracer, &mut batch, false);
            [0, 3, 6, 11].map(|sample| batch.radiance(sample).to_array().map(f32::to_bits))
        };
        let found = radiance(true);
        assert_eq!(found, radiance(false), "{:?}", isa.level());
        assert!(
            found
                .iter()
                .all(|sample| sample.iter().all(|x| f32::from_bits(*x) > 0.0))
        );
    }
}
