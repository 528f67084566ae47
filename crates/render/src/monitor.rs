//! How a caller watches a rendering and stops it.

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
}

/// Watches nothing and never stops.
impl Monitor for () {}
