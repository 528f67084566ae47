//! What must not change a picture, and what must.
//!
//! - threads, orders, collapses, widths, instruction sets, the pre-pass, counting: the same bits
//! - instances are their shapes written out by hand
//! - a crop holds the pixels of the full picture
//! - seed and samples per pixel do matter
//! - figures: what is counted, what is learned
//! - errors and cancelling

mod support;

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use antumbra::{Builder, Collapse, Isa, Order, Width};
use antumbra_render::{Error, Monitor, Options, Phase, Rendering, World, image_hash, render};
use antumbra_scene::{
    DirectStrategy, Filter, Geometry, Instance, Integrator, Light, LightStrategy, Mapping,
    Material, Object, Param, Rgb, SamplerKind, Scene, Shape, Texture, TriangleMesh,
};
use glam::{Affine3, Vec3};
use support::*;

/// Numbers in -1..1, the same on every machine.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

/// A heap of triangles of every material, with vertex normals on some, lit by everything.
fn heap(seed: u64) -> Scene {
    println!("seed {seed}");
    let mut numbers = Numbers(seed);
    let mut scene = empty();
    scene.camera = look(Vec3::new(0.0, 0.0, -6.0), Vec3::ZERO, 35.0);
    scene.film.resolution = [40, 27];
    let plastic = Material::Plastic {
        kd: Rgb::splat(0.3).into(),
        ks: Rgb::splat(0.3).into(),
        roughness: 0.1.into(),
        remap_roughness: true,
    };
    let rough = Material::Glass {
        kr: Rgb::ONE.into(),
        kt: Rgb::splat(0.9).into(),
        eta: 1.5.into(),
        roughness: [0.2, 0.1].map(Param::Constant),
        remap_roughness: false,
    };
    let mirror = Material::Mirror {
        kr: Rgb::splat(0.9).into(),
    };
    let oren_nayar = Material::Matte {
        kd: Rgb::new(0.2, 0.5, 0.8).into(),
        sigma: 20.0.into(),
    };
    let mut materials = vec![matte(0.6), oren_nayar, plastic, rough, mirror, glass(1.3)];
    materials.extend(layered());
    for material in materials {
        let mut mesh = TriangleMesh::default();
        for triangle in 0..60 {
            let center = numbers.vector() * 2.0;
            for _ in 0..3 {
                mesh.positions
                    .push((center + numbers.vector() * 0.4).to_array());
                mesh.normals.push(numbers.vector().normalize());
            }
            mesh.indices
                .push([0, 1, 2].map(|corner| 3 * triangle + corner));
        }
        if matches!(material, Material::Plastic { .. } | Material::Mirror { .. }) {
            mesh.normals.clear();
        }
        add(&mut scene, Geometry::Mesh(Arc::new(mesh)), material);
    }
    add(&mut scene, floor(3.0), matte(0.5));
    let lamp = quad(Vec3::new(-1.0, 3.0, -1.0), Vec3::X, Vec3::Z);
    add(&mut scene, lamp, matte(0.0)).area_light = emission(20.0);
    add(
        &mut scene,
        sphere(Vec3::new(2.0, -2.0, 0.0), 0.5),
        matte(0.2),
    )
    .area_light = emission(5.0);
    scene.lights = vec![
        sky(0.2),
        Light::Point {
            position: Vec3::new(0.0, 0.0, -5.0),
            intensity: Rgb::splat(4.0),
        },
    ];
    scene
}

/// Materials whose lobes stand side by side, and one that is not there.
fn layered() -> [Material; 5] {
    let grey = |value: f32| Param::Constant(Rgb::splat(value));
    let roughness = [0.1, 0.3].map(Param::Constant);
    let metal = Material::Metal {
        eta: Rgb::new(0.2, 0.9, 1.1).into(),
        k: Rgb::new(3.9, 2.5, 2.1).into(),
        roughness: roughness.clone(),
        remap_roughness: true,
    };
    let uber = Material::Uber {
        kd: grey(0.3),
        ks: grey(0.2),
        kr: grey(0.2),
        kt: grey(0.3),
        roughness: roughness.clone(),
        opacity: grey(0.6),
        eta: 1.4.into(),
        remap_roughness: true,
    };
    let substrate = Material::Substrate {
        kd: grey(0.4),
        ks: grey(0.3),
        roughness,
        remap_roughness: true,
    };
    let translucent = Material::Translucent {
        kd: grey(0.4),
        ks: grey(0.3),
        reflect: grey(0.5),
        transmit: grey(0.5),
        roughness: 0.2.into(),
        remap_roughness: true,
    };
    let mixed = Material::Mix {
        materials: [metal, translucent].map(Arc::new),
        amount: grey(0.3),
    };
    // What their textures are is the business of `materials.rs`.
    let bumped = Material::Bumped {
        material: Arc::new(substrate.clone()),
        height: Param::Texture(Arc::new(Texture::Bilerp {
            corners: [0.0, 0.1, 0.0, 0.3],
            mapping: Mapping::default(),
        })),
    };
    [uber, substrate, mixed, bumped, Material::None]
}

fn integrators() -> Vec<Integrator> {
    let direct = |strategy| Integrator::DirectLighting {
        strategy,
        max_depth: 5,
    };
    vec![
        Integrator::Path {
            max_depth: 7,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Spatial,
        },
        direct(DirectStrategy::All),
        direct(DirectStrategy::One),
        Integrator::AmbientOcclusion {
            samples: 5,
            cosine_sampling: true,
        },
    ]
}

fn options() -> Options {
    Options {
        spp: Some(9),
        ..Options::default()
    }
}

#[test]
fn nothing_but_scene_samples_and_seed_changes_a_picture() {
    for (number, integrator) in integrators().into_iter().enumerate() {
        let mut scene = heap(0x9e37 + number as u64);
        scene.integrator = integrator;
        scene.film.filter = if number == 0 {
            Filter::Mitchell {
                radius: [2.0, 1.5],
                b: 0.3,
                c: 0.3,
            }
        } else {
            Filter::default()
        };
        scene.sampler.kind = [SamplerKind::Random, SamplerKind::Sobol][number % 2];
        let world = World::new(&scene).expect("a valid scene");
        let run = |options: Options| render(&world, &options, &()).expect("nothing stops it");
        let reference = run(Options {
            order: Order::Simple,
            collapse: Collapse::Area,
            width: Width::W4,
            threads: NonZeroUsize::new(1),
            ..options()
        });
        let same = |what: &str, options: Options| {
            let rendering = run(options);
            assert_eq!(rendering.image, reference.image, "{integrator:?}: {what}");
            assert_eq!(rendering.stats.image_hash, reference.stats.image_hash);
            assert_eq!(
                rendering.stats.shadow_rays, reference.stats.shadow_rays,
                "{what}"
            );
            assert_eq!(
                rendering.stats.closest_rays, reference.stats.closest_rays,
                "{what}"
            );
            assert_eq!(
                rendering.stats.occluded_rays, reference.stats.occluded_rays,
                "{what}"
            );
        };
        for threads in [2, 3, 7] {
            let threads = NonZeroUsize::new(threads);
            same(
                "threads",
                Options {
                    threads,
                    ..options()
                },
            );
        }
        for collapse in Collapse::ALL {
            for order in Order::ALL {
                same(
                    &format!("{collapse} {order}"),
                    Options {
                        order,
                        collapse,
                        ..options()
                    },
                );
            }
            for width in Width::ALL {
                for isa in Isa::available() {
                    same(
                        &format!("{collapse} {width:?} {isa:?}"),
                        Options {
                            width,
                            isa,
                            collapse,
                            ..options()
                        },
                    );
                }
            }
            for log_share in [0.0, 0.1, 1.0] {
                same(
                    &format!("{collapse}, log share {log_share}"),
                    Options {
                        log_share,
                        collapse,
                        ..options()
                    },
                );
            }
        }
        for (turn, builder) in Builder::ALL.into_iter().enumerate() {
            for (order, log_share) in [
                (Order::Simple, 0.1),
                (Order::SortPlus, 0.0),
                (Order::SortPlus, 0.2),
            ] {
                let collapse = Collapse::ALL[(number + turn) % Collapse::ALL.len()];
                same(
                    &format!("{builder} {collapse} {order} {log_share}"),
                    Options {
                        builder,
                        collapse,
                        order,
                        log_share,
                        ..options()
                    },
                );
            }
        }
        let measured = Options {
            count: true,
            cost_map: true,
            standard_error: true,
            ..options()
        };
        same("measuring", measured);
    }
}

#[test]
fn a_crop_holds_the_pixels_of_the_full_picture() {
    for integrator in integrators() {
        let mut scene = heap(77);
        scene.integrator = integrator;
        let full = picture_with(&scene, &options()).image;
        scene.film.crop_window = [0.26, 0.9, 0.33, 0.71];
        let crop = picture_with(&scene, &options()).image;
        let window = crop.window();
        assert_eq!(
            (window.x0, window.x1, window.y0, window.y1),
            (11, 36, 9, 20)
        );
        for y in window.y0..window.y1 {
            for x in window.x0..window.x1 {
                assert_eq!(crop.get(x, y), full.get(x, y), "{integrator:?} ({x}, {y})");
            }
        }
    }
}

#[test]
fn seed_and_samples_change_a_picture_and_the_same_seed_repeats_it() {
    let scene = heap(5);
    let hash = |seed, spp| {
        let options = Options {
            seed,
            spp: Some(spp),
            ..options()
        };
        image_hash(&picture_with(&scene, &options).image)
    };
    assert_eq!(hash(1, 4), hash(1, 4));
    assert_ne!(hash(1, 4), hash(2, 4));
    assert_ne!(hash(1, 4), hash(1, 5));
}

#[test]
fn the_standard_error_is_the_spread_over_seeds() {
    let mut scene = heap(6);
    scene.sampler.kind = SamplerKind::Random;
    scene.film.resolution = [12, 12];
    let runs: Vec<Rendering> = (0..24)
        .map(|seed| {
            picture_with(
                &scene,
                &Options {
                    seed,
                    spp: Some(64),
                    standard_error: true,
                    ..options()
                },
            )
        })
        .collect();
    let (mut spread, mut claimed) = (0.0, 0.0);
    for pixel in 0..144 {
        let values: Vec<f64> = runs
            .iter()
            .map(|r| f64::from(r.image.pixels()[pixel][1]))
            .collect();
        let mean = values.iter().sum::<f64>() / 24.0;
        spread += values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 23.0;
        let error =
            |r: &Rendering| r.standard_error.as_ref().expect("asked for").pixels()[pixel][1];
        claimed += runs
            .iter()
            .map(|r| f64::from(error(r)).powi(2))
            .sum::<f64>()
            / 24.0;
    }
    near(claimed, spread, 0.25, "variance");
}

#[test]
fn figures_of_orders_that_learn() {
    let scene = heap(8);
    let rendering = picture_with(
        &scene,
        &Options {
            count: true,
            // Equation (1) is what this order minimises: what it predicts falls.
            order: Order::SortPlus,
            ..options()
        },
    );
    let stats = &rendering.stats;
    assert!(stats.logged_rays > 0 && stats.logged_rays < stats.shadow_rays / 2);
    for value in [
        stats.node_tests_before,
        stats.prim_tests_before,
        stats.node_tests_after,
        stats.prim_tests_after,
        stats.predicted_cost_before,
        stats.predicted_cost_after,
    ] {
        assert!(value.is_some_and(|v| v > 0.0 && v.is_finite()), "{stats:?}");
    }
    assert!(stats.predicted_cost_after <= stats.predicted_cost_before);
    assert!(stats.shadow_share() > 0.0 && stats.shadow_share() < 1.0);
    let parts = stats.split.named();
    assert!(parts.iter().all(|(_, seconds)| *seconds > 0.0), "{parts:?}");

    // The log is a sum over workers: its figures do not depend on their number.
    let threads = NonZeroUsize::new(3);
    let again = picture_with(
        &scene,
        &Options {
            count: true,
            order: Order::SortPlus,
            threads,
            ..options()
        },
    )
    .stats;
    assert_eq!(again.threads, 3);
    assert_eq!(again.logged_rays, stats.logged_rays);
    assert_eq!(again.node_tests_before, stats.node_tests_before);
    assert_eq!(again.node_tests_after, stats.node_tests_after);
    assert_eq!(again.predicted_cost_after, stats.predicted_cost_after);
}

#[test]
fn figures_of_orders_that_do_not_learn() {
    let scene = heap(9);
    let order = Order::Sato;
    let counted = picture_with(
        &scene,
        &Options {
            order,
            count: true,
            ..options()
        },
    )
    .stats;
    assert_eq!(counted.logged_rays, 0);
    assert!(counted.node_tests_before.is_some());
    assert_eq!(counted.node_tests_before, counted.node_tests_after);
    assert_eq!(counted.prim_tests_before, counted.prim_tests_after);
    assert_eq!(counted.predicted_cost_before, None);
    let plain = picture_with(&scene, &Options { order, ..options() }).stats;
    assert_eq!(plain.node_tests_after, None);
    assert_eq!(plain.node_tests_before, None);
}

/// The map is the mean over each pixel's rays; weighted by rays it is the total, which a picture of one pixel
/// shows.
#[test]
fn cost_maps_hold_the_mean_cost_of_a_shadow_ray() {
    let mut scene = heap(10);
    let options = Options {
        order: Order::Simple,
        cost_map: true,
        ..options()
    };
    let rendering = picture_with(&scene, &options);
    let map = rendering.cost_map.expect("asked for");
    assert_eq!(map.len(), 40 * 27);
    assert!(map.iter().all(|cost| cost.is_finite()) && map.iter().any(|&cost| cost > 0.0));
    scene.film.resolution = [1, 1];
    let single = picture_with(&scene, &options);
    let map = single.cost_map.expect("asked for");
    let stats = single.stats;
    let total = stats.node_tests_after.expect("counted") + stats.prim_tests_after.expect("counted");
    near(f64::from(map[0]), total, 1e-6, "one pixel");
}

#[test]
fn degenerate_scenes_render() {
    let mut nothing = empty();
    let rendering = picture(&nothing, 2);
    assert_eq!(mean(&rendering), 0.0);
    assert_eq!(rendering.stats.shadow_share(), 0.0);
    nothing.lights.push(sky(1.0));
    assert_eq!(mean(&picture(&nothing, 2)), 1.0);
    let mut broken = heap(11);
    let mesh = TriangleMesh {
        positions: vec![[f32::NAN; 3], [0.0; 3], [1.0; 3], [f32::INFINITY; 3]],
        indices: vec![[0, 1, 2], [1, 1, 2], [1, 2, 3]],
        ..TriangleMesh::default()
    };
    add(&mut broken, Geometry::Mesh(Arc::new(mesh)), matte(0.5)).area_light = emission(9.0);
    let stats = picture_with(&broken, &options()).stats;
    assert!(stats.build.dropped >= 2, "{:?}", stats.build);
}

/// A shape mirrored along x and moved, without the library's help; exact but for the sums, which are rounded once.
fn mirrored(shape: &Shape, by: Vec3) -> Shape {
    let place = |p: Vec3| Vec3::new(-p.x, p.y, p.z) + by;
    let mut shape = shape.clone();
    shape.transform_swaps_handedness ^= true;
    match &mut shape.geometry {
        Geometry::Mesh(mesh) => {
            let mesh = Arc::make_mut(mesh);
            for position in &mut mesh.positions {
                *position = place(Vec3::from(*position)).to_array();
            }
            for normal in &mut mesh.normals {
                // Scaled to unit length once more, as whatever moves normals does.
                let unit = normal.as_dvec3().normalize().as_vec3();
                *normal = Vec3::new(-unit.x, unit.y, unit.z);
            }
        }
        Geometry::Sphere(sphere) => sphere.center = place(sphere.center),
    }
    shape
}

/// Rays are moved to the space of an object instead of the object to the world, which rounds differently: here and
/// there a path takes another way. Nearly everywhere the two pictures are the same up to rounding.
#[test]
fn instances_are_their_shapes_written_out() {
    let by = Vec3::new(0.5, 0.25, 1.0);
    for integrator in integrators() {
        let mut by_hand = heap(21);
        by_hand.integrator = integrator;
        let mut instanced = by_hand.clone();
        let standing = instanced.shapes.split_off(6);
        let heap = Object {
            name: "heap".into(),
            shapes: std::mem::replace(&mut instanced.shapes, standing),
        };
        let mirror = Affine3::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        instanced.instances = [
            Affine3::IDENTITY,
            Affine3::from_translation(by) * mirror,
            Affine3::from_translation(by * 2.0) * mirror,
        ]
        .map(|world_from_object| Instance {
            object: 1,
            world_from_object,
        })
        .to_vec();
        by_hand.shapes.rotate_left(6);
        for by in [by, by * 2.0] {
            let moved: Vec<_> = heap.shapes.iter().map(|s| mirrored(s, by)).collect();
            by_hand.shapes.extend(moved);
        }
        instanced.objects = vec![Object::default(), heap];
        let hashes = Builder::ALL.map(|builder| {
            let options = Options {
                builder,
                ..options()
            };
            picture_with(&instanced, &options).stats.image_hash
        });
        assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
        let [instanced, by_hand] =
            [instanced, by_hand].map(|scene| picture_with(&scene, &options()));
        let pairs = instanced.image.pixels().iter().zip(by_hand.image.pixels());
        let same = pairs.filter(|(a, b)| {
            let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-3 * a.abs().max(b.abs());
            a.iter().zip(b.iter()).all(close)
        });
        let share = same.count() as f64 / instanced.image.pixels().len() as f64;
        assert!(share > 0.9, "{integrator:?}: {share}");
        let [a, b] = [&instanced, &by_hand].map(mean);
        assert!((a / b - 1.0).abs() < 0.01, "{integrator:?}: {a} {b}");
        assert_eq!(instanced.stats.triangles, by_hand.stats.triangles);
        assert!(mean(&instanced) > 0.0);
    }
}

#[test]
fn what_cannot_be_rendered_is_refused() {
    let refused = |change: &dyn Fn(&mut Scene)| {
        let mut scene = heap(12);
        change(&mut scene);
        World::new(&scene).expect_err("refused")
    };
    assert!(matches!(
        refused(&|s| s.shapes[0].material = 99),
        Error::Material { material: 99, .. }
    ));
    assert!(matches!(
        refused(&|s| s.film.resolution = [0, 4]),
        Error::EmptyPicture { .. }
    ));
    assert!(matches!(
        refused(&|s| s.film.crop_window = [0.5, 0.5, 0.0, 1.0]),
        Error::EmptyPicture { .. }
    ));
    assert!(matches!(
        refused(&|s| s.film.filter = Filter::Box { radius: [0.0, 1.0] }),
        Error::FilterRadius { .. }
    ));
    assert!(matches!(
        refused(&|s| s.sampler.pixel_samples = 0),
        Error::NoSamples { .. }
    ));
    assert!(matches!(
        refused(&|s| s.camera.fov = 180.0),
        Error::FieldOfView { .. }
    ));
    assert!(matches!(
        refused(&|s| s.instances.push(Instance {
            object: 3,
            world_from_object: Affine3::IDENTITY,
        })),
        Error::Geometry(antumbra::Error::ObjectOutOfRange { object: 3, .. })
    ));
    let mesh = |indices, normals| TriangleMesh {
        positions: vec![[0.0; 3]; 3],
        indices: vec![indices],
        normals,
        ..TriangleMesh::default()
    };
    let normals = mesh([0, 1, 2], vec![Vec3::Z]);
    assert!(matches!(
        refused(&|s| s.shapes[0].geometry = Geometry::Mesh(Arc::new(normals.clone()))),
        Error::VertexAttribute {
            found: 1,
            positions: 3,
            ..
        }
    ));
    let index = mesh([0, 1, 7], Vec::new());
    assert!(matches!(
        refused(&|s| s.shapes[0].geometry = Geometry::Mesh(Arc::new(index.clone()))),
        Error::Geometry(_)
    ));
    let world = World::new(&heap(12)).expect("a valid scene");
    let error = |options: Options| render(&world, &options, &()).expect_err("refused");
    assert!(matches!(
        error(Options {
            spp: Some(0),
            ..options()
        }),
        Error::NoSamples { .. }
    ));
    let log_share = f64::NAN;
    assert!(matches!(
        error(Options {
            log_share,
            ..options()
        }),
        Error::LogShare { .. }
    ));
}

#[test]
fn any_share_may_be_learned_from() {
    let scene = heap(14);
    let stats_of = |collapse, log_share| {
        let options = Options {
            log_share,
            collapse,
            count: true,
            ..options()
        };
        picture_with(&scene, &options).stats
    };
    // Learned collapses keep a bounded sample of the rays, and so do builders that are driven by rays.
    let learned = stats_of(Collapse::Learned, 1.0);
    assert_eq!(learned.logged_rays, learned.shadow_rays.min(1 << 14));
    let driven = Options {
        log_share: 1.0,
        builder: Builder::Srdh,
        collapse: Collapse::Area,
        ..options()
    };
    let driven = picture_with(&scene, &driven).stats;
    assert_eq!(driven.logged_rays, driven.shadow_rays.min(1 << 14));
    let nothing = stats_of(Collapse::Learned, 0.0);
    assert_eq!(nothing.logged_rays, 0);
    assert_eq!(nothing.predicted_cost_after, None);

    let stats = |log_share| stats_of(Collapse::Area, log_share);
    let all = stats(1.0);
    assert_eq!(all.logged_rays, all.shadow_rays);
    assert!(all.node_tests_before.is_some() && all.predicted_cost_after.is_some());
    assert_eq!(all.node_tests_after, None);
    let half = stats(0.5);
    let share = half.logged_rays as f64 / half.shadow_rays as f64;
    assert!((share - 0.5).abs() < 0.05, "{share}");
    assert_eq!(stats(0.0).logged_rays, 0);
}

/// Stops when the picture is done.
#[derive(Default)]
struct TooLate(std::sync::atomic::AtomicBool);

impl Monitor for TooLate {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        self.0
            .fetch_or(phase == Phase::Render && done == total, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

#[test]
fn whoever_stops_after_the_last_tile_gets_the_picture() {
    let world = World::new(&heap(15)).expect("a valid scene");
    let monitor = TooLate::default();
    let late = render(&world, &options(), &monitor).expect("nothing was left to do");
    assert!(monitor.cancelled());
    let reference = render(&world, &options(), &()).expect("nothing stops it");
    assert_eq!(late.image, reference.image);
}

/// Counts progress and stops after so many questions.
struct Patience {
    left: AtomicU64,
    steps: AtomicU64,
}

impl Monitor for Patience {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        assert!(done <= total, "{phase:?}");
        self.steps.fetch_add(1, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.left
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                left.checked_sub(1)
            })
            .is_err()
    }
}

#[test]
fn a_monitor_can_stop_a_rendering_at_any_time() {
    let world = World::new(&heap(13)).expect("a valid scene");
    for left in [0, 1, 2, 5] {
        let monitor = Patience {
            left: left.into(),
            steps: 0.into(),
        };
        let outcome = render(&world, &options(), &monitor);
        assert!(matches!(outcome, Err(Error::Cancelled)), "after {left}");
    }
    let monitor = Patience {
        left: u64::MAX.into(),
        steps: 0.into(),
    };
    render(&world, &options(), &monitor).expect("never stopped");
    assert!(monitor.steps.load(Ordering::Relaxed) > 6);
}
