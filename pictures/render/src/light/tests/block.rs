//! Blocks of light samples hold the samples of [`Lights::choose`] and [`Light::sample`], bit for bit.

use antumbra::{Aabb, Isa};
use antumbra_scene::{Integrator, LightStrategy, Scene};

use super::*;
use crate::columns::BLOCK;

fn mesh(seed: u32, with_normals: bool) -> Geometry {
    let corners = points(seed + 20).skip(seed as usize).take(12);
    let positions: Vec<[f32; 3]> = corners
        .enumerate()
        .map(|(i, [x, y])| [4.0 * x, 4.0 * y, 3.0 + 0.1 * i as f32])
        .collect();
    Geometry::Mesh(Arc::new(TriangleMesh {
        indices: (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        normals: if with_normals {
            vec![Vec3::new(0.1, 0.2, -1.0); positions.len()]
        } else {
            Vec::new()
        },
        positions,
        ..TriangleMesh::default()
    }))
}

fn scene(lights: usize, strategy: LightStrategy) -> Scene {
    let shape = |geometry: Geometry, two_sided: bool| Shape {
        geometry,
        material: 0,
        area_light: Some(AreaLight {
            radiance: Vec3::new(1.0, 2.0, 3.0),
            texture: None,
            two_sided,
            samples: 1,
        }),
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: two_sided,
        transform_swaps_handedness: false,
    };
    let ball = Geometry::Sphere(Sphere::new(Vec3::new(-3.0, 1.0, 2.0), 0.5));
    let shapes = vec![
        shape(mesh(1, false), false),
        shape(mesh(30, false), true),
        shape(mesh(60, true), false),
        shape(ball, false),
    ];
    let mut others = vec![
        antumbra_scene::Light::Infinite {
            radiance: Vec3::new(0.3, 0.2, 0.1),
            environment: None,
            samples: 1,
        },
        antumbra_scene::Light::Distant {
            to_light: Vec3::Y,
            radiance: Vec3::splat(0.5),
        },
    ];
    others.extend((0..lights).map(|i| antumbra_scene::Light::Point {
        position: Vec3::new(i as f32, 2.0, 0.5),
        intensity: Vec3::ONE,
    }));
    Scene {
        name: String::new(),
        shapes,
        objects: Vec::new(),
        instances: Vec::new(),
        materials: Vec::new(),
        media: Vec::new(),
        lights: others,
        camera: Default::default(),
        film: Default::default(),
        sampler: Default::default(),
        integrator: Integrator::Path {
            max_depth: 5,
            rr_threshold: 1.0,
            light_strategy: strategy,
        },
        accelerator: Default::default(),
        origin: Default::default(),
    }
}

#[test]
fn samples_of_blocks_are_single_samples() {
    let bounds = Aabb {
        min: [-5.0; 3],
        max: [5.0; 3],
    };
    let mut seen = 0;
    for (count, strategy) in [
        (1, LightStrategy::Spatial),
        (20, LightStrategy::Spatial),
        (100, LightStrategy::Spatial),
        (2, LightStrategy::Power),
    ] {
        let lights = Lights::new(&scene(count, strategy), &bounds, &mut Textures::default());
        let sampler = Sampler::new(Method::Independent, 3);
        for isa in Isa::available() {
            let mut block = LightBlock::default();
            for round in 0..40 {
                let stream = |lane: usize| sampler.stream(round, lane as i32, 1);
                let lanes = BLOCK - round as usize;
                for lane in 0..lanes {
                    let stream = stream(lane);
                    let normal = uniform_sphere(stream.pair(0));
                    let asked = &mut block.asked;
                    asked.point.set(lane, uniform_sphere(stream.pair(1)) * 2.0);
                    asked.normal.set(lane, normal);
                    asked.both_sides[lane] = u32::from(lane % 3 == 0);
                    asked.wants[lane] = u32::from(lane % 7 != 2);
                    asked.choice[0][lane] = stream.uniform(2);
                    let [u, v] = stream.pair(3);
                    (asked.u[0][lane], asked.u[1][lane]) = (u, v);
                }
                block.sample(isa, &lights, lanes);
                for lane in 0..lanes {
                    let stream = stream(lane);
                    let at = block.asked.receiver(lane);
                    let (light, probability) =
                        lights.choose(at.point, stream.uniform(2)).expect("lights");
                    let expected = lights.all()[light].sample(&at, stream.pair(3));
                    let expected = expected.filter(|_| lane % 7 != 2);
                    let found = &block.found;
                    assert_eq!(found.found[lane] != 0, expected.is_some());
                    let Some(expected) = expected else { continue };
                    seen += 1;
                    let bits = |v: Vec3| v.to_array().map(f32::to_bits);
                    assert_eq!(bits(found.wi.get(lane)), bits(expected.wi));
                    assert_eq!(bits(found.radiance.get(lane)), bits(expected.radiance));
                    assert_eq!(found.density[lane], expected.pdf * probability);
                    assert_eq!(found.is_delta[lane] != 0, expected.is_delta);
                    let is_far = found.is_far[lane] != 0;
                    match expected.end {
                        End::Infinity => assert!(is_far),
                        End::Point(point) => {
                            assert!(!is_far && found.target.get(lane) == point);
                            assert_eq!(found.normal.get(lane), Vec3::ZERO);
                        }
                        End::Surface {
                            point,
                            error,
                            normal,
                        } => {
                            assert!(!is_far);
                            assert_eq!(bits(found.target.get(lane)), bits(point));
                            assert_eq!(bits(found.error.get(lane)), bits(error));
                            assert_eq!(bits(found.normal.get(lane)), bits(normal));
                        }
                    }
                }
            }
        }
    }
    assert!(seen > 5000, "{seen}");
}

#[test]
fn samples_of_elements_in_blocks_are_single_samples() {
    let bounds = Aabb {
        min: [-5.0; 3],
        max: [5.0; 3],
    };
    let lights = Lights::new(
        &scene(2, LightStrategy::Power),
        &bounds,
        &mut Textures::default(),
    );
    let elements: Vec<_> = (lights.all().iter().enumerate())
        .flat_map(|(light, all)| (0..all.elements()).map(move |element| (light, element)))
        .collect();
    let sampler = Sampler::new(Method::Independent, 5);
    let mut seen = 0;
    for isa in Isa::available() {
        let mut block = LightBlock::default();
        for round in 0..40 {
            let stream = sampler.stream(round, 0, 1);
            let at = Receiver {
                point: uniform_sphere(stream.pair(1)) * 2.0,
                normal: uniform_sphere(stream.pair(0)),
                both_sides: round % 3 == 0,
            };
            block.asked.fill(&at);
            let asks = |lane: usize| {
                let (light, element) = elements[(lane + round as usize) % elements.len()];
                ElementSample {
                    light,
                    element,
                    samples: 1 + lane as u32 % 5,
                    u: stream.pair(2 + lane as u32),
                }
            };
            for lane in 0..BLOCK {
                block.ask_element(lane, &asks(lane));
            }
            block.sample_elements(isa, &lights, BLOCK);
            for lane in 0..BLOCK {
                let ElementSample {
                    light,
                    element,
                    samples,
                    u,
                } = asks(lane);
                let expected = lights.all()[light].sample_element(&at, element, u);
                let found = &block.found;
                assert_eq!(found.found[lane] != 0, expected.is_some());
                let Some(expected) = expected else { continue };
                seen += 1;
                assert_eq!(found.wi.get(lane), expected.wi);
                assert_eq!(found.radiance.get(lane), expected.radiance);
                assert_eq!(found.density[lane], expected.pdf * samples as f32);
                assert_eq!(found.is_delta[lane] != 0, expected.is_delta);
                if let End::Surface { point, .. } = expected.end {
                    assert_eq!(found.target.get(lane), point);
                }
            }
        }
    }
    assert!(seen > 2000, "{seen}");
}
