//! The steps of learning as methods of a tree, and queries that count what they do.

use alloc::vec;
use core::time::Duration;

use antumbra_simd::Isa;

use super::oracle::{self, Visits};
use crate::api::bvh::Bvh;
use crate::api::recipe::Recipe;
use crate::builder::{self, Builder};
use crate::collapse::{Collapse, Learning};
use crate::error::Error;
use crate::geometry::primitives::Primitives;
use crate::learn::ray_log::RayLog;
use crate::learn::surface_rays::surface_rays;
use crate::learn::{Log, LogKind, TreeLog};
use crate::order::Order;
use crate::parallel;
use crate::ray::Ray;
use crate::trace::observe::Cost;
use crate::trace::pick::Pick;
use crate::tree::binary::BinaryTree;
use crate::tree::costs::CostModel;
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
    fn log_of(&self, rays: &[Ray], kind: LogKind, seed: u64) -> Log;

    /// Puts a tree fresh from its collapse into the order of a recipe, learned from `log` or else from `rays`. Where the
    /// order learns and there is neither, the tree stays as it is.
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
    ) -> Result<(), Error>;

    /// Whether anything lies in the interval of each ray, and what each ray cost; on the calling thread.
    ///
    /// # Panics
    /// If the slices differ in length.
    fn occluded_batch_counted(&self, rays: &[Ray], occluded: &mut [bool], costs: &mut [Cost]);

    /// [`Laboratory::occluded_batch_counted`], and the rays are written to `log`, in whose shuffled mode
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

    /// Nodes that rays visit, counted separately for occluded rays and for the others:
    /// [`Laboratory::occluded_batch_counted`] summed up, on the threads of the current rayon pool.
    fn visits(&self, rays: &[Ray]) -> Visits;

    /// Nodes that rays would visit if each went straight to an occluder, by the shortest path to any: what the best
    /// order of all, made for each single ray, could save. The tree's own order does not matter.
    ///
    /// The difference to [`Laboratory::visits`] is the most that any order can still save.
    fn oracle_visits(&self, rays: &[Ray]) -> Visits;

    /// Has batches prefetch or not: as the recipe says, or else as a short timing of `rays` by its clock decides.
    fn choose_prefetch(&mut self, rays: &[Ray], recipe: &Recipe);

    /// Has batches prefetch nodes and leaves from now on, or not.
    fn set_prefetch(&mut self, prefetch: bool);

    /// Times `rays`, as occlusion queries on the calling thread, with and without prefetching of nodes and leaves.
    /// Keeps what is faster and returns it. `clock` returns the time that has passed since some moment: the kernel has
    /// no clock.
    ///
    /// A few thousand rays like the ones to come are enough. Rays traced for the first time say more than rays that
    /// were just traced. With fewer than 512 rays, or a clock that does not advance, the setting stays as it is.
    fn time_prefetch(&mut self, rays: &[Ray], clock: impl Fn() -> Duration) -> bool;
}

impl Laboratory for Bvh {
    fn collapse(
        primitives: &Primitives,
        tree: &BinaryTree,
        collapse: Collapse,
        width: Width,
        isa: Isa,
    ) -> Self {
        Self::collapse(primitives, tree, collapse, width, isa)
    }

    fn collapse_logged(
        primitives: &Primitives,
        tree: &BinaryTree,
        log: &TreeLog,
        learning: &Learning,
        width: Width,
        isa: Isa,
    ) -> Self {
        Self::collapse_logged(primitives, tree, log, learning, width, isa)
    }

    fn new_log(&self, kind: LogKind, seed: u64) -> Log {
        self.new_log(kind, seed)
    }

    fn plan(&self, order: Order, log: Option<&Log>, model: &CostModel) -> Result<SlotOrder, Error> {
        self.plan(order, log, model)
    }

    fn predicted_cost(
        &self,
        log: &Log,
        model: &CostModel,
        order: Option<&SlotOrder>,
    ) -> Result<f64, Error> {
        self.predicted_cost(log, model, order)
    }

    fn apply(&mut self, order: &SlotOrder) {
        self.apply(order)
    }

    fn log_of(&self, rays: &[Ray], kind: LogKind, seed: u64) -> Log {
        self.log_of(rays, kind, seed)
    }

    fn learn_order(
        &mut self,
        rays: &[Ray],
        log: Option<&Log>,
        recipe: &Recipe,
    ) -> Result<(), Error> {
        self.learn_order(rays, log, recipe).map(|_| ())
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
        self.occluded_batch_logged(rays, occluded, costs, log)
    }

    fn visits(&self, rays: &[Ray]) -> Visits {
        sum_visits(rays, |rays| {
            let mut occluded = vec![false; rays.len()];
            let mut costs = vec![Cost::default(); rays.len()];
            self.occluded_batch_counted(rays, &mut occluded, &mut costs);
            let mut sum = Visits::default();
            for (occluded, cost) in occluded.into_iter().zip(costs) {
                sum.add(occluded, cost.node_tests.into());
            }
            sum
        })
    }

    fn oracle_visits(&self, rays: &[Ray]) -> Visits {
        sum_visits(rays, |rays| {
            let mut log = RayLog::default();
            self.follow(rays, &mut log);
            let mut sum = Visits::default();
            oracle::add_shortest(&self.tree, &log, &mut sum);
            // Rays that cannot hit anything are not in the log.
            let all = sum.occluded_rays + sum.unoccluded_rays;
            sum.unoccluded_rays += rays.len() as u64 - all;
            sum
        })
    }

    fn choose_prefetch(&mut self, rays: &[Ray], recipe: &Recipe) {
        self.choose_prefetch(rays, recipe)
    }

    fn set_prefetch(&mut self, prefetch: bool) {
        self.set_prefetch(prefetch)
    }

    fn time_prefetch(&mut self, rays: &[Ray], clock: impl Fn() -> Duration) -> bool {
        self.time_prefetch(rays, clock)
    }
}

fn sum_visits(rays: &[Ray], visits: impl Fn(&[Ray]) -> Visits + Sync + Send) -> Visits {
    /// Visits take memory until they are counted.
    const CHUNK: usize = 1 << 10;
    let chunks = parallel::map(rays.len().div_ceil(CHUNK), 1, |chunk| {
        visits(&rays[chunk * CHUNK..rays.len().min((chunk + 1) * CHUNK)])
    });
    let mut sum = Visits::default();
    for visits in chunks {
        sum.merge(&visits);
    }
    sum
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
    /// come, the result is the tree of [`Builder::BinnedSah`].
    pub fn build_for(primitives: &Primitives, builder: Builder, rays: &[Ray]) -> Self {
        builder::build(primitives, builder, rays, &())
    }
}
