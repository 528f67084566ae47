//! Meshes and instances that move between two keys, beside Embree with the same keys.

use antumbra::{Bvh, Geometry, Instance, Ray, Recipe};
use antumbra_lab::embree::{Call, Scene, SceneFlags};
use antumbra_lab::harness::{Bench, Case, Mesh, dot, model, unit};
use antumbra_render::Lowered;
use antumbra_testkit::{Rng, mesh};

use crate::Outcome;

/// Rays of a scene: what one thread takes at a time.
const RAYS: usize = 1 << 14;

/// Relative difference of distances by which Embree's motion differs from ours.
const NEARLY: f32 = 1e-3;

pub fn run(bench: &mut Bench) -> Outcome {
    let city = Mesh::read("builtin:city:200000")?;
    for share in [0.001, 0.01, 0.1] {
        let end = bent(&city.positions, share);
        let moving = Geometry::moving([city.positions.clone(), end], &city.indices[..]);
        compare(bench, &format!("city, moved by {share}"), &model(moving))?;
    }
    for count in [200, 5000] {
        compare(bench, &format!("{count} instances"), &balls(count))?;
    }
    Ok(())
}

fn compare(bench: &mut Bench, name: &str, model: &Lowered) -> Outcome {
    let embree = Scene::build(&bench.device()?, model, SceneFlags::default())?;
    let primitives = model.primitives()?;
    let bvh = Bvh::build(&primitives, &Recipe::default())?;
    // The same rays among what does not move, to see what motion costs.
    let still = Bvh::build(&primitives.middle(0), &Recipe::default())?;
    let (rays, times) = &rays(&bvh, RAYS / bench.part);
    let ray = |index: usize| (rays[index], times[index]);
    let free = || vec![false; rays.len()];
    let none = || vec![None; rays.len()];
    let packets = |call| {
        let (embree, ray) = (&embree, &ray);
        move |answers: &mut [bool]| {
            embree.occluded(call, answers.len(), ray, |index, is| answers[index] = is);
        }
    };
    let batch = || bvh.batch(rays).at(times).on_this_thread();
    let mut case = Case::new(name, rays.len());
    case.base("rtcOccluded1", free(), packets(Call::Single));
    case.add("rtcOccluded16", free(), packets(Call::Packets(16)));
    case.add("occluded", free(), |answers| {
        for (index, answer) in answers.iter_mut().enumerate() {
            *answer = bvh.query(&rays[index]).at(times[index]).occluded();
        }
    });
    case.add("occluded_batch", free(), |answers| {
        batch().occluded_into(answers)
    });
    case.add("occluded_batch, nothing moves", free(), |answers| {
        still.batch(rays).on_this_thread().occluded_into(answers);
    });
    case.base("rtcIntersect1", vec![0.0f32; rays.len()], |distances| {
        embree.intersect(Call::Single, rays.len(), ray, |index, (t, _)| {
            distances[index] = t
        });
    });
    case.add("intersect", none(), |hits| {
        for (index, hit) in hits.iter_mut().enumerate() {
            *hit = bvh.query(&rays[index]).at(times[index]).intersect();
        }
    });
    case.add("intersect_batch", none(), |hits| {
        batch().intersect_into(hits)
    });
    // Rays begin that close to surfaces.
    let absolute = 1e-4 * bvh.bounds().reach();
    Ok(case.run(bench, [NEARLY, absolute])?)
}

/// Positions bent and moved by a share of their size.
fn bent(positions: &[[f32; 3]], share: f32) -> Vec<[f32; 3]> {
    let size = positions
        .iter()
        .flatten()
        .fold(0.0f32, |size, x| size.max(x.abs()));
    let wave = |at: f32| share * size * (6.0 * at / size).sin();
    let moved = positions
        .iter()
        .map(|&[x, y, z]| [x + wave(y), y + wave(x + z), z + wave(x)]);
    moved.collect()
}

/// A ball with bumps, and instances of it that turn and move by about their size.
fn balls(count: usize) -> Lowered<'static> {
    let mut rng = Rng::new(7);
    let ball = mesh::icosphere(4).map("bumpy", |at| {
        let bump = 1.0 + 0.2 * (9.0 * at[0]).sin() * (9.0 * at[1]).sin();
        at.map(|x| x * bump)
    });
    let half = 1.6 * (count as f32).cbrt();
    let instance = |_| {
        let (at, way, axis) = (rng.point(half), rng.direction(), rng.direction());
        let angles = [rng.range(-0.6, 0.6), rng.range(-0.6, 0.6)];
        let key = |angle: f32, share: f32| {
            turned(unit(axis), angle, [0, 1, 2].map(|i| at[i] + share * way[i]))
        };
        Instance::moving(0, [key(angles[0], 0.0), key(angles[1], 1.0)])
    };
    Lowered {
        instances: (0..count).map(instance).collect(),
        objects: vec![vec![Geometry::triangles(ball.positions, ball.indices)]],
        ..Lowered::default()
    }
}

/// Rows of a transform that turns by twice an angle and moves.
fn turned(axis: [f32; 3], angle: f32, [a, b, c]: [f32; 3]) -> [[f32; 4]; 3] {
    let (sin, w) = angle.sin_cos();
    let [x, y, z] = axis.map(|x| x * sin);
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            a,
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            b,
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
            c,
        ],
    ]
}

/// Rays without end from what the first rays through the scene hit, in random directions away from there, each at a time of
/// its own.
fn rays(bvh: &Bvh, count: usize) -> (Vec<Ray>, Vec<f32>) {
    let mut rng = Rng::new(11);
    let bounds = bvh.bounds();
    let offset = bounds.origin_offset();
    let (mut rays, mut times) = (Vec::new(), Vec::new());
    while rays.len() < count {
        let time = rng.unit();
        let inside = [0, 1, 2].map(|axis| rng.range(bounds.min[axis], bounds.max[axis]));
        let first = Ray::new(inside, rng.direction());
        let Some(hit) = bvh.query(&first).at(time).intersect() else {
            continue;
        };
        let at = first.at(hit.t);
        // Back to the side that the first ray came from.
        let dir = rng.direction();
        let dir = if dot(dir, first.dir) > 0.0 {
            dir.map(|x| -x)
        } else {
            dir
        };
        let back = unit(first.dir).map(|x| x * offset.max(1e-4 * hit.t));
        rays.push(Ray::new([0, 1, 2].map(|i| at[i] - back[i]), dir));
        times.push(time);
    }
    (rays, times)
}
