//! The main pass: all samples that the pre-pass has not taken. Every sample ends on the film.

use std::slice;
use std::time::Instant;

use antumbra::Bvh;
use antumbra_image::Window;
use glam::Vec3;

use super::accumulator::TileAccumulator;
use super::job::Job;
use super::learn::Learned;
use super::monitor::Phase;
use super::workers::Jobs;
use crate::Error;
use crate::film::{Sample, batches, batches_after};
use crate::integrator::{Batch, Integrator, Observe, Observer, PathBatch, Tracer};
use crate::live::{LiveTile, LiveTiles};
use crate::options::Options;
use crate::resume::{Effort, Sums, TileWork};

/// Traces the unfinished tiles, on top of what is `done`. An observer answers the queries, if there is one.
///
/// # Errors
/// [`Error::Cancelled`], after the monitor was given a snapshot.
pub fn run(
    job: &Job,
    options: &Options,
    bvh: &Bvh,
    learned: &Learned,
    done: Sums,
    observer: Option<&dyn Observer>,
) -> Result<Sums, Error> {
    let before = done.film.finished();
    let live = job.monitor.tiles();
    let live = live.filter(|live| live.window() == job.rules.window);
    if let Some(live) = live
        && (before > 0 || !done.begun.is_empty())
    {
        publish_earlier(live, job, &done)?;
    }
    let moving = job.moving(bvh, observer.is_some())?;
    let accumulator = TileAccumulator::new(done, rayon::current_num_threads());
    let jobs = Jobs::after(before, job.todo.len(), Phase::Render, job.monitor);
    let outcome = jobs.run(|jobs| {
        let stop = || jobs.is_cancelled();
        let mut queries = observer.map(|observer| observer.thread(&stop));
        let observe = match &mut queries {
            Some(queries) => Observe::Each(&mut **queries),
            None if options.counts() => Observe::Count,
            None => Observe::Nothing,
        };
        let mut worker = Worker {
            job,
            learned,
            accumulator: &accumulator,
            live,
            costs: options.cost_map,
            thread: rayon::current_thread_index().unwrap_or(0),
            tracer: (Tracer::new(bvh, observe).until(&stop)).moving(job.world, moving.as_ref()),
            integrator: Integrator::new(job.world),
            samples: Vec::new(),
            pixels: Vec::new(),
            batch: Batch::default(),
        };
        while let Some(turn) = jobs.take() {
            if worker.tile(job.todo[turn], jobs).is_none() {
                break;
            }
            jobs.finish();
        }
        drop(worker);
        if let Some(queries) = queries {
            queries.end();
        }
    });
    let sums = accumulator.into_sums();
    match outcome {
        Ok(_) => Ok(sums),
        Err(error) => {
            job.monitor.keep(job.snapshot(sums, learned));
            Err(error)
        }
    }
}

/// A thread with its buffers.
struct Worker<'a> {
    job: &'a Job<'a>,
    learned: &'a Learned,
    accumulator: &'a TileAccumulator,
    /// Where tiles are published, if anybody looks.
    live: Option<&'a LiveTiles>,
    /// Whether a cost map is wanted.
    costs: bool,
    /// Slot of the thread in the accumulator.
    thread: usize,
    tracer: Tracer<'a>,
    integrator: Integrator,
    samples: Vec<Sample>,
    /// Pixels of the paths, for an observer.
    pixels: Vec<[i32; 2]>,
    batch: Batch,
}

impl<'a> Worker<'a> {
    fn is_logged(&self, sample: Sample) -> bool {
        let selection = self.learned.selection;
        selection.is_some_and(|selection| selection.takes(sample))
    }

    /// Traces the samples of a tile that are left. `None` when cancelled.
    fn tile(&mut self, index: usize, jobs: &Jobs) -> Option<()> {
        let job = self.job;
        let window = job.tiles.window(index);
        let anew = || TileWork::new(job.rules, window, self.costs);
        let done = self.accumulator.begin(self.thread, index, anew);
        let mut logged = self.radiance_left(index, window, done);
        for samples in batches_after(window, job.spp, done) {
            if jobs.is_cancelled() {
                return None;
            }
            if job.monitor.wants_snapshot() {
                let snapshot = job.snapshot(self.accumulator.copy(), self.learned);
                job.monitor.keep(snapshot);
            }
            self.samples.clear();
            self.samples.extend(samples);
            self.batch(index, window, &mut logged)?;
        }
        self.accumulator.finish(self.thread, window);
        Some(())
    }

    /// Radiance of the tile's samples in the pre-pass, except samples of an earlier run, which the film has already:
    /// they lie among the first `done` samples of every pixel.
    fn radiance_left(&self, index: usize, window: Window, done: u32) -> slice::Iter<'a, Vec3> {
        let radiance: &[Vec3] = match &self.learned.prepass {
            Some(prepass) => &prepass.radiance[index],
            None => &[],
        };
        let done = if radiance.is_empty() { 0 } else { done };
        let earlier = batches(window, done).flatten();
        let earlier = earlier.filter(|&sample| self.is_logged(sample)).count();
        radiance[earlier.min(radiance.len())..].iter()
    }

    /// Says to an observer which paths the current samples are.
    fn announce(&mut self, tile: usize) {
        let Some(queries) = self.tracer.queries() else {
            return;
        };
        let selection = self.learned.selection;
        let is_traced = |sample: Sample| selection.is_none_or(|taken| !taken.takes(sample));
        let traced = self.samples.iter().filter(|sample| is_traced(**sample));
        self.pixels.clear();
        self.pixels.extend(traced.map(|sample| sample.pixel));
        queries.begin(&PathBatch {
            tile,
            first: self.samples.first().map_or(0, |sample| sample.index),
            pixels: &self.pixels,
        });
    }

    /// Traces the current samples and adds them to the tile. `logged` has the radiance of samples of the pre-pass.
    /// `None` when cancelled: no sample was added.
    fn batch(
        &mut self,
        index: usize,
        window: Window,
        logged: &mut slice::Iter<'_, Vec3>,
    ) -> Option<()> {
        let job = self.job;
        let start = Instant::now();
        self.batch.clear();
        for &sample in &self.samples {
            if !self.is_logged(sample) {
                job.push(sample, &mut self.batch);
            }
        }
        self.announce(index);
        self.integrator
            .trace(job.world, &mut self.tracer, &mut self.batch, self.costs);
        if self.tracer.is_stopped() {
            return None;
        }
        if let Some(queries) = self.tracer.queries() {
            queries.traced();
        }
        let counts = self.tracer.take_counts();
        let filmed = Instant::now();
        let mut shown = None;
        self.accumulator.add(self.thread, |tile| {
            let mut traced = 0;
            for &sample in &self.samples {
                if self.is_logged(sample) {
                    let radiance = logged.next().copied().unwrap_or(Vec3::NAN);
                    tile.film.add(sample.pixel, job.inside(sample), radiance);
                } else {
                    tile.add(window, sample.pixel, &self.batch, traced);
                    traced += 1;
                }
                tile.done = tile.done.max(sample.index + 1);
            }
            tile.effort.add(&Effort {
                counts,
                busy: start.elapsed(),
                filming: filmed.elapsed(),
            });
            if let Some(live) = self.live {
                shown = live_tile(live, index, window, tile).map(|tile| (live, tile));
            }
        });
        if let Some(queries) = self.tracer.queries() {
            queries.filmed();
        }
        let rays = counts.closest_rays + counts.shadow_rays;
        job.monitor.traced(self.samples.len() as u64, rays);
        if let Some((live, tile)) = shown {
            live.publish(index, tile);
        }
        Some(())
    }
}

/// Publishes what an earlier run has done.
fn publish_earlier(live: &LiveTiles, job: &Job, done: &Sums) -> Result<(), Error> {
    let image = done.film.image(job.world.film.resolution)?;
    live.complete(&image, |index| done.film.has(index));
    for (&index, tile) in &done.begun {
        if let Some(tile) = live_tile(live, index, job.tiles.window(index), tile) {
            live.publish(index, tile);
        }
    }
    Ok(())
}

/// A tile as it can be shown now. `None` if it lies outside of the picture.
pub fn live_tile(
    live: &LiveTiles,
    index: usize,
    whole: Window,
    work: &TileWork,
) -> Option<LiveTile> {
    let window = live.part(index);
    if window.is_empty() {
        return None;
    }
    let tests = work.costs.as_ref().map(|costs| {
        let rows = window.y0..window.y1;
        let places = rows.flat_map(|y| (window.x0..window.x1).map(move |x| (x, y)));
        let place = |(x, y)| (y - whole.y0) as usize * whole.width() + (x - whole.x0) as usize;
        places.map(|at| costs[place(at)].mean()).collect()
    });
    Some(LiveTile {
        window,
        pixels: work.film.pixels(window),
        tests,
    })
}
