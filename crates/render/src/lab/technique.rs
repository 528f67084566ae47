//! Trees for occlusion rays by any combination of builder, collapse and order.
//!
//! A laboratory makes hundreds of trees, so the steps are separate and combinations share them:
//!
//! - [`Forest`] has a binary tree and its training log, which serves every collapse.
//! - [`Grove`] is one wide tree with its training logs. A log serves every order that learns from its kind.
//! - [`Grown`] is a tree in its child order, ready for queries.
//!
//! [`crate::render()`] takes the same steps.

use std::time::{Duration, Instant};

use antumbra::{
    AnyBvh, BinaryTree, Builder, Collapse, Cost, CostModel, Isa, Learning, Log, LogKind, Order,
    Ray, TreeLog, Width, surface_rays,
};

use crate::Error;
use crate::world::World;

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
}

/// A binary tree of a world, and the training log in it.
#[derive(Debug)]
pub struct Forest<'a> {
    world: &'a World,
    tree: BinaryTree,
    builder: Builder,
    rays: Vec<Ray>,
    log: TreeLog,
    seed: u64,
    build_time: Duration,
    log_time: Duration,
}

impl<'a> Forest<'a> {
    /// Builds the tree and logs `rays` in it. Uses the current rayon pool.
    pub fn new(
        world: &'a World,
        builder: Builder,
        rays: &[Ray],
        from: RaysFrom,
        seed: u64,
    ) -> Self {
        let primitives = world.primitives();
        let rays = match from {
            RaysFrom::Camera | RaysFrom::Both => rays.to_vec(),
            RaysFrom::Surfaces => surface_rays(primitives, rays.len(), seed),
        };
        let start = Instant::now();
        let tree = match from {
            _ if !builder.needs_rays() => BinaryTree::build(primitives, builder),
            RaysFrom::Camera | RaysFrom::Surfaces => {
                BinaryTree::build_for(primitives, builder, &rays)
            }
            RaysFrom::Both => {
                let mut all = rays.clone();
                all.extend(surface_rays(primitives, rays.len(), seed));
                BinaryTree::build_for(primitives, builder, &all)
            }
        };
        let build_time = start.elapsed();
        let start = Instant::now();
        let mut log = match from {
            RaysFrom::Camera => TreeLog::new(&tree),
            RaysFrom::Surfaces | RaysFrom::Both => TreeLog::of_surfaces(primitives, &tree, None),
        };
        log.add(primitives, &tree, &rays, log.weight_for(&rays));
        Self {
            world,
            tree,
            builder,
            rays,
            log,
            seed,
            build_time,
            log_time: start.elapsed(),
        }
    }

    /// Builder of the tree.
    pub fn builder(&self) -> Builder {
        self.builder
    }

    /// Training rays.
    pub fn rays(&self) -> &[Ray] {
        &self.rays
    }

    /// Makes the tree wide.
    pub fn collapse(&self, collapse: Collapse, width: Width, isa: Isa) -> Grove<'_> {
        let start = Instant::now();
        let primitives = self.world.primitives();
        let bvh = if collapse.needs_log() {
            let learning = Learning {
                collapse,
                thorough: true,
                ..Learning::default()
            };
            AnyBvh::collapse_logged(primitives, &self.tree, &self.log, &learning, width, isa)
        } else {
            AnyBvh::collapse_unlogged(primitives, &self.tree, collapse, width, isa)
        };
        Grove {
            forest: self,
            bvh,
            logs: Vec::new(),
            collapse_time: start.elapsed(),
        }
    }
}

/// A wide tree as its collapse left it, and the training logs in it.
#[derive(Debug)]
pub struct Grove<'a> {
    forest: &'a Forest<'a>,
    bvh: AnyBvh,
    /// Logs by kind, with their times, made on first use.
    logs: Vec<(LogKind, Log, Duration)>,
    collapse_time: Duration,
}

/// A tree in its child order, ready for queries.
#[derive(Debug)]
pub struct Grown {
    /// The tree.
    pub bvh: AnyBvh,
    /// Predicted cost of a ray before and after ordering. `None` for an order that picks ray by ray, or without
    /// training rays.
    pub predicted: Option<[f64; 2]>,
    /// Time of the order's training log, even if the log has served other orders before. 0 without a log.
    pub log_time: Duration,
    /// Time of planning and applying the order.
    pub sort_time: Duration,
}

impl Grove<'_> {
    /// Tree as its collapse left it.
    pub fn bvh(&self) -> &AnyBvh {
        &self.bvh
    }

    /// Number of training rays.
    pub fn learned_from(&self) -> u64 {
        self.forest.rays.len() as u64
    }

    /// Time of the binary tree and of its collapse.
    pub fn build_time(&self) -> Duration {
        self.forest.build_time + self.collapse_time
    }

    /// Time of following the training rays through the binary tree.
    pub fn follow_time(&self) -> Duration {
        self.forest.log_time
    }

    /// Puts a copy of the tree into an order.
    ///
    /// # Errors
    /// An error of the kernel.
    pub fn order(&mut self, order: Order) -> Result<Grown, Error> {
        let model = CostModel::default();
        let learns = order.log_kind().filter(|_| !self.forest.rays.is_empty());
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
        let plan = plan.map_err(Error::Order)?;
        let mut sort_time = start.elapsed();
        let predicted = match of_model.map(|place| &self.logs[place].1) {
            Some(log) if log.rays() > 0 && !picks_by_ray(order) => {
                let cost = |plan| bvh.predicted_cost(log, &model, plan).map_err(Error::Order);
                Some([cost(None)?, cost(Some(&plan))?])
            }
            _ => None,
        };
        let start = Instant::now();
        bvh.apply(&plan);
        sort_time += start.elapsed();
        Ok(Grown {
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
        let rays = &self.forest.rays;
        let mut log = self.bvh.new_log(kind, self.forest.seed);
        let mut occluded = vec![false; rays.len()];
        let mut costs = vec![Cost::default(); rays.len()];
        self.bvh
            .occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
        self.logs.push((kind, log, start.elapsed()));
        self.logs.len() - 1
    }
}

/// Whether children are picked ray by ray, which the paper's model does not cover.
fn picks_by_ray(order: Order) -> bool {
    matches!(order, Order::Ftob | Order::TwoWay | Order::Octants)
}
