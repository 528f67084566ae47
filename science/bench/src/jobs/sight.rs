//! Visibility between points, and of a terrain from one point. Ours does the second without a mesh or a tree.

use antumbra::{Bvh, Ray, Recipe};
use antumbra_bake::{HeightField, Limits, Observer, ViewshedJob, sees_each_other};
use antumbra_lab::embree::{Call, Scene, SceneFlags};
use antumbra_lab::harness::{Mesh, dot, less};
use antumbra_testkit::Rng;

use super::{Job, Programs};
use crate::Outcome;
use crate::input::{along_curve, origin_offset};

/// Which points see each other.
pub fn matrix(job: &mut Job, mesh: &Mesh, points: &[[f32; 3]]) -> Outcome {
    let ours = |bvh: &Bvh| {
        let seen = sees_each_other(bvh, points, 0..points.len(), None, &());
        seen.expect("memory for a matrix").into_words()
    };
    let width = points.len().div_ceil(64);
    let embree = |scene: &Scene, call, share| {
        let offset = origin_offset(mesh, points);
        let order = along_curve(points);
        let sorted: Vec<[f32; 3]> = order.iter().map(|&index| points[index as usize]).collect();
        let mut seen = vec![0u64; points.len() * width];
        for row in (0..points.len()).step_by(share) {
            let from = sorted[row];
            let others = &sorted[row + 1..];
            scene.occluded(
                call,
                others.len(),
                |index| between(from, others[index], offset),
                |index, occluded| {
                    let (a, b) = (order[row] as usize, order[row + 1 + index] as usize);
                    seen[a * width + b / 64] |= u64::from(!occluded) << (b % 64);
                    seen[b * width + a / 64] |= u64::from(!occluded) << (a % 64);
                },
            );
        }
        seen
    };
    let programs = Programs {
        mesh,
        flags: SceneFlags::default(),
        ours,
        ways: &Call::USUAL,
        embree,
    };
    let pairs = points.len() * (points.len() - 1) / 2;
    job.compare(programs, |a: &Vec<u64>, b| {
        [pairs, different_bits(a, b) / 2]
    })?;
    Ok(())
}

/// Which points of a terrain, of so many points to a side, a tower on a hill sees. Points are a metre above the ground.
pub fn viewshed(job: &mut Job, side: u32) -> Outcome {
    let mut mesh = Mesh::default();
    mesh.push_field(side, side, |column, row| {
        let (x, y) = (10.0 * column as f32, 10.0 * row as f32);
        [x, y, height(x, y)]
    });
    let targets: Vec<[f32; 3]> = mesh
        .positions
        .iter()
        .map(|&[x, y, z]| [x, y, z + 1.0])
        .collect();
    // The highest point in the middle quarter.
    let middle = |place: u32| (side / 4..side - side / 4).contains(&place);
    let places = (0..side * side).filter(|place| middle(place % side) && middle(place / side));
    let hill = places
        .max_by(|a, b| mesh.positions[*a as usize][2].total_cmp(&mesh.positions[*b as usize][2]));
    let [x, y, z] = mesh.positions[hill.ok_or("a terrain of no points")? as usize];
    let tower = [x + 1.0, y + 2.0, z + 30.0];
    let heights: Vec<f64> = (mesh.positions.iter())
        .map(|position| f64::from(position[2]))
        .collect();
    // Vertices are the centres of cells.
    let transform = [-5.0, 10.0, 0.0, -5.0, 0.0, 10.0];
    let field = || HeightField::new([side as usize; 2], &heights, transform).expect("cells");
    let ours = |field: &HeightField<'_>| {
        let [x, y, height] = tower.map(f64::from);
        let observers = [Observer {
            place: field.place([x, y]),
            height,
            normal: [0.0; 3],
        }];
        let limits = Limits {
            target: 1.0,
            ..Limits::default()
        };
        let job = ViewshedJob::new(field, &observers, limits).expect("memory for heights");
        let nothing = Bvh::build(&[], &Recipe::default()).expect("an empty tree");
        let found = antumbra_bake::run(&job, &nothing, &()).expect("memory for runs");
        let mut seen = vec![0u64; heights.len().div_ceil(64)];
        for cell in found.seen(0).flatten() {
            seen[cell / 64] |= 1 << (cell % 64);
        }
        seen
    };
    let embree = |scene: &Scene, call, share: usize| {
        let offset = origin_offset(&mesh, &targets);
        let mut seen = vec![0u64; targets.len().div_ceil(64)];
        scene.occluded(
            call,
            targets.len() / share,
            |index| between(tower, targets[index], offset),
            |index, occluded| seen[index / 64] |= u64::from(!occluded) << (index % 64),
        );
        seen
    };
    let programs = (&Call::USUAL[..], embree);
    let judge = |a: &Vec<u64>, b: &Vec<u64>| [targets.len(), different_bits(a, b)];
    job.compare_with((&mesh, SceneFlags::default()), field, ours, programs, judge)?;
    Ok(())
}

/// The segment between two points without an offset at both ends.
fn between(from: [f32; 3], to: [f32; 3], offset: f32) -> Ray {
    let dir = less(to, from);
    let part = offset / dot(dir, dir).sqrt();
    Ray {
        org: from,
        tnear: part,
        dir,
        tfar: 1.0 - part,
    }
}

fn different_bits(a: &[u64], b: &[u64]) -> usize {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a ^ b).count_ones() as usize)
        .sum()
}

/// Height of hills: smooth noise in seven octaves, ridges in the lower ones.
fn height(x: f32, y: f32) -> f32 {
    let (mut sum, mut size, mut scale) = (0.0, 900.0, 1.0 / 4000.0);
    for octave in 0..7 {
        let value = noise(x * scale, y * scale, octave);
        sum += size
            * if octave < 3 {
                1.0 - (2.0 * value - 1.0).abs()
            } else {
                value
            };
        size *= 0.45;
        scale *= 2.1;
    }
    sum
}

/// Values of 0 to 1 at whole numbers, smooth between them.
fn noise(x: f32, y: f32, seed: u64) -> f32 {
    let at =
        |column: f32, row: f32| Rng::new(seed << 40 | (column as u64) << 20 | row as u64).unit();
    let (left, low) = (x.floor(), y.floor());
    let ease = |part: f32| part * part * (3.0 - 2.0 * part);
    let (u, v) = (ease(x - left), ease(y - low));
    let mix = |a: f32, b: f32, part: f32| a + part * (b - a);
    mix(
        mix(at(left, low), at(left + 1.0, low), u),
        mix(at(left, low + 1.0), at(left + 1.0, low + 1.0), u),
        v,
    )
}
