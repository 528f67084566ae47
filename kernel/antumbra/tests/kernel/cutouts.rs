//! Partly transparent triangles: what counts as a hit, and that every tree agrees.

use std::sync::Arc;

use antumbra::cutout::{Candidate, Coverage, Opacity, Pattern, QueryKind};
use antumbra::parts::{BinaryTree, Learning, LogKind, Steps, TreeLog};
use antumbra::recipe::{Builder, Collapse, Engine};
use antumbra::shapes::Sphere;
use antumbra::{Brute, Bvh, Geometry, Instance, Primitives, Ray, Width};
use antumbra_testkit::sample::pairs;
use antumbra_testkit::{Mesh, Rng, mesh, rays};
use proptest::prelude::*;

use crate::support::{
    bits, brute, config, cutouts, equals_brute, geometry, kernel_rays, square, upwards, ways,
};

/// Fields of a checkerboard over (u, v) per unit.
const FIELDS: f64 = 3.0;

/// Which field of the checkerboard a point lies on, and how far it is from the next one.
fn field(u: f64, v: f64) -> (bool, f64) {
    // The last field is closed.
    let [u, v] = [u, v].map(|x| (x * FIELDS).min(FIELDS - 1e-9));
    let odd = (u.floor() + v.floor()).rem_euclid(2.0) == 1.0;
    let distance = |x: f64| (x - x.round()).abs();
    (odd, distance(u).min(distance(v)))
}

/// Some triangles opaque, some clear, the others a checkerboard: no chance involved.
#[derive(Debug)]
struct Checker {
    /// Whether it tells what it knows of whole triangles.
    tells: bool,
}

impl Opacity for Checker {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        match candidate.prim_id % 5 {
            0 => 1.0,
            1 => 0.0,
            _ if field(f64::from(candidate.u), f64::from(candidate.v)).0 => 1.0,
            _ => 0.0,
        }
    }

    fn coverage(&self, prim_id: u32, corners: &[[f32; 2]; 3]) -> Coverage {
        match prim_id % 5 {
            _ if !self.tells => Coverage::Unknown,
            0 => Coverage::Opaque,
            1 => Coverage::Clear,
            _ => {
                // Whole numbers between the corners of a box around them, a hair wider.
                let crosses = |axis: usize| {
                    let fields = corners.map(|corner| f64::from(corner[axis]) * FIELDS);
                    let least = fields.iter().copied().fold(f64::INFINITY, f64::min) - 1e-5;
                    let most = fields.iter().copied().fold(0.0, f64::max) + 1e-5;
                    // Below 0 and above 1 there is no triangle.
                    least.max(0.0).floor() != most.min(FIELDS - 1e-9).floor()
                };
                let [[u0, v0], [u1, v1], [u2, v2]] = corners.map(|corner| corner.map(f64::from));
                match field((u0 + u1 + u2) / 3.0, (v0 + v1 + v2) / 3.0) {
                    _ if crosses(0) || crosses(1) => Coverage::Mixed,
                    (true, _) => Coverage::Opaque,
                    (false, _) => Coverage::Clear,
                }
            }
        }
    }

    /// All checkerboards look alike, those of other meshes and objects too.
    fn pattern(&self, prim_id: u32) -> Option<Pattern> {
        let kind = prim_id % 5;
        self.tells.then_some(Pattern([kind.min(2).into(), 0, 0, 0]))
    }
}

/// Anything there can be: constant, varying, out of range, NaN, different for the two queries.
#[derive(Debug)]
struct Wild;

impl Opacity for Wild {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        let seen = candidate.query == QueryKind::Intersect;
        match candidate.prim_id % 8 {
            0 => 0.5,
            1 => candidate.u,
            2 => 1.0 - candidate.v,
            3 => f32::NAN,
            4 => -1.0,
            5 => f32::INFINITY,
            6 if seen => 1.0,
            6 => 0.0,
            _ if seen => 0.2,
            _ => 0.9,
        }
    }
}

/// The same opacity everywhere; it may or may not say so of whole triangles.
#[derive(Debug)]
struct Uniform {
    opacity: f32,
    coverage: Coverage,
}

impl Uniform {
    fn new(opacity: f32) -> Arc<Self> {
        let coverage = Coverage::Unknown;
        Arc::new(Self { opacity, coverage })
    }
}

impl Opacity for Uniform {
    fn opacity(&self, _: &Candidate) -> f32 {
        self.opacity
    }

    fn coverage(&self, _: u32, _: &[[f32; 2]; 3]) -> Coverage {
        self.coverage
    }
}

fn count_occluded(geometries: &[Geometry<'_>], rays: &[Ray]) -> usize {
    let mut occluded = vec![false; rays.len()];
    let bvh = Bvh::build(geometries, &Default::default()).expect("indices in range");
    bvh.batch(rays).occluded_into(&mut occluded);
    occluded.iter().filter(|occluded| **occluded).count()
}

proptest! {
    #![proptest_config(config(4))]

    #[test]
    fn every_tree_equals_brute_force(seed: u64) {
        every_tree(seed);
    }
}

/// A sliver whose distance single precision tells far from where it is: trees whose leaves had parts of it once missed it.
#[test]
fn slivers_are_hit_in_every_tree() {
    every_tree(585059203327856445);
}

/// Everything there can be, in every tree.
fn every_tree(seed: u64) {
    let mut rng = Rng::new(seed);
    for generate in mesh::ALL {
        let size = 1 + rng.below(150);
        let (opaque, checkered) = (generate(&mut rng, size / 2), generate(&mut rng, size));
        let wild = mesh::soup(&mut rng, size);
        let spheres: Vec<_> = (0..rng.below(9))
            .map(|_| Sphere {
                center: rng.point(1.0),
                radius: rng.unit() * 0.2,
            })
            .collect();
        let rays = kernel_rays(&rays::around(&mut rng, &checkered, 150));
        let tells = rng.below(2) == 0;
        let geometries = [
            cutouts(&checkered, Arc::new(Checker { tells })),
            geometry(&opaque),
            Geometry::spheres(spheres),
            cutouts(&wild, Arc::new(Wild)),
        ];
        let primitives = Primitives::new(&geometries).expect("indices in range");
        let name = format!("seed {seed}: {} with holes", checkered.name);
        equals_brute(&name, &primitives, &rays);
    }
}

/// Collapses learned from a log of rays that the cut-outs stop or let through.
#[test]
fn learned_trees_equal_brute_force() {
    let seed = 41;
    let mut rng = Rng::new(seed);
    let (opaque, wild) = (mesh::soup(&mut rng, 300), mesh::soup(&mut rng, 600));
    let checkered = mesh::bumpy_grid(&mut rng, 300);
    let geometries = [
        cutouts(&wild, Arc::new(Wild)),
        geometry(&opaque),
        cutouts(&checkered, Arc::new(Checker { tells: true })),
    ];
    let primitives = Primitives::new(&geometries).expect("indices in range");
    let brute = Brute::new(&primitives);
    let rays = kernel_rays(&rays::around(&mut rng, &opaque, 400));
    for (builder, engine) in pairs(seed, &Builder::ALL, &ways()) {
        let tree = BinaryTree::build(&primitives, builder);
        let mut log = TreeLog::new(&tree);
        log.add(&primitives, &tree, &rays, 1.0);
        let learning = Learning::default();
        let bvh = Bvh::collapse_logged(&primitives, &tree, &log, &learning, engine);
        bvh.validate().expect("a valid tree");
        let mut occluded = vec![false; rays.len()];
        let mut hits = vec![None; rays.len()];
        bvh.batch(&rays).occluded_into(&mut occluded);
        bvh.batch(&rays).intersect_into(&mut hits);
        for (index, ray) in rays.iter().enumerate() {
            let place = format!("seed {seed} {builder} {engine:?} {ray:?}");
            assert_eq!(occluded[index], brute.occluded(ray), "{place}");
            assert_eq!(bits(hits[index]), bits(brute.intersect(ray)), "{place}");
        }
    }
}

/// Cut-outs in objects that are placed several times, each object with filters of its own.
#[test]
fn cutouts_in_instances_equal_brute_force() {
    let seed = 50;
    let mut rng = Rng::new(seed);
    let meshes: Vec<_> = (0..4).map(|_| mesh::soup(&mut rng, 60)).collect();
    let world = [geometry(&meshes[0]), cutouts(&meshes[1], Uniform::new(0.3))];
    let objects = [
        vec![
            cutouts(&meshes[2], Arc::new(Checker { tells: true })),
            geometry(&meshes[0]),
        ],
        vec![cutouts(&meshes[3], Arc::new(Wild))],
    ];
    let instances: Vec<_> = (0..12)
        .map(|index| {
            Instance::new(
                index % 2,
                core::array::from_fn(|_| core::array::from_fn(|_| rng.range(-1.0, 1.0))),
            )
        })
        .collect();
    let primitives =
        Primitives::with_instances(&world, &objects, &instances).expect("indices in range");
    let rays = kernel_rays(&rays::around(&mut rng, &meshes[0], 300));
    equals_brute("cut-outs in instances", &primitives, &rays);
}

/// A ray decides for every instance anew, even of the same object.
#[test]
fn instances_stop_rays_independently() {
    const COUNT: usize = 20_000;
    let rays = upwards(&mut Rng::new(51), COUNT);
    let veil = square(0.0);
    let objects = [vec![cutouts(&veil, Uniform::new(0.5))]];
    // All at the same place, so that the ray is the same in all of them.
    let at = |z: f32| {
        Instance::new(
            0,
            [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, z],
            ],
        )
    };
    let instances = [at(1.0), at(1.0), at(1.0)];
    let primitives = Primitives::with_instances(&[], &objects, &instances).expect("one object");
    let tree = BinaryTree::build(&primitives, Builder::default());
    let bvh = Bvh::collapse(&primitives, &tree, Collapse::Area, Engine::best(Width::W8));
    let mut occluded = vec![false; COUNT];
    bvh.batch(&rays).occluded_into(&mut occluded);
    let found = occluded.iter().filter(|occluded| **occluded).count() as f64;
    let (mean, deviation) = (0.875 * COUNT as f64, (0.875 * 0.125 * COUNT as f64).sqrt());
    assert!(
        (found - mean).abs() < 4.5 * deviation,
        "{found} instead of {mean}"
    );
}

/// A naive loop in double precision that knows nothing of the kernel; it cannot tell what happens within a hair
/// of an edge, of a field's border or of another hit, so such rays are left out.
#[test]
fn checkerboards_are_hit_where_a_naive_loop_says() {
    const HAIR: f64 = 1e-3;
    let seed = 42;
    let mut rng = Rng::new(seed);
    // Large triangles, so that most rays meet several.
    let mesh = Mesh {
        name: "large triangles",
        positions: (0..120).map(|_| rng.point(1.0)).collect(),
        indices: (0..40)
            .map(|index| [0, 40, 80].map(|first| first + index))
            .collect(),
    };
    let rays: Vec<_> = (0..4000)
        .map(|_| Ray::new(rng.point(1.5), rng.direction()))
        .collect();
    let mut compared = [0; 2];
    for tells in [false, true] {
        let brute = brute(&[cutouts(&mesh, Arc::new(Checker { tells }))]);
        'rays: for ray in &rays {
            let mut nearest: Option<(f64, u32)> = None;
            for prim_id in 0..mesh.indices.len() as u32 {
                let Some((t, u, v)) = moeller_trumbore(&mesh.triangle(prim_id as usize), ray)
                else {
                    continue;
                };
                let in_doubt = |x: f64| x.abs() < HAIR;
                if in_doubt(u) || in_doubt(v) || in_doubt(1.0 - u - v) || in_doubt(t) {
                    continue 'rays;
                }
                if u < 0.0 || v < 0.0 || u + v > 1.0 || t < 0.0 {
                    continue;
                }
                let opaque = match prim_id % 5 {
                    0 => true,
                    1 => false,
                    _ => {
                        let (odd, distance) = field(u, v);
                        if distance < HAIR {
                            continue 'rays;
                        }
                        odd
                    }
                };
                if opaque {
                    match nearest {
                        Some((best, _)) if (t - best).abs() < HAIR => continue 'rays,
                        Some((best, _)) if best < t => {}
                        _ => nearest = Some((t, prim_id)),
                    }
                }
            }
            let hit = brute.intersect(ray);
            let place = format!("seed {seed} {ray:?}");
            assert_eq!(
                hit.map(|hit| hit.prim_id),
                nearest.map(|(_, id)| id),
                "{place}"
            );
            assert_eq!(brute.occluded(ray), nearest.is_some(), "{place}");
            compared[usize::from(nearest.is_some())] += 1;
        }
    }
    assert!(compared.iter().all(|&count| count > 1000), "{compared:?}");
}

/// Möller and Trumbore (1997), for either side: `(t, u, v)` where the ray's line meets the triangle's plane.
fn moeller_trumbore(corners: &[[f32; 3]; 3], ray: &Ray) -> Option<(f64, f64, f64)> {
    let [a, b, c] = corners.map(|corner| corner.map(f64::from));
    let (org, dir) = (ray.org.map(f64::from), ray.dir.map(f64::from));
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let (e, f, s) = (minus(b, a), minus(c, a), minus(org, a));
    let p = cross(dir, f);
    let det = dot(e, p);
    if det.abs() < 1e-9 {
        return None;
    }
    let q = cross(s, e);
    Some((dot(f, q) / det, dot(s, p) / det, dot(dir, q) / det))
}

/// Opacity 1 is as no filter and opacity 0 as no mesh, bit for bit, whether or not the filter says so beforehand.
#[test]
fn all_opaque_is_no_filter_and_all_clear_is_no_mesh() {
    let mut rng = Rng::new(43);
    let (mesh, other) = (mesh::soup(&mut rng, 200), mesh::bumpy_grid(&mut rng, 100));
    let count = mesh.indices.len();
    let all = count + other.indices.len();
    let rays = kernel_rays(&rays::around(&mut rng, &mesh, 500));
    let empty = mesh::empty(&mut rng, 0);
    for (opacity, coverage, reference) in [
        (1.0, Coverage::Opaque, &mesh),
        (0.0, Coverage::Clear, &empty),
    ] {
        let wanted = Primitives::new(&[geometry(reference), geometry(&other)]).expect("indices");
        let wanted_brute = Brute::new(&wanted);
        for told in [coverage, Coverage::Mixed, Coverage::Unknown] {
            let filter = Uniform {
                opacity,
                coverage: told,
            };
            let geometries = [cutouts(&mesh, Arc::new(filter)), geometry(&other)];
            let primitives = Primitives::new(&geometries).expect("indices in range");
            let name = format!("opacity {opacity}, {told:?}");
            equals_brute(&name, &primitives, &rays);
            let filtered = Brute::new(&primitives);
            let bvh = Bvh::build(&geometries, &Default::default()).expect("indices in range");
            let report = bvh.report();
            assert_eq!(report.dropped, 0, "{name}");
            if told != coverage {
                assert_eq!((report.primitives, report.cutouts), (all, count), "{name}");
                assert_eq!(report.transparent, 0, "{name}");
            } else {
                assert_eq!(report.primitives, wanted.len(), "{name}");
                assert_eq!((report.cutouts, primitives.cutouts()), (0, 0), "{name}");
                assert_eq!(report.transparent, all - wanted.len(), "{name}");
                assert_eq!(primitives.transparent(), report.transparent, "{name}");
            }
            for ray in &rays {
                assert_eq!(
                    filtered.occluded(ray),
                    wanted_brute.occluded(ray),
                    "{name} {ray:?}"
                );
                assert_eq!(
                    bits(filtered.intersect(ray)),
                    bits(wanted_brute.intersect(ray)),
                    "{name} {ray:?}"
                );
            }
        }
    }
}

/// What a filter tells of whole triangles changes no answer, only the work.
#[test]
fn coverage_changes_no_answer() {
    let mut rng = Rng::new(44);
    let mesh = mesh::soup(&mut rng, 500);
    let rays = kernel_rays(&rays::around(&mut rng, &mesh, 3000));
    let [told, untold] = [true, false].map(|tells| {
        let geometries = [cutouts(&mesh, Arc::new(Checker { tells }))];
        let bvh = Bvh::build(&geometries, &Default::default()).expect("indices in range");
        let report = bvh.report();
        let (mut occluded, mut hits) = (vec![false; rays.len()], vec![None; rays.len()]);
        bvh.batch(&rays).occluded_into(&mut occluded);
        bvh.batch(&rays).intersect_into(&mut hits);
        let hits: Vec<_> = hits.into_iter().map(bits).collect();
        (occluded, hits, report)
    });
    assert_eq!(told.0, untold.0);
    assert_eq!(told.1, untold.1);
    assert_eq!(
        (told.2.primitives, told.2.cutouts, told.2.transparent),
        (400, 300, 100)
    );
    assert_eq!((untold.2.primitives, untold.2.cutouts), (500, 500));
}

/// Of many rays, a surface stops the share that its opacity says; two of them stop independently of each other.
#[test]
fn the_share_of_hits_is_the_opacity() {
    const COUNT: usize = 40_000;
    let rays = upwards(&mut Rng::new(46), COUNT);
    let meshes = [square(1.0), square(2.0)];
    let within = |found: usize, share: f64, what: &str| {
        let (mean, found) = (share * COUNT as f64, found as f64);
        let deviation = (mean * (1.0 - share)).sqrt();
        assert!(
            (found - mean).abs() <= 4.5 * deviation,
            "{what}: {found} instead of {mean}"
        );
    };
    for opacity in [1e-3, 0.1, 0.5, 0.77, 0.999] {
        let share = f64::from(opacity);
        let one = [cutouts(&meshes[0], Uniform::new(opacity))];
        within(count_occluded(&one, &rays), share, "one square");
        let veil = Uniform::new(opacity);
        // In meshes of their own, and in the same mesh.
        let two = [
            cutouts(&meshes[0], veil.clone()),
            cutouts(&meshes[1], veil.clone()),
        ];
        let both = 1.0 - (1.0 - share) * (1.0 - share);
        within(count_occluded(&two, &rays), both, "two squares");
        let mut positions = meshes[0].positions.clone();
        positions.extend_from_slice(&meshes[1].positions);
        let indices = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let joined = [Geometry::cutouts(&positions[..], &indices[..], veil)];
        within(
            count_occluded(&joined, &rays),
            both,
            "two squares of one mesh",
        );
    }
    for (opacity, wanted) in [
        (0.0, 0),
        (-0.5, 0),
        (f32::NAN, 0),
        (1.0, COUNT),
        (7.0, COUNT),
    ] {
        let one = [cutouts(&meshes[0], Uniform::new(opacity))];
        assert_eq!(count_occluded(&one, &rays), wanted, "opacity {opacity}");
    }
}

/// What a ray meets does not depend on its interval: both queries agree on every part of it, and the parts make
/// up the whole.
#[test]
fn a_ray_cut_into_pieces_meets_the_same() {
    let seed = 47;
    let mut rng = Rng::new(seed);
    let mesh = mesh::soup(&mut rng, 300);
    let geometries = [cutouts(&mesh, Uniform::new(0.4))];
    let bvh = Bvh::build(&geometries, &Default::default()).expect("indices in range");
    let mut cut = 0;
    for _ in 0..3000 {
        let ray = Ray::new(rng.point(1.2), rng.direction());
        let Some(hit) = bvh.intersect(&ray) else {
            assert!(!bvh.occluded(&ray), "seed {seed} {ray:?}");
            continue;
        };
        let place = format!("seed {seed} {ray:?} {hit:?}");
        assert!(bvh.occluded(&ray), "{place}");
        // The distance that is reported is not quite the one that decides.
        let before = Ray {
            tfar: hit.t - 1e-4,
            ..ray
        };
        assert!(!bvh.occluded(&before), "{place}");
        let up_to = Ray {
            tfar: hit.t + 1e-4,
            ..ray
        };
        assert_eq!(bits(bvh.intersect(&up_to)), bits(Some(hit)), "{place}");
        let middle = rng.range(0.0, 3.0);
        let [first, second] = [
            Ray {
                tfar: middle,
                ..ray
            },
            Ray {
                tnear: middle,
                ..ray
            },
        ];
        assert!(bvh.occluded(&first) || bvh.occluded(&second), "{place}");
        cut += 1;
    }
    assert!(cut > 500, "only {cut} rays hit anything");
}

/// Zeros of either sign are the same number, so such rays are the same ray.
#[test]
fn equal_rays_have_equal_answers() {
    let mesh = square(1.0);
    let bvh = Bvh::build(&[cutouts(&mesh, Uniform::new(0.5))], &Default::default());
    let bvh = bvh.expect("indices in range");
    for step in 1..500 {
        let x = step as f32 / 512.0;
        let ray = Ray::new([x, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let same = Ray::new([x, -0.0, -0.0], [-0.0, -0.0, 1.0]);
        assert_eq!(ray, same);
        assert_eq!(bvh.occluded(&ray), bvh.occluded(&same), "{ray:?}");
    }
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn threads_and_batches_change_no_answer() {
    let mut rng = Rng::new(48);
    let mesh = mesh::bumpy_grid(&mut rng, 600);
    let geometries = [cutouts(&mesh, Uniform::new(0.5))];
    let rays = kernel_rays(&rays::around(&mut rng, &mesh, 40_000));
    let mut answers = Vec::new();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        answers.push(pool.build().expect("a pool").install(|| {
            let bvh = Bvh::build(&geometries, &Default::default()).expect("indices in range");
            let (mut occluded, mut hits) = (vec![false; rays.len()], vec![None; rays.len()]);
            bvh.batch(&rays).occluded_into(&mut occluded);
            for (rays, hits) in rays.chunks(997).zip(hits.chunks_mut(997)) {
                bvh.batch(rays).intersect_into(hits);
            }
            (occluded, hits)
        }));
    }
    assert!(answers[0] == answers[1]);
    assert!(answers[0].0.contains(&true) && answers[0].0.contains(&false));
}

/// A log counts a hit where the ray ends, so it counts partly transparent surfaces with their opacity; and a tree
/// learned from it looks first where rays really end.
#[test]
fn logs_count_what_occludes() {
    let rays = upwards(&mut Rng::new(49), 10_000);
    let (veil, wall) = (square(1.0), square(2.0));
    for opacity in [0.0, 0.3, 1.0] {
        let geometries = [cutouts(&veil, Uniform::new(opacity))];
        let bvh = Bvh::build(&geometries, &Default::default()).expect("indices in range");
        let kind = LogKind {
            boxes: true,
            shuffled: true,
            masks: false,
        };
        let mut log = bvh.new_log(kind, 1);
        let (mut occluded, mut costs) = (
            vec![false; rays.len()],
            vec![Default::default(); rays.len()],
        );
        bvh.occluded_batch_logged(&rays, &mut occluded, &mut costs, &mut log);
        let found = occluded.iter().filter(|occluded| **occluded).count();
        assert_eq!(log.occluded(), found as u64);
        assert_eq!(found, count_occluded(&geometries, &rays));
        // Both triangles are in one leaf, and all rays come to it.
        assert!(
            costs
                .iter()
                .all(|cost| cost.prim_tests == 2 && cost.node_tests == 1)
        );
    }

    // The veil stops few rays, the wall behind it all: the wall comes first, so that hardly a ray is asked of
    // the veil.
    let geometries = [cutouts(&veil, Uniform::new(0.02)), geometry(&wall)];
    let primitives = Primitives::new(&geometries).expect("indices in range");
    let tree = BinaryTree::build(&primitives, Builder::default());
    let mut log = TreeLog::new(&tree);
    log.add(&primitives, &tree, &rays, 1.0);
    let learning = Learning::default();
    let bvh = Bvh::collapse_logged(&primitives, &tree, &log, &learning, Engine::best(Width::W4));
    let (mut occluded, mut costs) = (
        vec![false; rays.len()],
        vec![Default::default(); rays.len()],
    );
    bvh.occluded_batch_counted(&rays, &mut occluded, &mut costs);
    assert!(occluded.iter().all(|occluded| *occluded));
    assert!(costs.iter().all(|cost| cost.prim_tests == 2));
}
