//! Scenes that move while rays are traced: every tree against brute force over the scene at the time of the ray.

use antumbra::recipe::Engine;
use std::sync::Arc;

use antumbra::shapes::Sphere;
use antumbra::{
    Brute, Build, Bvh, Directions, Error, Geometry, Instance, Masks, NestedInstances, Object,
    PrimId, Primitives, Ray, RayOrder, Recipe, Visit, Width, World,
};
use antumbra_testkit::{Mesh, Rng, mesh, rays};

use super::support::{Stripes, cases, cutouts, engines_for, kernel_rays, quads};
use super::transforms::{IDENTITY, Transform, product, rotation, scale, transform, translation};

/// A mesh whose keys are the mesh, moved and bent.
fn moving_mesh(rng: &mut Rng, mesh: &Mesh, keys: usize) -> Geometry<'static> {
    let mut positions = vec![mesh.positions.clone()];
    while positions.len() < keys {
        let (way, bend) = (rng.point(0.7), rng.range(0.0, 0.3));
        let last = &positions[positions.len() - 1];
        let next = last.iter().map(|at| {
            let off = rng.point(bend);
            core::array::from_fn(|axis| at[axis] + way[axis] + off[axis])
        });
        let next = next.collect();
        positions.push(next);
    }
    Geometry::moving(positions, mesh.indices.clone())
}

/// Conditions that rays can have.
const CONDITIONS: [&str; 5] = ["none", "mask", "except", "filter", "all"];

/// Compares single rays and batches of every width and level with brute force, at few and at many times.
fn check(scene: &Primitives, rng: &mut Rng, rays: &[Ray], what: &str) -> [usize; 2] {
    let few = [0.0, 1.0, 0.5, rng.unit(), rng.unit(), -3.0, 7.0];
    let times: Vec<f32> = rays.iter().map(|_| few[rng.below(few.len())]).collect();
    let masks = Masks::new()
        .world(vec![1, 2, 3, 1])
        .instances(vec![2, 3, 1, 2, 1]);
    let mut brutes: Vec<(f32, Brute, Bvh)> = Vec::new();
    for time in few {
        let scene = scene.at(time);
        let mut brute = Brute::new(&scene);
        brute.set_masks(masks.clone());
        let still = Bvh::build(&scene, &Recipe::fast()).expect("checked");
        brutes.push((time, brute, still));
    }
    let of_time = |index: usize| {
        let found = brutes.iter().find(|(time, ..)| *time == times[index]);
        found.expect("one of few")
    };
    let brute = |index: usize| &of_time(index).1;
    let plain: Vec<_> = (0..rays.len())
        .map(|index| brute(index).intersect(&rays[index]))
        .collect();
    let surfaces: Vec<_> = (0..rays.len())
        .map(|index| of_time(index).2.surface(&rays[index]))
        .collect();
    // Every other ray leaves out what it hits first.
    let excluded: Vec<PrimId> = (plain.iter().enumerate())
        .map(|(index, hit)| match hit {
            Some(hit) if index % 2 == 0 => PrimId::from(*hit),
            _ => PrimId::NONE,
        })
        .collect();
    let counts = |hit: &antumbra::Hit| hit.prim_id % 3 != 1;
    let filter = |_: usize, hit: &antumbra::Hit| counts(hit);
    let ways = CONDITIONS.iter().enumerate();
    let expected: Vec<Vec<Vec<antumbra::Hit>>> = ways
        .map(|(way, _)| {
            let of_ray = |index: usize| {
                let mut query = brute(index).query(&rays[index]);
                if way == 1 || way == 4 {
                    query = query.mask(1);
                }
                if way == 2 || way == 4 {
                    query = query.except(excluded[index]);
                }
                if way == 3 || way == 4 {
                    query = query.filter(&counts);
                }
                let hits = query.all_hits();
                assert_eq!(query.occluded(), !hits.is_empty());
                hits
            };
            (0..rays.len()).map(of_ray).collect()
        })
        .collect();
    for (turn, width) in Width::ALL.into_iter().enumerate() {
        let recipe = match (turn + rays.len()) % 2 {
            0 => Recipe::default(),
            _ => Recipe::fast(),
        };
        let mut bvh = Bvh::build(scene, &recipe.engine(Engine::best(width))).expect("checked");
        bvh.set_masks(masks.clone());
        bvh.validate().expect("valid");
        assert!(bvh.report().moves && scene.moves());
        for engine in engines_for(bvh.width()) {
            engine.run(&mut bvh).expect("its width");
            // Two conditions at a time, and all in turns.
            for way in [rng.below(5), rng.below(5)] {
                let expected = &expected[way];
                let name = CONDITIONS[way];
                let what = format!("{what}, {engine:?}, {name}");
                let batch = |rays, times, excluded| {
                    let mut batch = bvh.batch(rays).at(times);
                    if way == 1 || way == 4 {
                        batch = batch.mask(1);
                    }
                    if way == 2 || way == 4 {
                        batch = batch.except(excluded);
                    }
                    match way {
                        3 | 4 => batch.filter(&filter),
                        _ => batch,
                    }
                };
                // Also a batch of few rays, and one whose rays are sorted.
                for (count, order) in [
                    (rays.len(), RayOrder::AsGiven),
                    (rays.len(), RayOrder::Sorted),
                    (5, RayOrder::AsGiven),
                ] {
                    let some = (&rays[..count], &times[..count], &excluded[..count]);
                    let batch = || batch(some.0, some.1, some.2).order(order);
                    compare(&batch, &expected[..count], &what);
                }
                for (index, ray) in rays.iter().enumerate() {
                    let mut query = bvh.query(ray).at(times[index]);
                    if way == 1 || way == 4 {
                        query = query.mask(1);
                    }
                    if way == 2 || way == 4 {
                        query = query.except(excluded[index]);
                    }
                    if way == 3 || way == 4 {
                        query = query.filter(&counts);
                    }
                    let all = &expected[index];
                    assert_eq!(query.intersect(), all.first().copied(), "{what}: {ray:?}");
                    assert_eq!(query.occluded(), !all.is_empty(), "{what}: {ray:?}");
                    assert_eq!(query.occluder().is_some(), !all.is_empty(), "{what}");
                    assert_eq!(&query.all_hits(), all, "{what}: {ray:?}");
                }
            }
            // Without a time it is the beginning.
            let start = Brute::new(&scene.at(0.0));
            let occluded = bvh.batch(rays).occluded();
            for (ray, occluded) in rays.iter().zip(occluded) {
                let hit = start.intersect(ray);
                assert_eq!(bvh.intersect(ray), hit, "{what}: {ray:?} without a time");
                assert_eq!(occluded, hit.is_some());
            }
            assert!(
                bvh.batch(rays).at(&times).surfaces() == surfaces,
                "{what}: surfaces"
            );
        }
    }
    let hits = plain.iter().flatten().count();
    [hits, rays.len() - hits]
}

/// Every query of a batch against all hits of each ray.
fn compare<'a>(
    batch: &dyn Fn() -> antumbra::Batch<'a>,
    expected: &[Vec<antumbra::Hit>],
    what: &str,
) {
    let first: Vec<_> = expected.iter().map(|hits| hits.first().copied()).collect();
    let occluded: Vec<bool> = first.iter().map(Option::is_some).collect();
    assert!(batch().intersect() == first, "{what}: hits of a batch");
    assert!(
        batch().occluded() == occluded,
        "{what}: occlusion of a batch"
    );
    let surfaces = batch().surfaces();
    let seen: Vec<_> = surfaces.iter().map(|one| one.map(|one| one.hit)).collect();
    assert!(seen == first, "{what}: surfaces of a batch");
    for ((occluder, hits), index) in batch().occluders().iter().zip(expected).zip(0..) {
        // Quads are hit by halves.
        let is_one = |id: &PrimId| hits.iter().any(|hit| PrimId::from(*hit) == *id);
        assert_eq!(
            occluder.is_some(),
            !hits.is_empty(),
            "{what}: occluder {index}"
        );
        assert!(
            occluder.as_ref().is_none_or(is_one),
            "{what}: occluder {index}"
        );
    }
    let lists = batch().all_hits();
    let mut visited = vec![Vec::new(); expected.len()];
    batch().visit_hits(&mut visited, |hits, hit| {
        hits.push(hit);
        Visit::Reject
    });
    for (index, hits) in expected.iter().enumerate() {
        assert!(lists.of(index) == &hits[..], "{what}: all hits of {index}");
        assert!(&visited[index] == hits, "{what}: visit of {index}");
    }
}

fn add(sums: &mut [usize; 2], counts: [usize; 2]) {
    for (sum, count) in sums.iter_mut().zip(counts) {
        *sum += count;
    }
}

#[test]
fn meshes_answer_as_brute_force() {
    let mut sums = [0; 2];
    for seed in 0..cases(6) {
        let mut rng = Rng::new(u64::from(seed) + 4100);
        let kinds = [
            mesh::soup,
            mesh::bumpy_grid,
            mesh::slivers,
            mesh::axis_aligned,
            mesh::coincident,
        ];
        let shape = kinds[seed as usize % kinds.len()](&mut rng, 120);
        let keys = 2 + seed as usize % 3;
        let still = mesh::soup(&mut rng, 20);
        let scene = Primitives::new(&[
            moving_mesh(&mut rng, &shape, keys),
            Geometry::triangles(still.positions.clone(), still.indices.clone()),
            Geometry::moving([still.positions.clone()], still.indices.clone()),
            Geometry::spheres(vec![Sphere {
                center: [0.3, 0.1, 0.0],
                radius: 0.1,
            }]),
        ])
        .expect("sound");
        assert_eq!(scene.spans(), keys - 1);
        let rays = kernel_rays(&rays::around(&mut rng, &shape, 150));
        add(
            &mut sums,
            check(
                &scene,
                &mut rng,
                &rays,
                &format!("seed {seed}, {}", shape.name),
            ),
        );
    }
    assert!(sums[0] > 150 && sums[1] > 150, "{sums:?}");
}

/// Leaves of these kinds have loops of their own, and never move.
#[test]
fn cutouts_and_quads_beside_a_moving_mesh_answer_as_brute_force() {
    let mut rng = Rng::new(4400);
    let [shape, veil, walls] = [(); 3].map(|()| mesh::soup(&mut rng, 40));
    let world = [
        moving_mesh(&mut rng, &shape, 2),
        cutouts(&veil, Arc::new(Stripes { count: 3.0 })),
        quads(&walls),
    ];
    let scene = Primitives::new(&world).expect("sound");
    let rays = kernel_rays(&rays::around(&mut rng, &veil, 200));
    let counts = check(&scene, &mut rng, &rays, "cut-outs");
    assert!(counts[0] > 20 && counts[1] > 20, "{counts:?}");
}

/// A random transform and others that it can move to.
fn path(rng: &mut Rng, keys: usize) -> Vec<Transform> {
    let mut keys_of_path = vec![transform(rng)];
    while keys_of_path.len() < keys {
        let last = keys_of_path[keys_of_path.len() - 1];
        let mut next = product(&rotation(rng), &last);
        if rng.below(2) == 0 {
            next = product(
                &next,
                &scale([rng.range(0.5, 2.0), rng.range(0.5, 2.0), 1.0]),
            );
        }
        keys_of_path.push(product(&translation(rng.point(1.0)), &next));
    }
    keys_of_path
}

#[test]
fn instances_answer_as_brute_force() {
    let mut sums = [0; 2];
    for seed in 0..cases(8) {
        let mut rng = Rng::new(u64::from(seed) + 4200);
        let shape = mesh::soup(&mut rng, 60);
        let keys = 2 + seed as usize % 2;
        let objects = vec![
            vec![Geometry::triangles(
                shape.positions.clone(),
                shape.indices.clone(),
            )],
            vec![Geometry::spheres(vec![Sphere {
                center: [0.0; 3],
                radius: 0.5,
            }])],
            vec![],
        ];
        let instances: Vec<_> = (0..12)
            .map(|number| {
                let keys = if number % 4 == 0 { 1 } else { keys };
                Instance::moving(number % 3, path(&mut rng, keys))
            })
            .collect();
        let ground = moving_mesh(&mut rng, &mesh::soup(&mut Rng::new(9), 10), keys);
        let scene = Primitives::with_instances(&[ground], &objects, &instances).expect("sound");
        let rays: Vec<Ray> = (0..200)
            .map(|_| Ray::between(rng.point(3.0), rng.point(3.0)))
            .collect();
        add(
            &mut sums,
            check(&scene, &mut rng, &rays, &format!("seed {seed}")),
        );
    }
    assert!(sums[0] > 150 && sums[1] > 150, "{sums:?}");
}

/// A square of side 1 that moves by 2 along x covers a point for half of the time, and its edges are ramps.
#[test]
fn a_moving_square_covers_points_for_as_long_as_it_is_above_them() {
    let square = |x: f32| {
        vec![
            [x, 0.0, 1.0],
            [x + 1.0, 0.0, 1.0],
            [x + 1.0, 1.0, 1.0],
            [x, 1.0, 1.0],
        ]
    };
    let indices = vec![[0, 1, 2], [0, 2, 3]];
    let mesh = Geometry::moving([square(0.0), square(2.0)], indices.clone());
    let object = [Geometry::triangles(square(0.0), indices)];
    let instance = Instance::moving(0, [IDENTITY, translation([2.0, 0.0, 0.0])]);
    let scene = Primitives::with_instances(&[], &[object], &[instance]).expect("sound");
    let recipe = Recipe::default();
    for bvh in [
        Bvh::build(&[mesh], &recipe).expect("sound"),
        Bvh::build(&scene, &recipe).expect("sound"),
    ] {
        // More rays than one thread takes at a time.
        const COLUMNS: usize = 30;
        const TIMES: usize = 1000;
        let x = |column: usize| (column as f32 + 0.5) / 10.0;
        let rays: Vec<Ray> = (0..COLUMNS * TIMES)
            .map(|ray| Ray::new([x(ray / TIMES), 0.4, 0.0], [0.0, 0.0, 1.0]))
            .collect();
        let times: Vec<f32> = (0..COLUMNS * TIMES)
            .map(|ray| ((ray % TIMES) as f32 + 0.5) / TIMES as f32)
            .collect();
        let occluded = bvh.batch(&rays).at(&times).occluded();
        for ((ray, time), occluded) in rays.iter().zip(&times).zip(&occluded) {
            let single = bvh.query(ray).at(*time).occluded();
            assert_eq!(single, *occluded, "{ray:?} at {time}");
        }
        for (column, occluded) in occluded.chunks(TIMES).enumerate() {
            let x = x(column);
            let covered = occluded.iter().filter(|&&o| o).count() as f32 / TIMES as f32;
            // The square is above x from time (x - 1) / 2 to x / 2.
            let expected = (x / 2.0).min(1.0) - ((x - 1.0) / 2.0).max(0.0);
            assert!(
                (covered - expected).abs() < 0.003,
                "{x}: {covered}, not {expected}"
            );
        }
    }
}

/// Half a turn: points go around in a circle, not through its middle. Meanwhile the size grows from 1 to 3.
#[test]
fn rotations_turn_and_stretches_grow() {
    let turned: Transform = [
        [-1.0, 0.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ];
    let end = product(&turned, &scale([3.0; 3]));
    let instance = Instance::moving(0, [IDENTITY, end]);
    for step in 0..=16 {
        let time = step as f32 / 16.0;
        let [row, other, _] = instance.transform_at(time).expect("sound");
        let angle = std::f32::consts::PI * time;
        let size = 1.0 + 2.0 * time;
        let expected = [size * angle.cos(), size * angle.sin().abs()];
        assert!((row[0] - expected[0]).abs() < 2e-6, "{time}: {row:?}");
        assert!(
            (other[0].abs() - expected[1]).abs() < 2e-6,
            "{time}: {other:?}"
        );
    }
}

/// Its corners coincide in the middle only, where the tree is built.
#[test]
fn a_triangle_that_is_a_point_for_a_moment_is_kept() {
    let keys = [1.0f32, -1.0].map(|s| vec![[s, 0.0, 1.0], [-s, s, 1.0], [-s, -s, 1.0]]);
    let mesh = Geometry::moving(keys, vec![[0, 1, 2]]);
    let bvh = Bvh::build(&[mesh], &Recipe::default()).expect("sound");
    let occluded = |x, time| {
        let ray = Ray::new([x, 0.0, 0.0], [0.0, 0.0, 1.0]);
        bvh.query(&ray).at(time).occluded()
    };
    assert!(occluded(0.5, 0.0) && occluded(0.5, 1.0));
    assert!(occluded(0.0, 0.4999) && !occluded(0.1, 0.5));
}

/// One corner is on another at the beginning only, and of a second triangle all the time.
#[test]
fn a_triangle_that_is_unsound_at_first_is_there_later() {
    let at = |x: f32| {
        vec![
            [0.0, 0.0, 1.0],
            [x, 0.0, 1.0],
            [0.0, 1.0, 1.0],
            [0.0, 0.0, 1.0],
        ]
    };
    let mesh = Geometry::moving([at(0.0), at(1.0)], vec![[0, 1, 2], [0, 3, 2]]);
    let scene = Primitives::new(&[mesh]).expect("sound");
    assert_eq!((scene.len(), scene.dropped()), (1, 1));
    assert_eq!(
        (
            scene.at(0.0).len(),
            scene.at(0.5).len(),
            scene.at(0.0).dropped()
        ),
        (0, 1, 2)
    );
    let bvh = Bvh::build(&scene, &Recipe::default()).expect("sound");
    let ray = Ray::new([0.1, 0.1, 0.0], [0.0, 0.0, 1.0]);
    assert!(!bvh.occluded(&ray) && bvh.query(&ray).at(1.0).occluded());
    let brute = Brute::new(&scene);
    assert!(!brute.occluded(&ray) && brute.query(&ray).at(1.0).occluded());
}

#[test]
fn learning_over_time_changes_no_answer() {
    let mut rng = Rng::new(4300);
    let shape = mesh::soup(&mut rng, 200);
    let mesh = [moving_mesh(&mut rng, &shape, 3)];
    let rays: Vec<Ray> = (0..3000)
        .map(|_| Ray::between(rng.point(2.0), rng.point(2.0)))
        .collect();
    let times: Vec<f32> = rays.iter().map(|_| rng.unit()).collect();
    let learned = Build::new(&mesh)
        .rays(&rays)
        .times(&times)
        .bvh()
        .expect("sound");
    let plain = Bvh::build(&mesh, &Recipe::fast()).expect("sound");
    let [learned, plain] = [&learned, &plain].map(|bvh| bvh.batch(&rays).at(&times));
    assert_eq!(learned.intersect(), plain.intersect());
    assert_eq!(learned.occluded(), plain.occluded());
}

#[test]
fn times_are_clamped_and_nan_is_the_beginning() {
    let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    let mesh = Geometry::moving([at(0.0), at(4.0)], vec![[0, 1, 2]]);
    let scene = Primitives::new(&[mesh]).expect("sound");
    let start = |time| scene.at(time).bounds().min[0];
    assert_eq!(
        [f32::NAN, -1.0, 0.5, f32::INFINITY].map(start),
        [0.0, 0.0, 2.0, 4.0]
    );
    let bvh = Bvh::build(&scene, &Recipe::default()).expect("sound");
    assert_eq!(bvh.bounds().max[0], 5.0, "at all times");
    let occluded = |x, time| {
        let ray = Ray::new([x, 0.2, 0.0], [0.0, 0.0, 1.0]);
        bvh.query(&ray).at(time).occluded()
    };
    assert!(occluded(0.2, f32::NAN) && occluded(0.2, -1.0));
    assert!(occluded(4.2, 2.0) && !occluded(0.2, 2.0));
    assert!(!occluded(f32::NAN, 0.5));
}

#[test]
fn nothing_moves_in_a_scene_of_one_key() {
    let ball = [Geometry::spheres(vec![Sphere {
        center: [0.0; 3],
        radius: 1.0,
    }])];
    let instance = Instance::moving(0, [IDENTITY]);
    let still = Primitives::with_instances(&[], &[ball], &[instance]).expect("sound");
    let bvh = Bvh::build(&still, &Recipe::default()).expect("sound");
    assert!(!still.moves() && !bvh.report().moves && still.spans() == 1);
    let ray = Ray::new([0.0, 0.0, -5.0], [0.0, 0.0, 1.0]);
    let hit = bvh.query(&ray).at(0.3).intersect();
    assert_eq!(hit.map(|hit| hit.t), Some(4.0));
    assert_eq!(bvh.batch(&[ray; 20]).at(&[0.3; 20]).intersect(), [hit; 20]);
}

#[test]
fn keys_of_no_use_are_refused() {
    let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    let mesh = |keys: Vec<Vec<[f32; 3]>>| Geometry::moving(keys, vec![[0, 1, 2]]);
    let refused = |world: &[Geometry<'_>], instances: &[Instance]| {
        Primitives::with_instances(world, &[[]], instances).expect_err("of no use")
    };
    assert!(matches!(
        refused(&[mesh(vec![])], &[]),
        Error::IndexOutOfRange { vertices: 0, .. }
    ));
    let differ = refused(
        &[
            mesh(vec![at(0.0), at(1.0)]),
            mesh(vec![at(0.0), at(1.0), at(2.0)]),
        ],
        &[],
    );
    let keys = Error::OtherKeys {
        what: "mesh",
        id: 1,
        expected: 2,
        found: 3,
    };
    assert_eq!(differ, keys);
    let vertices = refused(&[mesh(vec![at(0.0), vec![[0.0; 3]; 2]])], &[]);
    assert!(matches!(
        vertices,
        Error::OtherVertices {
            key: 1,
            expected: 3,
            found: 2,
            ..
        }
    ));
    for bad in [f32::NAN, f32::INFINITY, 1e38] {
        let refused = refused(&[mesh(vec![at(0.0), at(bad)])], &[]);
        assert!(
            matches!(
                refused,
                Error::KeyPosition {
                    key: 1,
                    vertex: 0,
                    ..
                }
            ),
            "{bad}: {refused}"
        );
    }
    let index = Geometry::moving([at(0.0), at(1.0)], vec![[0, 1, 3]]);
    assert!(matches!(
        refused(&[index], &[]),
        Error::IndexOutOfRange { index: 3, .. }
    ));
    let flat = scale([1.0, 1.0, 0.0]);
    let key = refused(&[], &[Instance::moving(0, [IDENTITY, flat])]);
    assert!(matches!(key, Error::KeyTransform { key: 1, .. }), "{key}");
    let mirrored = scale([1.0, 1.0, -1.0]);
    let mirrors = refused(&[], &[Instance::moving(0, [IDENTITY, mirrored])]);
    assert!(
        matches!(mirrors, Error::KeysMirror { key: 0, .. }),
        "{mirrors}"
    );
    let object = refused(&[], &[Instance::moving(3, [IDENTITY, IDENTITY])]);
    assert!(matches!(object, Error::ObjectOutOfRange { object: 3, .. }));
}

/// What cannot move says so.
#[test]
fn what_cannot_move_is_refused_in_words() {
    let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    let still = [Geometry::triangles(at(0.0), vec![[0, 1, 2]])];
    let mesh = [Geometry::moving([at(0.0), at(1.0)], vec![[0, 1, 2]])];
    let moves = |error: Option<Error>| matches!(error, Some(Error::Moves(_)));
    let recipe = Recipe::default();
    let mut bvh = Bvh::build(&mesh, &recipe).expect("sound");
    assert!(moves(bvh.write(Vec::new()).err()));
    assert!(moves(bvh.refit(&mesh).err()) && moves(bvh.refit(&still).err()));
    assert!(moves(Build::new(&mesh).stage().err()) && moves(Object::build(&mesh, &recipe).err()));
    let mut other = Bvh::build(&still, &recipe).expect("sound");
    assert!(moves(other.refit(&mesh).err()));
    let turned = Instance::moving(0, [IDENTITY, translation([1.0, 0.0, 0.0])]);
    let instances = [turned];
    let object = [still.to_vec()];
    assert!(moves(
        Primitives::with_instances(&[], &[mesh.to_vec()], &instances).err()
    ));
    assert!(moves(
        NestedInstances::new(&instances, &[vec![]], |_| true).err()
    ));
    let object_of_world = Object::build(&object[0], &recipe).expect("sound");
    assert!(moves(World::new(&[object_of_world], &instances).err()));
    let shape = Mesh {
        positions: at(0.0),
        ..mesh::soup(&mut Rng::new(1), 1)
    };
    let mut veil = cutouts(&shape, Arc::new(Stripes { count: 3.0 }));
    if let Geometry::Triangles(mesh) = &mut veil {
        mesh.moves_to.push(at(1.0).into());
    }
    assert!(moves(Primitives::new(&[veil]).err()));
    // Learning again changes nothing, and groups and points are of time 0.
    let before = bvh.clone();
    let ray = Ray::new([1.8, 0.1, 0.0], [0.0, 0.0, 1.0]);
    let order = bvh.relearn(&[ray; 50], &recipe);
    bvh.adopt(&order);
    assert!(!bvh.occluded(&ray) && bvh.query(&ray).at(1.0).occluded());
    assert_eq!(
        bvh.query(&ray).at(1.0).intersect(),
        before.query(&ray).at(1.0).intersect()
    );
    let up = Directions::new(&[[0.0, 0.0, 1.0]]);
    let mut open = [0; 2];
    bvh.group(&[[0.2, 0.2, 0.0], ray.org], &up)
        .open_into(&mut open);
    assert_eq!(open, [0, 1]);
    let closest = bvh.closest([0.2, 0.2, 0.0], 9.0).expect("near");
    assert_eq!(closest.distance, 1.0);
}

/// Trees of another scene are refused.
#[test]
fn trees_of_another_scene_are_refused() {
    let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    let scene = |x| {
        let mesh = Geometry::moving([at(0.0), at(x)], vec![[0, 1, 2]]);
        Primitives::new(&[mesh]).expect("sound")
    };
    let tree = Bvh::build(&scene(1.0).middle(0), &Recipe::default()).expect("sound");
    assert!(Bvh::moving(&scene(1.0), vec![tree.clone()]).is_ok());
    let other = Bvh::moving(&scene(2.0), vec![tree.clone()]);
    assert!(matches!(other.err(), Some(Error::PrimitiveIsGone { .. })));
    for trees in [vec![], vec![tree; 2]] {
        let found = trees.len();
        let error = Bvh::moving(&scene(1.0), trees).err();
        assert_eq!(error, Some(Error::OtherTrees { expected: 1, found }));
    }
}
