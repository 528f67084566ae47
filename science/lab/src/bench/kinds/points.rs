//! Nearest primitives of points: ours in double precision, Embree's with a function in single precision.

use std::sync::Arc;

use antumbra::{Brute, Ray};

use super::{Entry, Found, Plan, Questions, case};
use crate::Error;
use crate::bench::engine::Engine;
use crate::bench::ours::{Api, Ours};
use crate::bench::rival::Rival;
use crate::embree::{Device, Scene, SceneFlags};
use crate::harness::{Mesh, each, work};

/// Adds rows.
pub fn measure(
    plan: &Plan,
    mesh: &Mesh,
    device: Option<&Arc<Device>>,
    found: &mut Found,
) -> Result<(), Error> {
    let model = mesh.model();
    let primitives = model.primitives()?;
    let tree = plan.tree(&primitives)?;
    let points = &points(plan)[..];
    if points.is_empty() {
        return Ok(());
    }
    let scene = device.map(|device| Scene::build(device, &model, SceneFlags::default()));
    let scene = scene.transpose()?;
    let (bvh, triangles) = (&tree.bvh, &mesh.triangles());
    let nearest = vec![None; points.len()];
    let ours = |api, work| Entry {
        kind: "points",
        label: Ours { tree: &tree, api }.label(),
        work,
    };
    let mut entries = vec![
        ours(
            Api::Single,
            work(nearest.clone(), |nearest| {
                each(points, nearest, |point| bvh.closest(*point, f32::INFINITY));
            }),
        ),
        ours(
            Api::Batch,
            work(nearest, |nearest| bvh.points(points).closest_into(nearest)),
        ),
    ];
    if let Some(scene) = &scene {
        entries.push(Entry {
            kind: "points",
            label: Rival::REFERENCE,
            work: work(vec![0.0; points.len()], move |distances| {
                scene.distances(triangles, points, false, distances);
            }),
        });
    }
    let brute = Brute::new(&primitives);
    let distance = |_: &str, index: usize| {
        let near = brute.closest(points[index], f32::INFINITY);
        near.map_or(f32::INFINITY, |near| near.distance)
    };
    let questions = Questions {
        query: "closest",
        check: "points",
        triangles: mesh.indices.len(),
    };
    case(plan, questions, entries, distance, found)
}

/// Points at some distance from surfaces: the origins of diffuse rays, moved along the rays by up to a fiftieth of what they
/// may be long, or of the scene.
fn points(plan: &Plan) -> Vec<[f32; 3]> {
    let rays = &plan.rays.diffuse;
    let extent = |axis: usize| {
        let all = rays.iter().map(|ray| ray.org[axis]);
        let ends = (f32::INFINITY, f32::NEG_INFINITY);
        let (min, max) = all.fold(ends, |(min, max), x| (min.min(x), max.max(x)));
        max - min
    };
    let size = (0..3).map(extent).fold(0.0f32, f32::max);
    let point = |(index, ray): (usize, &Ray)| {
        let part = (index as u32).wrapping_mul(0x9e37_79b1) as f32 / u32::MAX as f32;
        let length = ray.dir.iter().map(|x| x * x).sum::<f32>().sqrt();
        ray.at(0.02 * size * part / length)
    };
    let points = rays.iter().enumerate().map(point);
    points
        .filter(|point| point.iter().all(|x| x.is_finite()))
        .collect()
}
