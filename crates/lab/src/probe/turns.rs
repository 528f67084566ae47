//! Timing in turns on one thread.

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
