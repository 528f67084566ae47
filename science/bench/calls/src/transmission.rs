//! Coloured shadows: light along rays through panes of glass, ray by ray and in a batch.

use std::cell::RefCell;

use antumbra::{Bvh, Error, Geometry, Hit, Ray, Recipe, Visit};

use crate::input::Mesh;
use crate::turns::{Work, medians};

/// Panes in a scene, each a hundredth of its diagonal wide.
const PANES: usize = 4000;
/// Geometry id of the panes.
const GLASS: u32 = 1;

/// Prints rates relative to the loop.
pub fn run(name: &str, mesh: &Mesh, rays: &[Ray], rounds: usize) -> Result<(), Error> {
    let panes = panes(mesh);
    let geometry = [
        Geometry::triangles(&mesh.positions[..], &mesh.indices[..]),
        Geometry::triangles(&panes.positions[..], &panes.indices[..]),
    ];
    let bvh = Bvh::build(&geometry, &Recipe::default())?;
    let visit = |light: &mut f32, hit: Hit| {
        if hit.geom_id == GLASS {
            *light *= 0.9;
            Visit::Reject
        } else {
            *light = 0.0;
            Visit::Accept
        }
    };
    let lights = [(); 2].map(|()| RefCell::new(vec![1.0f32; rays.len()]));
    let mut works: Vec<Work<'_>> = vec![
        (
            "visit_hits".into(),
            Box::new(|| {
                for (ray, light) in rays.iter().zip(lights[0].borrow_mut().iter_mut()) {
                    *light = 1.0;
                    bvh.query(ray).visit_hits(|hit| visit(light, hit));
                }
            }),
        ),
        (
            "batch.visit_hits".into(),
            Box::new(|| {
                let mut lights = lights[1].borrow_mut();
                lights.fill(1.0);
                bvh.batch(rays)
                    .on_this_thread()
                    .visit_hits(&mut lights, visit);
            }),
        ),
    ];
    let names: Vec<String> = works.iter().map(|(name, _)| name.clone()).collect();
    let times = medians(rounds, &mut works);
    drop(works);
    assert_eq!(lights[0], lights[1]);
    let through = lights[0]
        .borrow()
        .iter()
        .filter(|&&light| light > 0.0)
        .count();
    for (name_of, time) in names.iter().zip(&times) {
        println!(
            "{name:16} {name_of:18} {:7.1} ns {:6.2} ({:.0} % lit)",
            1e9 * time / rays.len() as f64,
            times[0] / time,
            100.0 * through as f64 / rays.len() as f64
        );
    }
    Ok(())
}

/// Panes at places of a low-discrepancy sequence in the bounds of a mesh, upright, towards either axis.
fn panes(mesh: &Mesh) -> Mesh {
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for position in &mesh.positions {
        for (axis, &value) in position.iter().enumerate() {
            bounds[0][axis] = bounds[0][axis].min(value);
            bounds[1][axis] = bounds[1][axis].max(value);
        }
    }
    let [low, high] = bounds;
    let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    let width = 0.01 * size.iter().map(|size| size * size).sum::<f32>().sqrt();
    let mut panes = Mesh::default();
    for pane in 0..PANES {
        let step = |ratio: f64| (ratio * (pane + 1) as f64).fract() as f32;
        // Powers of the plastic number's inverse in three dimensions.
        let place = [0.819_172_513, 0.671_043_607, 0.549_700_478].map(step);
        let corner = [0, 1, 2].map(|axis| low[axis] + place[axis] * size[axis]);
        let along = 2 * (pane % 2);
        let first = panes.positions.len() as u32;
        for (right, up) in [(0.0, 0.0), (width, 0.0), (width, width), (0.0, width)] {
            let mut position = corner;
            position[along] += right;
            position[1] += up;
            panes.positions.push(position);
        }
        panes.indices.push([first, first + 1, first + 2]);
        panes.indices.push([first, first + 2, first + 3]);
    }
    panes
}
