//! A rendering from beginning to end: build, learn, order, trace, assemble.
//!
//! - `job.rs`: what all threads share: the scene, the tiles left to do, what earlier runs did
//! - `learn.rs`: the tree for shadow rays: its nodes and its child order
//! - `prepass.rs`: the first share of the samples, traced for their training rays
//! - `pass.rs`: all other samples
//! - `session.rs`: one rendering step by step, with the trees and the observer of the caller
//! - `paths.rs`: camera paths one at a time, with their rays
//! - `rounds.rs`: pictures that grow everywhere at once, for viewers
//! - `kept.rs`: a tree for many pictures of one world, for viewers
//! - `accumulator.rs`: the tile accumulator, where threads put finished tiles
//! - `workers.rs`: the loop that every thread runs
//! - `monitor.rs`: how a caller watches a rendering and stops it
//! - `layers.rs`: albedo, normals, positions and depth of the first surfaces
//! - `stats.rs`: figures of a rendering

mod accumulator;
mod job;
mod kept;
mod layers;
mod learn;
mod monitor;
mod pass;
mod paths;
mod prepass;
mod rounds;
mod session;
mod stats;
mod workers;

use std::time::Instant;

use antumbra_image::Image;

use crate::Error;
use crate::film::Shard;
use crate::integrator::SampleCost;
use crate::options::Options;
use crate::resume::Snapshot;
use crate::training::Lesson;
use crate::world::World;
use job::Job;
pub use kept::{KeptTree, Sight, training_rays};
pub use layers::Layers;
pub use learn::LearningFigures;
use learn::{Learned, first_tree, learn};
pub use monitor::{Monitor, Phase};
pub use paths::{PathRays, PathTracer, Paths};
pub use rounds::{Growth, Round, render_rounds};
pub use session::{ObservedPicture, Session};
pub use stats::{Split, Stats, image_hash};
use stats::{Times, Traced};

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// The picture: linear RGB, cropped as the scene's film says.
    pub image: Image,
    /// Standard error of every pixel, if requested. Infinite where there are fewer than two samples.
    pub standard_error: Option<Image>,
    /// Mean node plus primitive tests per shadow ray of every pixel of the picture's window, row by row, if
    /// requested. 0 where there was no shadow ray. Samples of the pre-pass do not count.
    pub cost_map: Option<Vec<f32>>,
    /// Figures: rays, tests, times.
    pub stats: Stats,
}

/// Part of a picture to render, and where to go on from.
#[derive(Clone, Debug, Default)]
pub struct Task {
    /// Part of the picture, by default the whole.
    pub shard: Shard,
    /// State of an earlier run of this part.
    pub resume: Option<Snapshot>,
    /// Training rays, instead of a pre-pass. `None` takes the training rays of `resume`.
    pub lesson: Option<Lesson>,
    /// Whether the state can be [extended](Snapshot::extend) later. Takes more memory with a filter wider than a pixel.
    ///
    /// A part always can. A rendering that is resumed can if it could before.
    pub extendable: bool,
}

/// Renders a picture of the world.
///
/// The picture depends, bit for bit, only on the scene and on `spp`, `texture_spp` and `seed` of the options.
///
/// # Errors
/// [`Error::Cancelled`], [`Error::NoSamples`], [`Error::LogShare`], [`Error::Threads`], or an error of the
/// kernel.
pub fn render(world: &World, options: &Options, monitor: &dyn Monitor) -> Result<Rendering, Error> {
    render_task(world, options, Task::default(), monitor).map(|(rendering, _)| rendering)
}

/// Renders a part of a picture, or the rest of it. Returns also the state that can be kept.
///
/// The tiles of a part have the bits that they have in the whole picture. Pixels outside of them are black.
/// An interruption changes no bit either.
///
/// # Errors
/// As [`render`], and [`Error::OtherSnapshot`].
pub fn render_task(
    world: &World,
    options: &Options,
    task: Task,
    monitor: &dyn Monitor,
) -> Result<(Rendering, Snapshot), Error> {
    let Some(threads) = options.threads else {
        return render_here(world, options, task, monitor);
    };
    let threads = threads.get();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|source| Error::Threads { threads, source })?;
    pool.install(|| render_here(world, options, task, monitor))
}

/// Renders in the current rayon pool.
fn render_here(
    world: &World,
    options: &Options,
    task: Task,
    monitor: &dyn Monitor,
) -> Result<(Rendering, Snapshot), Error> {
    let (job, done, lesson) = Job::begin(world, options, task, monitor)?;
    monitor.progress(Phase::Build, 0, 1);
    let mut start = Instant::now();
    let ready = first_tree(world, &options.recipe, monitor).and_then(|(mut bvh, time)| {
        monitor.progress(Phase::Build, 1, 1);
        start = Instant::now();
        let learned = learn(&job, options, &mut bvh, lesson.as_ref())?;
        Ok((bvh, time, learned))
    });
    let (bvh, build_time, learned) = match ready {
        // Whoever goes on later finds at least what this run has begun with.
        Err(Error::Cancelled) => {
            monitor.keep(job.snapshot(done, &Learned::of(lesson)));
            return Err(Error::Cancelled);
        }
        ready => ready?,
    };
    let sums = pass::run(&job, options, &bvh, &learned, done, None)?;
    let developing = Instant::now();
    let image = sums.film.image(world.film.resolution)?;
    if let Some(live) = monitor.tiles()
        && live.window() == image.window()
    {
        live.complete(&image, |tile| job.shard.holds(tile));
    }
    let times = Times {
        build: build_time + learned.figures.rebuilding,
        developing: developing.elapsed(),
        render: start
            .elapsed()
            .saturating_sub(learned.figures.predicting + learned.figures.rebuilding),
    };

    let effort = sums.effort;
    let snapshot = job.snapshot(sums, &learned);
    let traced = Traced {
        job: &job,
        learned: &learned,
        bvh: &bvh,
        image: &image,
        effort,
        times,
    };
    let stats = traced.stats(&snapshot, options.counts());
    let costs = snapshot.sums.costs.as_ref();
    let rendering = Rendering {
        standard_error: snapshot.standard_error()?,
        cost_map: costs.map(|costs| costs.iter().map(SampleCost::mean).collect()),
        image,
        stats,
    };
    Ok((rendering, snapshot))
}
