//! Nearest primitives of points: ours in double precision, Embree's with a function in single precision.

use std::sync::Arc;
use std::time::Instant;

use antumbra::{Brute, ClosestPoint};

use super::shapes::{self, Merged};
use super::{BRUTE_RAYS, Found, Plan, row};
use crate::Error;
use crate::bench::embree::{Device, Scene};
use crate::bench::engine::{Answers, Engine};
use crate::bench::measure::{Outcome, TOLERANCE, median_ratio};
use crate::bench::ours::{Api, Ours};
use crate::bench::record::Check;
use crate::bench::rival::Rival;

/// Adds rows.
pub fn measure(
    plan: &Plan,
    mesh: &Merged,
    device: Option<&Arc<Device>>,
    found: &mut Found,
) -> Result<(), Error> {
    let model = shapes::lowered(mesh.triangles());
    let primitives = model.primitives()?;
    let tree = plan.tree(&primitives)?;
    let points = points(plan);
    if points.is_empty() {
        return Ok(());
    }
    let brute = Brute::new(&primitives);
    let scene = device
        .map(|device| Scene::build(device, &model, false))
        .transpose();
    let scene = scene.map_err(Error::Embree)?;
    let nearest =
        |closest: &Option<ClosestPoint>| closest.map_or(f32::INFINITY, |near| near.distance);
    let mut distances = vec![0.0; points.len()];
    let mut closest = vec![None; points.len()];
    let mut outcomes: Vec<_> = [Api::Single, Api::Batch]
        .map(|api| Ours { tree: &tree, api })
        .iter()
        .map(Engine::label)
        .chain(scene.is_some().then_some(Rival::REFERENCE))
        .map(|label| Outcome {
            label,
            seconds: Vec::new(),
            disagreements: 0,
        })
        .collect();
    let mut right = Answers::Distances(Vec::new());
    for round in 0..=plan.rounds {
        for turn in 0..outcomes.len() {
            // The first round begins with the first one, which is right.
            let which = (round + turn) % outcomes.len();
            let start = Instant::now();
            match which {
                0 => {
                    for (point, closest) in points.iter().zip(&mut closest) {
                        *closest = tree.bvh.closest(*point, f32::INFINITY);
                    }
                }
                1 => plan.pool.install(|| {
                    tree.bvh.points(&points).closest_into(&mut closest);
                }),
                _ => {
                    if let Some(scene) = &scene {
                        scene.distances(&mesh.mesh(), &points, &mut distances);
                    }
                }
            }
            let seconds = start.elapsed().as_secs_f64();
            if round > 0 {
                outcomes[which].seconds.push(seconds);
                continue;
            }
            let (answers, tolerance) = match which {
                0 | 1 => (closest.iter().map(nearest).collect(), 0.0),
                _ => (distances.clone(), TOLERANCE),
            };
            let answers = Answers::Distances(answers);
            if which == 0 {
                right = answers.clone();
            }
            outcomes[which].disagreements = answers.differing_from(&right, tolerance);
        }
    }
    let count = BRUTE_RAYS.min(points.len());
    let Answers::Distances(right) = &right else {
        return Ok(());
    };
    let wrong = (0..count)
        .map(|turn| turn * points.len() / count)
        .filter(|&index| {
            let closest = brute.closest(points[index], f32::INFINITY);
            nearest(&closest).to_bits() != right[index].to_bits()
        });
    found.checks.push(Check {
        scene: format!("{}, points", plan.scene),
        rays: "points",
        ray_count: count,
        disagreements: wrong.count(),
    });
    let reference = outcomes
        .iter()
        .find(|outcome| outcome.label == Rival::REFERENCE);
    let reference = reference.map(|outcome| outcome.seconds.clone());
    let blank = plan.blank("points", "closest", mesh.indices.len());
    for outcome in &outcomes {
        let mut row = row(&blank, outcome, points.len());
        row.ratio_to_embree = reference
            .as_ref()
            .map(|reference| median_ratio(&outcome.seconds, reference));
        found.rows.push(row);
    }
    Ok(())
}

/// Points at some distance from surfaces: the origins of diffuse rays, moved along the rays by up to a fiftieth of what they
/// may be long, or of the scene.
fn points(plan: &Plan) -> Vec<[f32; 3]> {
    let bounds = |rays: &[antumbra::Ray]| {
        let mut size = 0.0f32;
        for axis in 0..3 {
            let all = rays.iter().map(|ray| ray.org[axis]);
            let (min, max) = all.fold((f32::INFINITY, f32::NEG_INFINITY), |(min, max), x| {
                (min.min(x), max.max(x))
            });
            size = size.max(max - min);
        }
        size
    };
    let rays = &plan.rays.diffuse;
    let size = bounds(rays);
    let point = |(index, ray): (usize, &antumbra::Ray)| {
        let part = (index as u32).wrapping_mul(0x9e37_79b1) as f32 / u32::MAX as f32;
        let length = ray.dir.iter().map(|x| x * x).sum::<f32>().sqrt();
        ray.at(0.02 * size * part / length)
    };
    let point = rays.iter().enumerate().map(point);
    point
        .filter(|point| point.iter().all(|x| x.is_finite()))
        .collect()
}
