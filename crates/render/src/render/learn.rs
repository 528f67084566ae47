//! The tree that shadow rays visit: which nodes it has and in which order they stand.
//!
//! A learned collapse is made twice. The first tree, good for any rays, is learned from synthetic surface
//! rays alone; with it the pre-pass is traced. The second is learned from a blend of those and of the
//! pre-pass's shadow rays, which count for half or more: what the camera sees decides, and what it does not see is not
//! forgotten. Its order is then learned as an order of any tree is, from a log of the same shadow rays.
//!
//! A builder that needs rays is driven by those of the pre-pass, too: until they are known, binned SAH stands in
//! for it.
//!
//! An order of a tree made by area is learned from all shadow rays of the pre-pass as they are traced, unless it
//! wants to know more of each than can be kept: then from a sample, which is followed once more.
//!
//! In the final tree the rays learned from tell whether it pays to prefetch.

use std::time::{Duration, Instant};

use antumbra::{AnyBvh, Builder, Cost, Learning, Log, LogKind, Ray, TreeLog};
use antumbra_scene::Integrator;

use crate::Error;
use crate::film::tile::Selection;
use crate::options::Options;
use crate::render::Job;
use crate::render::Phase;
use crate::render::prepass::{self, Prepass};
use crate::training::lesson::Lesson;
use crate::training::sample::{Evidence, RaySample};
use crate::training::trees::BuiltTree;
use crate::world::World;

/// What came of learning.
#[derive(Default)]
pub struct Learned {
    /// The samples traced so far.
    pub prepass: Option<Prepass>,
    /// Which they are.
    pub selection: Option<Selection>,
    /// What it can be learned from again; `None` if nothing was to be learned.
    pub lesson: Option<Lesson>,
    /// Rays that were learned from.
    pub logged_rays: u64,
    /// Cost of a shadow ray in the tree before and after its order was applied.
    pub predicted: Option<[f64; 2]>,
    /// Time that went into `predicted`.
    pub predicting: Duration,
    /// Time from the first sample of the pre-pass to a full log, wall-clock.
    pub logging: Duration,
    /// The part of it without the pre-pass's own threads: following its rays once more.
    pub following: Duration,
    /// Time of building the binary tree anew, wall-clock.
    pub rebuilding: Duration,
    /// Time of the second collapse, of planning and applying the order, and of trying whether to prefetch.
    pub sorting: Duration,
}

/// The tree to begin with, for any rays, and how long it takes: what an earlier rendering has already done of it counts
/// as if it were done now.
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

/// The builder of that tree.
fn first_builder(options: &Options) -> Builder {
    if options.builder.needs_rays() && options.order.log_kind().is_some() {
        Builder::BinnedSah
    } else {
        options.builder
    }
}

/// A tree that knows nothing of the scene's own rays.
fn for_any_rays(world: &World, options: &Options, builder: Builder) -> AnyBvh {
    let tree = world.tree(builder);
    let log = || tree.surface_log(&world.primitives);
    let log = options.collapse.needs_log().then(log);
    wide(world, options, tree, log, &learning(options))
}

/// A binary tree made wide, by a log of it if the collapse needs one.
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

/// About how many shadow rays a sample has.
fn shadow_rays_per_sample(integrator: &Integrator) -> f64 {
    match integrator {
        Integrator::AmbientOcclusion { samples, .. } => f64::from(*samples),
        Integrator::Path { .. } | Integrator::DirectLighting { .. } => 4.0,
    }
}

/// From how many of its shadow rays a picture learns, if it need not learn from all: to learn from one takes the time of a
/// hundred, and is to take a twentieth of what all take. 8192 give the node tests that 16384 give to 0.1 % (San Miguel 1 %),
/// 4096 to 1.3 % (six scenes, `path`). The same for all parts of a picture.
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

/// Orders the tree, by a sample of shadow rays if the order learns; then a learned collapse is made anew, too.
/// The logs end here: they grow with the tree, and nothing asks for them again.
///
/// With a `lesson` there is no pre-pass: all is learned from its rays.
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
        // What is kept of every ray must be kept of few of them.
        let anew = options.collapse.needs_log() || options.builder.needs_rays();
        let rays = RaySample::new(rays_worth_learning(job));
        let mut evidence = if !anew && !kind.masks {
            Evidence::Log {
                log: Box::new(bvh.new_log(kind, job.seed)),
                rays,
            }
        } else {
            Evidence::Sample {
                rays,
                counted: options.counts(),
            }
        };
        if let Some(lesson) = lesson {
            evidence.add(bvh, lesson.rays());
            learned.following = start.elapsed();
        } else {
            let pixels = job.pixels_to_do();
            let rays = shadow_rays_per_sample(&job.world.integrator);
            let selection = Selection::new(options.log_share, rays, pixels, job.spp, job.seed);
            let (prepass, found) = prepass::run(job, bvh, &evidence, selection)?;
            evidence = found;
            learned.prepass = Some(prepass);
            learned.selection = selection;
        }
        learned.logging = start.elapsed();
        let (full, rays) = match evidence {
            Evidence::Log { log, rays } => (Some(*log), rays),
            Evidence::Sample { rays, .. } => (None, rays),
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
    /// Makes the tree anew as suits `rays`; without any, as suits any rays.
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

    /// Follows `rays` through the tree once more, for its order; `None` if there are not any.
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

    /// Following the rays of the pre-pass has taken the time since `start`.
    fn followed(&mut self, start: Instant) {
        let time = start.elapsed();
        self.following += time;
        self.logging += time;
    }

    /// Has batches prefetch or not, as asked for or as the rays learned from tell.
    fn choose_prefetch(&mut self, options: &Options, bvh: &mut AnyBvh) {
        if let Some(prefetch) = options.prefetch {
            bvh.set_prefetch(prefetch);
        } else if let Some(lesson) = &self.lesson {
            let start = Instant::now();
            bvh.time_prefetch(lesson.rays(), || start.elapsed());
            self.sorting += start.elapsed();
        }
    }

    /// Puts the tree into the order asked for.
    fn sort(
        &mut self,
        options: &Options,
        bvh: &mut AnyBvh,
        log: Option<&Log>,
    ) -> Result<(), Error> {
        if log.is_none() && options.order.log_kind().is_some() {
            // There were no rays to learn from, and the tree has the order of the synthetic ones already.
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
