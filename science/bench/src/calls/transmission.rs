//! Coloured shadows: light along rays through panes of glass, ray by ray and in a batch.

use antumbra::{Aabb, Bvh, Hit, Ray, Recipe, Visit};
use antumbra_lab::harness::{Bench, Case, Mesh, dot, less};

use crate::Outcome;

/// Panes in a scene, each a hundredth of its diagonal wide.
const PANES: usize = 4000;
/// Geometry id of the panes.
const GLASS: u32 = 1;

pub fn run(bench: &mut Bench, name: &str, mesh: &Mesh, rays: &[Ray]) -> Outcome {
    let bvh = Bvh::build(
        &[mesh.geometry(), panes(mesh).geometry()],
        &Recipe::default(),
    )?;
    let visit = |light: &mut f32, hit: Hit| {
        if hit.geom_id == GLASS {
            *light *= 0.9;
            Visit::Reject
        } else {
            *light = 0.0;
            Visit::Accept
        }
    };
    let mut case = Case::new(name, rays.len());
    case.base("visit_hits", vec![1.0; rays.len()], |lights| {
        for (ray, light) in rays.iter().zip(lights) {
            bvh.query(ray).visit_hits(|hit| visit(light, hit));
        }
    });
    case.add("batch.visit_hits", vec![1.0; rays.len()], |lights| {
        bvh.batch(rays).on_this_thread().visit_hits(lights, visit);
    });
    Ok(case.run(bench, [0.0; 2])?)
}

/// Panes at places of a low-discrepancy sequence in the bounds of a mesh, upright, towards either axis.
fn panes(mesh: &Mesh) -> Mesh {
    let Aabb { min, max } = Aabb::around(&mesh.positions);
    let size = less(max, min);
    let width = 0.01 * dot(size, size).sqrt();
    let mut panes = Mesh::default();
    for pane in 0..PANES {
        let step = |ratio: f64| (ratio * (pane + 1) as f64).fract() as f32;
        // Powers of the plastic number's inverse in three dimensions.
        let place = [0.819_172_513, 0.671_043_607, 0.549_700_478].map(step);
        let corner = [0, 1, 2].map(|axis| min[axis] + place[axis] * size[axis]);
        let along = 2 * (pane % 2);
        panes.push_quad(
            [(0.0, 0.0), (width, 0.0), (width, width), (0.0, width)].map(|(right, up)| {
                let mut position = corner;
                position[along] += right;
                position[1] += up;
                position
            }),
        );
    }
    panes
}
