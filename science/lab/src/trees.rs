//! Trees for occlusion rays by any combination of builder, collapse and order.
//!
//! A laboratory makes hundreds of trees, so the steps are separate and combinations share them:
//!
//! - [`TrainedTree`] has a binary tree and its training log, which serves every collapse.
//! - [`CollapsedTree`] is one wide tree with its training logs. A log serves every order that learns from its kind.
//! - [`OrderedTree`] is a tree in its child order, ready for queries.
//!
//! [`antumbra_render::render()`] takes the same steps.

use std::borrow::Cow;
use std::time::{Duration, Instant};

use antumbra::parts::{Log, LogKind, Steps, TreeLog, surface_rays};
use antumbra::recipe::{Builder, Order, TrainingRays};
use antumbra::{Build, Bvh, Ray, Recipe, Stage};
use antumbra_render::World;

use crate::Error;

/// Source of the training rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum RaysFrom {
    /// The rays given.
    Camera,
    /// Surface rays.
    Surfaces,
    /// Nodes from both, where the rays given count for half or more. Child order from the rays given. A rendering
    /// does likewise.
    #[default]
    Both,
}

impl RaysFrom {
    /// All sources.
    pub const ALL: [Self; 3] = [Self::Camera, Self::Surfaces, Self::Both];

    /// Name on the command line and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Surfaces => "surfaces",
            Self::Both => "both",
        }
    }

    /// Source that a recipe learns from.
    pub const fn of(recipe: &Recipe) -> Self {
        match recipe.training.rays {
            TrainingRays::Given => Self::Camera,
            TrainingRays::Surface => Self::Surfaces,
            _ => Self::Both,
        }
    }

    /// Choice of a recipe for this source.
    const fn training_rays(self) -> TrainingRays {
        match self {
            Self::Camera => TrainingRays::Given,
            Self::Surfaces => TrainingRays::Surface,
            Self::Both => TrainingRays::Both,
        }
    }
}

/// A binary tree of a world, and the training log in it.
#[derive(Debug)]
pub struct TrainedTree {
    stage: Stage,
    recipe: Recipe,
    rays: Vec<Ray>,
    log: TreeLog,
    build_time: Duration,
    log_time: Duration,
}

impl TrainedTree {
    /// Builds the tree of a recipe and logs the training rays in it: `rays`, or as many surface rays. Uses the current
    /// rayon pool.
    pub fn new(world: &World, recipe: &Recipe, rays: &[Ray], from: RaysFrom) -> Self {
        let primitives = world.primitives();
        let recipe = recipe.training_rays(from.training_rays());
        let start = Instant::now();
        let build = Build::new(primitives).rays(rays).recipe(&recipe);
        let stage = build.stage().expect("nobody stops it");
        let build_time = start.elapsed();
        let rays = match from {
            RaysFrom::Camera | RaysFrom::Both => rays.to_vec(),
            RaysFrom::Surfaces => surface_rays(primitives, rays.len(), recipe.training.seed),
        };
        let start = Instant::now();
        let log = match from {
            RaysFrom::Camera | RaysFrom::Both => stage.training_log(&rays, &recipe),
            RaysFrom::Surfaces => {
                let both = recipe.training_rays(TrainingRays::Both);
                stage.training_log(&rays, &both)
            }
        };
        let log = Cow::into_owned(log);
        Self {
            stage,
            recipe,
            rays,
            log,
            build_time,
            log_time: start.elapsed(),
        }
    }

    /// Builder of the tree.
    pub fn builder(&self) -> Builder {
        self.recipe.builder
    }

    /// Training rays.
    pub fn rays(&self) -> &[Ray] {
        &self.rays
    }

    /// Makes the tree wide, with the collapse, width, level and costs of a recipe.
    pub fn collapse(&self, recipe: &Recipe) -> CollapsedTree<'_> {
        let start = Instant::now();
        let log = recipe.collapse.needs_log().then_some(&self.log);
        let bvh = self.stage.collapse_for(log, true, recipe);
        CollapsedTree {
            trained: self,
            recipe: *recipe,
            bvh,
            logs: Vec::new(),
            collapse_time: start.elapsed(),
        }
    }
}

/// A wide tree as its collapse left it, and the training logs in it.
#[derive(Debug)]
pub struct CollapsedTree<'a> {
    trained: &'a TrainedTree,
    recipe: Recipe,
    bvh: Bvh,
    /// Logs by kind, with their times, made on first use.
    logs: Vec<(LogKind, Log, Duration)>,
    collapse_time: Duration,
}

/// A tree in its child order, ready for queries.
#[derive(Debug)]
pub struct OrderedTree {
    /// The tree.
    pub bvh: Bvh,
    /// Predicted cost of a ray before and after ordering. `None` for an order that picks ray by ray, or without
    /// training rays.
    pub predicted: Option<[f64; 2]>,
    /// Time of the order's training log, even if the log has served other orders before. 0 without a log.
    pub log_time: Duration,
    /// Time of planning and applying the order.
    pub sort_time: Duration,
}

impl CollapsedTree<'_> {
    /// Tree as its collapse left it.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Number of training rays.
    pub fn learned_from(&self) -> u64 {
        self.trained.rays.len() as u64
    }

    /// Time of the binary tree and of its collapse.
    pub fn build_time(&self) -> Duration {
        self.trained.build_time + self.collapse_time
    }

    /// Time of following the training rays through the binary tree.
    pub fn follow_time(&self) -> Duration {
        self.trained.log_time
    }

    /// Puts a copy of the tree into an order.
    ///
    /// # Errors
    /// An error of the kernel.
    pub fn order(&mut self, order: Order) -> Result<OrderedTree, Error> {
        let model = self.recipe.costs;
        let learns = order.log_kind().filter(|_| !self.trained.rays.is_empty());
        let of_order = learns.map(|kind| self.log(kind));
        // All orders are predicted from the kind of log that the paper uses.
        let of_model = Order::SortPlus.log_kind().map(|kind| self.log(kind));
        let mut bvh = self.bvh.clone();
        let start = Instant::now();
        let (plan, log_time) = match of_order {
            Some(place) => {
                let (_, log, time) = &self.logs[place];
                (bvh.plan(order, Some(log), &model), *time)
            }
            // Without training rays the order of the collapse stays.
            None if order.log_kind().is_some() => {
                (bvh.plan(Order::Simple, None, &model), Duration::ZERO)
            }
            None => (bvh.plan(order, None, &model), Duration::ZERO),
        };
        let plan = plan?;
        let mut sort_time = start.elapsed();
        let predicted = match of_model.map(|place| &self.logs[place].1) {
            Some(log) if log.rays() > 0 && !order.picks_by_ray() => {
                let cost = |plan| bvh.predicted_cost(log, &model, plan);
                Some([cost(None)?, cost(Some(&plan))?])
            }
            _ => None,
        };
        let start = Instant::now();
        bvh.apply(&plan);
        sort_time += start.elapsed();
        Ok(OrderedTree {
            bvh,
            predicted,
            log_time,
            sort_time,
        })
    }

    /// Place of a log that covers a kind, made on first use.
    fn log(&mut self, kind: LogKind) -> usize {
        if let Some(place) = self.logs.iter().position(|(other, ..)| other.covers(kind)) {
            return place;
        }
        let start = Instant::now();
        let seed = self.trained.recipe.training.seed;
        let log = self.bvh.log_of(&self.trained.rays, kind, seed);
        self.logs.push((kind, log, start.elapsed()));
        self.logs.len() - 1
    }
}
