//! Trees that learn from the rays of a job, where learning pays.

use std::fmt;
use std::time::Instant;

use antumbra::{Bvh, Ray};
use serde::Serialize;

use crate::Job;

/// Rays from which on learning is tried: it takes the time of tracing some millions.
const LEAST: u64 = 50_000_000;
/// Number of training rays.
const TRAINING: usize = 1 << 14;
/// Rays that both trees are measured with.
const HELD_OUT: usize = 1 << 16;
/// Rounds of measuring, interleaved.
const ROUNDS: usize = 5;

/// Outcome of learning. No answer depends on it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Learned {
    /// Whether the learned tree is used.
    pub used: bool,
    /// Speedup of the learned tree over the plain one, for held-out rays.
    pub speedup: f64,
    /// Seconds of learning and measuring.
    pub seconds: f64,
}

impl fmt::Display for Learned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let outcome = if self.used { "taken" } else { "left" };
        write!(
            f,
            "learned from {TRAINING} of its own rays in {:.2} s: {:.2} times as fast, {outcome}",
            self.seconds, self.speedup
        )
    }
}

/// A tree that learned from rays of the job, if it is faster than `bvh`. `None` if the job has too few rays to learn from,
/// or if there is no tree.
///
/// `learn` makes the tree from training rays, if it can. `clock` returns the seconds that the calling thread has run.
pub fn learn_when_it_pays<J: Job>(
    job: &J,
    bvh: &Bvh,
    learn: impl FnOnce(&[Ray]) -> Option<Bvh>,
    clock: impl Fn() -> f64,
) -> Option<(Option<Bvh>, Learned)> {
    let size = job.size();
    if size.rays.saturating_mul(size.items as u64) < LEAST {
        return None;
    }
    let start = Instant::now();
    let training = job.training_rays(bvh, TRAINING, 4);
    let held_out = job.training_rays(bvh, HELD_OUT, usize::MAX);
    if training.is_empty() || held_out.is_empty() {
        return None;
    }
    let learned = learn(&training)?;
    let mut bits = vec![0; held_out.len().div_ceil(64)];
    let mut time = |bvh: &Bvh| {
        let start = clock();
        let batch = bvh.batch(&held_out).on_this_thread();
        batch.occluded_bits_into(&mut bits);
        clock() - start
    };
    let mut speedups = [0.0; ROUNDS].map(|_: f64| time(bvh) / time(&learned).max(1e-9));
    speedups.sort_by(f64::total_cmp);
    let speedup = speedups[ROUNDS / 2];
    let used = speedup > 1.0;
    let outcome = Learned {
        used,
        speedup,
        seconds: start.elapsed().as_secs_f64(),
    };
    Some((used.then_some(learned), outcome))
}
