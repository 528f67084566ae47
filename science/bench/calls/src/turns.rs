//! Times of things that are done in turns, and tables of them.

use rustix::time::{ClockId, clock_gettime};

/// Seconds for which this thread has run.
pub fn seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Something to be timed.
pub type Work<'a> = (String, Box<dyn FnMut() + 'a>);

/// Does everything in turns; returns the median seconds of each.
pub fn medians(rounds: usize, works: &mut [Work<'_>]) -> Vec<f64> {
    let mut times = vec![Vec::new(); works.len()];
    for round in 0..=rounds {
        for ((_, work), times) in works.iter_mut().zip(&mut times) {
            let start = seconds();
            work();
            // The first round fetches memory.
            if round > 0 {
                times.push(seconds() - start);
            }
        }
    }
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    times.into_iter().map(median).collect()
}
