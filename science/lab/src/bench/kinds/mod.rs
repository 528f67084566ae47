//! Cost of everything beside plain triangles: quads, user geometry, conditions on hits, vertices that move,
//! points. Beside Embree, where it has the same.
//!
//! - this file: which rows there are;  `shapes`: one mesh as several kinds of geometry
//! - `asked`: our trees, queried with conditions;  `moving`: refits;  `points`: what is near a point

mod asked;
mod moving;
mod points;
mod shapes;

use antumbra::{Brute, Isa, PrimId, Primitives, Ray, Recipe, Width};
use antumbra_render::Lowered;
use rayon::ThreadPool;

use super::embree::{self, Device, Embree, Scene};
use super::engine::{Answers, Engine, Query};
use super::measure::{Outcome, measure_each, median, median_ratio};
use super::ours::{Api, Ingredients, Ours, Tree};
use super::record::{Check, KindRow};
use super::rival::{Rival, Variant};
use crate::Error;
use crate::Rays;
use crate::watch::{self, Watcher};
use asked::{Asked, Condition};
use shapes::Merged;

/// Rays, or points, of each kind that are compared with brute force.
const BRUTE_RAYS: usize = 64;

/// Scene, rays and recipe of one measurement.
pub struct Plan<'a> {
    pub scene: &'a str,
    pub model: &'a Lowered<'a>,
    /// Rays that are timed: `shadow` by occlusion queries, `diffuse` by closest hits.
    pub rays: &'a Rays,
    /// Training rays.
    pub sample: &'a Rays,
    pub recipe: Recipe,
    pub isa: Isa,
    pub pool: &'a ThreadPool,
    pub rounds: usize,
    pub embree: Option<Embree>,
}

/// Rows, and the number of rays that brute force answered.
#[derive(Default)]
pub struct Found {
    pub rows: Vec<KindRow>,
    pub checks: Vec<Check>,
}

/// Measures everything on one thread. A scene with instances, or without a mesh, has no rows.
pub fn measure(plan: &Plan, watcher: &dyn Watcher) -> Result<Found, Error> {
    let mut found = Found::default();
    let mesh = Merged::new(plan.model);
    if !plan.model.instances.is_empty() || mesh.indices.is_empty() {
        watcher.note(&format!(
            "{}: kinds are measured in scenes of one level only",
            plan.scene
        ));
        return Ok(found);
    }
    let device = || -> Result<_, Error> {
        let Some((embree, isa)) = plan.embree.zip(embree::isa(plan.isa.level())) else {
            return Ok(None);
        };
        Device::new(embree, isa, 0).map(Some).map_err(Error::Embree)
    };
    let device = device()?;
    rays(plan, &mesh, device.as_ref(), watcher, &mut found)?;
    watch::check(watcher)?;
    points::measure(plan, &mesh, device.as_ref(), &mut found)?;
    watch::check(watcher)?;
    moving::measure(plan, &mesh, device.as_ref(), watcher, &mut found)?;
    Ok(found)
}

impl Plan<'_> {
    /// A learned tree of other geometry.
    fn tree(&self, primitives: &Primitives) -> Result<Tree, Error> {
        let recipe = &self.recipe;
        let width = Width::auto(self.isa.level());
        let ingredients = Ingredients::new(primitives, self.sample, recipe);
        Ok(ingredients.tree(width, recipe.collapse, recipe.order, self.isa)?)
    }

    /// A row without figures.
    fn blank(&self, kind: &'static str, query: &'static str, triangles: usize) -> KindRow {
        KindRow {
            scene: self.scene.to_owned(),
            triangles,
            kind,
            query,
            level: self.isa.level().to_string(),
            ..KindRow::default()
        }
    }

    /// The rays of a query.
    fn rays(&self, query: Query) -> &[Ray] {
        match query {
            Query::Occluded => &self.rays.shadow,
            Query::Intersect => &self.rays.diffuse,
        }
    }
}

/// An engine of a kind.
struct Entry<'a> {
    kind: &'static str,
    engine: Box<dyn Engine + 'a>,
}

/// Rows of all queries by rays.
fn rays(
    plan: &Plan,
    mesh: &Merged,
    device: Option<&std::sync::Arc<Device>>,
    watcher: &dyn Watcher,
    found: &mut Found,
) -> Result<(), Error> {
    let triangles = shapes::lowered(mesh.triangles());
    let quads = shapes::lowered(mesh.quads());
    let user = shapes::lowered(mesh.user());
    let holes = shapes::lowered(mesh.holes());
    let primitives = |model: &Lowered| model.primitives();
    let (of_triangles, of_quads, of_user) = (
        primitives(&triangles)?,
        primitives(&quads)?,
        primitives(&user)?,
    );
    let mut trees = [
        plan.tree(&of_triangles)?,
        plan.tree(&of_quads)?,
        plan.tree(&of_user)?,
    ];
    trees[0].bvh.set_masks(asked::masks());
    let trees = &trees;
    let scenes = device.map(|device| {
        let build = |model| Scene::build(device, model, false).map_err(Error::Embree);
        Ok::<_, Error>([
            build(&triangles)?,
            build(&quads)?,
            build(&user)?,
            build(&holes)?,
        ])
    });
    let scenes = scenes.transpose()?;
    let brutes = [&of_triangles, &of_quads, &of_user].map(Brute::new);
    for query in Query::ALL {
        let rays = plan.rays(query);
        if rays.is_empty() {
            continue;
        }
        // The primitives that the rays start on.
        let starts: Vec<_> = (rays.iter())
            .map(|ray| {
                let start = trees[0].bvh.closest(ray.org, f32::INFINITY);
                start.map_or(PrimId::NONE, |start| PrimId {
                    prim_id: start.prim_id,
                    geom_id: start.geom_id,
                    inst_id: start.inst_id,
                })
            })
            .collect();
        let starts = &starts[..];
        let mut entries: Vec<Entry> = Vec::new();
        let mut add = |kind, engine| entries.push(Entry { kind, engine });
        if let Some(scenes) = &scenes {
            for (kind, scene) in ["triangles", "quads", "user", "filter"]
                .into_iter()
                .zip(scenes)
            {
                let variant = Variant::Default;
                add(kind, Box::new(Rival { scene, variant }) as Box<dyn Engine>);
            }
        }
        for api in [Api::Single, Api::Batch] {
            for (kind, tree) in ["triangles", "quads", "user"].into_iter().zip(trees) {
                add(kind, Box::new(Ours { tree, api }));
            }
            for (kind, condition) in [
                ("closed", Condition::Closed),
                ("mask", Condition::Mask),
                ("except", Condition::Except(starts)),
                ("filter", Condition::Filter),
                ("visit", Condition::Visit),
            ] {
                let all = rays;
                if condition.has(query, api) {
                    let tree = &trees[0];
                    add(
                        kind,
                        Box::new(Asked {
                            tree,
                            api,
                            all,
                            condition,
                        }),
                    );
                }
            }
        }
        // Our answers one by one are right, if brute force says so.
        let mut references: Vec<(&str, Answers)> = Vec::new();
        let ours = |entry: &&Entry| entry.engine.label().engine == "antumbra";
        for entry in entries.iter().filter(ours) {
            if references.iter().any(|(kind, _)| *kind == entry.kind) {
                continue;
            }
            let Some(mut work) = entry.engine.work(query, rays) else {
                continue;
            };
            work.reset();
            work.run();
            let answers = work.answers();
            let brute = match entry.kind {
                "quads" => &brutes[1],
                "user" => &brutes[2],
                _ => &brutes[0],
            };
            let condition =
                |index: usize| asked::brute(entry.kind, brute, &rays[index], starts[index]);
            found
                .checks
                .push(check(plan, entry.kind, query, &answers, condition));
            references.push((entry.kind, answers));
            watch::check(watcher)?;
        }
        let reference = |kind: &str| references.iter().find(|(other, _)| *other == kind);
        let engines: Vec<(&dyn Engine, &Answers)> = (entries.iter())
            .filter_map(|entry| Some((&*entry.engine, &reference(entry.kind)?.1)))
            .collect();
        let outcomes = measure_each(&engines, query, rays, plan.pool, plan.rounds, watcher)?;
        let count = mesh.indices.len();
        for (entry, outcome) in entries.iter().zip(&outcomes) {
            let blank = plan.blank(entry.kind, query.name(), count);
            let of_kind = |kind: &str, label: super::engine::Label| {
                let mut all = entries.iter().zip(&outcomes);
                let found = all.find(|(entry, other)| entry.kind == kind && other.label == label);
                found.map(|(_, other)| median_ratio(&outcome.seconds, &other.seconds))
            };
            found.rows.push(KindRow {
                ratio_to_embree: of_kind(entry.kind, Rival::REFERENCE),
                ratio_to_triangles: of_kind("triangles", outcome.label.clone()),
                ..row(&blank, outcome, rays.len())
            });
        }
    }
    Ok(())
}

/// A row of what was measured.
fn row(blank: &KindRow, outcome: &Outcome, count: usize) -> KindRow {
    let seconds = median(outcome.seconds.iter().copied());
    KindRow {
        engine: outcome.label.engine,
        api: outcome.label.api,
        count,
        millions_per_s: count as f64 / seconds / 1e6,
        disagreements: outcome.disagreements,
        ..blank.clone()
    }
}

/// Compares answers with brute force, which returns whether anything counts and at which distance the first hit is.
fn check(
    plan: &Plan,
    kind: &'static str,
    query: Query,
    answers: &Answers,
    brute: impl Fn(usize) -> f32,
) -> Check {
    let len = match answers {
        Answers::Occluded(all) => all.len(),
        Answers::Distances(all) => all.len(),
    };
    let count = BRUTE_RAYS.min(len);
    let wrong = (0..count).map(|turn| turn * len / count).filter(|&index| {
        let t = brute(index);
        match answers {
            Answers::Occluded(all) => all[index] != t.is_finite(),
            Answers::Distances(all) => all[index].to_bits() != t.to_bits(),
        }
    });
    Check {
        scene: format!("{}, {kind}", plan.scene),
        rays: query.name(),
        ray_count: count,
        disagreements: wrong.count(),
    }
}
