//! Learning: from training rays and a recipe to a tree that is ready.
//!
//! The steps are always the same: binary tree, training log of the binary tree, collapse, training log of the wide
//! tree, child order, prefetching. [`Bvh::learn`] takes them all; [`BinaryStage`] stops in between for those who
//! make many trees from one binary tree.

use core::time::Duration;
use std::borrow::Cow;
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
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let primitives = Primitives::new(geometries)?;
        let checked = stopwatch.lap();
        let mut bvh = Self::learn_over(&primitives, rays, recipe);
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
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let tree = if recipe.builder.needs_rays() {
            let rays = driving_rays(primitives, rays, recipe);
            builder::build(primitives, recipe.builder, &rays)
        } else {
            builder::build(primitives, recipe.builder, &[])
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
        let mut stopwatch = Stopwatch::new(recipe.clock);
        let mut times = BuildTimes {
            tree: self.time,
            ..BuildTimes::default()
        };
        let log =
            (recipe.collapse.needs_log()).then(|| self.training_log(primitives, rays, recipe));
        times.log = stopwatch.lap();
        let mut bvh = self.collapse_for(primitives, log.as_deref(), !rays.is_empty(), recipe);
        times.collapse = stopwatch.lap();
        bvh.times = recipe.clock.map(|_| times);
        bvh
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
        let mut bvh = self.collapse(primitives, rays, recipe);
        let training = order_rays(primitives, rays, recipe);
        bvh.learn_order(&training, None, recipe)
            .expect("the log is made here, of this tree and as the order asks for");
        bvh.choose_prefetch(rays, recipe);
        bvh
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

/// Rays that the child order is learned from; none for an order that does not learn.
fn order_rays<'a>(primitives: &Primitives, rays: &'a [Ray], recipe: &Recipe) -> Cow<'a, [Ray]> {
    if !recipe.order.learns() {
        return Cow::Borrowed(&[]);
    }
    if rays.is_empty() || recipe.training.rays == TrainingRays::Surface {
        let training = &recipe.training;
        let count = training.surface_rays.unwrap_or(default_count(primitives));
        return surface_rays(primitives, count.max(rays.len()), training.seed).into();
    }
    rays.into()
}
