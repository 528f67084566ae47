//! A rendering from beginning to end: build, learn, order, trace, assemble.

pub mod accumulator;
pub mod learn;
mod monitor;
mod pass;
mod prepass;
mod stats;
mod workers;

use std::time::Instant;

use antumbra_image::Image;

use crate::Error;
use crate::film::Shard;
use crate::film::tile::{Sample, Tiles};
use crate::film::{Film, Rules};
use crate::integrator::{SampleCost, Wave, dimension};
use crate::options::Options;
use crate::resume::{Earlier, Snapshot};
use crate::sampler::{Method, Sampler};
use crate::training::lesson::Lesson;
use crate::world::World;
use accumulator::Sums;
use learn::{first_tree, learn};
pub use monitor::{Monitor, Phase};
use stats::mean_tests;
pub use stats::{Split, Stats, image_hash};

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// The picture: linear RGB, cropped as the scene's film says.
    pub image: Image,
    /// Standard error of every pixel, if it was asked for; infinite where there are fewer than two samples.
    pub standard_error: Option<Image>,
    /// Mean node plus primitive tests per shadow ray of every pixel of the picture's window, row by row, if
    /// asked for; 0 where there was no shadow ray. Samples that were learned from do not count.
    pub cost_map: Option<Vec<f32>>,
    /// What was done.
    pub stats: Stats,
}

/// What all workers of a rendering share.
pub struct Job<'a> {
    /// The scene.
    pub world: &'a World,
    /// Who watches.
    pub monitor: &'a dyn Monitor,
    /// Tiles of the sampled pixels.
    pub tiles: Tiles,
    /// Samples per pixel.
    pub spp: u32,
    /// Seed of all random values.
    pub seed: u64,
    /// How samples enter pixels.
    pub rules: Rules,
    /// The part of the picture that is made.
    pub shard: Shard,
    /// Its tiles that are not finished yet: those that were begun come first.
    pub todo: Vec<usize>,
    /// When it began.
    pub started: Instant,
    /// What earlier runs did.
    pub earlier: Earlier,
    sampler: Sampler,
}

/// What is to be made of a picture, and on top of what.
#[derive(Clone, Debug, Default)]
pub struct Task {
    /// Which part of it.
    pub shard: Shard,
    /// What is done of this part already.
    pub resume: Option<Snapshot>,
    /// What to learn from, instead of a pre-pass. That of `resume` if absent.
    pub lesson: Option<Lesson>,
}

impl Job<'_> {
    /// Adds the camera ray of a sample to a wave.
    pub fn push(&self, sample: Sample, wave: &mut Wave) {
        let [x, y] = sample.pixel;
        let stream = self.sampler.stream(x, y, sample.index);
        let [dx, dy] = stream.pair(dimension::FILM);
        let film = [x as f32 + dx, y as f32 + dy];
        let lens = stream.pair(dimension::LENS);
        wave.rays.push(self.world.camera.ray(film, lens));
        wave.streams.push(stream);
        wave.inside.push([dx, dy]);
        // As far apart as so many samples are in a pixel, as in pbrt-v3.
        wave.step = 1.0 / (self.spp as f32).sqrt();
    }

    /// Number of pixels of the tiles that are to be done.
    pub fn pixels_to_do(&self) -> usize {
        let areas = self.todo.iter().map(|&tile| self.tiles.window(tile).area());
        areas.sum()
    }

    /// Works out what is to be done; returns what is done already and what is to be learned from.
    fn begin(&mut self, task: Task, options: &Options) -> Result<(Sums, Option<Lesson>), Error> {
        let (sums, learned) = match task.resume {
            Some(snapshot) if snapshot.suits(self, options.cost_map) => {
                self.earlier = snapshot.earlier;
                snapshot.into_parts()
            }
            Some(_) => return Err(Error::OtherSnapshot),
            None => {
                let film = if self.shard.is_whole() {
                    Film::new(self.rules)
                } else {
                    Film::apart(self.rules)
                };
                (Sums::new(film, options.cost_map), None)
            }
        };
        let mine = (0..self.tiles.count()).filter(|&tile| self.shard.holds(tile));
        let left = mine.filter(|&tile| !sums.film.has(tile));
        let (begun, fresh): (Vec<_>, Vec<_>) = left.partition(|tile| sums.begun.contains_key(tile));
        self.todo = begun;
        self.todo.extend(fresh);
        Ok((sums, task.lesson.or(learned)))
    }

    /// Where a sample lies inside its pixel.
    pub fn inside(&self, sample: Sample) -> [f32; 2] {
        let [x, y] = sample.pixel;
        self.sampler
            .stream(x, y, sample.index)
            .pair(dimension::FILM)
    }
}

/// Renders a picture of the world.
///
/// The picture depends on the scene, on `options.spp` and on `options.seed`; on nothing else, bit for bit.
///
/// # Errors
/// [`Error::Cancelled`], [`Error::NoSamples`], [`Error::LogShare`], [`Error::Threads`], or an error of the
/// kernel.
pub fn render(world: &World, options: &Options, monitor: &dyn Monitor) -> Result<Rendering, Error> {
    render_task(world, options, Task::default(), monitor).map(|(rendering, _)| rendering)
}

/// Renders a part of a picture, or the rest of it, and returns also what can be kept of it.
///
/// The tiles of a part have the bits that they have in the whole picture; pixels outside of them are black.
/// Whether a rendering was interrupted and gone on with changes no bit either.
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
    let started = Instant::now();
    let spp = options.spp.unwrap_or(world.sampler.pixel_samples);
    if spp == 0 {
        return Err(Error::NoSamples {
            what: "samples per pixel",
        });
    }
    if !(0.0..=1.0).contains(&options.log_share) {
        return Err(Error::LogShare {
            share: options.log_share,
        });
    }
    let rules = Rules::new(&world.film, options.standard_error);
    let method = Method::of(world.sampler.kind, spp);
    let mut job = Job {
        world,
        monitor,
        tiles: Tiles::new(rules.sampled()),
        spp,
        seed: options.seed,
        rules,
        shard: task.shard,
        todo: Vec::new(),
        started,
        earlier: Earlier::default(),
        sampler: Sampler::new(method, options.seed),
    };
    let (done, lesson) = job.begin(task, options)?;
    monitor.progress(Phase::Build, 0, 1);
    let (mut bvh, build_time) = first_tree(world, options);
    monitor.progress(Phase::Build, 1, 1);

    let start = Instant::now();
    let learned = learn(&job, options, &mut bvh, lesson.as_ref())?;
    let build_seconds = (build_time + learned.rebuilding).as_secs_f64();
    let sums = pass::run(&job, options, &bvh, &learned, done)?;
    let developed = Instant::now();
    let image = sums.film.image(world.film.resolution)?;
    let developing = developed.elapsed();
    let render_seconds = start
        .elapsed()
        .saturating_sub(learned.predicting + learned.rebuilding)
        .as_secs_f64();

    let main = sums.effort;
    let snapshot = Snapshot::new(&job, sums, &learned);
    let prepass = snapshot.earlier.prepass;
    let mut total = main.counts;
    total.add(&prepass);
    let mut logging = learned.following;
    if let Some(logged) = &learned.prepass {
        logging += logged.busy;
    }
    let sort_seconds = learned.sorting.as_secs_f64();
    let queries = main.counts.shadow + main.counts.closest;
    let split = Split {
        build: build_seconds,
        log: logging.as_secs_f64(),
        sort: sort_seconds,
        shadow: main.counts.shadow.as_secs_f64(),
        closest: main.counts.closest.as_secs_f64(),
        shading: (main.busy.saturating_sub(main.filming + queries)).as_secs_f64(),
        film: (main.filming + developing).as_secs_f64(),
    };
    let counted = options.counts();
    let after = if counted {
        mean_tests(&main.counts)
    } else {
        [None; 3]
    };
    let before = match &learned.prepass {
        Some(_) => mean_tests(&prepass),
        None => after,
    };
    let stats = Stats {
        triangles: world.triangle_count(),
        spp,
        threads: rayon::current_num_threads(),
        sampler: method.name(),
        closest_rays: total.closest_rays,
        shadow_rays: total.shadow_rays,
        occluded_rays: total.occluded_rays,
        logged_rays: learned.logged_rays,
        node_tests_before: before[0],
        prim_tests_before: before[1],
        node_tests_after: after[0],
        prim_tests_after: after[1],
        top_node_tests: [before[2], after[2]],
        predicted_cost_before: learned.predicted.map(|[before, _]| before),
        predicted_cost_after: learned.predicted.map(|[_, after]| after),
        build_seconds,
        log_seconds: learned.logging.as_secs_f64(),
        sort_seconds,
        render_seconds,
        split,
        dropped_samples: snapshot.dropped_samples(),
        dropped_at: snapshot.dropped_at(),
        image_hash: image_hash(&image),
        build: bvh.build_report(),
        prefetch: bvh.prefetches(),
    };
    let costs = snapshot.sums.costs.as_ref();
    let rendering = Rendering {
        standard_error: snapshot.standard_error()?,
        cost_map: costs.map(|costs| costs.iter().map(SampleCost::mean).collect()),
        image,
        stats,
    };
    Ok((rendering, snapshot))
}
