//! How long the steps of a build took, by a clock that the caller gives: the kernel has none.

use core::time::Duration;

/// Tells the time that has passed since some moment, which is always the same.
pub type Clock = fn() -> Duration;

/// How long the steps of [`AnyBvh::build`](crate::AnyBvh::build) took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BuildTimes {
    /// Checking and copying primitives; zero where that was done before, as for [`AnyBvh::build_over`](crate::AnyBvh::build_over).
    pub primitives: Duration,
    /// Building the binary tree.
    pub tree: Duration,
    /// Following sample rays through it; next to nothing without a learned collapse.
    pub log: Duration,
    /// Collapsing the binary tree, sorting children and writing nodes and leaf blocks.
    pub collapse: Duration,
}

impl BuildTimes {
    /// All of them.
    pub fn total(&self) -> Duration {
        self.primitives + self.tree + self.log + self.collapse
    }
}

/// Times one step after another.
pub(crate) struct Stopwatch {
    clock: Option<Clock>,
    last: Duration,
}

impl Stopwatch {
    /// Starts now; without a clock all times are zero.
    pub fn new(clock: Option<Clock>) -> Self {
        let last = clock.map_or(Duration::ZERO, |clock| clock());
        Self { clock, last }
    }

    /// The time since the last call, or since the start.
    pub fn lap(&mut self) -> Duration {
        let now = self.clock.map_or(Duration::ZERO, |clock| clock());
        // A clock that is set back has no right to a panic.
        let lap = now.saturating_sub(self.last);
        self.last = now;
        lap
    }
}
