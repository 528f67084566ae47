//! Scenes that move while rays are traced: every tree against brute force over the scene at the time of the ray.

use std::sync::Arc;

use antumbra::recipe::Preset;
use antumbra::{
    Brute, Bvh, Error, Geometry, Motion, MovingBvh, MovingGeometry, MovingInstance, MovingMesh,
    MovingScene, Ray, Recipe, Sphere,
};
use antumbra_testkit::sample::pairs;
use antumbra_testkit::{Mesh, Rng, mesh, rays};

use super::support::{Stripes, cases, cutouts, kernel_rays, quads, ways};
use super::transforms::{IDENTITY, Transform, product, rotation, scale, transform, translation};

/// A mesh whose keys are the mesh, moved and bent.
fn moving_mesh(rng: &mut Rng, mesh: &Mesh, keys: usize) -> MovingMesh<'static> {
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
    let keys = positions.into_iter().map(Into::into).collect();
    MovingMesh::new(keys, mesh.indices.clone())
}

/// Compares single rays and batches of every width and level with brute force, at few and at many times.
fn check(scene: &MovingScene<'_>, rng: &mut Rng, rays: &[Ray], what: &str) -> [usize; 2] {
    let few = [0.0, 1.0, 0.5, rng.unit(), rng.unit(), -3.0, 7.0];
    let times: Vec<f32> = rays.iter().map(|_| few[rng.below(few.len())]).collect();
    let mut expected = vec![None; rays.len()];
    for time in few {
        let brute = Brute::new(&scene.at(time).expect("checked"));
        for index in (0..rays.len()).filter(|&index| times[index] == time) {
            expected[index] = brute.intersect(&rays[index]);
            assert_eq!(brute.occluded(&rays[index]), expected[index].is_some());
        }
    }
    let occluded: Vec<bool> = expected.iter().map(Option::is_some).collect();
    let presets = [Preset::Default, Preset::Fast];
    for (preset, (width, isa)) in pairs(rng.bits(), &presets, &ways()) {
        let recipe = preset.recipe().width(width);
        let mut bvh = MovingBvh::build(scene, &recipe).expect("checked");
        bvh.validate().expect("valid");
        bvh.set_isa(isa);
        let what = format!("{what}, {preset} x{width} {}", isa.level());
        let (mut hits, mut shadows) = (vec![None; rays.len()], vec![false; rays.len()]);
        bvh.intersect_batch(rays, &times, &mut hits);
        bvh.occluded_batch(rays, &times, &mut shadows);
        assert!(hits == expected, "{what}: hits of a batch");
        assert!(shadows == occluded, "{what}: occlusion of a batch");
        for (index, (ray, &time)) in rays.iter().zip(&times).enumerate() {
            assert_eq!(bvh.intersect(ray, time), expected[index], "{what}: {ray:?}");
            assert_eq!(bvh.occluded(ray, time), occluded[index], "{what}: {ray:?}");
        }
    }
    let hits = occluded.iter().filter(|&&hit| hit).count();
    [hits, rays.len() - hits]
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
        let scene = MovingScene::new(
            vec![
                moving_mesh(&mut rng, &shape, keys).into(),
                Geometry::triangles(still.positions.clone(), still.indices.clone()).into(),
                MovingMesh::new(vec![still.positions.clone().into()], still.indices.clone()).into(),
                Geometry::spheres(vec![Sphere {
                    center: [0.3, 0.1, 0.0],
                    radius: 0.1,
                }])
                .into(),
            ],
            vec![],
            vec![],
        )
        .expect("sound");
        assert_eq!(scene.spans(), keys - 1);
        let rays = kernel_rays(&rays::around(&mut rng, &shape, 400));
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
    assert!(sums[0] > 300 && sums[1] > 300, "{sums:?}");
}

/// Leaves of these kinds have loops of their own, and never move.
#[test]
fn cutouts_and_quads_beside_a_moving_mesh_answer_as_brute_force() {
    let mut rng = Rng::new(4400);
    let [shape, veil, walls] = [(); 3].map(|()| mesh::soup(&mut rng, 40));
    let world = vec![
        moving_mesh(&mut rng, &shape, 2).into(),
        cutouts(&veil, Arc::new(Stripes { count: 3.0 })).into(),
        quads(&walls).into(),
    ];
    let scene = MovingScene::new(world, vec![], vec![]).expect("sound");
    let rays = kernel_rays(&rays::around(&mut rng, &veil, 400));
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
                MovingInstance::new(number % 3, path(&mut rng, keys))
            })
            .collect();
        let ground = moving_mesh(&mut rng, &mesh::soup(&mut Rng::new(9), 10), keys);
        let scene = MovingScene::new(vec![ground.into()], objects, instances).expect("sound");
        let rays: Vec<Ray> = (0..600)
            .map(|_| Ray::between(rng.point(3.0), rng.point(3.0)))
            .collect();
        add(
            &mut sums,
            check(&scene, &mut rng, &rays, &format!("seed {seed}")),
        );
    }
    assert!(sums[0] > 400 && sums[1] > 400, "{sums:?}");
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
    let mesh = MovingMesh::new(
        vec![square(0.0).into(), square(2.0).into()],
        indices.clone(),
    );
    let object = vec![Geometry::triangles(square(0.0), indices)];
    let instance = MovingInstance::new(0, vec![IDENTITY, translation([2.0, 0.0, 0.0])]);
    for scene in [
        MovingScene::new(vec![mesh.into()], vec![], vec![]).expect("sound"),
        MovingScene::new(vec![], vec![object], vec![instance]).expect("sound"),
    ] {
        let bvh = MovingBvh::build(&scene, &Recipe::default()).expect("checked");
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
        let mut occluded = vec![false; rays.len()];
        bvh.occluded_batch(&rays, &times, &mut occluded);
        for ((ray, time), occluded) in rays.iter().zip(&times).zip(&occluded) {
            assert_eq!(bvh.occluded(ray, *time), *occluded, "{ray:?} at {time}");
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
    let instance = MovingInstance::new(0, vec![IDENTITY, end]);
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
    let mesh = MovingMesh::new(keys.map(Into::into).into(), vec![[0, 1, 2]]);
    let scene = MovingScene::new(vec![mesh.into()], vec![], vec![]).expect("sound");
    let bvh = MovingBvh::build(&scene, &Recipe::default()).expect("checked");
    let ray = |x| Ray::new([x, 0.0, 0.0], [0.0, 0.0, 1.0]);
    assert!(bvh.occluded(&ray(0.5), 0.0) && bvh.occluded(&ray(0.5), 1.0));
    assert!(bvh.occluded(&ray(0.0), 0.4999) && !bvh.occluded(&ray(0.1), 0.5));
}

#[test]
fn learning_over_time_changes_no_answer() {
    let mut rng = Rng::new(4300);
    let shape = mesh::soup(&mut rng, 200);
    let mesh = moving_mesh(&mut rng, &shape, 3);
    let scene = MovingScene::new(vec![mesh.into()], vec![], vec![]).expect("sound");
    let rays: Vec<Ray> = (0..3000)
        .map(|_| Ray::between(rng.point(2.0), rng.point(2.0)))
        .collect();
    let times: Vec<f32> = rays.iter().map(|_| rng.unit()).collect();
    let learned = MovingBvh::learn(&scene, &rays, &times, &Recipe::default()).expect("checked");
    let plain = MovingBvh::build(&scene, &Recipe::fast()).expect("checked");
    for (ray, time) in rays.iter().zip(&times) {
        assert_eq!(learned.intersect(ray, *time), plain.intersect(ray, *time));
        assert_eq!(learned.occluded(ray, *time), plain.occluded(ray, *time));
    }
}

#[test]
fn times_are_clamped_and_nan_is_the_beginning() {
    let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    let mesh = MovingMesh::new(vec![at(0.0).into(), at(4.0).into()], vec![[0, 1, 2]]);
    assert_eq!(mesh.positions_at(f32::NAN), at(0.0));
    assert_eq!(mesh.positions_at(f32::INFINITY), at(4.0));
    let scene = MovingScene::new(vec![mesh.into()], vec![], vec![]).expect("sound");
    let bvh = MovingBvh::build(&scene, &Recipe::default()).expect("checked");
    let ray = |x| Ray::new([x, 0.2, 0.0], [0.0, 0.0, 1.0]);
    assert!(bvh.occluded(&ray(0.2), f32::NAN) && bvh.occluded(&ray(0.2), -1.0));
    assert!(bvh.occluded(&ray(4.2), 2.0) && !bvh.occluded(&ray(0.2), 2.0));
    let nan = Ray::new([f32::NAN; 3], [0.0, 0.0, 1.0]);
    assert!(!bvh.occluded(&nan, 0.5) && bvh.intersect(&nan, 0.5).is_none());
}

#[test]
fn nothing_moves_in_a_scene_of_one_key_and_nothing_hits_an_empty_one() {
    let still = MovingScene::new(
        vec![
            Geometry::spheres(vec![Sphere {
                center: [0.0; 3],
                radius: 1.0,
            }])
            .into(),
        ],
        vec![vec![]],
        vec![MovingInstance::new(0, vec![IDENTITY])],
    )
    .expect("sound");
    let bvh = MovingBvh::build(&still, &Recipe::default()).expect("checked");
    let ray = Ray::new([0.0, 0.0, -5.0], [0.0, 0.0, 1.0]);
    assert_eq!(bvh.intersect(&ray, 0.3).map(|hit| hit.t), Some(4.0));
    let empty = MovingScene::new(vec![], vec![], vec![]).expect("sound");
    let bvh = MovingBvh::build(&empty, &Recipe::default()).expect("checked");
    assert!(bvh.intersect(&ray, 0.3).is_none() && !bvh.occluded(&ray, 0.3));
}

#[test]
fn keys_of_no_use_are_refused() {
    let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    let mesh = |keys: Vec<Vec<[f32; 3]>>| -> MovingGeometry<'static> {
        MovingMesh::new(keys.into_iter().map(Into::into).collect(), vec![[0, 1, 2]]).into()
    };
    let refused = |world: Vec<MovingGeometry<'static>>, instances: Vec<MovingInstance>| {
        MovingScene::new(world, vec![vec![]], instances).expect_err("of no use")
    };
    assert!(matches!(
        refused(vec![mesh(vec![])], vec![]),
        Error::OtherKeys { found: 0, .. }
    ));
    let differ = refused(
        vec![
            mesh(vec![at(0.0), at(1.0)]),
            mesh(vec![at(0.0), at(1.0), at(2.0)]),
        ],
        vec![],
    );
    assert!(
        matches!(
            differ,
            Error::OtherKeys {
                id: 1,
                expected: 2,
                found: 3,
                ..
            }
        ),
        "{differ}"
    );
    let vertices = refused(vec![mesh(vec![at(0.0), vec![[0.0; 3]; 2]])], vec![]);
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
        let refused = refused(vec![mesh(vec![at(0.0), at(bad)])], vec![]);
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
    let flat = scale([1.0, 1.0, 0.0]);
    let key = refused(vec![], vec![MovingInstance::new(0, vec![IDENTITY, flat])]);
    assert!(matches!(key, Error::KeyTransform { key: 1, .. }), "{key}");
    let mirrored = scale([1.0, 1.0, -1.0]);
    let mirrors = refused(
        vec![],
        vec![MovingInstance::new(0, vec![IDENTITY, mirrored])],
    );
    assert!(
        matches!(mirrors, Error::KeysMirror { key: 0, .. }),
        "{mirrors}"
    );
    let object = refused(vec![], vec![MovingInstance::new(3, vec![IDENTITY])]);
    assert!(matches!(object, Error::ObjectOutOfRange { object: 3, .. }));
}

/// Trees of another scene are refused.
#[test]
fn trees_of_another_scene_are_refused() {
    let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    let scene = |x| {
        let mesh = MovingMesh::new(vec![at(0.0).into(), at(x).into()], vec![[0, 1, 2]]);
        MovingScene::new(vec![mesh.into()], vec![], vec![]).expect("sound")
    };
    let motion = |x| Motion::new(&scene(x)).expect("sound");
    let tree =
        Bvh::build(&scene(1.0).middle(0).expect("sound"), &Recipe::default()).expect("sound");
    assert!(MovingBvh::from_trees(&motion(1.0), vec![tree.clone()]).is_ok());
    let other = MovingBvh::from_trees(&motion(2.0), vec![tree]);
    assert!(matches!(other.err(), Some(Error::PrimitiveIsGone { .. })));
    assert!(matches!(
        MovingBvh::from_trees(&motion(1.0), vec![]).err(),
        Some(Error::OtherTrees {
            expected: 1,
            found: 0
        })
    ));
}
