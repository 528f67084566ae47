//! The steps of learning one by one, and queries that are observed: for those who make many trees of one geometry and
//! compare them, and for those who learn from rays while they trace them. [`Build`](super::build::Build) takes all steps in
//! one call.

use alloc::borrow::Cow;
use alloc::vec;
use alloc::vec::Vec;

use super::bvh::Bvh;
use super::recipe::Recipe;
use super::stage::{Stage, reached};
use super::times::Stopwatch;
use crate::builder::{self, Builder};
use crate::collapse::{self, Collapse, Learning};
use crate::error::Error;
use crate::geometry::primitives::Primitives;
use crate::learn::log::Logging;
use crate::learn::surface_rays::surface_rays;
use crate::learn::tree_log::INSTANCE_ITEMS;
use crate::learn::{Log, LogKind, TreeLog};
use crate::monitor::BuildMonitor;
use crate::order::{self, Order};
use crate::ray::Ray;
use crate::trace::engine::Engine;
use crate::trace::observe::{Cost, Observer};
use crate::trace::pick::{Pick, Shuffle};
use crate::tree::binary::BinaryTree;
use crate::tree::costs::CostModel;
use crate::tree::slot_order::SlotOrder;

/// Steps of learning one by one, and queries that count what they do: methods of [`Bvh`] for those who import them.
///
/// [`Bvh::learn`] takes all steps in one call.
pub trait Steps: Sized {
    /// Collapses a binary tree without rays; children stay in the depth-first order of the binary tree. A collapse
    /// that [needs a log](Collapse::needs_log) goes by areas in place of visits.
    ///
    /// # Panics
    /// If the tree was built over other primitives: see [`BinaryTree::is_of`].
    fn collapse(
        primitives: &Primitives,
        tree: &BinaryTree,
        collapse: Collapse,
        engine: Engine,
    ) -> Self;

    /// Collapses a binary tree for the rays in `log`: by default both the nodes and the order of children and
    /// primitives are learned. An empty log gives the collapse of least surface area.
    ///
    /// # Panics
    /// If the log was made for another tree, or the tree was built over other primitives: see [`BinaryTree::is_of`].
    fn collapse_logged(
        primitives: &Primitives,
        tree: &BinaryTree,
        log: &TreeLog,
        learning: &Learning,
        engine: Engine,
    ) -> Self;

    /// Empty log for this tree. `seed` starts the shuffling, if the kind shuffles.
    fn new_log(&self, kind: LogKind, seed: u64) -> Log;

    /// Computes an order for a tree fresh from a collapse. [`Order::Simple`] leaves the tree as it is: in the
    /// depth-first order of the binary tree, or in the order that the collapse learned.
    ///
    /// # Errors
    /// [`Error::NeedsLog`], [`Error::NeedsBoxes`] or [`Error::NeedsMasks`] when the log lacks what the order learns
    /// from, [`Error::OtherTree`] when the log is of a tree of another shape.
    fn plan(&self, order: Order, log: Option<&Log>, model: &CostModel) -> Result<SlotOrder, Error>;

    /// Mean cost of an occlusion query by the paper's equation (1), `C_any` of the root, with chances estimated from
    /// `log`: for the slots as they are, or as `order` would put them.
    ///
    /// # Errors
    /// [`Error::OtherTree`] when the log or the order is of a tree of another shape.
    fn predicted_cost(
        &self,
        log: &Log,
        model: &CostModel,
        order: Option<&SlotOrder>,
    ) -> Result<f64, Error>;

    /// Puts children and primitives where `order` wants them. A log made before counts the old slots and is of no
    /// more use with this tree.
    ///
    /// # Panics
    /// If the order was planned for a tree of another shape.
    fn apply(&mut self, order: &SlotOrder);

    /// Traces `rays` in this tree and returns their log. `seed` starts the shuffling of children, for kinds that shuffle.
    ///
    /// Rays may test 256 nodes each in the mean, ten times as many as in ordinary scenes, and one per two primitives besides.
    /// Where they test more, as in a soup of triangles, some of them are left out, evenly over the list.
    fn log_of(&self, rays: &[Ray], kind: LogKind, seed: u64) -> Log;

    /// Puts a tree fresh from its collapse into the order of a recipe, learned from `log` or else from `rays`, and has it
    /// prefetch as the recipe says. Where the order learns and there is neither, the tree stays as it is. Returns the log, if
    /// one had to be made.
    ///
    /// The [report](Bvh::report) then has the number of rays learned from, and the predicted cost before and after.
    ///
    /// # Errors
    /// [`Error::NeedsBoxes`], [`Error::NeedsMasks`] or [`Error::OtherTree`] if the log given does not suit.
    fn learn_order(
        &mut self,
        rays: &[Ray],
        log: Option<&Log>,
        recipe: &Recipe,
    ) -> Result<Option<Log>, Error>;

    /// Whether anything lies in the interval of each ray, and what each ray cost; on the calling thread.
    ///
    /// # Panics
    /// If the slices differ in length.
    fn occluded_batch_counted(&self, rays: &[Ray], occluded: &mut [bool], costs: &mut [Cost]);

    /// [`Steps::occluded_batch_counted`], and the rays are written to `log`, in whose shuffled mode
    /// children are visited in random order.
    ///
    /// # Panics
    /// If the slices differ in length, or the log was made for a tree of another shape.
    fn occluded_batch_logged(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        costs: &mut [Cost],
        log: &mut Log,
    );
}

impl Steps for Bvh {
    fn collapse(
        primitives: &Primitives,
        tree: &BinaryTree,
        collapse: Collapse,
        engine: Engine,
    ) -> Self {
        tree.assert_is_of(primitives);
        if collapse == Collapse::Area {
            let tree = collapse::by_area(primitives, tree, engine.width());
            return Self::fresh(tree, engine, primitives);
        }
        let learning = Learning {
            collapse,
            sort: false,
            ..Default::default()
        };
        let log = TreeLog::new(tree);
        let mut bvh = Self::collapse_logged(primitives, tree, &log, &learning, engine);
        bvh.predicted_cost = None;
        bvh
    }

    fn collapse_logged(
        primitives: &Primitives,
        tree: &BinaryTree,
        log: &TreeLog,
        learning: &Learning,
        engine: Engine,
    ) -> Self {
        Self::collapse_until((primitives, tree), log, learning, engine, &())
            .expect("nobody stops it")
    }

    fn new_log(&self, kind: LogKind, seed: u64) -> Log {
        Log::new(&self.tree, kind, seed)
    }

    fn plan(&self, order: Order, log: Option<&Log>, model: &CostModel) -> Result<SlotOrder, Error> {
        order::plan(&self.tree, order, log, model, &())
    }

    fn predicted_cost(
        &self,
        log: &Log,
        model: &CostModel,
        order: Option<&SlotOrder>,
    ) -> Result<f64, Error> {
        order::ratio::predicted_cost(&self.tree, log, model, order)
    }

    fn apply(&mut self, order: &SlotOrder) {
        if let Err(error) = Error::unless_fits(order.shape, self.shape()) {
            panic!("{error}");
        }
        self.tree.apply(order);
        self.predicted_cost = None;
    }

    fn log_of(&self, rays: &[Ray], kind: LogKind, seed: u64) -> Log {
        self.log_until((rays, rays.len()), kind, seed, &())
    }

    fn learn_order(
        &mut self,
        rays: &[Ray],
        log: Option<&Log>,
        recipe: &Recipe,
    ) -> Result<Option<Log>, Error> {
        self.learn_order_until((rays, rays.len()), log, recipe, &())
    }

    fn occluded_batch_counted(&self, rays: &[Ray], occluded: &mut [bool], costs: &mut [Cost]) {
        assert_eq!(rays.len(), costs.len(), "one cost per ray");
        let mut observer = self.counting(costs);
        self.observe(Pick::Rule, &mut observer, rays, occluded);
    }

    fn occluded_batch_logged(
        &self,
        rays: &[Ray],
        occluded: &mut [bool],
        costs: &mut [Cost],
        log: &mut Log,
    ) {
        assert_eq!(rays.len(), costs.len(), "one cost per ray");
        if let Err(error) = Error::unless_fits(log.shape(), self.shape()) {
            panic!("{error}");
        }
        let pick = if log.kind().shuffled {
            Pick::Shuffled(Shuffle::new(log.seed()))
        } else {
            Pick::Rule
        };
        let mut observer = Logging::new(self.counting(costs), log);
        self.observe(pick, &mut observer, rays, occluded);
        if let Some(masks) = log.masks_mut() {
            self.follow(rays, masks);
        }
    }
}

/// Rays that are logged between two questions whether the build should stop.
const LOGGED_AT_ONCE: usize = 8;
/// Nodes that a log may test: whatever the tree, and per ray that was given.
const LOGGED_NODES: [usize; 2] = [1 << 14, 256];

impl Bvh {
    /// [`Steps::collapse_logged`]; `None` if the monitor stopped it.
    pub(super) fn collapse_until(
        (primitives, tree): (&Primitives, &BinaryTree),
        log: &TreeLog,
        learning: &Learning,
        engine: Engine,
        monitor: &dyn BuildMonitor,
    ) -> Option<Self> {
        tree.assert_is_of(primitives);
        log.assert_fits(tree);
        let width = engine.width();
        let (tree, cost) = collapse::by_log(primitives, tree, log, learning, width, monitor)?;
        Some(Self {
            predicted_cost: Some(cost),
            ..Self::fresh(tree, engine, primitives)
        })
    }

    /// [`Steps::log_of`] of rays, so many of which were given. Of fewer rays if the monitor stops it.
    pub(crate) fn log_until(
        &self,
        (rays, given): (&[Ray], usize),
        kind: LogKind,
        seed: u64,
        monitor: &dyn BuildMonitor,
    ) -> Log {
        let mut log = self.new_log(kind, seed);
        let [least, per_ray] = LOGGED_NODES;
        let items = self.primitives + INSTANCE_ITEMS * self.tree.instances.len();
        let budget = (least + per_ray * given + items / 2) as f64;
        let pieces = rays.len().div_ceil(LOGGED_AT_ONCE) as f64;
        let mut tested = 0;
        for (piece, rays) in rays.chunks(LOGGED_AT_ONCE).enumerate() {
            // A quarter in advance, so that a few rays that test many nodes do no harm.
            let allowed = budget * (0.25 + 0.75 * (piece + 1) as f64 / pieces);
            if tested as f64 > allowed {
                continue;
            }
            if monitor.cancelled() {
                break;
            }
            let mut occluded = [false; LOGGED_AT_ONCE];
            let mut costs = [Cost::default(); LOGGED_AT_ONCE];
            let (occluded, costs) = (&mut occluded[..rays.len()], &mut costs[..rays.len()]);
            let visits = |log: &Log| log.masks().map_or(0, |masks| masks.visits().len());
            let before = visits(&log);
            self.occluded_batch_logged(rays, occluded, costs, &mut log);
            let nodes = costs.iter().map(|cost| cost.node_tests as usize);
            tested += nodes.sum::<usize>() + visits(&log) - before;
        }
        log
    }

    /// [`Steps::learn_order`].
    ///
    /// # Errors
    /// Besides, [`Error::Cancelled`] if the monitor stopped it.
    pub(super) fn learn_order_until(
        &mut self,
        (rays, given): (&[Ray], usize),
        log: Option<&Log>,
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Option<Log>, Error> {
        let Recipe { order, costs, .. } = recipe;
        self.prefetch = recipe.prefetch.or(self.prefetch);
        if *order == Order::Simple {
            // A fresh tree is in this order.
            return Ok(None);
        }
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let mut times = self.times.unwrap_or_default();
        let made = match (order.properties().log, log) {
            (Some(kind), None) if !rays.is_empty() => {
                Some(self.log_until((rays, given), kind, recipe.training.seed, monitor))
            }
            _ => None,
        };
        reached(0.9, monitor)?;
        let log = log.or(made.as_ref());
        times.order_log += stopwatch.lap();
        if log.is_none() && order.learns() {
            return Ok(None);
        }
        let plan = order::plan(&self.tree, *order, log, costs, monitor)?;
        reached(0.93, monitor)?;
        times.order += stopwatch.lap();
        let predicted = match log {
            Some(log) if !order.picks_by_ray() && log.kind().boxes => Some([
                self.predicted_cost(log, costs, None)?,
                self.predicted_cost(log, costs, Some(&plan))?,
            ]),
            _ => None,
        };
        times.predict += stopwatch.lap();
        self.apply(&plan);
        times.order += stopwatch.lap();
        if let Some([before, after]) = predicted {
            self.predicted_before = Some(before);
            self.predicted_cost = Some(after);
        }
        self.training_rays = log.map_or(0, Log::rays);
        self.times = recipe.clock.map(|_| times);
        Ok(made)
    }
}

impl BinaryTree {
    /// Builds a tree over all primitives; empty for none. Uses the rayon pool that is current, if the `parallel`
    /// feature is on; the tree does not depend on the number of threads.
    ///
    /// A builder that [needs rays](Builder::needs_rays) is driven by [`surface_rays`]: 512 of a small scene, 4096 of a
    /// large one.
    pub fn build(primitives: &Primitives, builder: Builder) -> Self {
        /// Seed of the surface rays.
        const SEED: u64 = 2009;
        if builder.needs_rays() {
            let count = (primitives.stored() / 16).clamp(512, 4096);
            Self::build_for(primitives, builder, &surface_rays(primitives, count, SEED))
        } else {
            Self::build_for(primitives, builder, &[])
        }
    }

    /// Builds a tree for rays like these, all with the same weight, if the builder [needs rays](Builder::needs_rays);
    /// the others ignore them. Without rays, and where hardly any come, the result is the tree of
    /// [`Builder::BinnedSah`].
    pub fn build_for(primitives: &Primitives, builder: Builder, rays: &[Ray]) -> Self {
        builder::build(primitives, builder, rays, &())
    }
}

/// The steps behind a binary tree, one by one.
impl Stage {
    /// Binary tree of this stage.
    pub fn tree(&self) -> &BinaryTree {
        &self.binary.tree
    }

    /// Log of the training rays of a recipe in the binary tree.
    pub fn training_log(&self, rays: &[Ray], recipe: &Recipe) -> Cow<'_, TreeLog> {
        (self.binary).training_log(&self.primitives, rays, recipe, &())
    }

    /// Wide tree for the rays of a training log, or without one for areas only. A thorough search for a learned
    /// collapse takes two starts, which pays for rays that are known.
    ///
    /// # Panics
    /// If the log was made for another tree.
    pub fn collapse_for(&self, log: Option<&TreeLog>, thorough: bool, recipe: &Recipe) -> Bvh {
        (self.binary)
            .collapse_for(&self.primitives, log, thorough, recipe, &())
            .expect("nobody stops it")
    }
}

/// Occlusion of rays one by one, on the calling thread, while what happens is reported to an observer. Returns whether anything lies
/// in the interval of each ray.
pub fn observe(bvh: &Bvh, rays: &[Ray], observer: &mut dyn Observer) -> Vec<bool> {
    let mut occluded = vec![false; rays.len()];
    bvh.observe(Pick::Rule, observer, rays, &mut occluded);
    occluded
}
