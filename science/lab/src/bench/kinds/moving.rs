//! Refits: vertices that move to and fro, and the rays afterwards.

use std::sync::Arc;
use std::time::Instant;

use antumbra::{Brute, Geometry, Primitives};

use super::{Entry, Found, Plan, Questions, case, row};
use crate::Error;
use crate::bench::Outcome;
use crate::bench::engine::{Engine, Query};
use crate::bench::ours::{Api, Ours, Tree};
use crate::bench::record::KindRow;
use crate::bench::rival::{Rival, Variant};
use crate::embree::{self, Device, Scene};
use crate::harness::{Mesh, interleave, median_ratio};
use crate::watch;

/// Adds rows: refits on one thread, and rays after a refit.
pub fn measure(
    plan: &Plan,
    mesh: &Mesh,
    device: Option<&Arc<Device>>,
    found: &mut Found,
) -> Result<(), Error> {
    let moved = stirred(mesh);
    let there = [Geometry::triangles(&moved[..], &mesh.indices[..])];
    let mut tree = plan.tree(&Primitives::new(&[mesh.geometry()])?)?;
    refits(plan, (mesh, &moved), &mut tree, found)?;
    tree.bvh.refit(&there)?;
    let moved_scene = |device| {
        let mut scene = Scene::of_moving(device, &mesh.triangles())?;
        scene.refit(&moved).map(|_| scene)
    };
    let moving = device.map(moved_scene).transpose()?;
    let brute = Brute::new(&Primitives::new(&there)?);
    let mut engines: Vec<Box<dyn Engine + '_>> = Vec::new();
    for api in [Api::Single, Api::Batch] {
        engines.push(Box::new(Ours { tree: &tree, api }));
    }
    if let Some(scene) = &moving {
        let variant = Variant::Default;
        engines.push(Box::new(Rival { scene, variant }));
    }
    for query in Query::ALL {
        let rays = plan.rays(query);
        let entry = |engine| Entry::of("refitted", engine, query, rays);
        let entries = engines.iter().filter_map(|engine| entry(&**engine));
        let entries: Vec<_> = entries.filter(|_| !rays.is_empty()).collect();
        let t = |_: &str, index: usize| {
            let hit = brute.intersect(&rays[index]);
            hit.map_or(f32::INFINITY, |hit| hit.t)
        };
        let triangles = tree.bvh.report().primitives;
        case(plan, Questions::of(query, triangles), entries, t, found)?;
    }
    Ok(())
}

/// Adds rows of refits on one thread, there and back. The tree is back at the end.
fn refits(
    plan: &Plan,
    (mesh, moved): (&Mesh, &[[f32; 3]]),
    tree: &mut Tree,
    found: &mut Found,
) -> Result<(), Error> {
    let here = [mesh.geometry()];
    let there = [Geometry::triangles(moved, &mesh.indices[..])];
    let api = Api::Single;
    let labels = [Ours { tree, api }.label(), Rival::REFERENCE];
    let rival = plan.embree.zip(embree::isa(plan.isa.level()));
    let engines = 1 + usize::from(rival.is_some());
    let seconds = interleave(plan.rounds, engines, |which| {
        watch::check(plan.watcher)?;
        match rival.filter(|_| which == 1) {
            None => plan.pool.install(|| {
                let start = Instant::now();
                tree.bvh.refit(&there)?;
                tree.bvh.refit(&here)?;
                Ok::<_, Error>(start.elapsed().as_secs_f64())
            }),
            // Gone before our next turn: with few threads, one of its scheduler spins as long as it lives.
            Some((embree, isa)) => {
                let device = Device::new(embree, Some(isa), 1)?;
                let mut moving = Scene::of_moving(&device, &mesh.triangles())?;
                Ok(moving.refit(moved)? + moving.refit(&mesh.positions)?)
            }
        }
    })?;
    let count = mesh.indices.len();
    let blank = plan.blank("refit", "update", count);
    for (label, own) in labels.into_iter().zip(&seconds) {
        let outcome = Outcome {
            label,
            seconds: own.clone(),
            disagreements: 0,
        };
        found.rows.push(KindRow {
            ratio_to_embree: seconds.get(1).map(|theirs| median_ratio(own, theirs)),
            // Two refits each.
            ..row(&blank, &outcome, 2 * count)
        });
    }
    Ok(())
}

/// The positions after a wave of a fiftieth of the scene has passed: neighbours stay neighbours.
fn stirred(mesh: &Mesh) -> Vec<[f32; 3]> {
    let all = mesh.positions.iter().flatten();
    let extent = all.fold(0.0f32, |most, x| most.max(x.abs()));
    let wave = |x: f32| 0.02 * extent * (20.0 * x / extent).sin();
    let moved = |[x, y, z]: &[f32; 3]| [x + wave(*y), y + wave(*z), z + wave(*x)];
    mesh.positions.iter().map(moved).collect()
}
