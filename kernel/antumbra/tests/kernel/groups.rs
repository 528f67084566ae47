//! Groups: rays of many points in the same directions have the answers of single rays, in every tree and level.

use antumbra::recipe::Engine;
use antumbra::{Bvh, Directions, Instance, Primitives, Ray, Recipe, Width};
use antumbra_testkit::sample::pairs;
use antumbra_testkit::{Rng, mesh};

use crate::support::{cases, geometry, ways};

/// Suns of some days, directions all around, and some that no ray can have.
fn directions(rng: &mut Rng) -> Vec<[f32; 3]> {
    let mut all = Vec::new();
    for day in 0..24 {
        for hour in 0..12 {
            let (height, turn) = (0.3 + 0.01 * day as f32, 0.25 * hour as f32);
            all.push([turn.cos(), turn.sin(), height]);
        }
    }
    all.extend((0..90).map(|_| rng.direction()));
    // Along axes and planes, long and short, and none.
    all.extend([
        [0.0, 0.0, 1.0],
        [-0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
        [1e20, 1e19, 0.0],
        [1e-30, 0.0, 1e-30],
    ]);
    all.extend([[0.0; 3], [f32::NAN, 1.0, 0.0], [0.0, f32::INFINITY, 0.0]]);
    for index in (1..all.len()).rev() {
        all.swap(index, rng.below(index + 1));
    }
    all
}

struct Case {
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    near: Vec<f32>,
}

impl Case {
    fn new(rng: &mut Rng, positions: &[[f32; 3]]) -> Self {
        let mut points: Vec<[f32; 3]> = (0..12).map(|_| rng.point(1.5)).collect();
        points.extend((0..12).filter_map(|_| positions.get(rng.below(positions.len().max(1)))));
        points.extend([[f32::NAN, 0.0, 0.0], [1e30, 0.0, 0.0]]);
        // Side by side, for packets of one direction: from the third block of sixteen on.
        let corner = rng.point(1.0);
        points.resize_with(48, || rng.point(1.5));
        points.extend((0..54).map(|_| {
            let step = rng.point(0.02);
            [0, 1, 2].map(|axis| corner[axis] + step[axis])
        }));
        let mut normals: Vec<[f32; 3]> = points.iter().map(|_| rng.direction()).collect();
        normals[0] = [0.0; 3];
        normals[1] = [f32::NAN, 0.0, 1.0];
        normals[2] = [0.0, 0.0, 1e-40];
        normals[3] = [0.0, 1e38, 1e38];
        let mut near: Vec<f32> = points.iter().map(|_| rng.range(0.0, 0.1)).collect();
        near[4] = f32::NAN;
        near[5] = -0.5;
        near[6] = f32::INFINITY;
        near[7] = f32::NEG_INFINITY;
        Self {
            points,
            normals,
            near,
        }
    }

    fn check(&self, bvh: &Bvh, given: &[[f32; 3]], place: &str) -> usize {
        let directions = Directions::new(given);
        let words = given.len().div_ceil(64);
        let mut traced = 0;
        for (way, far) in [(0, f32::INFINITY), (1, 0.4), (2, 3.0), (3, f32::INFINITY)] {
            let (faces, begins) = (way & 1 == 1, way & 2 == 2);
            let mut group = bvh.group(&self.points, &directions).far(far);
            if faces {
                group = group.above(&self.normals);
            }
            if begins {
                group = group.near(&self.near);
            }
            let mut open = vec![u64::MAX; words * self.points.len()];
            group.open_into(&mut open);
            for (row, bits) in open.chunks(words).enumerate() {
                for column in 0..64 * words {
                    let bit = bits[column / 64] >> (column % 64) & 1 == 1;
                    let Some(&dir) = given.get(column) else {
                        assert!(!bit, "{place}: behind the last column");
                        continue;
                    };
                    let ray = Ray {
                        tnear: if begins { self.near[row] } else { 0.0 },
                        tfar: far,
                        ..Ray::new(self.points[row], dir)
                    };
                    let [x, y, z] = [0, 1, 2]
                        .map(|axis| f64::from(dir[axis]) * f64::from(self.normals[row][axis]));
                    let largest = dir.iter().fold(0.0, |most: f32, x| most.max(x.abs()));
                    let is_ray = ray.org.iter().chain(&dir).all(|x| x.is_finite())
                        && 1.0 / largest < f32::INFINITY
                        && !ray.tnear.is_nan();
                    let expected = is_ray && (!faces || x + y + z > 0.0) && !bvh.occluded(&ray);
                    assert_eq!(bit, expected, "{place}, way {way}: {ray:?}");
                    traced += usize::from(is_ray);
                }
            }
        }
        traced
    }
}

/// Eight cases of all widths and levels are more than a hundred million rays.
#[test]
fn rays_of_a_group_have_the_answers_of_single_rays() {
    let (mut rng, rounds) = (Rng::new(33), cases(1));
    let mut traced = 0;
    let meshes = (0..rounds).flat_map(|round| pairs(round.into(), mesh::ALL, &ways()));
    for (generate, engine) in meshes {
        let mesh = generate(&mut rng, 300);
        let case = Case::new(&mut rng, &mesh.positions);
        let given = directions(&mut rng);
        let recipe = Recipe::default().engine(engine);
        let bvh = Bvh::build(&[geometry(&mesh)], &recipe).expect("a mesh");
        let place = format!("{} {engine:?}", mesh.name);
        traced += case.check(&bvh, &given, &place);
    }
    println!("{traced} rays");
    assert!(traced > 100_000 * rounds as usize, "{traced}");
}

#[test]
fn instances_and_other_kinds_have_them_too() {
    let mut rng = Rng::new(34);
    let mesh = mesh::bumpy_grid(&mut rng, 200);
    let soup = mesh::soup(&mut rng, 50);
    let instances: Vec<Instance> = (0..4)
        .map(|place| {
            let mut transform = [[0.0; 4]; 3];
            for (axis, row) in transform.iter_mut().enumerate() {
                row[axis] = 0.4;
                row[3] = rng.range(-0.5, 0.5) * (place + axis) as f32;
            }
            Instance::new(0, transform)
        })
        .collect();
    let (world, objects) = ([geometry(&soup)], [[geometry(&mesh)]]);
    let primitives = Primitives::with_instances(&world, &objects, &instances).expect("instances");
    let case = Case::new(&mut rng, &mesh.positions);
    let given = directions(&mut rng);
    for width in Width::ALL {
        let bvh = Bvh::build(&primitives, &Recipe::default().engine(Engine::best(width)))
            .expect("a tree");
        case.check(&bvh, &given, &format!("instances x{width}"));
    }
}

#[test]
fn a_group_of_nothing_has_no_bits() {
    let bvh = Bvh::build(&[], &Recipe::default()).expect("a tree");
    bvh.group(&[], &Directions::new(&[[1.0, 0.0, 0.0]]))
        .open_into(&mut []);
    bvh.group(&[[0.0; 3]], &Directions::new(&[]))
        .open_into(&mut []);
    let mut open = [0];
    let axes = Directions::new(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    bvh.group(&[[0.0; 3]], &axes).open_into(&mut open);
    assert_eq!(open, [0b11], "there is nothing in the way");
}

#[test]
#[should_panic(expected = "one normal per point")]
fn lists_of_different_length_panic() {
    let bvh = Bvh::build(&[], &Recipe::default()).expect("a tree");
    let axes = Directions::new(&[[1.0, 0.0, 0.0]]);
    let _ = bvh.group(&[[0.0; 3]], &axes).above(&[]);
}
