//! Houses in pieces that are loaded when rays need them, against one tree of all.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{Error, Pieces, SunJob, UpAxis, run};
use antumbra_testkit::Rng;

use crate::field_sun::sunlight;

/// Lowest and largest coordinates.
type Box3 = [[f32; 3]; 2];

/// Houses in a town of 800 m, far from the origin of coordinates on one axis; some stand wall to wall.
fn town() -> Vec<Box3> {
    let mut rng = Rng::new(7);
    let mut at = |most: f32| (16.0 * rng.unit() * most).round() / 16.0;
    let mut houses = Vec::new();
    for index in 0..300 {
        let low = [at(760.0) - 60.0, 2000.0 + at(760.0), 0.0];
        let high = if index % 20 == 0 {
            80.0
        } else {
            4.0 + at(14.0)
        };
        let size = [6.0 + at(10.0), 6.0 + at(10.0)];
        let around =
            |x: f32, high: f32| [[x, low[1], low[2]], [x + size[0], low[1] + size[1], high]];
        houses.push(around(low[0], high));
        houses.push(around(low[0] + size[0], high + at(3.0)));
    }
    houses
}

/// Walls and roof of a house.
fn triangles(&[low, high]: &Box3) -> Vec<[[f32; 3]; 3]> {
    let corner = |index: usize| [0, 1, 2].map(|axis| [low, high][index >> axis & 1][axis]);
    let sides = [
        [0, 1, 5, 4],
        [3, 2, 6, 7],
        [2, 0, 4, 6],
        [1, 3, 7, 5],
        [4, 5, 7, 6],
    ];
    let halves = sides
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    halves.map(|corners| corners.map(corner)).collect()
}

/// Points on roofs and walls, with normals.
fn points(houses: &[&Box3]) -> [Vec<[f32; 3]>; 2] {
    let on = |&&[low, high]: &&Box3| {
        let middle = [0, 1, 2].map(|axis: usize| 0.5 * (low[axis] + high[axis]));
        [
            ([middle[0], middle[1], high[2]], [0.0, 0.0, 1.0]),
            ([low[0], middle[1], middle[2]], [-1.0, 0.0, 0.0]),
            ([middle[0], low[1], low[2] + 1.0], [0.0, -1.0, 0.0]),
            ([high[0], high[1], low[2] + 0.5], [0.0, 1.0, 0.0]),
        ]
    };
    let (points, normals) = houses.iter().flat_map(on).unzip();
    [points, normals]
}

fn tree(geometry: &[&[[[f32; 3]; 3]]]) -> Bvh {
    let mesh = |triangles: &&[[[f32; 3]; 3]]| {
        let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        Geometry::triangles(
            triangles.as_flattened().to_vec(),
            indices.collect::<Vec<_>>(),
        )
    };
    let geometry: Vec<Geometry<'_>> = geometry.iter().map(mesh).collect();
    Bvh::build(&geometry, &Recipe::default()).expect("a tree")
}

fn touch(a: &Box3, b: &Box3) -> bool {
    (0..3).all(|axis| a[0][axis] <= b[1][axis] && b[0][axis] <= a[1][axis])
}

fn union(boxes: impl Iterator<Item = Box3>) -> Box3 {
    boxes.fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |all, own| {
        let ends = [f32::min as fn(f32, f32) -> f32, f32::max];
        [0, 1].map(|end| [0, 1, 2].map(|axis| ends[end](all[end][axis], own[end][axis])))
    })
}

#[test]
fn pieces_hide_what_one_tree_hides() {
    let (houses, light) = (town(), sunlight(UpAxis::Z));
    let all: Vec<Vec<_>> = houses.iter().map(triangles).collect();
    let whole = tree(&[&all.concat()]);
    let bounds = union(houses.iter().copied());
    let mut rng = Rng::new(3);
    for side in [200.0, 330.0, 800.0, 0.0] {
        // In squares, or anyhow.
        let place = |house: &Box3| match side {
            0.0 => rng.below(5),
            _ => {
                let at = [0, 1].map(|axis| ((house[0][axis] - bounds[0][axis]) / side) as usize);
                at[1] * 5 + at[0]
            }
        };
        let places: Vec<usize> = houses.iter().map(place).collect();
        let numbers: Vec<usize> = places
            .iter()
            .copied()
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect();
        let of = |piece: usize| {
            let all = (0..houses.len()).filter(|&house| places[house] == piece);
            all.collect::<Vec<_>>()
        };
        let boxes: Vec<Vec<Box3>> = numbers
            .iter()
            .map(|&piece| of(piece).iter().map(|&house| houses[house]).collect())
            .collect();
        let meshes: Vec<Vec<_>> = numbers
            .iter()
            .map(|&piece| {
                of(piece)
                    .iter()
                    .flat_map(|&house| all[house].clone())
                    .collect()
            })
            .collect();
        let (mut used, mut hours) = (0, 0.0);
        for (own, boxes_of_own) in boxes.iter().enumerate() {
            let is_near = |other: &usize| {
                let touches = |a: &Box3| boxes_of_own.iter().any(|b| touch(a, b));
                boxes[*other].iter().any(touches)
            };
            let [near, far]: [Vec<usize>; 2] = [true, false].map(|wanted| {
                (0..boxes.len())
                    .filter(|other| is_near(other) == wanted)
                    .collect()
            });
            let mut geometry: Vec<&[_]> = near.iter().map(|&other| &meshes[other][..]).collect();
            let mark = [Pieces::mark(bounds)];
            geometry.push(&mark);
            let bvh = tree(&geometry);
            let loaded = Mutex::new(BTreeSet::new());
            let load = |piece: usize| {
                assert!(loaded.lock().expect("a set").insert(piece) || side == 0.0);
                Ok(Arc::new(tree(&[&meshes[piece]])))
            };
            let pieces = far.iter().map(|&other| (other, &boxes[other][..]));
            let pieces = Pieces::new(pieces, 1, &load).expect("a tree");
            let [points, normals] = points(&boxes_of_own.iter().collect::<Vec<_>>());
            for normals in [&normals[..], &[]] {
                let job = SunJob::new(&points, normals, &light).expect("a job");
                let wanted = run(&job, &whole, &()).expect("values");
                let job = job.beside(&pieces);
                let found = run(&job, &bvh, &()).expect("values");
                assert!(found.suns_seen == wanted.suns_seen, "{side} {own}");
                assert!(found.sky_seen == wanted.sky_seen, "{side} {own}");
                hours += found.values.hours.iter().sum::<f64>();
                used += loaded.lock().expect("a set").len();
                loaded.lock().expect("a set").clear();
            }
        }
        assert!(hours > 0.0);
        let others = 2 * boxes.len() * boxes.len();
        if side == 200.0 {
            assert!(used > 0 && 4 * used < 3 * others, "{used} of {others}");
        }
    }
}

#[test]
fn a_piece_that_cannot_be_loaded_is_an_error() {
    let bvh = tree(&[&triangles(&[[0.0; 3], [1.0; 3]])]);
    let load = |_: usize| Err(Error::Cancelled);
    let wall: Box3 = [[-50.0, -50.0, 0.0], [50.0, -40.0, 90.0]];
    let boxes = [wall];
    let pieces = Pieces::new([(0, &boxes[..])], 1, &load).expect("a tree");
    let light = sunlight(UpAxis::Z);
    let job = SunJob::new(&[[0.5, 0.5, 1.0]], &[], &light).expect("a job");
    assert!(run(&job, &bvh, &()).is_ok());
    assert_eq!(
        run(&job.beside(&pieces), &bvh, &()).err(),
        Some(Error::Cancelled)
    );
}
