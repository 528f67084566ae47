//! The steps of learning: a wide tree from a binary one, the log of rays in it, the child order from the log.

use alloc::vec;

use antumbra_simd::Isa;

use super::bvh::Bvh;
use super::recipe::Recipe;
use super::times::Stopwatch;
use crate::collapse::{self, Collapse, Learning};
use crate::error::Error;
use crate::geometry::primitives::Primitives;
use crate::learn::{Log, LogKind, TreeLog};
use crate::order::{self, Order};
use crate::ray::Ray;
use crate::trace::observe::Cost;
use crate::tree::binary::BinaryTree;
use crate::tree::costs::CostModel;
use crate::tree::slot_order::SlotOrder;
use crate::tree::width::Width;

impl Bvh {
    /// Collapses a binary tree without rays; children stay in the depth-first order of the binary tree. A collapse
    /// that [needs a log](Collapse::needs_log) goes by areas in place of visits.
    ///
    /// # Panics
    /// If the tree was built over other primitives: see [`BinaryTree::is_of`].
    pub(crate) fn collapse(
        primitives: &Primitives,
        tree: &BinaryTree,
        collapse: Collapse,
        width: Width,
        isa: Isa,
    ) -> Self {
        tree.assert_is_of(primitives);
        if collapse == Collapse::Area {
            let tree = collapse::by_area(primitives, tree, width);
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

    /// Collapses a binary tree for the rays in `log`: by default both the nodes and the order of children and
    /// primitives are learned. An empty log gives the collapse of least surface area.
    ///
    /// # Panics
    /// If the log was made for another tree, or the tree was built over other primitives: see [`BinaryTree::is_of`].
    pub(crate) fn collapse_logged(
        primitives: &Primitives,
        tree: &BinaryTree,
        log: &TreeLog,
        learning: &Learning,
        width: Width,
        isa: Isa,
    ) -> Self {
        tree.assert_is_of(primitives);
        log.assert_fits(tree);
        let (tree, cost) = collapse::by_log(primitives, tree, log, learning, width);
        Self {
            predicted_cost: Some(cost),
            ..Self::fresh(tree, isa, primitives)
        }
    }

    /// Empty log for this tree. `seed` starts the shuffling, if the kind shuffles.
    pub(crate) fn new_log(&self, kind: LogKind, seed: u64) -> Log {
        Log::new(&self.tree, kind, seed)
    }

    /// Computes an order for a tree fresh from a collapse. [`Order::Simple`] leaves the tree as it is: in the
    /// depth-first order of the binary tree, or in the order that the collapse learned.
    ///
    /// # Errors
    /// [`Error::NeedsLog`], [`Error::NeedsBoxes`] or [`Error::NeedsMasks`] when the log lacks what the order learns
    /// from, [`Error::OtherTree`] when the log is of a tree of another shape.
    pub(crate) fn plan(
        &self,
        order: Order,
        log: Option<&Log>,
        model: &CostModel,
    ) -> Result<SlotOrder, Error> {
        order::plan(&self.tree, order, log, model)
    }

    /// Mean cost of an occlusion query by the paper's equation (1), `C_any` of the root, with chances estimated from
    /// `log`: for the slots as they are, or as `order` would put them.
    ///
    /// # Errors
    /// [`Error::OtherTree`] when the log or the order is of a tree of another shape.
    pub(crate) fn predicted_cost(
        &self,
        log: &Log,
        model: &CostModel,
        order: Option<&SlotOrder>,
    ) -> Result<f64, Error> {
        order::ratio::predicted_cost(&self.tree, log, model, order)
    }

    /// Puts children and primitives where `order` wants them. A log made before counts the old slots and is of no
    /// more use with this tree.
    ///
    /// # Panics
    /// If the order was planned for a tree of another shape.
    pub(crate) fn apply(&mut self, order: &SlotOrder) {
        if let Err(error) = Error::unless_fits(order.shape, self.shape()) {
            panic!("{error}");
        }
        self.tree.apply(order);
        self.predicted_cost = None;
    }

    /// Log of this kind for `rays` in this tree. `seed` starts the shuffling, if the kind shuffles.
    pub(crate) fn log_of(&self, rays: &[Ray], kind: LogKind, seed: u64) -> Log {
        let mut log = self.new_log(kind, seed);
        let mut occluded = vec![false; rays.len()];
        let mut costs = vec![Cost::default(); rays.len()];
        self.occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
        log
    }

    /// Puts a tree fresh from its collapse into the order of a recipe, and has it prefetch as the recipe says. Learned from `log` or else from `rays`. Where the
    /// order learns and there is neither, the tree stays as it is.
    ///
    /// The [report](Bvh::report) then has the number of rays learned from, and the predicted cost before and after.
    /// Returns the log if one was made, which counts the slots as they were.
    ///
    /// # Errors
    /// [`Error::NeedsBoxes`], [`Error::NeedsMasks`] or [`Error::OtherTree`] if the log given does not suit.
    pub(crate) fn learn_order(
        &mut self,
        rays: &[Ray],
        log: Option<&Log>,
        recipe: &Recipe,
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
                Some(self.log_of(rays, kind, recipe.training.seed))
            }
            _ => None,
        };
        let log = log.or(made.as_ref());
        times.order_log += stopwatch.lap();
        if log.is_none() && order.learns() {
            return Ok(None);
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
        Ok(made)
    }
}
