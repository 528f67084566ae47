//! Rays at hairs, beside Embree's flat linear curves of the same segments.

use std::cell::RefCell;

use antumbra::shapes::Curves;
use antumbra::{Bvh, Error, Geometry, Ray, Recipe};
use antumbra_testkit::Rng;

use crate::embree::Embree;
use crate::turns::{Work, medians};

/// Hairs of a scene, and segments of a hair.
const HAIRS: usize = 20_000;
const SEGMENTS: usize = 12;
/// Rays of each kind.
const RAYS: usize = 1 << 16;

/// Prints times and rates relative to Embree's single calls.
pub fn run(embree: &mut Embree, rounds: usize) -> Result<(), Error> {
    let mut rng = Rng::new(1);
    for (name, length, radius) in [("fur", 0.1, 0.001), ("hair", 1.0, 0.0005)] {
        let (points, segments) = hairs(&mut rng, length, radius);
        embree.build_curves(&points, &segments);
        let bvh = Bvh::build(
            &[Geometry::curves(Curves::new(&points[..], &segments[..]))],
            &Recipe::default(),
        )?;
        for (kind, rays) in [
            ("camera", camera(&mut rng)),
            ("ao", around(&mut rng, &points, f32::INFINITY)),
            ("shadow", around(&mut rng, &points, 1.0)),
        ] {
            compare(&format!("{name} {kind}"), &bvh, embree, &rays, rounds);
        }
    }
    Ok(())
}

fn compare(name: &str, bvh: &Bvh, embree: &Embree, rays: &[Ray], rounds: usize) {
    let occluded = [(); 2].map(|()| RefCell::new(vec![false; rays.len()]));
    let distances = RefCell::new(vec![0.0; rays.len()]);
    let hits = RefCell::new(vec![None; rays.len()]);
    let mut works: Vec<Work<'_>> = vec![
        (
            "rtcOccluded1".into(),
            Box::new(|| embree.occluded(rays, &mut occluded[0].borrow_mut())),
        ),
        (
            "occluded".into(),
            Box::new(|| {
                for (ray, answer) in rays.iter().zip(occluded[1].borrow_mut().iter_mut()) {
                    *answer = bvh.occluded(ray);
                }
            }),
        ),
        (
            "batch.occluded".into(),
            Box::new(|| {
                let batch = bvh.batch(rays).on_this_thread();
                batch.occluded_into(&mut occluded[1].borrow_mut());
            }),
        ),
        (
            "rtcIntersect1".into(),
            Box::new(|| embree.intersect(rays, &mut distances.borrow_mut())),
        ),
        (
            "batch.intersect".into(),
            Box::new(|| {
                let batch = bvh.batch(rays).on_this_thread();
                batch.intersect_into(&mut hits.borrow_mut());
            }),
        ),
    ];
    let names: Vec<String> = works.iter().map(|(name, _)| name.clone()).collect();
    let times = medians(rounds, &mut works);
    drop(works);
    // Embree's joints are open, and its test is in single precision.
    let [theirs, ours] = &occluded;
    let differ = theirs
        .borrow()
        .iter()
        .zip(&*ours.borrow())
        .filter(|(a, b)| a != b)
        .count();
    let share = 100.0 * differ as f64 / rays.len() as f64;
    for (index, (of, time)) in names.iter().zip(&times).enumerate() {
        let base = times[if index < 3 { 0 } else { 3 }];
        let each = 1e9 * time / rays.len() as f64;
        println!(
            "{name:12} {of:16} {each:8.1} ns {:6.2}  ({share:.2} % differ)",
            base / time
        );
    }
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
            let scale = length / SEGMENTS as f32 / way.iter().map(|x| x * x).sum::<f32>().sqrt();
            at = [0, 1, 2].map(|axis| at[axis] + scale * way[axis]);
        }
    }
    (points, segments)
}

/// Rays of a camera, row by row.
fn camera(rng: &mut Rng) -> Vec<Ray> {
    let side = RAYS.isqrt();
    (0..side * side)
        .map(|pixel| {
            let across = |place: usize, by: f32| (place as f32 + by) / side as f32 - 0.5;
            let dir = [
                across(pixel % side, rng.unit()),
                across(pixel / side, rng.unit()),
                -1.0,
            ];
            Ray::new([0.0, 0.0, 4.0], dir)
        })
        .collect()
}

/// Rays from points of hairs, just outside of them, in directions of chance.
fn around(rng: &mut Rng, points: &[[f32; 4]], tfar: f32) -> Vec<Ray> {
    (0..RAYS)
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
