//! Learning: from training rays and a recipe to a tree that is ready.
//!
//! The steps are always the same: binary tree, training log of the binary tree, collapse, training log of the wide
//! tree, child order, prefetching. [`Bvh::learn`] takes them all; [`BinaryStage`] stops in between for those who
//! make many trees from one binary tree.

use alloc::borrow::Cow;
#[cfg(not(feature = "std"))]
use core::cell::OnceCell as OnceLock;
use core::time::Duration;
#[cfg(feature = "std")]
use std::sync::OnceLock;

use super::bvh::Bvh;
use super::lab::Laboratory;
use super::recipe::{Recipe, TrainingRays};
use super::times::{BuildTimes, Stopwatch};
use crate::builder;
use crate::collapse::Learning;
use crate::error::Error;
use crate::geometry::Geometry;
use crate::geometry::primitives::Primitives;
use crate::learn::TreeLog;
use crate::learn::surface_rays::{default_count, surface_rays};
use crate::monitor::BuildMonitor;
use crate::ray::Ray;
use crate::tree::binary::BinaryTree;

impl Bvh {
    /// Builds a tree over geometries and learns it from surface rays. The place of a geometry in the list is its
    /// `geom_id`.
    ///
    /// Uses the rayon pool that is current, if the `parallel` feature is on. The tree does not depend on the number
    /// of threads.
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn build(geometries: &[Geometry<'_>], recipe: &Recipe) -> Result<Self, Error> {
        Self::learn(geometries, &[], recipe)
    }

    /// Builds a tree over geometries and learns it from `rays`: a few thousand rays like those to come. Without any,
    /// from surface rays.
    ///
    /// Rays that cannot hit anything teach nothing. Learning pays where rays differ from
    /// [surface rays](crate::lab::surface_rays), from which every tree learns by default; answers stay the same.
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn learn(
        geometries: &[Geometry<'_>],
        rays: &[Ray],
        recipe: &Recipe,
    ) -> Result<Self, Error> {
        Self::learn_monitored(geometries, rays, recipe, &())
    }

    /// [`Bvh::learn`] with a monitor, which hears how far the build is and may stop it.
    ///
    /// Sorting primitives into a first tree and writing nodes are not interrupted. The tree is the same with any
    /// monitor.
    ///
    /// # Errors
    /// As [`Bvh::learn`]; [`Error::Cancelled`] if the monitor stopped the build before it was done.
    pub fn learn_monitored(
        geometries: &[Geometry<'_>],
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Self, Error> {
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let primitives = Primitives::new(geometries)?;
        let checked = stopwatch.lap();
        reached(0.05, monitor)?;
        let mut bvh = Self::learn_over_monitored(&primitives, rays, recipe, monitor)?;
        if let Some(times) = &mut bvh.times {
            times.primitives = checked;
        }
        Ok(bvh)
    }

    /// [`Bvh::build`] for primitives that are checked already, with instances if there are any: see
    /// [`Primitives::with_instances`].
    pub fn build_over(primitives: &Primitives, recipe: &Recipe) -> Self {
        Self::learn_over(primitives, &[], recipe)
    }

    /// [`Bvh::learn`] for primitives that are checked already, with instances if there are any: see
    /// [`Primitives::with_instances`].
    pub fn learn_over(primitives: &Primitives, rays: &[Ray], recipe: &Recipe) -> Self {
        BinaryStage::new(primitives, rays, recipe).learn(primitives, rays, recipe)
    }

    /// [`Bvh::learn_monitored`] for primitives that are checked already.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the monitor stopped the build before it was done.
    pub fn learn_over_monitored(
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Self, Error> {
        let stage = BinaryStage::monitored(primitives, rays, recipe, monitor)?;
        stage.learn_monitored(primitives, rays, recipe, monitor)
    }
}

/// Tells a monitor how far a build is.
fn reached(done: f32, monitor: &dyn BuildMonitor) -> Result<(), Error> {
    monitor.progress(done);
    if monitor.cancelled() {
        Err(Error::Cancelled)
    } else {
        Ok(())
    }
}

/// A binary tree with what surface rays meet in it: what wide trees of any collapse and order are made from.
///
/// The primitives are passed to every step and must be those of the first, or a clone: others make the steps panic.
#[derive(Debug)]
pub struct BinaryStage {
    tree: BinaryTree,
    time: Duration,
    /// Made on first use and kept.
    surface_log: OnceLock<SurfaceLog>,
}

/// What surface rays meet in the binary tree.
#[derive(Debug)]
struct SurfaceLog {
    /// How many a recipe asked for, see [`Training`](super::recipe::Training).
    count: Option<usize>,
    log: TreeLog,
    time: Duration,
}

impl BinaryStage {
    /// Builds the binary tree. A builder that needs rays is driven by the training rays of the recipe.
    pub fn new(primitives: &Primitives, rays: &[Ray], recipe: &Recipe) -> Self {
        Self::watched(primitives, rays, recipe, &())
    }

    /// [`BinaryStage::new`] with a monitor, which may stop it.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the monitor stopped the build.
    pub fn monitored(
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Self, Error> {
        let stage = Self::watched(primitives, rays, recipe, monitor);
        reached(0.4, monitor)?;
        Ok(stage)
    }

    /// Builds the binary tree, which is sound but not what was asked for when the monitor stops it.
    fn watched(
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Self {
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let tree = if recipe.builder.needs_rays() {
            let rays = driving_rays(primitives, rays, recipe);
            builder::build(primitives, recipe.builder, &rays, monitor)
        } else {
            builder::build(primitives, recipe.builder, &[], monitor)
        };
        Self {
            tree,
            time: stopwatch.lap(),
            surface_log: OnceLock::new(),
        }
    }

    /// Binary tree of this stage.
    pub fn tree(&self) -> &BinaryTree {
        &self.tree
    }

    /// Time that the binary tree took; zero without a clock.
    pub fn time(&self) -> Duration {
        self.time
    }

    /// Time that the log of surface rays took; zero without a clock, or if nobody asked for it yet.
    pub fn surface_log_time(&self) -> Duration {
        (self.surface_log.get()).map_or(Duration::ZERO, |made| made.time)
    }

    /// What the surface rays of a recipe meet in the binary tree. Made on first use, in the current rayon pool, and
    /// kept for all recipes that ask for as many.
    pub fn surface_log(&self, primitives: &Primitives, recipe: &Recipe) -> Cow<'_, TreeLog> {
        let count = recipe.training.surface_rays;
        if let Some(made) = self.surface_log.get()
            && made.count == count
        {
            return Cow::Borrowed(&made.log);
        }
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let log = TreeLog::of_surfaces(primitives, &self.tree, count);
        let time = stopwatch.lap();
        // Made inside `get_or_init`, the log could wait for itself: its thread may take up another task of the pool in
        // the meantime.
        match self.surface_log.set(SurfaceLog { count, log, time }) {
            Ok(()) => self.surface_log(primitives, recipe),
            Err(made) => Cow::Owned(made.log),
        }
    }

    /// What the training rays of a recipe meet in the binary tree.
    pub fn training_log(
        &self,
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
    ) -> Cow<'_, TreeLog> {
        if rays.is_empty() || recipe.training.rays == TrainingRays::Surface {
            return self.surface_log(primitives, recipe);
        }
        let mut log = match recipe.training.rays {
            TrainingRays::Given => TreeLog::new(&self.tree),
            TrainingRays::Both | TrainingRays::Surface => {
                self.surface_log(primitives, recipe).into_owned()
            }
        };
        log.add(primitives, &self.tree, rays, log.weight_for(rays));
        Cow::Owned(log)
    }

    /// Wide tree as the collapse leaves it, without a child order of its own: for `rays`, or for any if there are
    /// none.
    pub fn collapse(&self, primitives: &Primitives, rays: &[Ray], recipe: &Recipe) -> Bvh {
        self.collapse_monitored(primitives, rays, recipe, &())
            .expect("nobody stops it")
    }

    /// [`BinaryStage::collapse`] with a monitor, which may stop it.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the monitor stopped it before it was done.
    pub fn collapse_monitored(
        &self,
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Bvh, Error> {
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let mut times = BuildTimes {
            tree: self.time,
            ..BuildTimes::default()
        };
        let log =
            (recipe.collapse.needs_log()).then(|| self.training_log(primitives, rays, recipe));
        times.log = stopwatch.lap();
        reached(0.6, monitor)?;
        let mut bvh = self.collapse_for(primitives, log.as_deref(), !rays.is_empty(), recipe);
        times.collapse = stopwatch.lap();
        bvh.times = recipe.clock.map(|_| times);
        Ok(bvh)
    }

    /// Wide tree for the rays of a training log, or without one by areas alone. A thorough search for a learned collapse
    /// takes two starts, which pays for rays that are known.
    ///
    /// # Panics
    /// If the log was made for another tree.
    pub fn collapse_for(
        &self,
        primitives: &Primitives,
        log: Option<&TreeLog>,
        thorough: bool,
        recipe: &Recipe,
    ) -> Bvh {
        let Recipe {
            collapse,
            width,
            isa,
            ..
        } = *recipe;
        let Some(log) = log else {
            return Bvh::collapse(primitives, &self.tree, collapse, width, isa);
        };
        let learning = Learning {
            collapse,
            model: recipe.costs,
            thorough,
            ..Learning::default()
        };
        Bvh::collapse_logged(primitives, &self.tree, log, &learning, width, isa)
    }

    /// Wide tree in its child order, ready for queries: for `rays`, or for any if there are none.
    pub fn learn(&self, primitives: &Primitives, rays: &[Ray], recipe: &Recipe) -> Bvh {
        self.learn_monitored(primitives, rays, recipe, &())
            .expect("nobody stops it")
    }

    /// [`BinaryStage::learn`] with a monitor, which may stop it.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the monitor stopped it before it was done.
    pub fn learn_monitored(
        &self,
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Bvh, Error> {
        let mut bvh = self.collapse_monitored(primitives, rays, recipe, monitor)?;
        reached(0.8, monitor)?;
        let training = order_rays(primitives, rays, recipe);
        bvh.learn_order(&training, None, recipe)
            .expect("the log is made here, of this tree and as the order asks for");
        reached(0.95, monitor)?;
        bvh.choose_prefetch(rays, recipe);
        monitor.progress(1.0);
        Ok(bvh)
    }
}

/// Rays that drive a builder.
fn driving_rays<'a>(primitives: &Primitives, rays: &'a [Ray], recipe: &Recipe) -> Cow<'a, [Ray]> {
    let seed = recipe.training.seed;
    if rays.is_empty() {
        let count = (primitives.stored() / 16).clamp(512, 4096);
        return surface_rays(primitives, count, seed).into();
    }
    match recipe.training.rays {
        TrainingRays::Given => rays.into(),
        TrainingRays::Surface => surface_rays(primitives, rays.len(), seed).into(),
        TrainingRays::Both => {
            let mut all = rays.to_vec();
            all.extend(surface_rays(primitives, rays.len(), seed));
            all.into()
        }
    }
}

/// Surface rays among the rays that a child order learns from: one for so many rays given. Without any, orders learned from
/// shadow rays make ambient occlusion rays up to 1.17 times as dear. See `docs/notes/kernel.md`.
const GIVEN_PER_SURFACE_RAY: usize = 4;

/// Rays that the child order is learned from; none for an order that does not learn.
fn order_rays<'a>(primitives: &Primitives, rays: &'a [Ray], recipe: &Recipe) -> Cow<'a, [Ray]> {
    if !recipe.order.learns() {
        return Cow::Borrowed(&[]);
    }
    let training = &recipe.training;
    if rays.is_empty() || training.rays == TrainingRays::Surface {
        let count = training.surface_rays.unwrap_or(default_count(primitives));
        return surface_rays(primitives, count.max(rays.len()), training.seed).into();
    }
    if training.rays == TrainingRays::Given {
        return rays.into();
    }
    let count = rays.len().div_ceil(GIVEN_PER_SURFACE_RAY);
    let mut all = rays.to_vec();
    all.extend(surface_rays(primitives, count, training.seed));
    all.into()
}
