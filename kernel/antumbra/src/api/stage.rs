//! The stage between geometry and a tree that answers rays: a binary tree, and the log of training rays in it.
//!
//! The steps are always the same: binary tree, training log of the binary tree, collapse, training log of the wide
//! tree, child order. [`Build`](super::build::Build) takes them all. [`Stage`] stops in between for those
//! who make many trees from one binary tree.

use alloc::borrow::Cow;
use alloc::sync::Arc;
#[cfg(not(feature = "std"))]
use core::cell::OnceCell as OnceLock;
use core::fmt;
use core::time::Duration;
#[cfg(feature = "std")]
use std::sync::OnceLock;

use super::bvh::Bvh;
use super::recipe::{Recipe, TrainingRays};
use super::steps::Steps;
use super::times::{BuildTimes, Stopwatch};
use crate::builder;
use crate::collapse::Learning;
use crate::error::Error;
use crate::geometry::primitives::Primitives;
use crate::learn::TreeLog;
use crate::learn::surface_rays::{default_count, surface_rays};
use crate::monitor::{BuildMonitor, Latched};
use crate::order::Order;
use crate::ray::Ray;
use crate::tree::binary::BinaryTree;

/// A binary tree that can still learn: wide trees of any collapse and child order are made from it, for any rays.
///
/// Made by [`Build::stage`](crate::Build::stage). The log of surface rays is made once, on first use, and kept for all
/// trees.
///
/// ```
/// use antumbra::{Build, Geometry, Ray, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let stage = Build::new(&geometry).stage()?;
///
/// // Two trees from one binary tree: for any rays, and for rays like these.
/// let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])];
/// let recipe = Recipe::default();
/// let trees = [stage.learn(&[], &recipe, &())?, stage.learn(&rays, &recipe, &())?];
/// assert!(trees.iter().all(|bvh| bvh.occluded(&rays[0])));
/// # Ok::<(), antumbra::Error>(())
/// ```
pub struct Stage {
    pub(super) primitives: Arc<Primitives>,
    pub(super) binary: BinaryStage,
}

impl Stage {
    pub(super) fn new(primitives: Arc<Primitives>, binary: BinaryStage) -> Self {
        Self { primitives, binary }
    }

    /// Primitives of every tree of this stage.
    pub fn primitives(&self) -> &Arc<Primitives> {
        &self.primitives
    }

    /// Time that the binary tree took; zero without a [clock](Recipe::clock).
    pub fn time(&self) -> Duration {
        self.binary.time
    }

    /// Wide tree as the collapse leaves it, for `rays`, or without any for surface rays. Its child order is still to be
    /// learned: see [`Bvh::relearn`].
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the monitor stopped it before it was done.
    pub fn collapse(
        &self,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Bvh, Error> {
        (self.binary).collapse(&self.primitives, rays, recipe, &Latched::new(monitor))
    }

    /// Wide tree in its child order, ready for queries: learned from `rays`, or without any from surface rays.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the monitor stopped it before it was done; the error of an order that plugs in.
    pub fn learn(
        &self,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Bvh, Error> {
        (self.binary).learn(&self.primitives, rays, recipe, &Latched::new(monitor))
    }
}

/// Reports to a monitor how far a build is. [`Error::Cancelled`] if the monitor stops the build.
pub(super) fn reached(done: f32, monitor: &dyn BuildMonitor) -> Result<(), Error> {
    monitor.progress(done);
    if monitor.cancelled() {
        Err(Error::Cancelled)
    } else {
        Ok(())
    }
}

/// A [`Stage`] without its primitives. Every step must be given the primitives of the first, and a monitor that [stays
/// cancelled](Latched).
#[derive(Debug)]
pub(crate) struct BinaryStage {
    pub(super) tree: BinaryTree,
    time: Duration,
    /// Made on first use and kept.
    surface_log: OnceLock<SurfaceLog>,
}

/// Training log of surface rays in the binary tree.
#[derive(Debug)]
struct SurfaceLog {
    /// Number of rays that a recipe requested, see [`Training`](super::recipe::Training).
    count: Option<usize>,
    log: TreeLog,
    time: Duration,
}

impl BinaryStage {
    /// Builds the binary tree. A builder that needs rays is driven by the training rays of the recipe.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the monitor stopped the build.
    pub fn new(
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Self, Error> {
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let rays = match recipe.builder.needs_rays() {
            true => driving_rays(primitives, rays, recipe),
            false => Cow::Borrowed(&[][..]),
        };
        let tree = builder::build(primitives, recipe.builder, &rays, monitor);
        let stage = Self {
            tree,
            time: stopwatch.lap(),
            surface_log: OnceLock::new(),
        };
        reached(0.4, monitor)?;
        Ok(stage)
    }

    /// Log of the surface rays of a recipe. Made on first use, in the current rayon pool, and kept for all recipes that want
    /// as many. A log that the monitor stopped is not kept.
    fn surface_log(
        &self,
        primitives: &Primitives,
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Cow<'_, TreeLog> {
        let count = recipe.training.surface_rays;
        if let Some(made) = self.surface_log.get()
            && made.count == count
        {
            return Cow::Borrowed(&made.log);
        }
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let log = TreeLog::of_surfaces_until(primitives, &self.tree, count, monitor);
        let time = stopwatch.lap();
        if monitor.cancelled() {
            return Cow::Owned(log);
        }
        // Made inside `get_or_init`, the log could wait for itself: its thread may take up another task of the pool in
        // the meantime.
        match self.surface_log.set(SurfaceLog { count, log, time }) {
            Ok(()) => self.surface_log(primitives, recipe, monitor),
            Err(made) => Cow::Owned(made.log),
        }
    }

    /// Log of the training rays of a recipe.
    pub fn training_log(
        &self,
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Cow<'_, TreeLog> {
        if rays.is_empty() || recipe.training.rays == TrainingRays::Surface {
            return self.surface_log(primitives, recipe, monitor);
        }
        let mut log = match recipe.training.rays {
            TrainingRays::Given => TreeLog::new(&self.tree),
            TrainingRays::Both | TrainingRays::Surface => {
                self.surface_log(primitives, recipe, monitor).into_owned()
            }
        };
        log.add_until(
            primitives,
            &self.tree,
            (rays, rays.len()),
            log.weight_for(rays),
            monitor,
        );
        Cow::Owned(log)
    }

    /// [`Stage::collapse`]. Its times include making the surface rays' log, even where the log was made before.
    pub fn collapse(
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
        let log = (recipe.collapse.needs_log())
            .then(|| self.training_log(primitives, rays, recipe, monitor));
        times.log = match (&log, self.surface_log.get()) {
            (Some(Cow::Borrowed(_)), Some(kept)) => kept.time,
            _ => Duration::ZERO,
        };
        times.log = stopwatch.lap().max(times.log);
        reached(0.6, monitor)?;
        let thorough = !rays.is_empty();
        let bvh = self.collapse_for(primitives, log.as_deref(), thorough, recipe, monitor);
        let mut bvh = bvh.ok_or(Error::Cancelled)?;
        times.collapse = stopwatch.lap();
        bvh.times = recipe.clock.map(|_| times);
        Ok(bvh)
    }

    /// [`Stage::collapse_for`]; `None` if the monitor stopped it.
    pub fn collapse_for(
        &self,
        primitives: &Primitives,
        log: Option<&TreeLog>,
        thorough: bool,
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Option<Bvh> {
        let Recipe {
            collapse, engine, ..
        } = *recipe;
        let Some(log) = log else {
            return Some(Bvh::collapse(primitives, &self.tree, collapse, engine));
        };
        let learning = Learning {
            collapse,
            model: recipe.costs,
            thorough,
            ..Learning::default()
        };
        Bvh::collapse_until((primitives, &self.tree), log, &learning, engine, monitor)
    }

    /// [`Stage::learn`].
    pub fn learn(
        &self,
        primitives: &Primitives,
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Bvh, Error> {
        check_training(rays, recipe)?;
        let mut bvh = self.collapse(primitives, rays, recipe, monitor)?;
        reached(0.8, monitor)?;
        let training = order_rays(primitives, rays, recipe);
        // Without rays to learn from, children are in the order of their areas.
        let order = match training.is_empty() && recipe.order.learns() {
            true => Order::Sato,
            false => recipe.order,
        };
        let given = rays.len().min(training.len());
        bvh.learn_order_until((&training, given), None, &recipe.order(order), monitor)?;
        reached(0.95, monitor)?;
        monitor.progress(1.0);
        Ok(bvh)
    }
}

/// More surface rays teach nothing, and a mistaken number would fill the memory.
const MOST_SURFACE_RAYS: usize = 1 << 24;

/// Bytes that learning takes for each training ray, as measured, and some more.
const TRAINING_BYTES: usize = 1100;

/// Fails if there are more surface rays than are of use, or more training rays than there is memory for.
fn check_training(rays: &[Ray], recipe: &Recipe) -> Result<(), Error> {
    let found = recipe.training.surface_rays.unwrap_or(0);
    if found > MOST_SURFACE_RAYS {
        return Err(Error::TooMany {
            what: "surface rays",
            found,
            limit: MOST_SURFACE_RAYS,
        });
    }
    Error::if_no_memory("training rays", found.max(rays.len()), TRAINING_BYTES)
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

/// Given rays per surface ray among the rays that a child order learns from. Without any surface rays, orders learned
/// from shadow rays make ambient occlusion rays up to 1.17 times as expensive. See `docs/notes/kernel.md`.
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

impl fmt::Debug for Stage {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stage")
            .field("primitives", &self.primitives.stored())
            .field("time", &self.binary.time)
            .finish_non_exhaustive()
    }
}
