//! Our own engines: trees with their order, queried ray by ray or in batches.

use std::time::Instant;

use antumbra::{
    AnyBvh, BinaryTree, Builder, Collapse, Cost, CostModel, Error, Hit, Isa, Learning, Order,
    Primitives, Ray, TreeLog, Width, surface_rays,
};
use antumbra_render::Rays;

use super::engine::{Answers, Engine, Label, Query, TreeLabel, Work};

/// A tree ready to be queried.
pub struct Tree {
    pub bvh: AnyBvh,
    pub label: TreeLabel,
}

/// Ingredients of trees.
pub struct Ingredients<'a> {
    pub primitives: &'a Primitives,
    pub binary: &'a BinaryTree,
    pub builder: Builder,
    /// Training log of a learned collapse, see [`tree_log`].
    pub log: &'a TreeLog,
    /// Rays that learned orders learn from, none of them among those that are timed.
    pub sample: &'a Rays,
    /// Whether batches prefetch, or `None` for what is faster on the sample.
    pub prefetch: Option<bool>,
    pub seed: u64,
}

/// Training log of the binary tree: surface rays and the sample, shadow and diffuse rays alike.
pub fn tree_log(primitives: &Primitives, binary: &BinaryTree, sample: &Rays) -> TreeLog {
    let mut log = TreeLog::of_surfaces(primitives, binary, None);
    let rays = [&sample.shadow[..], &sample.diffuse].concat();
    log.add(primitives, binary, &rays, log.weight_for(&rays));
    log
}

/// Rays for builders that need rays: the sample and as many surface rays.
pub fn training_rays(primitives: &Primitives, sample: &Rays, seed: u64) -> Vec<Ray> {
    let mut rays = [&sample.shadow[..], &sample.diffuse].concat();
    rays.extend(surface_rays(primitives, rays.len(), seed));
    rays
}

impl Ingredients<'_> {
    /// Collapses a tree, and has it learn if its order learns: from shadow and diffuse rays alike, because a log of one kind
    /// alone can ruin the other.
    pub fn tree(
        &self,
        width: Width,
        collapse: Collapse,
        order: Order,
        isa: Isa,
    ) -> Result<Tree, Error> {
        let (primitives, binary) = (self.primitives, self.binary);
        let mut bvh = match collapse {
            Collapse::Area => AnyBvh::collapse(primitives, binary, width, isa),
            _ => {
                let learning = Learning {
                    collapse,
                    thorough: true,
                    ..Learning::default()
                };
                AnyBvh::collapse_logged(primitives, binary, self.log, &learning, width, isa)
            }
        };
        let log = order.log_kind().map(|kind| {
            let mut log = bvh.new_log(kind, self.seed);
            for rays in [&self.sample.shadow, &self.sample.diffuse] {
                let mut occluded = vec![false; rays.len()];
                let mut costs = vec![Cost::default(); rays.len()];
                bvh.occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
            }
            log
        });
        let plan = bvh.plan(order, log.as_ref(), &CostModel::default())?;
        bvh.apply(&plan);
        match self.prefetch {
            Some(prefetch) => bvh.set_prefetch(prefetch),
            None => {
                let start = Instant::now();
                let rays = [&self.sample.shadow[..], &self.sample.diffuse].concat();
                bvh.time_prefetch(&rays, || start.elapsed());
            }
        }
        let label = TreeLabel {
            builder: self.builder.name(),
            collapse: collapse.name(),
            width: width.lanes(),
            order: order.name(),
        };
        Ok(Tree { bvh, label })
    }
}

/// How a tree is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Api {
    Single,
    Batch,
}

/// A tree and how it is asked.
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
            Query::Occluded => Box::new(Occlusion {
                bvh,
                api,
                rays,
                answers: vec![false; rays.len()],
            }),
            Query::Intersect => Box::new(Closest {
                bvh,
                api,
                rays,
                answers: vec![None; rays.len()],
            }),
        })
    }
}

struct Occlusion<'a> {
    bvh: &'a AnyBvh,
    api: Api,
    rays: &'a [Ray],
    answers: Vec<bool>,
}

impl Work for Occlusion<'_> {
    fn reset(&mut self) {
        self.answers.fill(false);
    }

    fn run(&mut self) {
        match self.api {
            Api::Single => {
                let mut tracer = self.bvh.tracer();
                for (ray, answer) in self.rays.iter().zip(&mut self.answers) {
                    *answer = tracer.occluded(ray);
                }
            }
            Api::Batch => self.bvh.occluded_batch(self.rays, &mut self.answers),
        }
    }

    fn answers(&self) -> Answers {
        Answers::Occluded(self.answers.clone())
    }
}

struct Closest<'a> {
    bvh: &'a AnyBvh,
    api: Api,
    rays: &'a [Ray],
    answers: Vec<Option<Hit>>,
}

impl Work for Closest<'_> {
    fn reset(&mut self) {
        self.answers.fill(None);
    }

    fn run(&mut self) {
        match self.api {
            Api::Single => {
                let mut tracer = self.bvh.tracer();
                for (ray, answer) in self.rays.iter().zip(&mut self.answers) {
                    *answer = tracer.intersect(ray);
                }
            }
            Api::Batch => self.bvh.intersect_batch(self.rays, &mut self.answers),
        }
    }

    fn answers(&self) -> Answers {
        Answers::of_hits(&self.answers)
    }
}

/// Mean node and primitive tests of an occlusion ray; NaN for no rays.
pub fn mean_tests(bvh: &AnyBvh, rays: &[Ray]) -> [f64; 2] {
    let mut occluded = vec![false; rays.len()];
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut occluded, &mut costs);
    let mean = |tests: fn(&Cost) -> u32| {
        costs.iter().map(|cost| f64::from(tests(cost))).sum::<f64>() / rays.len() as f64
    };
    [mean(|cost| cost.node_tests), mean(|cost| cost.prim_tests)]
}
