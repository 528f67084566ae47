//! Our own engines: trees with their order, queried ray by ray or in batches.

use antumbra::parts::{Steps, TreeLog};
use antumbra::recipe::{Collapse, Order};
use antumbra::{Build, Bvh, Error, Isa, Primitives, Ray, Recipe, Stage, Width};
use antumbra_render::clock;
use antumbra_trees::engine;

use super::engine::{Engine, Label, Query, TreeLabel};
use crate::Rays;
use crate::counted::{counted, sum};
use crate::harness::{Work, each, work};

/// A tree ready to be queried.
pub struct Tree {
    pub bvh: Bvh,
    pub label: TreeLabel,
}

/// Binary tree, training log and rays that the trees of a scene share.
pub struct Ingredients {
    stage: Stage,
    log: TreeLog,
    /// Training rays, none of them among those that are timed.
    training: Vec<Ray>,
    recipe: Recipe,
}

impl Ingredients {
    /// Builds the binary tree of a recipe and logs the sample in it: shadow and diffuse rays alike, because a log of one
    /// kind only can ruin the other.
    pub fn new(primitives: &Primitives, sample: &Rays, recipe: &Recipe) -> Self {
        let recipe = recipe.clock(Some(clock));
        let training = [&sample.shadow[..], &sample.diffuse].concat();
        let build = Build::new(primitives).rays(&training).recipe(&recipe);
        let stage = build.stage().expect("nobody stops it");
        let log = stage.training_log(&training, &recipe);
        Self {
            log: log.into_owned(),
            stage,
            training,
            recipe,
        }
    }

    /// Collapses the tree, and has it learn if its order learns.
    pub fn tree(
        &self,
        width: Width,
        collapse: Collapse,
        order: Order,
        isa: Isa,
    ) -> Result<Tree, Error> {
        let recipe = self
            .recipe
            .engine(engine(isa, width))
            .collapse(collapse)
            .order(order);
        let log = collapse.needs_log().then_some(&self.log);
        let mut bvh = self.stage.collapse_for(log, true, &recipe);
        bvh.learn_order(&self.training, None, &recipe)?;
        let label = TreeLabel {
            builder: recipe.builder.name(),
            collapse: collapse.name(),
            width: width.lanes(),
            order: order.name(),
        };
        Ok(Tree { bvh, label })
    }
}

/// How a tree is queried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Api {
    Single,
    Batch,
}

/// A tree and how it is queried.
pub struct Ours<'t> {
    pub tree: &'t Tree,
    pub api: Api,
}

impl Engine for Ours<'_> {
    fn label(&self) -> Label {
        Label {
            engine: "antumbra",
            api: match self.api {
                Api::Single => "single",
                Api::Batch => "batch",
            },
            tree: Some(self.tree.label),
        }
    }

    fn work<'a>(&'a self, query: Query, rays: &'a [Ray]) -> Option<Box<dyn Work + 'a>> {
        let (bvh, api) = (&self.tree.bvh, self.api);
        Some(match query {
            Query::Occluded => work(vec![false; rays.len()], move |answers| match api {
                Api::Single => each(rays, answers, |ray| bvh.occluded(ray)),
                Api::Batch => bvh.batch(rays).occluded_into(answers),
            }),
            Query::Intersect => work(vec![None; rays.len()], move |answers| match api {
                Api::Single => each(rays, answers, |ray| bvh.intersect(ray)),
                Api::Batch => bvh.batch(rays).intersect_into(answers),
            }),
        })
    }
}

/// Mean node and primitive tests of an occlusion ray; NaN for no rays.
pub fn mean_tests(bvh: &Bvh, rays: &[Ray]) -> [f64; 2] {
    let [nodes, prims, _] = sum(&counted(bvh, rays).1);
    [nodes, prims].map(|tests| tests as f64 / rays.len() as f64)
}
