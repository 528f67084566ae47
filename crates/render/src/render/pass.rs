//! The pass over all samples that the pre-pass has not taken: every sample ends on the film.

use std::time::Instant;

use antumbra::AnyBvh;
use glam::Vec3;

use crate::Error;
use crate::film::tile::{Sample, waves, waves_after};
use crate::integrator::tracer::{Observe, Tracer};
use crate::integrator::{Integrator, Wave};
use crate::options::Options;
use crate::render::Job;
use crate::render::Phase;
use crate::render::accumulator::{Desk, Effort, Sums, TileWork};
use crate::render::learn::Learned;
use crate::render::workers::Jobs;
use crate::resume::Snapshot;

/// Traces the tiles that are to be done, on top of what is done already.
///
/// # Errors
/// [`Error::Cancelled`]; then the monitor was given what is done.
pub fn run(
    job: &Job,
    options: &Options,
    bvh: &AnyBvh,
    learned: &Learned,
    done: Sums,
) -> Result<Sums, Error> {
    let before = done.film.finished();
    let desk = Desk::new(done, rayon::current_num_threads());
    let jobs = Jobs::after(before, job.todo.len(), Phase::Render, job.monitor);
    let outcome = jobs.run(|jobs| {
        let observe = if options.counts() {
            Observe::Count
        } else {
            Observe::Nothing
        };
        let mut worker = Worker {
            job,
            learned,
            desk: &desk,
            costs: options.cost_map,
            thread: rayon::current_thread_index().unwrap_or(0),
            tracer: Tracer::new(bvh, observe),
            integrator: Integrator::new(job.world),
            samples: Vec::new(),
            wave: Wave::default(),
        };
        while let Some(turn) = jobs.take() {
            if worker.tile(job.todo[turn], jobs).is_none() {
                break;
            }
            jobs.finish();
        }
    });
    let sums = desk.clear();
    match outcome {
        Ok(_) => Ok(sums),
        Err(error) => {
            job.monitor.keep(Snapshot::new(job, sums, learned));
            Err(error)
        }
    }
}

/// One thread at work, with its buffers.
struct Worker<'a> {
    job: &'a Job<'a>,
    learned: &'a Learned,
    desk: &'a Desk,
    /// Whether costs of pixels are wanted.
    costs: bool,
    /// Whose slot of the desk it is.
    thread: usize,
    tracer: Tracer<'a>,
    integrator: Integrator,
    samples: Vec<Sample>,
    wave: Wave,
}

impl Worker<'_> {
    fn is_logged(&self, sample: Sample) -> bool {
        let selection = self.learned.selection;
        selection.is_some_and(|selection| selection.takes(sample))
    }

    /// Finishes a tile; `None` when cancelled.
    fn tile(&mut self, index: usize, jobs: &Jobs) -> Option<()> {
        let job = self.job;
        let window = job.tiles.window(index);
        let anew = || TileWork::new(job.rules, window, self.costs);
        let done = self.desk.begin(self.thread, index, anew);
        let logged: &[Vec3] = match &self.learned.prepass {
            Some(prepass) => &prepass.radiance[index],
            None => &[],
        };
        // Those of an earlier run's samples are on the film already.
        let old = if logged.is_empty() { 0 } else { done };
        let old = waves(window, old).flatten();
        let old = old.filter(|&sample| self.is_logged(sample)).count();
        let mut logged = logged.iter().skip(old);
        for wave in waves_after(window, job.spp, done) {
            if jobs.is_cancelled() {
                return None;
            }
            if job.monitor.wants_snapshot() {
                let snapshot = Snapshot::new(job, self.desk.copy(), self.learned);
                job.monitor.keep(snapshot);
            }
            let start = Instant::now();
            self.samples.clear();
            self.samples.extend(wave);
            self.wave.clear();
            for &sample in &self.samples {
                if !self.is_logged(sample) {
                    job.push(sample, &mut self.wave);
                }
            }
            self.integrator
                .trace(job.world, &mut self.tracer, &mut self.wave, self.costs);
            let counts = self.tracer.take_counts();
            let filmed = Instant::now();
            self.desk.add(self.thread, |tile| {
                let mut traced = 0;
                for &sample in &self.samples {
                    let (inside, radiance) = if self.is_logged(sample) {
                        let radiance = logged.next().copied().unwrap_or(Vec3::NAN);
                        (job.inside(sample), radiance)
                    } else {
                        if let Some(costs) = &mut tile.costs {
                            let [x, y] = sample.pixel;
                            let (row, column) = (y - window.y0, x - window.x0);
                            costs[row as usize * window.width() + column as usize]
                                .add(&self.wave.costs[traced]);
                        }
                        traced += 1;
                        (self.wave.inside[traced - 1], self.wave.radiance(traced - 1))
                    };
                    tile.film.add(sample.pixel, inside, radiance);
                    tile.done = tile.done.max(sample.index + 1);
                }
                tile.effort.add(&Effort {
                    counts,
                    busy: start.elapsed(),
                    filming: filmed.elapsed(),
                });
            });
        }
        self.desk.finish(self.thread, window);
        Some(())
    }
}
