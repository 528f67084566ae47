//! The same loop on every thread of the pool: take the next job until none is left.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::Error;
use crate::monitor::{Monitor, Phase};

/// Jobs `0..count`, handed out in order to whoever asks.
pub struct Jobs<'m> {
    count: usize,
    next: AtomicUsize,
    done: AtomicUsize,
    stopped: AtomicBool,
    phase: Phase,
    monitor: &'m dyn Monitor,
}

impl<'m> Jobs<'m> {
    /// Jobs that report to `monitor` as they are done.
    pub fn new(count: usize, phase: Phase, monitor: &'m dyn Monitor) -> Self {
        monitor.progress(phase, 0, count as u64);
        Self {
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
        self.monitor
            .progress(self.phase, done as u64, self.count as u64);
    }

    /// Whether the monitor wants to stop; once it did, this stays true.
    pub fn is_cancelled(&self) -> bool {
        if !self.stopped.load(Ordering::Relaxed) && self.monitor.cancelled() {
            self.stopped.store(true, Ordering::Relaxed);
        }
        self.stopped.load(Ordering::Relaxed)
    }

    /// Runs `worker` on every thread of the current pool and returns what each made.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if a job was left undone because the monitor wanted to stop.
    pub fn run<R: Send>(&self, worker: impl Fn(&Self) -> R + Sync) -> Result<Vec<R>, Error> {
        let results = rayon::broadcast(|_| worker(self));
        if self.stopped.load(Ordering::Relaxed) {
            return Err(Error::Cancelled);
        }
        Ok(results)
    }
}
