//! Rays at hairs, beside Embree's flat linear curves of the same segments.

use antumbra::shapes::Curves;
use antumbra::{Bvh, Geometry, Ray, Recipe};
use antumbra_lab::embree::{Call, Scene, SceneFlags};
use antumbra_lab::harness::{Bench, Case, TOLERANCE, dot, each, model};
use antumbra_testkit::Rng;

use crate::Outcome;

/// Hairs of a scene, and segments of a hair.
const HAIRS: usize = 20_000;
const SEGMENTS: usize = 12;

/// Embree's joints are open, and its test is in single precision, so some answers differ.
pub fn run(bench: &mut Bench) -> Outcome {
    let (device, mut rng) = (bench.device()?, Rng::new(1));
    for (name, length, radius) in [("fur", 0.1, 0.001), ("hair", 1.0, 0.0005)] {
        let (points, segments) = hairs(&mut rng, length, radius);
        let geometry = Geometry::curves(Curves::new(&points[..], &segments[..]));
        let bvh = Bvh::build(std::slice::from_ref(&geometry), &Recipe::default())?;
        let model = model(geometry);
        let scene = Scene::build(&device, &model, SceneFlags::default())?;
        let count = bench.rays();
        for (kind, rays) in [
            ("camera", camera(&mut rng, count)),
            ("ao", around(&mut rng, &points, count, f32::INFINITY)),
            ("shadow", around(&mut rng, &points, count, 1.0)),
        ] {
            compare(bench, &format!("{name} {kind}"), (&bvh, &scene), &rays)?;
        }
    }
    Ok(())
}

fn compare(bench: &mut Bench, name: &str, (bvh, scene): (&Bvh, &Scene), rays: &[Ray]) -> Outcome {
    let ray = |index: usize| rays[index];
    let free = || vec![false; rays.len()];
    let mut case = Case::new(name, rays.len());
    case.base("rtcOccluded1", free(), |answers| {
        scene.occluded(Call::Single, rays.len(), ray, |index, is| {
            answers[index] = is
        });
    });
    case.add("occluded", free(), |answers| {
        each(rays, answers, |ray| bvh.occluded(ray))
    });
    case.add("batch.occluded", free(), |answers| {
        bvh.batch(rays).on_this_thread().occluded_into(answers)
    });
    case.base("rtcIntersect1", vec![0.0f32; rays.len()], |distances| {
        scene.intersect(Call::Single, rays.len(), ray, |index, (t, _)| {
            distances[index] = t
        });
    });
    case.add("batch.intersect", vec![None; rays.len()], |hits| {
        bvh.batch(rays).on_this_thread().intersect_into(hits);
    });
    Ok(case.run(bench, [TOLERANCE, 0.0])?)
}

/// Hairs that grow from a sphere, bent by chance.
fn hairs(rng: &mut Rng, length: f32, radius: f32) -> (Vec<[f32; 4]>, Vec<u32>) {
    let (mut points, mut segments) = (Vec::new(), Vec::new());
    for _ in 0..HAIRS {
        let mut at = rng.direction();
        let mut way = at;
        for step in 0..=SEGMENTS {
            let [x, y, z] = at;
            let left = 1.0 - step as f32 / SEGMENTS as f32;
            if step < SEGMENTS {
                segments.push(points.len() as u32);
            }
            points.push([x, y, z, radius * (0.2 + 0.8 * left)]);
            let bend = rng.direction();
            way = [0, 1, 2].map(|axis| way[axis] + 0.25 * bend[axis]);
            let scale = length / SEGMENTS as f32 / dot(way, way).sqrt();
            at = [0, 1, 2].map(|axis| at[axis] + scale * way[axis]);
        }
    }
    (points, segments)
}

/// Rays of a camera, row by row.
fn camera(rng: &mut Rng, count: usize) -> Vec<Ray> {
    let side = count.isqrt();
    (0..side * side)
        .map(|pixel| {
            let across = |place: usize, by: f32| (place as f32 + by) / side as f32 - 0.5;
            let (x, y) = (
                across(pixel % side, rng.unit()),
                across(pixel / side, rng.unit()),
            );
            Ray::new([0.0, 0.0, 4.0], [x, y, -1.0])
        })
        .collect()
}

/// Rays from points of hairs, just outside of them, in directions of chance.
fn around(rng: &mut Rng, points: &[[f32; 4]], count: usize, tfar: f32) -> Vec<Ray> {
    (0..count)
        .map(|_| {
            let [x, y, z, radius] = points[rng.below(points.len())];
            let dir = rng.direction();
            let org = [0, 1, 2].map(|axis| [x, y, z][axis] + 4.0 * radius * dir[axis]);
            Ray {
                tfar,
                ..Ray::new(org, dir)
            }
        })
        .collect()
}
