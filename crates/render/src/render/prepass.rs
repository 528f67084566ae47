//! The pre-pass: a small share of the samples, traced first so that an order can be learned from
//! their shadow rays.
//!
//! These samples are part of the picture. Their radiance is kept, tile by tile, and the tile that owns them
//! adds it in its place; nothing is traced twice.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use antumbra::AnyBvh;
use glam::Vec3;

use crate::Error;
use crate::film::tile::{Sample, Selection, WAVE, waves};
use crate::integrator::Integrator;
use crate::integrator::tracer::{Counts, Observe, Tracer};
use crate::render::Job;
use crate::render::Phase;
use crate::render::workers::Jobs;
use crate::training::sample::Evidence;

/// What the pre-pass leaves to the picture and its figures.
#[derive(Debug)]
pub struct Prepass {
    /// Radiance of the selected samples of every tile, in the order of [`waves`].
    pub radiance: Vec<Vec<Vec3>>,
    /// Rays and costs.
    pub counts: Counts,
    /// Time of all workers.
    pub busy: Duration,
}

/// A finished sample and the place of its tile.
type Found = (usize, Vec3);

/// Traces the selected samples of the tiles that are to be done and returns, beside what they found, the evidence of all workers together,
/// each of which begins with a copy of `empty`. Without a selection it stays empty.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn run(
    job: &Job,
    bvh: &AnyBvh,
    empty: &Evidence,
    selection: Option<Selection>,
) -> Result<(Prepass, Evidence), Error> {
    let tiles = job.todo.len();
    let mut sum = empty.clone();
    let mut prepass = Prepass {
        radiance: vec![Vec::new(); job.tiles.count()],
        counts: Counts::default(),
        busy: Duration::ZERO,
    };
    let Some(selection) = selection else {
        return Ok((prepass, sum));
    };
    let samples = job.tiles.window(0).area() as f64 * f64::from(job.spp);
    let group = ((WAVE as f64 / (samples * selection.share())) as usize).clamp(1, WAVE);
    // A wave may span tiles. Fewer, larger jobs make fuller waves; but every thread wants some.
    let group = group.min(tiles.div_ceil(4 * rayon::current_num_threads()).max(1));
    let radiance = Mutex::new(std::mem::take(&mut prepass.radiance));
    let jobs = Jobs::new(tiles.div_ceil(group), Phase::Log, job.monitor);
    let workers = jobs.run(|jobs| {
        let start = Instant::now();
        let mut tracer = Tracer::new(bvh, Observe::Learn(Box::new(empty.clone())));
        let mut integrator = Integrator::new(job.world);
        let mut batch = Batch::default();
        while let Some(index) = jobs.take() {
            let range = index * group..tiles.min((index + 1) * group);
            for &tile in &job.todo[range] {
                for wave in waves(job.tiles.window(tile), job.spp) {
                    batch.samples.extend(
                        wave.filter(|&sample| selection.takes(sample))
                            .map(|sample| (tile, sample)),
                    );
                    if batch.samples.len() >= WAVE {
                        batch.trace(job, &mut tracer, &mut integrator);
                        if jobs.is_cancelled() {
                            return (tracer.finish(), start.elapsed());
                        }
                    }
                }
            }
            batch.trace(job, &mut tracer, &mut integrator);
            let mut radiance = radiance.lock().unwrap_or_else(PoisonError::into_inner);
            for (tile, value) in batch.found.drain(..) {
                radiance[tile].push(value);
            }
            jobs.finish();
        }
        (tracer.finish(), start.elapsed())
    })?;
    for ((counts, evidence), busy) in workers {
        prepass.busy += busy;
        prepass.counts.add(&counts);
        if let Some(evidence) = evidence {
            sum.merge(evidence);
        }
    }
    prepass.radiance = radiance
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner);
    Ok((prepass, sum))
}

/// Samples to be traced together, and those of the job that are done.
#[derive(Default)]
struct Batch {
    samples: Vec<(usize, Sample)>,
    found: Vec<Found>,
    wave: crate::integrator::Wave,
}

impl Batch {
    fn trace(&mut self, job: &Job, tracer: &mut Tracer, integrator: &mut Integrator) {
        self.wave.clear();
        for &(_, sample) in &self.samples {
            job.push(sample, &mut self.wave);
        }
        integrator.trace(job.world, tracer, &mut self.wave, false);
        let tiles = self.samples.drain(..).enumerate();
        self.found
            .extend(tiles.map(|(index, (tile, _))| (tile, self.wave.radiance(index))));
    }
}
