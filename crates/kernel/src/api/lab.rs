//! What a laboratory needs of a tree, beside what every user needs.

use alloc::vec;

use antumbra_simd::Isa;

use super::bvh::Bvh;
use super::recipe::Recipe;
use super::times::Stopwatch;
use crate::builder::{self, Builder};
use crate::collapse;
use crate::collapse::{Collapse, Learning};
use crate::error::Error;
use crate::geometry::primitives::Primitives;
use crate::learn::surface_rays::surface_rays;
use crate::learn::{Log, LogKind, TreeLog};
use crate::order::exclusive::Events;
use crate::order::{self, Order};
use crate::ray::Ray;
use crate::trace::observe::Cost;
use crate::tree::any::{Tree, on_tree};
use crate::tree::binary::BinaryTree;
use crate::tree::costs::CostModel;
use crate::tree::directed::{Rule, Way};
use crate::tree::slot_order::SlotOrder;
use crate::tree::width::Width;

/// Steps of learning one by one, for those who compare builders, collapses and orders.
///
/// [`Bvh::learn`] takes them all in one call.
pub trait Laboratory: Sized {
    /// Collapses a binary tree without rays; children stay in the depth-first order of the binary tree. A collapse
    /// that [needs a log](Collapse::needs_log) goes by areas in place of visits.
    ///
    /// # Panics
    /// If the tree was built over other primitives: see [`BinaryTree::is_of`].
    fn collapse(
        primitives: &Primitives,
        tree: &BinaryTree,
        collapse: Collapse,
        width: Width,
        isa: Isa,
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
        width: Width,
        isa: Isa,
    ) -> Self;

    /// Empty log for this tree. `seed` starts the shuffling, if the kind asks for it.
    fn new_log(&self, kind: LogKind, seed: u64) -> Log;

    /// Works out an order for a tree fresh from a collapse. [`Order::Simple`] leaves the tree as it is: in the
    /// depth-first order of the binary tree, or in the order that the collapse learned.
    ///
    /// # Errors
    /// [`Error::NeedsLog`], [`Error::NeedsBoxes`] or [`Error::NeedsMasks`] when the log lacks what the order learns
    /// from, [`Error::OtherTree`] when the log is of a tree of another shape.
    fn plan(&self, order: Order, log: Option<&Log>, model: &CostModel) -> Result<SlotOrder, Error>;

    /// Mean cost of an occlusion query by the paper's equation (1), `C_any` of the root, with chances estimated from
    /// `log`: for the slots as they stand, or as `order` would put them.
    ///
    /// # Errors
    /// [`Error::OtherTree`] when the log or the order is of a tree of another shape.
    fn predicted_cost(
        &self,
        log: &Log,
        model: &CostModel,
        order: Option<&SlotOrder>,
    ) -> Result<f64, Error>;

    /// Mean cost of an occlusion query in the tree as it stands, by a model of how events at children depend on each other.
    /// The log has [masks](LogKind::masks).
    ///
    /// # Errors
    /// [`Error::OtherTree`] when the log is of a tree of another shape, [`Error::NeedsMasks`] when it has no masks.
    fn predicted_by(&self, log: &Log, model: &CostModel, events: Events) -> Result<f64, Error>;

    /// Has each node pick its children by the order of slots, near first or far first, whichever costs these rays
    /// least. Returns the number of nodes that pick in each of these ways. Queries become ray by ray.
    fn learn_ways(&mut self, rays: &[Ray], costs: &CostModel) -> [usize; 3];

    /// Puts children and primitives where `order` wants them. A log made before counts the old slots and is of no
    /// more use with this tree.
    ///
    /// # Panics
    /// If the order was planned for a tree of another shape.
    fn apply(&mut self, order: &SlotOrder);

    /// Log of this kind of what `rays` meet in this tree. `seed` starts the shuffling, if the kind asks for it.
    fn log_of(&self, rays: &[Ray], kind: LogKind, seed: u64) -> Log;

    /// Puts a tree fresh from its collapse into the order of a recipe, learned from `log` or else from `rays`. Where the
    /// order learns and there is neither, the tree stays as it is.
    ///
    /// The [report](Bvh::build_report) tells how many rays were learned from, and the predicted cost before and
    /// after.
    ///
    /// # Errors
    /// [`Error::NeedsBoxes`], [`Error::NeedsMasks`] or [`Error::OtherTree`] if the log given does not suit.
    fn learn_order(
        &mut self,
        rays: &[Ray],
        log: Option<&Log>,
        recipe: &Recipe,
    ) -> Result<(), Error>;

    /// Has batches prefetch or not, as the recipe wants or as a short timing of `rays` tells.
    fn choose_prefetch(&mut self, rays: &[Ray], recipe: &Recipe);
}

impl Laboratory for Bvh {
    fn collapse(
        primitives: &Primitives,
        tree: &BinaryTree,
        collapse: Collapse,
        width: Width,
        isa: Isa,
    ) -> Self {
        tree.assert_is_of(primitives);
        if collapse == Collapse::Area {
            let tree = match width {
                Width::W4 => Tree::W4(collapse::by_area(primitives, tree)),
                Width::W8 => Tree::W8(collapse::by_area(primitives, tree)),
                Width::W16 => Tree::W16(collapse::by_area(primitives, tree)),
            };
            return Self::fresh(tree, isa, primitives);
        }
        let learning = Learning {
            collapse,
            sort: false,
            ..Default::default()
        };
        let log = TreeLog::new(tree);
        let mut bvh = Self::collapse_logged(primitives, tree, &log, &learning, width, isa);
        bvh.predicted_cost = None;
        bvh
    }

    fn collapse_logged(
        primitives: &Primitives,
        tree: &BinaryTree,
        log: &TreeLog,
        learning: &Learning,
        width: Width,
        isa: Isa,
    ) -> Self {
        tree.assert_is_of(primitives);
        log.assert_fits(tree);
        let (tree, cost) = match width {
            Width::W4 => {
                let (tree, cost) = collapse::by_log(primitives, tree, log, learning);
                (Tree::W4(tree), cost)
            }
            Width::W8 => {
                let (tree, cost) = collapse::by_log(primitives, tree, log, learning);
                (Tree::W8(tree), cost)
            }
            Width::W16 => {
                let (tree, cost) = collapse::by_log(primitives, tree, log, learning);
                (Tree::W16(tree), cost)
            }
        };
        Self {
            predicted_cost: Some(cost),
            ..Self::fresh(tree, isa, primitives)
        }
    }

    fn new_log(&self, kind: LogKind, seed: u64) -> Log {
        on_tree!(&self.tree, tree => Log::new(tree, kind, seed))
    }

    fn plan(&self, order: Order, log: Option<&Log>, model: &CostModel) -> Result<SlotOrder, Error> {
        on_tree!(&self.tree, tree => order::plan(tree, order, log, model))
    }

    fn predicted_cost(
        &self,
        log: &Log,
        model: &CostModel,
        order: Option<&SlotOrder>,
    ) -> Result<f64, Error> {
        on_tree!(&self.tree, tree => order::ratio::predicted_cost(tree, log, model, order))
    }

    fn predicted_by(&self, log: &Log, model: &CostModel, events: Events) -> Result<f64, Error> {
        on_tree!(&self.tree, tree => order::exclusive::predicted_cost(tree, log, model, events))
    }

    fn learn_ways(&mut self, rays: &[Ray], costs: &CostModel) -> [usize; 3] {
        let ways = self.ways(rays, costs);
        let count = |way| ways.iter().filter(|other| **other == way).count();
        let counts = Way::ALL.map(count);
        on_tree!(&mut self.tree, tree => tree.pick = Rule::Nodes(ways));
        counts
    }

    fn apply(&mut self, order: &SlotOrder) {
        if let Err(error) = Error::unless_fits(order.shape, self.shape()) {
            panic!("{error}");
        }
        on_tree!(&mut self.tree, tree => tree.apply(order));
        self.predicted_cost = None;
    }

    fn learn_order(
        &mut self,
        rays: &[Ray],
        log: Option<&Log>,
        recipe: &Recipe,
    ) -> Result<(), Error> {
        let Recipe { order, costs, .. } = recipe;
        if *order == Order::Simple {
            // A fresh tree is in this order.
            return Ok(());
        }
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let mut times = self.times.unwrap_or_default();
        let made = match (order.log_kind(), log) {
            (Some(kind), None) if !rays.is_empty() => {
                Some(self.log_of(rays, kind, recipe.training.seed))
            }
            _ => None,
        };
        let log = log.or(made.as_ref());
        times.order_log += stopwatch.lap();
        if log.is_none() && order.learns() {
            return Ok(());
        }
        let plan = self.plan(*order, log, costs)?;
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
        Ok(())
    }

    fn log_of(&self, rays: &[Ray], kind: LogKind, seed: u64) -> Log {
        let mut log = self.new_log(kind, seed);
        let mut occluded = vec![false; rays.len()];
        let mut costs = vec![Cost::default(); rays.len()];
        self.occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
        log
    }

    fn choose_prefetch(&mut self, rays: &[Ray], recipe: &Recipe) {
        match (recipe.prefetch, recipe.clock) {
            (Some(prefetch), _) => self.set_prefetch(prefetch),
            (None, Some(clock)) => {
                let mut stopwatch = Stopwatch::new(Some(clock));
                self.time_prefetch(rays, clock);
                if let Some(times) = &mut self.times {
                    times.prefetch = stopwatch.lap();
                }
            }
            (None, None) => {}
        }
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
    /// the others ignore them. Of more than 2¹⁴ rays an even selection is used. Without rays, and where hardly any
    /// come, the tree is that of [`Builder::BinnedSah`].
    pub fn build_for(primitives: &Primitives, builder: Builder, rays: &[Ray]) -> Self {
        builder::build(primitives, builder, rays, &())
    }
}
