//! Cost of everything beside plain triangles: quads, user geometry, conditions on hits, vertices that move,
//! points. Beside Embree, where it has the same.
//!
//! - this file: one case, and the cases of rays;  `shapes`: one mesh as several kinds of geometry
//! - `asked`: our trees, queried with conditions;  `moving`: refits;  `points`: what is near a point

mod asked;
mod moving;
mod points;
mod shapes;

use std::sync::Arc;

use antumbra::{Brute, Isa, PrimId, Primitives, Ray, Recipe, Width};
use antumbra_render::Lowered;
use rayon::ThreadPool;

use super::Outcome;
use super::engine::{Engine, Label, Query};
use super::ours::{Api, Ingredients, Ours, Tree};
use super::record::{Check, KindRow};
use super::rival::{Rival, Variant};
use crate::embree::{self, Device, Embree, Scene, SceneFlags};
use crate::harness::{self, Answers, Mesh, Work, median, median_ratio, model};
use crate::watch::Watcher;
use crate::{Error, Rays};
use asked::{Asked, Condition};
use shapes::{holes, quads, user};

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
    pub watcher: &'a dyn Watcher,
}

/// Rows, and the number of rays that brute force answered.
#[derive(Default)]
pub struct Found {
    pub rows: Vec<KindRow>,
    pub checks: Vec<Check>,
}

/// Measures everything on one thread. A scene with instances, or without a mesh, has no rows.
pub fn measure(plan: &Plan) -> Result<Found, Error> {
    let mut found = Found::default();
    let mesh = Mesh::of(plan.model);
    if !plan.model.instances.is_empty() || mesh.indices.is_empty() {
        plan.watcher.note(&format!(
            "{}: kinds are measured in scenes of one level only",
            plan.scene
        ));
        return Ok(found);
    }
    let device = match plan.embree.zip(embree::isa(plan.isa.level())) {
        Some((embree, isa)) => Some(Device::new(embree, Some(isa), 0)?),
        None => None,
    };
    rays(plan, &mesh, device.as_ref(), &mut found)?;
    points::measure(plan, &mesh, device.as_ref(), &mut found)?;
    moving::measure(plan, &mesh, device.as_ref(), &mut found)?;
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

/// An engine of a kind, with its work.
struct Entry<'a> {
    kind: &'static str,
    label: Label,
    work: Box<dyn Work + 'a>,
}

impl<'a> Entry<'a> {
    /// An engine that knows a query.
    fn of(
        kind: &'static str,
        engine: &'a (dyn Engine + 'a),
        query: Query,
        rays: &'a [Ray],
    ) -> Option<Self> {
        let (label, work) = (engine.label(), engine.work(query, rays)?);
        Some(Self { kind, label, work })
    }
}

/// Questions of a case: what they are called in rows and in checks, and in a mesh of so many triangles.
#[derive(Clone, Copy)]
struct Questions {
    query: &'static str,
    check: &'static str,
    triangles: usize,
}

impl Questions {
    fn of(query: Query, triangles: usize) -> Self {
        Self {
            query: query.name(),
            check: query.name(),
            triangles,
        }
    }
}

/// Measures the engines of one case. The first of ours of each kind is right, if brute force says so.
fn case(
    plan: &Plan,
    questions: Questions,
    entries: Vec<Entry>,
    brute: impl Fn(&str, usize) -> f32,
    found: &mut Found,
) -> Result<(), Error> {
    let (names, teams): (Vec<_>, Vec<_>) = entries
        .into_iter()
        .map(|Entry { kind, label, work }| ((kind, label), vec![work]))
        .unzip();
    let measured = harness::measure(teams, plan.pool, plan.rounds, plan.watcher)?;
    let mut right: Vec<(&str, Answers)> = Vec::new();
    for ((kind, label), measured) in names.iter().zip(&measured) {
        if label.tree.is_some() && right.iter().all(|(other, _)| other != kind) {
            let disagreements = disagreements(&measured.answers, |index| brute(kind, index));
            found.checks.push(Check {
                scene: format!("{}, {kind}", plan.scene),
                rays: questions.check,
                ray_count: BRUTE_RAYS.min(measured.answers.len()),
                disagreements,
            });
            right.push((kind, measured.answers.clone()));
        }
    }
    let mut outcomes = Vec::new();
    for ((kind, label), measured) in names.into_iter().zip(measured) {
        if let Some((_, right)) = right.iter().find(|(other, _)| *other == kind) {
            outcomes.push((kind, Outcome::new(label, measured, right), right.len()));
        }
    }
    for (kind, outcome, count) in &outcomes {
        let blank = plan.blank(kind, questions.query, questions.triangles);
        let over = |kind: &str, label: &Label| {
            let mut all = outcomes.iter();
            let found = all.find(|(other, outcome, _)| *other == kind && outcome.label == *label);
            found.map(|(_, other, _)| median_ratio(&outcome.seconds, &other.seconds))
        };
        found.rows.push(KindRow {
            ratio_to_embree: over(kind, &Rival::REFERENCE),
            ratio_to_triangles: over("triangles", &outcome.label),
            ..row(&blank, outcome, *count)
        });
    }
    Ok(())
}

/// The primitives that rays start on.
fn starts(tree: &Tree, rays: &[Ray]) -> Vec<PrimId> {
    let start = |ray: &Ray| {
        let near = tree.bvh.closest(ray.org, f32::INFINITY);
        near.map_or(PrimId::NONE, |near| PrimId {
            prim_id: near.prim_id,
            geom_id: near.geom_id,
            inst_id: near.inst_id,
        })
    };
    rays.iter().map(start).collect()
}

/// Rows of all queries by rays.
fn rays(
    plan: &Plan,
    mesh: &Mesh,
    device: Option<&Arc<Device>>,
    found: &mut Found,
) -> Result<(), Error> {
    const KINDS: [&str; 4] = ["triangles", "quads", "user", "filter"];
    let models = [mesh.geometry(), quads(mesh), user(mesh), holes(mesh)].map(model);
    let mut primitives = Vec::new();
    for model in &models[..3] {
        primitives.push(model.primitives()?);
    }
    let trees: Result<Vec<Tree>, Error> = primitives.iter().map(|one| plan.tree(one)).collect();
    let mut trees = trees?;
    trees[0].bvh.set_masks(asked::masks());
    let scenes: Result<Vec<Scene>, Error> =
        (models.iter().filter_map(|model| Some((device?, model))))
            .map(|(device, model)| Scene::build(device, model, SceneFlags::default()))
            .collect();
    let scenes = scenes?;
    let brutes: Vec<Brute> = primitives.iter().map(Brute::new).collect();
    for query in Query::ALL {
        let rays = plan.rays(query);
        if rays.is_empty() {
            continue;
        }
        let starts = starts(&trees[0], rays);
        let mut engines: Vec<(&'static str, Box<dyn Engine + '_>)> = Vec::new();
        for (kind, scene) in KINDS.into_iter().zip(&scenes) {
            let variant = Variant::Default;
            engines.push((kind, Box::new(Rival { scene, variant })));
        }
        for api in [Api::Single, Api::Batch] {
            for (kind, tree) in KINDS.into_iter().zip(&trees) {
                engines.push((kind, Box::new(Ours { tree, api })));
            }
            for (kind, condition) in Condition::all(&starts) {
                let tree = &trees[0];
                let asked = Asked {
                    tree,
                    api,
                    condition,
                };
                engines.push((kind, Box::new(asked)));
            }
        }
        let entries = engines
            .iter()
            .filter_map(|(kind, engine)| Entry::of(kind, &**engine, query, rays));
        let brute = |kind: &str, index: usize| {
            let place = KINDS[..3].iter().position(|name| *name == kind);
            let brute = &brutes[place.unwrap_or(0)];
            asked::brute(kind, brute, &rays[index], starts[index])
        };
        let questions = Questions::of(query, mesh.indices.len());
        case(plan, questions, entries.collect(), brute, found)?;
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

/// Compares answers with brute force, which returns the distance of the first hit that counts.
fn disagreements(answers: &Answers, brute: impl Fn(usize) -> f32) -> usize {
    let count = BRUTE_RAYS.min(answers.len());
    let places = (0..count).map(|turn| turn * answers.len() / count);
    let wrong = places.filter(|&index| {
        let t = brute(index);
        match answers {
            Answers::Occluded(all) => all[index] != t.is_finite(),
            Answers::Distances(all) => all[index].to_bits() != t.to_bits(),
        }
    });
    wrong.count()
}
