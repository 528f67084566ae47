//! Trees: the same for any number of threads, valid for any input, complete.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::support::{BUILDERS, equals_brute_by, geometry, ways};
use antumbra::recipe::{Builder, Clock, Collapse, Engine};
use antumbra::shapes::Sphere;
use antumbra::{Bvh, Error, Geometry, Primitives, Ray, Recipe, Width};
use antumbra_testkit::sample::{pairs, triples};
use antumbra_testkit::{Rng, mesh};

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let mut rng = Rng::new(21);
    // The first builder divides the work of large nodes, too.
    let [large, small] = [60_000, 12_000].map(|size| mesh::soup(&mut rng, size));
    for builder in BUILDERS {
        let mesh = match builder {
            Builder::BinnedSah => &large,
            _ => &small,
        };
        let options = Recipe::default().builder(builder).surface_rays(Some(5000));
        let built = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            let bvh = pool
                .install(|| Bvh::build(&[geometry(mesh)], &options))
                .expect("indices in range");
            bvh.validate().expect("a valid tree");
            bvh.to_bytes()
        });
        assert!(built[0] == built[1] && built[1] == built[2], "{builder}");
    }
}

/// A clock that stands still but for a second at every look: the steps are timed one after the other, each once.
#[test]
fn steps_are_timed_by_the_clock_of_the_caller() {
    static SECONDS: AtomicU64 = AtomicU64::new(7);
    fn clock() -> Duration {
        Duration::from_secs(SECONDS.fetch_add(1, Ordering::Relaxed))
    }
    // Enough to be learned from.
    let mesh = mesh::soup(&mut Rng::new(25), 1000);
    for collapse in Collapse::ALL {
        let build = |clock: Option<Clock>| {
            let options = Recipe::default().collapse(collapse).clock(clock);
            let bvh = Bvh::build(&[geometry(&mesh)], &options).expect("indices in range");
            bvh.report().times
        };
        let second = Duration::from_secs(1);
        let times = build(Some(clock)).expect("a clock");
        // A step looks at the clock before and after, and may time a part of its own.
        let steps = [
            times.primitives,
            times.tree,
            times.log,
            times.collapse,
            times.order_log,
            times.order,
            times.predict,
        ];
        assert!(
            steps.iter().all(|step| *step >= second),
            "{collapse}: {steps:?}"
        );
        assert_eq!(times.total(), steps.iter().sum());
        assert_eq!(build(None), None);
    }
}

#[test]
fn every_primitive_is_in_the_tree() {
    let mut rng = Rng::new(22);
    for generate in mesh::ALL {
        for size in [0, 1, 2, 7, 8, 9, 100, 3000] {
            let mesh = generate(&mut rng, size.max(1));
            for (builder, width) in pairs(rng.bits(), &BUILDERS, &Width::ALL) {
                let options = Recipe::default()
                    .builder(builder)
                    .engine(Engine::best(width));
                let bvh = Bvh::build(&[geometry(&mesh)], &options).expect("indices in range");
                bvh.validate()
                    .unwrap_or_else(|broken| panic!("{} {size} {builder}: {broken}", mesh.name));
                let report = bvh.report();
                assert_eq!(
                    report.primitives + report.dropped,
                    mesh.indices.len(),
                    "{}",
                    mesh.name
                );
            }
        }
    }
}

#[test]
fn an_empty_scene_is_fine() {
    for geometries in [vec![], vec![Geometry::triangles(vec![], vec![])]] {
        let bvh = Bvh::build(&geometries, &Recipe::default()).expect("nothing to fail");
        bvh.validate().expect("a valid tree");
        assert!(bvh.bounds().is_empty());
        let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
        assert!(!bvh.occluded(&ray));
        assert_eq!(bvh.intersect(&ray), None);
        bvh.batch(&[]).occluded_into(&mut []);
    }
}

/// Exponentially spaced triangles: each SAH split would cut off a few, and the tree would be as deep as
/// the scene is long.
#[test]
fn trees_stay_shallow() {
    let positions: Vec<_> = (0..20_000u32)
        .flat_map(|i| {
            let x = 1.01f32.powi((i % 8000) as i32 - 4000);
            [[x, 0.0, 0.0], [x, x * 0.1, 0.0], [x, 0.0, x * 0.1]]
        })
        .collect();
    let indices: Vec<_> = (0..positions.len() as u32 / 3)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    let geometries = [Geometry::triangles(positions, indices)];
    for builder in BUILDERS {
        let options = Recipe::default()
            .builder(builder)
            .engine(Engine::best(Width::W4));
        let bvh = Bvh::build(&geometries, &options).expect("indices in range");
        bvh.validate().expect("a valid tree");
        assert!(bvh.report().depth <= 94, "{:?}", bvh.report());
    }
}

#[test]
fn leaves_hold_one_kind() {
    let mut rng = Rng::new(23);
    let mesh = mesh::soup(&mut rng, 5);
    let spheres = vec![
        Sphere {
            center: [0.1, 0.0, 0.0],
            radius: 0.2
        };
        3
    ];
    let geometries = [geometry(&mesh), Geometry::spheres(spheres)];
    let bvh = Bvh::build(&geometries, &Recipe::default()).expect("indices in range");
    bvh.validate().expect("a valid tree");
    assert_eq!(bvh.report().leaves, 2);
}

/// Large meshes are copied in pieces; what is wrong with a piece must not get lost.
#[test]
fn unsound_triangles_are_dropped_wherever_they_are() {
    let mut rng = Rng::new(24);
    let mut meshes = [30_000, 10, 20_000].map(|size| mesh::soup(&mut rng, size));
    let whole: usize = meshes.iter().map(|mesh| mesh.indices.len()).sum();
    let mut spoiled = 0;
    for mesh in &mut meshes {
        for triangle in (3..mesh.indices.len()).step_by(4999) {
            match triangle % 3 {
                0 => mesh.positions[3 * triangle + 1][2] = f32::NAN,
                1 => mesh.positions[3 * triangle][0] = f32::NEG_INFINITY,
                _ => mesh.indices[triangle][2] = mesh.indices[triangle][0],
            }
            spoiled += 1;
        }
    }
    let geometries = meshes.each_ref().map(geometry);
    let primitives = Primitives::new(&geometries).expect("indices in range");
    assert!(spoiled > 5);
    assert_eq!(primitives.dropped(), spoiled);
    assert_eq!(primitives.len(), whole - spoiled);
    let bvh = Bvh::build(&geometries, &Recipe::default()).expect("indices in range");
    bvh.validate().expect("a valid tree");
}

#[test]
fn the_first_index_out_of_range_is_named() {
    let mut rng = Rng::new(25);
    let mut meshes = [100, 30_000].map(|size| mesh::soup(&mut rng, size));
    // A NaN triangle before it is no error.
    meshes[0].positions[7][0] = f32::NAN;
    meshes[1].indices[29_000] = [u32::MAX; 3];
    meshes[1].indices[17_000][1] = 90_000;
    let geometries = meshes.each_ref().map(geometry);
    let error = Primitives::new(&geometries).expect_err("an index out of range");
    assert_eq!(
        error,
        Error::IndexOutOfRange {
            geom_id: 1,
            prim_id: 17_000,
            index: 90_000,
            vertices: 90_000
        }
    );
}

#[test]
fn collapses_are_known_by_their_names() {
    for collapse in Collapse::ALL {
        assert_eq!(collapse.name().parse(), Ok(collapse));
    }
    let error = "jenga".parse::<Collapse>().expect_err("no such collapse");
    for collapse in Collapse::ALL {
        assert!(error.to_string().contains(collapse.name()), "{error}");
    }
}

/// What is unfit is dropped before any builder sees it; what is extreme is built over.
#[test]
fn every_builder_takes_any_input() {
    let mut rng = Rng::new(26);
    let (spoiled, _) = mesh::spoiled(&mut rng, 200);
    let soup = mesh::soup(&mut rng, 200);
    let huge = soup.map("huge", |p| p.map(|x| x * 3e37));
    let tiny = soup.map("tiny", |p| p.map(|x| x * 1e-37));
    let flat = soup.map("flat", |[x, y, _]| [x, y, -0.0]);
    let line = soup.map("line", |[x, _, _]| [x, x, x]);
    let coincident = mesh::coincident(&mut rng, 200);
    let meshes = [spoiled, huge, tiny, flat, line, coincident];
    let inputs: Vec<_> = meshes
        .iter()
        .flat_map(|mesh| [0.0, 1.0, 1e19, f32::NAN].map(|size| (mesh, size)))
        .collect();
    let trees = pairs(0, &BUILDERS, &Collapse::ALL);
    for ((mesh, size), (builder, collapse), way) in triples(0, &inputs, &trees, &ways()) {
        let spheres = (0..20).map(|_| Sphere {
            center: rng.point(size),
            radius: 0.1 * size,
        });
        let geometries = [
            geometry(mesh),
            Geometry::spheres(spheres.collect::<Vec<_>>()),
        ];
        let primitives = Primitives::new(&geometries).expect("indices in range");
        let rays: Vec<_> = (0..200)
            .map(|_| Ray::new(rng.point(1.5), rng.direction()))
            .collect();
        equals_brute_by(builder, collapse, way, mesh.name, &primitives, &rays);
    }
}

#[test]
fn builders_are_known_by_their_names() {
    for builder in Builder::ALL {
        assert_eq!(builder.name().parse(), Ok(builder));
    }
    let error = "lego".parse::<Builder>().expect_err("no such builder");
    for builder in Builder::ALL {
        assert!(error.to_string().contains(builder.name()), "{error}");
    }
}
