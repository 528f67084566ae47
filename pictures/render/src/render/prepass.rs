//! The pre-pass: a small share of the samples, traced first for their shadow rays, the training rays.
//!
//! All samples of the pre-pass are part of the picture. Their radiance is kept, tile by tile, until the main pass
//! adds it to the film. No sample is traced twice.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use antumbra::Bvh;
use glam::Vec3;

use super::job::Job;
use super::monitor::Phase;
use super::workers::Jobs;
use crate::Error;
use crate::film::{BATCH, Sample, batches};
use crate::integrator::{Batch, Counts, Integrator, Observe, Observer, Tracer};
use crate::training::{Selection, TrainingSample};

/// Results of the pre-pass for the picture and its figures.
#[derive(Debug)]
pub struct Prepass {
    /// Radiance of the selected samples of every tile, in the order of [`batches`].
    pub radiance: Vec<Vec<Vec3>>,
    /// Numbers of rays and tests.
    pub counts: Counts,
    /// Time of all threads.
    pub busy: Duration,
}

/// Tile and radiance of a finished sample.
type Found = (usize, Vec3);

/// Traces the selected samples of the unfinished tiles. Returns also the training sample of all threads.
///
/// Every thread begins with a copy of `empty`. Without a selection the training sample stays empty. With an observer,
/// who answers the queries, the training sample stays empty, too.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn run(
    job: &Job,
    bvh: &Bvh,
    empty: &TrainingSample,
    selection: Option<Selection>,
    observer: Option<&dyn Observer>,
) -> Result<(Prepass, TrainingSample), Error> {
    let tiles = job.todo.len();
    let mut sum = empty.clone();
    let radiance = Mutex::new(vec![Vec::new(); job.tiles.count()]);
    let (mut counts, mut busy) = (Counts::default(), Duration::ZERO);
    let prepass = |radiance: Mutex<_>, counts, busy| Prepass {
        radiance: (radiance.into_inner()).unwrap_or_else(PoisonError::into_inner),
        counts,
        busy,
    };
    let Some(selection) = selection else {
        return Ok((prepass(radiance, counts, busy), sum));
    };
    let group = group_size(job, selection);
    let moving = job.moving(bvh, observer.is_some())?;
    let jobs = Jobs::new(tiles.div_ceil(group), Phase::Log, job.monitor);
    let workers = jobs.run(|jobs| {
        let start = Instant::now();
        let stop = || jobs.is_cancelled();
        let mut queries = observer.map(|observer| observer.thread(&stop));
        let observe = match &mut queries {
            Some(queries) => Observe::Each(&mut **queries),
            None => Observe::Learn(Box::new(empty.clone())),
        };
        let mut tracer = Tracer::new(bvh, observe).until(&stop);
        tracer = tracer.moving(job.world, moving.as_ref());
        let mut integrator = Integrator::new(job.world);
        let mut pending = Pending::default();
        while let Some(index) = jobs.take() {
            let range = index * group..tiles.min((index + 1) * group);
            for &tile in &job.todo[range] {
                for batch in batches(job.tiles.window(tile), job.spp) {
                    let taken = batch.filter(|&sample| selection.takes(sample));
                    pending.samples.extend(taken.map(|sample| (tile, sample)));
                    if pending.samples.len() >= BATCH {
                        pending.trace(job, &mut tracer, &mut integrator);
                        if jobs.is_cancelled() {
                            return (tracer.finish(), start.elapsed());
                        }
                    }
                }
            }
            pending.trace(job, &mut tracer, &mut integrator);
            // Its last samples may be incomplete.
            if jobs.is_cancelled() {
                break;
            }
            let mut radiance = radiance.lock().unwrap_or_else(PoisonError::into_inner);
            for (tile, value) in pending.found.drain(..) {
                radiance[tile].push(value);
            }
            jobs.finish();
        }
        let found = tracer.finish();
        if let Some(queries) = queries {
            queries.end();
        }
        (found, start.elapsed())
    })?;
    for ((of_thread, sample), time) in workers {
        busy += time;
        counts.add(&of_thread);
        if let Some(sample) = sample {
            sum.merge(sample);
        }
    }
    Ok((prepass(radiance, counts, busy), sum))
}

/// Number of tiles of one job of a thread.
fn group_size(job: &Job, selection: Selection) -> usize {
    let samples = job.tiles.window(0).area() as f64 * f64::from(job.spp);
    let group = ((BATCH as f64 / (samples * selection.share())) as usize).clamp(1, BATCH);
    // Large jobs make full batches, which may span tiles. Every thread needs some jobs, though.
    group.min((job.todo.len().div_ceil(4 * rayon::current_num_threads())).max(1))
}

/// Samples to be traced together, and finished samples of the job.
#[derive(Default)]
struct Pending {
    samples: Vec<(usize, Sample)>,
    found: Vec<Found>,
    batch: Batch,
}

impl Pending {
    fn trace(&mut self, job: &Job, tracer: &mut Tracer, integrator: &mut Integrator) {
        self.batch.clear();
        for &(_, sample) in &self.samples {
            job.push(sample, &mut self.batch);
        }
        integrator.trace(job.world, tracer, &mut self.batch, false);
        let tiles = self.samples.drain(..).enumerate();
        self.found
            .extend(tiles.map(|(index, (tile, _))| (tile, self.batch.radiance(index))));
    }
}
