//! The tree that shadow rays visit: its nodes and its child order.
//!
//! 1. *First tree.* A learned collapse learns from surface rays alone. The pre-pass is traced in this tree. Binned
//!    SAH stands in for a builder that needs rays.
//! 2. *Training rays.* The pre-pass yields a sample of its shadow rays. An order of a tree that is not made anew
//!    learns from all of them as they are traced, unless the order keeps more per ray than memory allows.
//! 3. *Final tree.* A learned collapse, and a builder that needs rays, learn from surface rays and training rays.
//!    Training rays count for half or more. Surface rays stand for the parts that the camera does not see.
//! 4. *Child order.* The order learns from a log of the training rays in the final tree.
//! 5. *Prefetch.* The training rays tell whether prefetching pays in the final tree.

use std::time::{Duration, Instant};

use antumbra::{AnyBvh, Builder, Cost, Learning, Log, LogKind, Ray, TreeLog};
use antumbra_scene::Integrator;

use super::job::Job;
use super::monitor::Phase;
use super::prepass::{self, Prepass};
use crate::Error;
use crate::options::Options;
use crate::training::{BuiltTree, Lesson, RaySample, Selection, TrainingSample};
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
    /// Number of rays in the log of the child order.
    pub logged_rays: u64,
    /// Cost of a shadow ray in the tree before and after its order was applied.
    pub predicted: Option<[f64; 2]>,
    /// Time that went into `predicted`.
    pub predicting: Duration,
    /// Time from the first sample of the pre-pass to a full training log, wall-clock.
    pub logging: Duration,
    /// Part of `logging` outside of the pre-pass: following training rays once more.
    pub following: Duration,
    /// Time of building the binary tree anew, wall-clock.
    pub rebuilding: Duration,
    /// Time of the second collapse, of planning and applying the order, and of trying whether to prefetch.
    pub sorting: Duration,
}

/// The first tree, for any rays, and its time. Work that an earlier rendering did counts as if done now.
pub fn first_tree(world: &World, options: &Options) -> (AnyBvh, Duration) {
    let builder = first_builder(options);
    let tree = world.tree(builder);
    let mut time = tree.time();
    if options.collapse.needs_log() {
        tree.surface_log(&world.primitives);
        time += tree.surface_log_time();
    }
    let start = Instant::now();
    let bvh = for_any_rays(world, options, builder);
    (bvh, time + start.elapsed())
}

/// Builder of the first tree.
fn first_builder(options: &Options) -> Builder {
    if options.builder.needs_rays() && options.order.log_kind().is_some() {
        Builder::BinnedSah
    } else {
        options.builder
    }
}

/// A tree learned without the scene's own rays.
fn for_any_rays(world: &World, options: &Options, builder: Builder) -> AnyBvh {
    let tree = world.tree(builder);
    let log = || tree.surface_log(&world.primitives);
    let log = options.collapse.needs_log().then(log);
    wide(world, options, tree, log, &learning(options))
}

/// A binary tree made wide, by a training log if the collapse needs one.
fn wide(
    world: &World,
    options: &Options,
    tree: &BuiltTree,
    log: Option<&TreeLog>,
    learning: &Learning,
) -> AnyBvh {
    let Options {
        collapse,
        width,
        isa,
        ..
    } = *options;
    match log {
        Some(log) => tree.logged(&world.primitives, log, learning, width, isa),
        None => tree.unlogged(&world.primitives, collapse, width, isa),
    }
}

/// Approximate number of shadow rays per sample.
fn shadow_rays_per_sample(integrator: &Integrator) -> f64 {
    match integrator {
        Integrator::AmbientOcclusion { samples, .. } => f64::from(*samples),
        Integrator::Path { .. } | Integrator::DirectLighting { .. } => 4.0,
    }
}

/// Number of training rays of a picture that does not learn from all its shadow rays.
///
/// Learning from a ray takes the time of tracing a hundred, and is to take a twentieth of the whole. The number is
/// the same for all shards. docs/notes/renderer.md has the node tests by number of rays.
fn rays_worth_learning(job: &Job) -> usize {
    const SHARE: f64 = 1.0 / 2048.0;
    const LEAST: f64 = (1 << 12) as f64;
    const MOST: f64 = (1 << 14) as f64;
    let samples = job.rules.sampled().area() as f64 * f64::from(job.spp);
    let rays = samples * shadow_rays_per_sample(&job.world.integrator);
    (rays * SHARE).clamp(LEAST, MOST) as usize
}

fn learning(options: &Options) -> Learning {
    Learning {
        collapse: options.collapse,
        model: options.model,
        ..Learning::default()
    }
}

/// Learns the final tree and its child order, see the module's documentation. Training logs end here.
///
/// Everything is learned from the rays of a `lesson`, if there is one, without a pre-pass.
pub fn learn(
    job: &Job,
    options: &Options,
    bvh: &mut AnyBvh,
    lesson: Option<&Lesson>,
) -> Result<Learned, Error> {
    let mut learned = Learned::default();
    let mut log = None;
    if let Some(kind) = options.order.log_kind() {
        let start = Instant::now();
        // A log of masks grows with every ray, so only a sample is logged.
        let anew = options.collapse.needs_log() || options.builder.needs_rays();
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
            learned.following = start.elapsed();
        } else {
            let pixels = job.pixels_to_do();
            let rays = shadow_rays_per_sample(&job.world.integrator);
            let selection = Selection::new(options.log_share, rays, pixels, job.spp, job.seed);
            let (prepass, found) = prepass::run(job, bvh, &sample, selection)?;
            sample = found;
            learned.prepass = Some(prepass);
            learned.selection = selection;
        }
        learned.logging = start.elapsed();
        let (full, rays) = match sample {
            TrainingSample::Log { log, rays } => (Some(*log), rays),
            TrainingSample::Rays { rays, .. } => (None, rays),
        };
        let lesson = Lesson::from(rays.into_rays());
        job.monitor.learned(&lesson);
        log = match full {
            Some(log) => Some(log),
            None => {
                if anew {
                    learned.make_anew(job, options, bvh, lesson.rays());
                }
                learned.log(bvh, lesson.rays(), kind, job.seed)
            }
        };
        learned.lesson = Some(lesson);
    }
    job.monitor.progress(Phase::Sort, 0, 1);
    learned.sort(options, bvh, log.as_ref())?;
    learned.choose_prefetch(options, bvh);
    job.monitor.progress(Phase::Sort, 1, 1);
    Ok(learned)
}

impl Learned {
    /// Makes the tree anew for `rays`. Without rays, makes it for any rays.
    fn make_anew(&mut self, job: &Job, options: &Options, bvh: &mut AnyBvh, rays: &[Ray]) {
        let world = job.world;
        if rays.is_empty() {
            if options.builder != first_builder(options) {
                let start = Instant::now();
                *bvh = for_any_rays(world, options, options.builder);
                self.rebuilding += start.elapsed();
            }
            return;
        }
        let rebuilt;
        let tree = if options.builder.needs_rays() {
            rebuilt = BuiltTree::for_rays(&world.primitives, options.builder, rays);
            self.rebuilding += rebuilt.time();
            &rebuilt
        } else {
            world.tree(options.builder)
        };
        let start = Instant::now();
        let log = options.collapse.needs_log().then(|| {
            let mut log = tree.surface_log(&world.primitives).clone();
            tree.follow(&world.primitives, &mut log, rays);
            log
        });
        self.followed(start);
        let start = Instant::now();
        let learning = Learning {
            thorough: true,
            ..learning(options)
        };
        *bvh = wide(world, options, tree, log.as_ref(), &learning);
        self.sorting += start.elapsed();
    }

    /// Training log of `rays` in the tree, for its child order. `None` without rays.
    fn log(&mut self, bvh: &AnyBvh, rays: &[Ray], kind: LogKind, seed: u64) -> Option<Log> {
        if rays.is_empty() {
            return None;
        }
        let start = Instant::now();
        let mut log = bvh.new_log(kind, seed);
        let mut occluded = vec![false; rays.len()];
        let mut costs = vec![Cost::default(); rays.len()];
        bvh.occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
        self.followed(start);
        Some(log)
    }

    /// Counts the time since `start` as time of following training rays.
    fn followed(&mut self, start: Instant) {
        let time = start.elapsed();
        self.following += time;
        self.logging += time;
    }

    /// Switches prefetching as asked for. Unless asked for, the training rays tell which is faster.
    fn choose_prefetch(&mut self, options: &Options, bvh: &mut AnyBvh) {
        if let Some(prefetch) = options.prefetch {
            bvh.set_prefetch(prefetch);
        } else if let Some(lesson) = &self.lesson {
            let start = Instant::now();
            bvh.time_prefetch(lesson.rays(), || start.elapsed());
            self.sorting += start.elapsed();
        }
    }

    /// Puts the tree into the child order asked for.
    fn sort(
        &mut self,
        options: &Options,
        bvh: &mut AnyBvh,
        log: Option<&Log>,
    ) -> Result<(), Error> {
        if log.is_none() && options.order.log_kind().is_some() {
            // Without training rays the tree keeps the order that surface rays gave it.
            return Ok(());
        }
        let start = Instant::now();
        let plan = bvh
            .plan(options.order, log, &options.model)
            .map_err(Error::Order)?;
        self.sorting += start.elapsed();
        if let Some(log) = log {
            let start = Instant::now();
            let cost = |plan| bvh.predicted_cost(log, &options.model, plan);
            let [before, after] = [cost(None), cost(Some(&plan))];
            self.predicted = Some([before.map_err(Error::Order)?, after.map_err(Error::Order)?]);
            self.logged_rays = log.rays();
            self.predicting = start.elapsed();
        }
        let start = Instant::now();
        bvh.apply(&plan);
        self.sorting += start.elapsed();
        Ok(())
    }
}
