//! How long the steps of a build took, by a clock that the caller gives: the kernel has none.

use core::time::Duration;

/// Clock of a build: returns the time since a fixed moment, such as the start of the program.
pub type Clock = fn() -> Duration;

/// Time that each step of [`Bvh::learn`](crate::Bvh::learn) took.
///
/// ```
/// use std::sync::LazyLock;
/// use std::time::{Duration, Instant};
///
/// use antumbra::recipe::Clock;
/// use antumbra::{Bvh, Geometry, Recipe};
///
/// static START: LazyLock<Instant> = LazyLock::new(Instant::now);
/// let clock: Clock = || START.elapsed();
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let bvh = Bvh::build(&geometry, &Recipe::default().clock(Some(clock)))?;
/// let times = bvh.report().times.expect("a clock was given");
/// assert!(times.total() > Duration::ZERO);
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct BuildTimes {
    /// Checking and copying primitives; zero where that was done before, in a build over [`Primitives`](crate::Primitives).
    pub primitives: Duration,
    /// Building the binary tree.
    pub tree: Duration,
    /// Following training rays through the binary tree; next to nothing without a learned collapse.
    pub log: Duration,
    /// Collapsing the binary tree, sorting children and writing nodes and leaf blocks.
    pub collapse: Duration,
    /// Following training rays through the wide tree.
    pub order_log: Duration,
    /// Computing the child order and applying it.
    pub order: Duration,
    /// Predicting the mean cost of a ray before and after the order is applied.
    pub predict: Duration,
}

impl BuildTimes {
    /// Returns the sum of all steps.
    pub fn total(&self) -> Duration {
        let Self {
            primitives,
            tree,
            log,
            collapse,
            order_log,
            order,
            predict,
        } = *self;
        primitives + tree + log + collapse + order_log + order + predict
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
