//! The tree that shadow rays visit: its nodes and its child order.
//!
//! 1. *First tree.* A learned collapse learns only from surface rays. The pre-pass is traced in this tree. Binned
//!    SAH replaces a builder that needs rays.
//! 2. *Training rays.* The pre-pass yields a sample of its shadow rays. An order of a tree that is not made again
//!    learns from all of them as they are traced, unless the order keeps more per ray than memory allows.
//! 3. *Final tree.* A learned collapse, and a builder that needs rays, learn from surface rays and training rays.
//!    Training rays count for half or more. Surface rays stand for the parts that the camera does not see.
//! 4. *Child order.* The order learns from a log of the training rays in the final tree.

use std::time::{Duration, Instant};

use antumbra::parts::{Log, Steps};
use antumbra::recipe::Builder;
use antumbra::{Build, BuildMonitor, Bvh, Ray, Recipe, Stage};
use antumbra_scene::Integrator;

use super::job::Job;
use super::monitor::{Monitor, Phase};
use super::prepass::{self, Prepass};
use crate::Error;
use crate::clock::clock;
use crate::options::Options;
use crate::training::{Lesson, RaySample, Selection, TrainingSample};
use crate::world::World;

/// Results of learning.
#[derive(Default)]
pub struct Learned {
    /// Samples of the pre-pass, traced.
    pub prepass: Option<Prepass>,
    /// Choice of these samples.
    pub selection: Option<Selection>,
    /// Training rays. `None` if nothing was to be learned.
    pub lesson: Option<Lesson>,
    /// Figures of the final tree.
    pub figures: LearningFigures,
    /// Time from the first sample of the pre-pass to a full training log, wall-clock.
    pub logging: Duration,
}

impl Learned {
    /// Nothing but training rays.
    pub fn of(lesson: Option<Lesson>) -> Self {
        Self {
            lesson,
            ..Self::default()
        }
    }
}

/// Figures of learning the final tree. Times are wall-clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct LearningFigures {
    /// Number of rays in the log of the child order.
    pub logged_rays: u64,
    /// Cost of a shadow ray in the tree before and after its order was applied.
    pub predicted: Option<[f64; 2]>,
    /// Time that went into `predicted`.
    pub predicting: Duration,
    /// Time of following training rays outside of the pre-pass.
    pub following: Duration,
    /// Time of building the binary tree from scratch.
    pub rebuilding: Duration,
    /// Time of the second collapse, and of planning and applying the order.
    pub sorting: Duration,
    /// Part of `sorting` that plans and applies the order.
    pub ordering: Duration,
}

/// The first tree, for any rays, and its time. Work that an earlier rendering did counts as if done now.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn first_tree(
    world: &World,
    recipe: &Recipe,
    monitor: &dyn Monitor,
) -> Result<(Bvh, Duration), Error> {
    let watched = WatchedBuild(monitor);
    let recipe = recipe.builder(first_builder(recipe)).clock(Some(clock));
    let stage = world.stage_monitored(recipe.builder, &watched)?;
    let bvh = stage
        .collapse(&[], &recipe, &watched)
        .map_err(Error::of_build)?;
    let times = bvh.report().times.unwrap_or_default();
    Ok((bvh, times.tree + times.log + times.collapse))
}

/// Builder of the first tree: binned SAH for a builder that waits for training rays, otherwise the recipe's.
pub fn first_builder(recipe: &Recipe) -> Builder {
    if recipe.builder.needs_rays() && recipe.order.learns() {
        Builder::BinnedSah
    } else {
        recipe.builder
    }
}

/// Approximate number of shadow rays per sample.
fn shadow_rays_per_sample(integrator: &Integrator) -> f64 {
    match integrator {
        Integrator::AmbientOcclusion { samples, .. } => f64::from(*samples),
        Integrator::Path { .. }
        | Integrator::VolumePath { .. }
        | Integrator::DirectLighting { .. } => 4.0,
    }
}

/// Choice of the samples of the pre-pass.
pub fn prepass_samples(job: &Job, options: &Options) -> Option<Selection> {
    let rays = shadow_rays_per_sample(&job.world.integrator);
    let pixels = job.pixels_to_do();
    Selection::new(options.log_share, rays, pixels, job.spp, job.seed)
}

/// Number of training rays of a picture that does not learn from all its shadow rays.
///
/// Learning from a ray takes the time of tracing a hundred, and is to take a twentieth of the whole. The number is
/// the same for all shards. docs/notes/renderer.md has the node tests by number of rays.
pub fn rays_worth_learning(job: &Job) -> usize {
    const SHARE: f64 = 1.0 / 2048.0;
    const LEAST: f64 = (1 << 12) as f64;
    const MOST: f64 = (1 << 14) as f64;
    let samples = job.rules.sampled().area() as f64 * f64::from(job.spp);
    let rays = samples * shadow_rays_per_sample(&job.world.integrator);
    (rays * SHARE).clamp(LEAST, MOST) as usize
}

/// Learns the final tree and its child order, see the module's documentation. Training logs end here.
///
/// Everything is learned from the rays of a `lesson`, if there is one, without a pre-pass.
pub fn learn(
    job: &Job,
    options: &Options,
    bvh: &mut Bvh,
    lesson: Option<&Lesson>,
) -> Result<Learned, Error> {
    let recipe = options.recipe.seed(job.seed).clock(Some(clock));
    let mut learned = Learned::default();
    // Training log of all shadow rays of the pre-pass, if there is one.
    let mut full = None;
    let mut made_anew = false;
    let mut following = Duration::ZERO;
    if let Some(kind) = recipe.order.log_kind() {
        let start = Instant::now();
        // A log of masks grows with every ray, so only a sample is logged.
        let anew = recipe.collapse.needs_log() || recipe.builder.needs_rays();
        let rays = RaySample::new(rays_worth_learning(job));
        let mut sample = if !anew && !kind.masks {
            TrainingSample::Log {
                log: Box::new(bvh.new_log(kind, job.seed)),
                rays,
            }
        } else {
            TrainingSample::Rays {
                rays,
                counted: options.counts(),
            }
        };
        if let Some(lesson) = lesson {
            sample.add(bvh, lesson.rays());
            following = start.elapsed();
        } else {
            let selection = prepass_samples(job, options);
            let (prepass, found) = prepass::run(job, bvh, &sample, selection, None)?;
            sample = found;
            learned.prepass = Some(prepass);
            learned.selection = selection;
        }
        learned.logging = start.elapsed();
        let rays = match sample {
            TrainingSample::Log { log, rays } => {
                full = Some(*log);
                rays
            }
            TrainingSample::Rays { rays, .. } => rays,
        };
        let lesson = Lesson::from(rays.into_rays());
        job.monitor.learned(&lesson);
        if anew {
            made_anew = make_anew(job, &recipe, bvh, lesson.rays(), &mut None)?;
        }
        learned.lesson = Some(lesson);
    }
    job.monitor.progress(Phase::Sort, 0, 1);
    let rays = learned.lesson.as_ref().map_or(&[][..], Lesson::rays);
    let figures = learn_order(&recipe, bvh, rays, full.as_ref(), made_anew)?;
    job.monitor.progress(Phase::Sort, 1, 1);
    learned.logging += figures.following;
    learned.figures = LearningFigures {
        following: following + figures.following,
        ..figures
    };
    Ok(learned)
}

/// Learns the child order of the final tree, which was `made_anew` or is the first tree, from a log or else from `rays`.
///
/// # Errors
/// [`Error::Order`].
pub fn learn_order(
    recipe: &Recipe,
    bvh: &mut Bvh,
    rays: &[Ray],
    log: Option<&Log>,
    made_anew: bool,
) -> Result<LearningFigures, Error> {
    bvh.learn_order(rays, log, recipe).map_err(Error::Order)?;
    Ok(LearningFigures::of(recipe, bvh, made_anew))
}

/// Makes the tree again for `rays`, or for any rays if there are none; returns whether it did. Its child order is still to
/// be learned. The binary tree for these rays is taken from `kept` if it is there, and else kept.
pub fn make_anew(
    job: &Job,
    recipe: &Recipe,
    bvh: &mut Bvh,
    rays: &[Ray],
    kept: &mut Option<(Builder, Stage)>,
) -> Result<bool, Error> {
    let world = job.world;
    if rays.is_empty() && recipe.builder == first_builder(recipe) {
        return Ok(false);
    }
    let watched = &WatchedBuild(job.monitor);
    let collapse = |stage: &Stage| (stage.collapse(rays, recipe, watched)).map_err(Error::of_build);
    *bvh = if recipe.builder.needs_rays() && !rays.is_empty() {
        let stage = match kept.take() {
            Some((builder, stage)) if builder == recipe.builder => stage,
            _ => {
                let build = Build::new(&world.primitives).rays(rays).recipe(recipe);
                build.monitor(watched).stage().map_err(Error::of_build)?
            }
        };
        collapse(&kept.insert((recipe.builder, stage)).1)?
    } else {
        collapse(&*world.stage_monitored(recipe.builder, watched)?)?
    };
    Ok(true)
}

/// Monitor of a rendering that watches a build.
struct WatchedBuild<'a>(&'a dyn Monitor);

impl BuildMonitor for WatchedBuild<'_> {
    fn progress(&self, done: f32) {
        const STEPS: u64 = 1000;
        let done = (f64::from(done) * STEPS as f64) as u64;
        self.0.progress(Phase::Build, done, STEPS);
    }

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

impl LearningFigures {
    /// Figures from the report of the final tree.
    fn of(recipe: &Recipe, bvh: &Bvh, made_anew: bool) -> Self {
        let report = bvh.report();
        let predicted = report.predicted_cost_before.zip(report.predicted_cost);
        let times = report.times.unwrap_or_default();
        let mut figures = Self {
            logged_rays: report.training_rays,
            predicted: predicted.map(|(before, after)| [before, after]),
            predicting: times.predict,
            following: times.order_log,
            rebuilding: Duration::ZERO,
            sorting: times.order,
            ordering: times.order,
        };
        if made_anew {
            figures.following += times.log;
            figures.sorting += times.collapse;
            if recipe.builder.needs_rays() {
                figures.rebuilding = times.tree;
            }
        }
        figures
    }
}
