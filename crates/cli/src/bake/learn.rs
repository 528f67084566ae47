//! Trees that learn from a bake's own rays, where that pays.

use std::fmt;
use std::time::Instant;

use antumbra::{Bvh, Isa, Ray, Recipe, Width};
use antumbra_lab::thread_seconds;
use serde::Serialize;

use super::mesh::Ground;

/// Rays from which on learning is tried: it takes the time of tracing some millions.
const LEAST: u64 = 50_000_000;
/// Training rays.
const TRAINING: usize = 1 << 14;
/// Rays that both trees are measured with.
const HELD_OUT: usize = 1 << 16;
/// Rounds of measuring, in turns.
const ROUNDS: usize = 5;

/// What came of learning. No answer depends on it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Learned {
    /// Whether the learned tree was taken.
    pub used: bool,
    /// Rate of the learned tree over that of the plain one, for held-out rays.
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

/// A tree that learned from some of the rays, if there are many. Given back is the faster one of both.
///
/// `rays(n, k)` makes `n` of the rays, `k` from each point.
pub fn when_it_pays(
    ground: &Ground,
    isa: Isa,
    total: u64,
    rays: impl Fn(usize, usize) -> Vec<Ray>,
) -> Option<(Option<Bvh>, Learned)> {
    if total < LEAST {
        return None;
    }
    let start = Instant::now();
    let training = rays(TRAINING, 4);
    let held_out = rays(HELD_OUT, usize::MAX);
    if training.is_empty() || held_out.is_empty() {
        return None;
    }
    let recipe = Recipe::default().width(Width::auto(isa.level())).isa(isa);
    let learned = Bvh::learn(ground.world.primitives(), &training, &recipe).expect("a tree");
    let mut bits = vec![0; held_out.len().div_ceil(64)];
    let mut time = |bvh: &Bvh| {
        let start = thread_seconds();
        bvh.batch(&held_out)
            .on_this_thread()
            .occluded_bits_into(&mut bits);
        thread_seconds() - start
    };
    let mut ratios: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let plain = time(&ground.bvh);
            plain / time(&learned).max(1e-9)
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    let speedup = ratios[ROUNDS / 2];
    let used = speedup > 1.0;
    let outcome = Learned {
        used,
        speedup,
        seconds: start.elapsed().as_secs_f64(),
    };
    Some((used.then_some(learned), outcome))
}
