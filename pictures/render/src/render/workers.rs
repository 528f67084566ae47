//! One loop on every thread of the pool: take the next job until none is left.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::monitor::{Monitor, Phase};
use crate::Error;

/// Jobs `0..count`, handed out in order to any thread.
pub struct Jobs<'m> {
    before: usize,
    count: usize,
    next: AtomicUsize,
    done: AtomicUsize,
    stopped: AtomicBool,
    phase: Phase,
    monitor: &'m dyn Monitor,
}

impl<'m> Jobs<'m> {
    /// Jobs that report their progress to `monitor`.
    pub fn new(count: usize, phase: Phase, monitor: &'m dyn Monitor) -> Self {
        Self::after(0, count, phase, monitor)
    }

    /// Jobs after `before` others that are done already.
    pub fn after(before: usize, count: usize, phase: Phase, monitor: &'m dyn Monitor) -> Self {
        monitor.progress(phase, before as u64, (before + count) as u64);
        Self {
            before,
            count,
            next: AtomicUsize::new(0),
            done: AtomicUsize::new(0),
            stopped: AtomicBool::new(false),
            phase,
            monitor,
        }
    }

    /// The next job, unless all are taken or the rendering was cancelled.
    pub fn take(&self) -> Option<usize> {
        if self.is_cancelled() {
            return None;
        }
        let job = self.next.fetch_add(1, Ordering::Relaxed);
        (job < self.count).then_some(job)
    }

    /// Reports a job as done.
    pub fn finish(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        let (done, all) = (self.before + done, self.before + self.count);
        self.monitor.progress(self.phase, done as u64, all as u64);
    }

    /// Whether the monitor has requested a stop, now or earlier.
    pub fn is_cancelled(&self) -> bool {
        if !self.stopped.load(Ordering::Relaxed) && self.monitor.cancelled() {
            self.stopped.store(true, Ordering::Relaxed);
        }
        self.stopped.load(Ordering::Relaxed)
    }

    /// Runs `worker` on every thread of the current pool. Returns the result of each.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if a job is left undone because the monitor requested a stop.
    pub fn run<R: Send>(&self, worker: impl Fn(&Self) -> R + Sync) -> Result<Vec<R>, Error> {
        let results = rayon::broadcast(|_| worker(self));
        // A wish to stop that comes after the last job is too late.
        if self.done.load(Ordering::Relaxed) < self.count {
            return Err(Error::Cancelled);
        }
        Ok(results)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Requests a stop as soon as `enough` jobs are done.
    struct Until {
        enough: u64,
        stop: AtomicBool,
    }

    impl Monitor for Until {
        fn progress(&self, _: Phase, done: u64, _: u64) {
            self.stop.fetch_or(done >= self.enough, Ordering::Relaxed);
        }

        fn cancelled(&self) -> bool {
            self.stop.load(Ordering::Relaxed)
        }
    }

    #[test]
    fn only_jobs_left_undone_make_a_run_cancelled() {
        let run = |enough: u64| {
            let stop = AtomicBool::new(false);
            let monitor = Until { enough, stop };
            let jobs = Jobs::new(1000, Phase::Render, &monitor);
            jobs.run(|jobs| {
                while jobs.take().is_some() {
                    jobs.finish();
                }
                // The question that comes after the last job.
                jobs.is_cancelled()
            })
        };
        assert!(matches!(run(0), Err(Error::Cancelled)));
        assert!(matches!(run(1), Err(Error::Cancelled)));
        let asked = run(1000).expect("all jobs were done");
        assert!(asked.contains(&true));
        assert!(run(1001).is_ok());
    }
}
