//! Scenes whose radiance is known on paper.
//!
//! - furnaces: closed emitting surfaces, truncated series
//! - one light of each kind over a plane
//! - ambient occlusion
//! - mirrors and glass in a uniform world
//! - which side emits, what is behind the camera, lens and filters in a uniform world

use std::f64::consts::{FRAC_1_PI, FRAC_1_SQRT_2, PI};

use crate::support::*;
use antumbra_scene::material::{Glass, Mirror, Plastic};
use antumbra_scene::{
    DirectStrategy, Filter, Integrator, Light, LightStrategy, Material, Param, Rgb, SamplerKind,
    Scene,
};
use glam::Vec3;

fn path(max_depth: u32) -> Integrator {
    Integrator::Path {
        max_depth,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    }
}

fn direct(strategy: DirectStrategy, max_depth: u32) -> Integrator {
    Integrator::DirectLighting {
        strategy,
        max_depth,
    }
}

/// Inside a closed surface of reflectance r that emits 1 everywhere, a path of at most n scattering events
/// sees 1 + r + ... + r^n from anywhere in any direction.
#[test]
fn furnaces() {
    let reflectance = 0.6;
    for (name, geometry) in [
        ("sphere", sphere(Vec3::new(0.2, 0.1, 0.3), 2.0)),
        ("cube", cube(Vec3::new(0.2, 0.1, 0.3), 1.0)),
        (
            "far from the origin",
            cube(Vec3::new(3000.0, 100.0, 0.0), 1.0),
        ),
    ] {
        for max_depth in [0, 1, 2, 4, 9] {
            let mut scene = empty();
            let center = match &geometry {
                antumbra_scene::Geometry::Mesh(mesh) if mesh.positions[0][0] > 1000.0 => {
                    Vec3::new(3000.0, 100.0, 0.0)
                }
                _ => Vec3::ZERO,
            };
            scene.camera = look(center, center + Vec3::new(0.3, -0.5, 0.8), 90.0);
            let shape = add(&mut scene, geometry.clone(), matte(reflectance));
            shape.area_light = emission(1.0);
            shape.reverse_orientation = true;
            scene.integrator = path(max_depth);
            let series: f64 = (0..=max_depth)
                .map(|n| f64::from(reflectance).powi(n as i32))
                .sum();
            let rendering = picture(&scene, 64);
            near(
                mean(&rendering),
                series,
                0.004,
                &format!("{name}, depth {max_depth}"),
            );
        }
    }
}

/// A body in an open scene, whose light comes only from a sky: nothing is reflected back.
#[test]
fn a_convex_body_under_a_uniform_sky_has_its_reflectance() {
    for kind in [SamplerKind::Random, SamplerKind::Halton] {
        for geometry in [
            floor(3.0),
            sphere(Vec3::Z * 3.0, 1.0),
            cube(Vec3::Z * 3.0, 1.0),
        ] {
            let mut scene = empty();
            scene.sampler.kind = kind;
            scene.lights.push(sky(2.0));
            add(&mut scene, geometry, matte(0.7));
            for integrator in [
                path(5),
                direct(DirectStrategy::All, 1),
                direct(DirectStrategy::One, 1),
            ] {
                scene.integrator = integrator;
                near(mean(&picture(&scene, 256)), 1.4, 0.005, "sky");
            }
        }
    }
}

fn over_a_plane(light: impl FnOnce(&mut Scene)) -> Scene {
    let mut scene = empty();
    scene.camera = look(Vec3::new(1.0, 0.5, 1.0), Vec3::Z * 3.0, 0.05);
    add(&mut scene, floor(3.0), matte(0.5));
    light(&mut scene);
    scene
}

/// Irradiance over π times the reflectance, whichever way the light is sampled.
#[track_caller]
fn reflects(scene: &mut Scene, irradiance: f64, what: &str) {
    for integrator in [
        path(1),
        direct(DirectStrategy::All, 1),
        direct(DirectStrategy::One, 1),
    ] {
        scene.integrator = integrator;
        let found = mean(&picture(scene, 256));
        near(
            found,
            0.5 * FRAC_1_PI * irradiance,
            0.006,
            &format!("{what}, {integrator:?}"),
        );
    }
}

#[test]
fn a_point_light_falls_off_with_the_squared_distance() {
    let intensity = Rgb::splat(10.0);
    let mut scene = over_a_plane(|scene| {
        let position = Vec3::new(1.0, 0.0, 1.0);
        scene.lights.push(Light::Point {
            position,
            intensity,
        });
    });
    reflects(&mut scene, 10.0 / 5.0 * (2.0 / 5.0_f64.sqrt()), "point");
}

#[test]
fn a_spot_shines_inside_its_cone() {
    let spot = |axis: Vec3| {
        over_a_plane(|scene| {
            scene.lights.push(Light::Spot {
                position: Vec3::ZERO,
                axis: axis.normalize(),
                intensity: Rgb::splat(9.0),
                cos_total_width: 0.8,
                cos_falloff_start: 0.9,
            });
        })
    };
    reflects(&mut spot(Vec3::Z), 1.0, "on the axis");
    reflects(&mut spot(Vec3::X), 0.0, "outside");
}

#[test]
fn distant_light_has_the_cosine_of_its_direction() {
    let mut scene = over_a_plane(|scene| {
        scene.lights.push(Light::Distant {
            to_light: Vec3::new(0.6, 0.0, -0.8),
            radiance: Rgb::splat(3.0),
        });
    });
    reflects(&mut scene, 2.4, "distant");
}

/// Irradiance at distance 1 below the centre of a square of half-width 1.
fn square_form_factor() -> f64 {
    4.0 * FRAC_1_SQRT_2 * FRAC_1_SQRT_2.atan()
}

/// A square of half-width 1 at z = 2 that faces down to the floor at z = 3.
fn square() -> antumbra_scene::Geometry {
    quad(Vec3::new(-1.0, -1.0, 2.0), Vec3::X * 2.0, Vec3::Y * 2.0)
}

#[test]
fn a_square_light_has_its_form_factor() {
    // Seen from the side, below the light.
    let mut scene = over_a_plane(|scene| {
        add(scene, square(), matte(0.0)).area_light = emission(2.0);
    });
    scene.camera = look(Vec3::new(3.0, 0.0, 2.0), Vec3::Z * 3.0, 0.05);
    reflects(&mut scene, 2.0 * square_form_factor(), "square");
}

#[test]
fn a_sphere_light_has_its_solid_angle() {
    let mut scene = over_a_plane(|scene| {
        add(scene, sphere(Vec3::ZERO, 0.8), matte(0.0)).area_light = emission(5.0);
    });
    reflects(&mut scene, 5.0 * PI * (0.8_f64 / 3.0).powi(2), "sphere");
}

#[test]
fn ambient_occlusion() {
    for cosine_sampling in [true, false] {
        let integrator = Integrator::AmbientOcclusion {
            samples: 16,
            cosine_sampling,
            distance: f32::INFINITY,
            open: std::f32::consts::PI,
        };
        let mut scene = over_a_plane(|_| ());
        scene.integrator = integrator;
        near(mean(&picture(&scene, 16)), PI, 0.003, "open plane");

        add(&mut scene, square(), matte(0.5));
        scene.camera = look(Vec3::new(3.0, 0.0, 2.0), Vec3::Z * 3.0, 0.05);
        let open = PI - square_form_factor();
        near(mean(&picture(&scene, 64)), open, 0.01, "under a square");

        let mut scene = over_a_plane(|scene| {
            add(scene, cube(Vec3::Z * 2.5, 4.0), matte(0.5));
        });
        scene.integrator = integrator;
        assert_eq!(mean(&picture(&scene, 4)), 0.0, "a closed room is dark");
        assert_eq!(
            mean(&picture(&empty(), 1)),
            0.0,
            "nothing at all is dark too"
        );
    }
}

/// In a world of radiance 1, bodies that lose nothing cannot be seen.
#[test]
fn mirrors_and_glass_vanish_in_a_uniform_world() {
    let bodies = [
        sphere(Vec3::new(0.1, 0.2, 4.0), 1.0),
        cube(Vec3::new(0.1, 0.2, 4.0), 0.9),
    ];
    let mirror = Material::Mirror(Mirror {
        kr: Rgb::ONE.into(),
    });
    for geometry in bodies {
        for material in [mirror.clone(), glass(1.5), glass(1.0)] {
            for integrator in [path(60), direct(DirectStrategy::All, 12)] {
                let mut scene = empty();
                scene.camera.fov = 40.0;
                scene.lights.push(sky(1.0));
                add(&mut scene, geometry.clone(), material.clone());
                scene.integrator = integrator;
                // A cube traps some light for ever by total reflection; a sphere never does.
                let found = mean(&picture(&scene, 32));
                let tolerance = match geometry {
                    antumbra_scene::Geometry::Sphere(_) => 1e-4,
                    _ => 0.03,
                };
                near(
                    found,
                    1.0,
                    tolerance,
                    &format!("{material:?} {integrator:?}"),
                );
            }
        }
    }
}

#[test]
fn a_mirror_shows_the_light_behind_the_camera() {
    let mut scene = empty();
    add(
        &mut scene,
        floor(2.0),
        Material::Mirror(Mirror {
            kr: Rgb::splat(0.8).into(),
        }),
    );
    let light = quad(Vec3::new(-5.0, -5.0, -3.0), Vec3::X * 10.0, Vec3::Y * 10.0);
    add(&mut scene, light, matte(0.0)).area_light = emission(3.0);
    for (integrator, expected) in [
        (path(1), 2.4),
        (path(0), 0.0),
        (direct(DirectStrategy::All, 2), 2.4),
        (direct(DirectStrategy::All, 1), 0.0),
    ] {
        scene.integrator = integrator;
        near(
            mean(&picture(&scene, 4)),
            expected,
            1e-5,
            &format!("{integrator:?}"),
        );
    }
}

#[test]
fn area_lights_emit_on_the_side_of_their_normal() {
    for (reverse, swaps, two_sided, expected) in [
        (false, false, false, 1.0),
        (true, false, false, 0.0),
        (false, true, false, 0.0),
        (true, true, false, 1.0),
        (true, false, true, 1.0),
    ] {
        let mut scene = empty();
        let shape = add(&mut scene, floor(2.0), matte(0.0));
        shape.area_light =
            emission(1.0).map(|light| antumbra_scene::AreaLight { two_sided, ..light });
        shape.reverse_orientation = reverse;
        shape.transform_swaps_handedness = swaps;
        near(mean(&picture(&scene, 1)), expected, 0.0, "camera");

        // From the light's point of view: a floor beyond the camera receives the irradiance.
        scene.shapes.rotate_left(1);
        let behind = quad(
            Vec3::new(-50.0, -50.0, -3.0),
            Vec3::X * 100.0,
            Vec3::Y * 100.0,
        );
        add(&mut scene, behind, matte(0.5));
        scene.camera = look(Vec3::ZERO, -Vec3::Z, 1.0);
        let found = mean(&picture(&scene, 64));
        assert_eq!(found > 0.4, expected > 0.0, "{found}");
    }
}

/// Lens, filter, crop and scale do not change a uniform world.
#[test]
fn a_uniform_world_is_uniform_through_every_lens_and_filter() {
    let radius = [2.0, 1.2];
    for filter in [
        Filter::Box { radius },
        Filter::Triangle { radius },
        Filter::Gaussian { radius, alpha: 2.0 },
        Filter::Mitchell {
            radius,
            b: 1.0 / 3.0,
            c: 1.0 / 3.0,
        },
        Filter::LanczosSinc { radius, tau: 3.0 },
    ] {
        let mut scene = empty();
        scene.lights.push(sky(1.0));
        scene.camera.lens_radius = 0.5;
        scene.camera.focal_distance = 3.0;
        scene.film.filter = filter;
        scene.film.scale = 2.5;
        scene.film.crop_window = [0.2, 0.9, 0.1, 0.7];
        let rendering = picture(&scene, 16);
        for pixel in rendering.image.pixels() {
            assert!((pixel[0] - 2.5).abs() < 1e-5, "{filter:?} {pixel:?}");
        }
    }
}

/// Three integrators agree on a scene with one light of every kind, rough glass and a glossy floor.
#[test]
fn integrators_agree_on_direct_light() {
    let mut scene = empty();
    scene.camera = look(Vec3::new(0.0, -4.0, 1.0), Vec3::new(0.0, 0.0, 2.5), 60.0);
    let plastic = Material::Plastic(Plastic {
        kd: Rgb::splat(0.4).into(),
        ks: Rgb::splat(0.4).into(),
        roughness: 0.2.into(),
        remap_roughness: true,
    });
    let rough = Material::Glass(Glass {
        kr: Rgb::ONE.into(),
        kt: Rgb::ONE.into(),
        eta: 1.4.into(),
        roughness: [0.3, 0.5].map(Param::Constant),
        remap_roughness: false,
    });
    add(&mut scene, floor(3.0), plastic);
    add(&mut scene, cube(Vec3::new(0.8, 0.0, 2.6), 0.4), matte(0.7));
    add(&mut scene, sphere(Vec3::new(-0.8, 0.0, 2.5), 0.5), rough);
    add(
        &mut scene,
        sphere(Vec3::new(0.0, 1.0, 1.0), 0.3),
        matte(0.2),
    )
    .area_light = emission(5.0);
    let lamp = add(
        &mut scene,
        cube(Vec3::new(-1.0, -1.0, 0.5), 0.2),
        matte(0.1),
    );
    lamp.area_light = emission(4.0).map(|light| antumbra_scene::AreaLight {
        samples: 3,
        ..light
    });
    scene.lights = vec![
        Light::Infinite {
            radiance: Rgb::splat(0.3),
            environment: None,
            samples: 4,
        },
        Light::Point {
            position: Vec3::new(2.0, 0.0, 0.0),
            intensity: Rgb::splat(3.0),
        },
        Light::Distant {
            to_light: Vec3::new(0.5, -0.5, -0.7).normalize(),
            radiance: Rgb::splat(0.7),
        },
        Light::Spot {
            position: Vec3::new(0.0, 0.0, -1.0),
            axis: Vec3::Z,
            intensity: Rgb::splat(8.0),
            cos_total_width: 0.9,
            cos_falloff_start: 0.95,
        },
    ];
    let means = [
        (path(1), 512),
        (direct(DirectStrategy::One, 1), 512),
        (direct(DirectStrategy::All, 1), 64),
    ]
    .map(|(integrator, spp)| {
        scene.integrator = integrator;
        mean(&picture(&scene, spp))
    });
    near(means[1], means[0], 0.01, "one light at random");
    near(means[2], means[0], 0.01, "all lights");
}
