//! Progress and cancellation.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Watches work that takes long. Called from any thread, many times a second.
///
/// `()` watches nothing, and cancels nothing.
pub trait Monitor: Sync {
    /// So many points of `total` are done. Calls may arrive out of order.
    fn progress(&self, done: usize, total: usize) {
        let _ = (done, total);
    }

    /// Whether to give up: the work then ends soon with [`Error::Cancelled`](crate::Error::Cancelled).
    fn cancelled(&self) -> bool {
        false
    }
}

impl Monitor for () {}

/// Counts the items that are done for a monitor.
pub struct Progress<'a> {
    monitor: &'a dyn Monitor,
    done: AtomicUsize,
    of: usize,
}

impl<'a> Progress<'a> {
    /// A counter of so many items.
    pub fn new(monitor: &'a dyn Monitor, of: usize) -> Self {
        let done = AtomicUsize::new(0);
        Self { monitor, done, of }
    }

    /// Adds items that are done.
    pub fn add(&self, items: usize) {
        let before = self.done.fetch_add(items, Ordering::Relaxed);
        self.monitor.progress(before + items, self.of);
    }
}

/// Watches a share of work, of so many that count alike.
pub struct Share<'a>(pub &'a dyn Monitor, pub [usize; 2]);

impl Monitor for Share<'_> {
    fn progress(&self, done: usize, total: usize) {
        let Self(monitor, [index, parts]) = self;
        let part = 1000 * done / total.max(1);
        monitor.progress(1000 * index + part, 1000 * parts);
    }

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}
