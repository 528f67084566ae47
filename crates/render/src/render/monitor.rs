//! How a caller watches a rendering and stops it.

use crate::resume::Snapshot;
use crate::training::lesson::Lesson;

/// What is being done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// Collapsing the binary tree.
    Build,
    /// Tracing the samples that an order is learned from.
    Log,
    /// Ordering the tree.
    Sort,
    /// Tracing the rest.
    Render,
}

/// Watches a rendering. Called from all threads: once per tile and once per wave of some thousand samples, so
/// both functions should be quick.
pub trait Monitor: Sync {
    /// `done` of `total` steps of a phase are done. Calls may arrive out of order.
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        let _ = (phase, done, total);
    }

    /// Whether to stop; asked between waves of rays.
    fn cancelled(&self) -> bool {
        false
    }

    /// What there was to learn is known, traced or given. Called at most once, before [`Phase::Sort`].
    fn learned(&self, lesson: &Lesson) {
        let _ = lesson;
    }

    /// Whether [`Monitor::keep`] is to be called now; asked between waves of rays while the picture is traced.
    fn wants_snapshot(&self) -> bool {
        false
    }

    /// What is done so far: when it was asked for, and once when the rendering is cancelled, unless that was
    /// before the first wave. The thread that calls does no other work until this returns, the others go on.
    fn keep(&self, snapshot: Snapshot) {
        let _ = snapshot;
    }
}

/// Watches nothing and never stops.
impl Monitor for () {}
