//! A rendering from beginning to end: build, learn, order, trace, assemble.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use antumbra::AnyBvh;
use antumbra_image::{Image, Window};
use glam::Vec3;

use crate::Error;
use crate::film::{Film, Rules, TileFilm};
use crate::integrator::{Integrator, SampleCost, Wave, dimension};
use crate::learn::{Learned, first_tree, learn};
use crate::monitor::{Monitor, Phase};
use crate::options::Options;
use crate::sampler::{Method, Sampler};
use crate::stats::{Split, Stats, image_hash, mean_tests};
use crate::tile::{Sample, Tiles, waves};
use crate::tracer::{Counts, Observe, Tracer};
use crate::workers::Jobs;
use crate::world::World;

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
    sampler: Sampler,
    rules: Rules,
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

    /// The pixels that are sampled.
    pub fn sampled(&self) -> Window {
        self.rules.sampled()
    }

    /// Where a sample lies inside its pixel.
    fn inside(&self, sample: Sample) -> [f32; 2] {
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
    let Some(threads) = options.threads else {
        return render_here(world, options, monitor);
    };
    let threads = threads.get();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|source| Error::Threads { threads, source })?;
    pool.install(|| render_here(world, options, monitor))
}

/// Renders in the current rayon pool.
fn render_here(
    world: &World,
    options: &Options,
    monitor: &dyn Monitor,
) -> Result<Rendering, Error> {
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
    let job = Job {
        world,
        monitor,
        tiles: Tiles::new(rules.sampled()),
        spp,
        seed: options.seed,
        sampler: Sampler::new(method, options.seed),
        rules,
    };
    let start = Instant::now();
    monitor.progress(Phase::Build, 0, 1);
    let waited = world.surface_log_seconds();
    let mut bvh = first_tree(world, options);
    monitor.progress(Phase::Build, 1, 1);
    // What an earlier rendering has already done of it counts as if it were done now.
    let build_seconds = world.tree_seconds() + waited + start.elapsed().as_secs_f64();

    let start = Instant::now();
    let learned = learn(&job, options, &mut bvh)?;
    let main = trace(&job, options, &bvh, &learned)?;
    let developed = Instant::now();
    let image = main.film.image(world.film.resolution)?;
    let developing = developed.elapsed();
    let render_seconds = start
        .elapsed()
        .saturating_sub(learned.predicting)
        .as_secs_f64();

    let mut total = main.counts;
    let mut logging = learned.following;
    if let Some(logged) = &learned.prepass {
        total.add(&logged.counts);
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
        Some(logged) => mean_tests(&logged.counts),
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
        dropped_samples: main.film.dropped(),
        image_hash: image_hash(&image),
        build: bvh.build_report(),
    };
    Ok(Rendering {
        standard_error: main.film.standard_error(world.film.resolution)?,
        cost_map: main
            .costs
            .map(|costs| costs.iter().map(SampleCost::mean).collect()),
        image,
        stats,
    })
}

/// The traced picture.
struct Traced {
    film: Film,
    /// Per pixel of the window, if a map was asked for.
    costs: Option<Vec<SampleCost>>,
    counts: Counts,
    /// Time of all workers, and the part of it that went into the film.
    busy: Duration,
    filming: Duration,
}

/// Traces all samples that the pre-pass has not, and puts every sample on the film.
fn trace(job: &Job, options: &Options, bvh: &AnyBvh, learned: &Learned) -> Result<Traced, Error> {
    let film = Mutex::new(Film::new(job.rules));
    let costs = options
        .cost_map
        .then(|| Mutex::new(vec![SampleCost::default(); job.rules.window.area()]));
    let jobs = Jobs::new(job.tiles.count(), Phase::Render, job.monitor);
    let workers = jobs.run(|jobs| {
        let start = Instant::now();
        let observe = if options.counts() {
            Observe::Count
        } else {
            Observe::Nothing
        };
        let mut worker = Worker {
            job,
            learned,
            tracer: Tracer::new(bvh, observe),
            integrator: Integrator::new(job.world),
            samples: Vec::new(),
            wave: Wave::default(),
            costs: costs.is_some().then(Vec::new),
            filming: Duration::ZERO,
        };
        while let Some(index) = jobs.take() {
            let Some(tile) = worker.tile(index, jobs) else {
                break;
            };
            let filmed = Instant::now();
            film.lock()
                .unwrap_or_else(PoisonError::into_inner)
                .finish(index, tile);
            worker.filming += filmed.elapsed();
            if let (Some(map), Some(costs)) = (&costs, &worker.costs) {
                let mut map = map.lock().unwrap_or_else(PoisonError::into_inner);
                place(&mut map, job.rules.window, costs, job.tiles.window(index));
            }
            jobs.finish();
        }
        (worker.tracer.finish().0, worker.filming, start.elapsed())
    })?;
    let mut traced = Traced {
        film: film.into_inner().unwrap_or_else(PoisonError::into_inner),
        costs: costs.map(|map| map.into_inner().unwrap_or_else(PoisonError::into_inner)),
        counts: Counts::default(),
        busy: Duration::ZERO,
        filming: Duration::ZERO,
    };
    for (counts, filming, busy) in workers {
        traced.counts.add(&counts);
        traced.busy += busy;
        traced.filming += filming;
    }
    Ok(traced)
}

/// Copies the costs of a tile's pixels to the map of the window.
fn place(map: &mut [SampleCost], window: Window, costs: &[SampleCost], tile: Window) {
    let pixels = (tile.y0..tile.y1).flat_map(|y| (tile.x0..tile.x1).map(move |x| (x, y)));
    for ((x, y), &cost) in pixels.zip(costs) {
        if window.contains(x, y) {
            let (row, column) = (y - window.y0, x - window.x0);
            map[row as usize * window.width() + column as usize] = cost;
        }
    }
}

/// One thread at work, with its buffers.
struct Worker<'a> {
    job: &'a Job<'a>,
    learned: &'a Learned,
    tracer: Tracer<'a>,
    integrator: Integrator,
    samples: Vec<Sample>,
    wave: Wave,
    /// Sums of the tile's pixels, if wanted.
    costs: Option<Vec<SampleCost>>,
    /// Time that went into the film.
    filming: Duration,
}

impl Worker<'_> {
    fn is_logged(&self, sample: Sample) -> bool {
        let selection = self.learned.selection;
        selection.is_some_and(|selection| selection.takes(sample))
    }

    /// The film of a tile, or `None` when cancelled.
    fn tile(&mut self, index: usize, jobs: &Jobs) -> Option<TileFilm> {
        let window = self.job.tiles.window(index);
        let mut film = TileFilm::new(self.job.rules, window);
        if let Some(costs) = &mut self.costs {
            costs.clear();
            costs.resize(window.area(), SampleCost::default());
        }
        let logged: &[Vec3] = match &self.learned.prepass {
            Some(prepass) => &prepass.radiance[index],
            None => &[],
        };
        let mut logged = logged.iter();
        for wave in waves(window, self.job.spp) {
            if jobs.is_cancelled() {
                return None;
            }
            self.samples.clear();
            self.samples.extend(wave);
            self.wave.clear();
            for &sample in &self.samples {
                if !self.is_logged(sample) {
                    self.job.push(sample, &mut self.wave);
                }
            }
            let costs = self.costs.is_some();
            self.integrator
                .trace(self.job.world, &mut self.tracer, &mut self.wave, costs);
            let filmed = Instant::now();
            let mut traced = 0;
            for &sample in &self.samples {
                let (inside, radiance) = if self.is_logged(sample) {
                    let radiance = logged.next().copied().unwrap_or(Vec3::NAN);
                    (self.job.inside(sample), radiance)
                } else {
                    if let Some(costs) = &mut self.costs {
                        let [x, y] = sample.pixel;
                        let (row, column) = (y - window.y0, x - window.x0);
                        costs[row as usize * window.width() + column as usize]
                            .add(&self.wave.costs[traced]);
                    }
                    traced += 1;
                    (self.wave.inside[traced - 1], self.wave.radiance(traced - 1))
                };
                film.add(sample.pixel, inside, radiance);
            }
            self.filming += filmed.elapsed();
        }
        Some(film)
    }
}
