//! Refits: vertices that move to and fro, and the rays afterwards.

use std::sync::Arc;
use std::time::Instant;

use antumbra::{Brute, Bvh, Geometry, Primitives, Ray};

use super::shapes::Merged;
use super::{Found, Plan, check, row};
use crate::Error;
use crate::bench::embree::{self, Device, MovingMesh, RayHit, SingleRay};
use crate::bench::engine::{Answers, Engine, Label, Query, Work};
use crate::bench::measure::{Outcome, measure_each, median_ratio};
use crate::bench::ours::{Api, Ours, Tree};
use crate::bench::record::KindRow;
use crate::bench::rival::Rival;
use crate::watch::{self, Watcher};

/// Adds rows: refits on one thread, and rays after a refit.
pub fn measure(
    plan: &Plan,
    mesh: &Merged,
    device: Option<&Arc<Device>>,
    watcher: &dyn Watcher,
    found: &mut Found,
) -> Result<(), Error> {
    let moved = stirred(mesh);
    let here = [mesh.triangles()];
    let there = [Geometry::triangles(&moved[..], &mesh.indices[..])];
    let mut tree = plan.tree(&Primitives::new(&here)?)?;
    let labels = [
        Ours {
            tree: &tree,
            api: Api::Single,
        }
        .label(),
        Rival::REFERENCE,
    ];
    let engines = if device.is_some() { 2 } else { 1 };
    let mut outcomes: Vec<_> = labels[..engines]
        .iter()
        .map(|label| Outcome {
            label: label.clone(),
            seconds: Vec::new(),
            disagreements: 0,
        })
        .collect();
    for round in 0..=plan.rounds {
        watch::check(watcher)?;
        let ours = plan
            .pool
            .install(|| refit(&mut tree.bvh, [&there, &here]))?;
        let mut seconds = vec![ours];
        if let Some((embree, isa)) = plan.embree.zip(embree::isa(plan.isa.level())) {
            // Gone before our next turn: with few threads, one of its scheduler spins as long as it lives.
            let theirs = || {
                let device = Device::new(embree, isa, 1)?;
                let mut moving = MovingMesh::build(&device, &mesh.mesh())?;
                Ok(moving.refit(&moved)? + moving.refit(&mesh.positions)?)
            };
            seconds.push(theirs().map_err(Error::Embree)?);
        }
        // The first round warms up.
        if round > 0 {
            for (outcome, seconds) in outcomes.iter_mut().zip(seconds) {
                outcome.seconds.push(seconds);
            }
        }
    }
    let count = mesh.indices.len();
    let blank = plan.blank("refit", "update", count);
    let reference = outcomes.get(1).map(|outcome| outcome.seconds.clone());
    for outcome in &outcomes {
        found.rows.push(KindRow {
            ratio_to_embree: (reference.as_ref())
                .map(|reference| median_ratio(&outcome.seconds, reference)),
            // Two refits each.
            ..row(&blank, outcome, 2 * count)
        });
    }
    tree.bvh.refit(&there)?;
    let moving = device.map(|device| {
        let mut moving = MovingMesh::build(device, &mesh.mesh())?;
        moving.refit(&moved)?;
        Ok(moving)
    });
    let moving = moving.transpose().map_err(Error::Embree)?;
    rays_after(plan, &tree, moving.as_ref(), &there, watcher, found)
}

/// Adds rows of rays in refitted trees.
fn rays_after(
    plan: &Plan,
    tree: &Tree,
    moving: Option<&MovingMesh>,
    there: &[Geometry<'_>],
    watcher: &dyn Watcher,
    found: &mut Found,
) -> Result<(), Error> {
    let brute = Brute::new(&Primitives::new(there)?);
    let mut engines: Vec<Box<dyn Engine + '_>> = Vec::new();
    for api in [Api::Single, Api::Batch] {
        engines.push(Box::new(Ours { tree, api }));
    }
    if let Some(moving) = moving {
        engines.push(Box::new(Moved(moving)));
    }
    for query in Query::ALL {
        let rays = plan.rays(query);
        let Some(mut work) = engines[0].work(query, rays).filter(|_| !rays.is_empty()) else {
            continue;
        };
        work.reset();
        work.run();
        let right = work.answers();
        let t = |index: usize| {
            brute
                .intersect(&rays[index])
                .map_or(f32::INFINITY, |hit| hit.t)
        };
        found.checks.push(check(plan, "refitted", query, &right, t));
        let each: Vec<_> = engines.iter().map(|engine| (&**engine, &right)).collect();
        let outcomes = measure_each(&each, query, rays, plan.pool, plan.rounds, watcher)?;
        let reference = outcomes
            .iter()
            .find(|outcome| outcome.label == Rival::REFERENCE);
        let triangles = tree.bvh.report().primitives;
        for outcome in &outcomes {
            let blank = plan.blank("refitted", query.name(), triangles);
            found.rows.push(KindRow {
                ratio_to_embree: reference
                    .map(|reference| median_ratio(&outcome.seconds, &reference.seconds)),
                ..row(&blank, outcome, rays.len())
            });
        }
    }
    Ok(())
}

/// Seconds of some refits.
fn refit(bvh: &mut Bvh, places: [&[Geometry<'_>]; 2]) -> Result<f64, Error> {
    let start = Instant::now();
    for place in places {
        bvh.refit(place)?;
    }
    Ok(start.elapsed().as_secs_f64())
}

/// The positions after a wave of a fiftieth of the scene has passed: neighbours stay neighbours.
fn stirred(mesh: &Merged) -> Vec<[f32; 3]> {
    let reach = mesh
        .positions
        .iter()
        .flatten()
        .fold(0.0f32, |most, x| most.max(x.abs()));
    let wave = |x: f32| 0.02 * reach * (20.0 * x / reach).sin();
    let moved = |[x, y, z]: &[f32; 3]| [x + wave(*y), y + wave(*z), z + wave(*x)];
    mesh.positions.iter().map(moved).collect()
}

/// Embree's refitted scene as an engine.
struct Moved<'s>(&'s MovingMesh);

impl Engine for Moved<'_> {
    fn label(&self) -> Label {
        Rival::REFERENCE
    }

    fn work<'a>(&'a self, query: Query, rays: &'a [Ray]) -> Option<Box<dyn Work + 'a>> {
        let scene = self.0;
        Some(Box::new(MovedWork {
            scene,
            query,
            rays,
            single: Vec::new(),
            hits: Vec::new(),
        }))
    }
}

struct MovedWork<'a> {
    scene: &'a MovingMesh,
    query: Query,
    rays: &'a [Ray],
    single: Vec<SingleRay>,
    hits: Vec<RayHit>,
}

impl Work for MovedWork<'_> {
    fn reset(&mut self) {
        self.single = self.rays.iter().map(SingleRay::new).collect();
        self.hits = self.rays.iter().map(RayHit::new).collect();
    }

    fn run(&mut self) {
        match self.query {
            Query::Occluded => self.scene.occluded(&mut self.single),
            Query::Intersect => self.scene.intersect(&mut self.hits),
        }
    }

    fn answers(&self) -> Answers {
        match self.query {
            Query::Occluded => {
                Answers::Occluded(self.single.iter().map(SingleRay::is_occluded).collect())
            }
            Query::Intersect => {
                Answers::Distances(self.hits.iter().map(RayHit::distance).collect())
            }
        }
    }
}
