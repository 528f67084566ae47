//! Interleaved timing on one thread.

use antumbra::{Bvh, Ray};

use super::row::Row;
use crate::thread_time;

/// Median and quartiles of how many times as fast as the first one each of some works is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Speed {
    /// Median over the rounds.
    pub median: f64,
    /// Lower quartile.
    pub low: f64,
    /// Upper quartile.
    pub high: f64,
    /// Median seconds of the work itself.
    pub seconds: f64,
}

/// Lets all works take turns, and compares each with the first.
pub fn in_turns(rounds: usize, works: &mut [Box<dyn FnMut() + '_>]) -> Vec<Speed> {
    let mut times = vec![Vec::with_capacity(rounds); works.len()];
    for _ in 0..rounds {
        for (work, times) in works.iter_mut().zip(&mut times) {
            let before = thread_time::seconds();
            work();
            times.push(thread_time::seconds() - before);
        }
    }
    let of = |own: &Vec<f64>| {
        let mut ratios: Vec<f64> = times[0].iter().zip(own).map(|(a, b)| a / b).collect();
        ratios.sort_by(f64::total_cmp);
        let mut own = own.clone();
        own.sort_by(f64::total_cmp);
        let at = |values: &[f64], share: f64| {
            let place = (share * (values.len() as f64 - 1.0)).round() as usize;
            values.get(place).copied().unwrap_or(f64::NAN)
        };
        Speed {
            median: at(&ratios, 0.5),
            low: at(&ratios, 0.25),
            high: at(&ratios, 0.75),
            seconds: at(&own, 0.5),
        }
    };
    times.iter().map(of).collect()
}

/// Times all trees or what stands for them, in batches and ray by ray, and notes the speeds in their rows. `ask` answers
/// the rays, as one batch if its third argument is true.
pub fn time_both<T>(
    rounds: usize,
    trees: &[T],
    rays: &[Ray],
    rows: &mut [Row],
    ask: impl Fn(&T, &[Ray], bool, &mut [bool]),
) {
    if rounds == 0 {
        return;
    }
    for batch in [true, false] {
        let mut works: Vec<Box<dyn FnMut() + '_>> = Vec::new();
        for tree in trees {
            let (ask, mut answers) = (&ask, vec![false; rays.len()]);
            works.push(Box::new(move || ask(tree, rays, batch, &mut answers)));
        }
        for (row, speed) in rows.iter_mut().zip(in_turns(rounds, &mut works)) {
            row.time(speed, batch);
        }
    }
}

/// Queries a tree, as one batch or ray by ray, on this thread.
pub fn ask(bvh: &Bvh, rays: &[Ray], batch: bool, answers: &mut [bool]) {
    if batch {
        bvh.batch(rays).on_this_thread().occluded_into(answers);
        return;
    }
    for (ray, answer) in rays.iter().zip(answers) {
        *answer = bvh.occluded(ray);
    }
}
