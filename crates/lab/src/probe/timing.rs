//! Timing in turns on one thread, by the time that the thread really ran.

/// Seconds for which this thread has run on a CPU.
#[cfg(unix)]
pub fn seconds() -> f64 {
    use rustix::time::{ClockId, clock_gettime};
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Seconds since the first call, where nobody tells for how long a thread has run.
#[cfg(not(unix))]
pub fn seconds() -> f64 {
    use std::sync::LazyLock;
    use std::time::Instant;
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64()
}

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
            let before = seconds();
            work();
            times.push(seconds() - before);
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
