//! Distances of a grid of points from a scan.

use antumbra::{Aabb, Bvh, ClosestPoint};
use antumbra_lab::embree::{Scene, SceneFlags};
use antumbra_lab::harness::{Mesh, dot};

use super::{Job, Programs, differing};
use crate::Outcome;

/// Whether Embree's program begins a search within what the point before allows.
const WAYS: [(&str, bool); 2] = [("point query", false), ("point query, bounded", true)];

/// So many points to a side, in the box of the mesh and a tenth around it.
pub fn run(job: &mut Job, mesh: &Mesh, side: usize) -> Outcome {
    let bounds = Aabb::around(&mesh.positions);
    let size = [0, 1, 2].map(|axis| bounds.max[axis] - bounds.min[axis]);
    // Every other row and slice backwards, so that each point is beside the one before.
    let to_and_fro = |place: usize, turn: usize| match turn % 2 {
        0 => place % side,
        _ => side - 1 - place % side,
    };
    let points: Vec<[f32; 3]> = (0..side * side * side)
        .map(|index| {
            let (row, slice) = (index / side, index / side / side);
            let places = [to_and_fro(index, row), to_and_fro(row, slice), slice];
            let places = places.map(|place| 1.2 * (place as f32 + 0.5) / side as f32 - 0.1);
            [0, 1, 2].map(|axis| bounds.min[axis] + places[axis] * size[axis])
        })
        .collect();
    let distance = |near: Option<ClosestPoint>| near.map_or(f32::INFINITY, |near| near.distance);
    let geometry = antumbra::shapes::TriangleMesh::new(&mesh.positions[..], &mesh.indices[..]);
    let programs = Programs {
        mesh,
        flags: SceneFlags::default(),
        ours: |bvh: &Bvh| {
            bvh.points(&points)
                .closest()
                .into_iter()
                .map(distance)
                .collect()
        },
        ways: &WAYS,
        embree: |scene: &Scene, is_bounded, share: usize| {
            let mut distances = vec![0.0; points.len() / share];
            scene.distances(&geometry, &points, is_bounded, &mut distances);
            distances
        },
    };
    let smallest = 1e-6 * dot(size, size).sqrt();
    let differs = |a: &f32, b: &f32| (a - b).abs() > 1e-4 * a + smallest;
    job.compare(programs, differing(differs))?;
    Ok(())
}
