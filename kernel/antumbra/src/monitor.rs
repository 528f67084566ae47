//! Whoever watches a build, and may stop it.

use core::sync::atomic::{AtomicBool, Ordering};

/// Receives the progress of a build, and may stop it.
///
/// Called from the threads of the build, often and in any order. An [`AtomicBool`] is a monitor that stops builds from
/// when it is true; `()` watches nothing.
///
/// ```
/// use antumbra::{Build, BuildMonitor, Error, Geometry};
///
/// /// Prints the progress, and stops at a half.
/// struct Half;
///
/// impl BuildMonitor for Half {
///     fn progress(&self, done: f32) {
///         println!("{:.0} %", 100.0 * done);
///     }
///
///     fn cancelled(&self) -> bool {
///         true
///     }
/// }
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let stopped = Build::new(&geometry).monitor(&Half).bvh();
/// assert_eq!(stopped.err(), Some(Error::Cancelled));
/// ```
pub trait BuildMonitor: Sync {
    /// Receives the share of the build that is done: from 0 to 1, never less than before. A rough estimate of the time.
    fn progress(&self, _done: f32) {}

    /// Returns whether the build should stop. Default: `false`.
    fn cancelled(&self) -> bool {
        false
    }
}

impl BuildMonitor for () {}

/// A monitor that stays cancelled once it has said so: whatever a step leaves undone then, the build ends with an error.
pub(crate) struct Latched<'a> {
    monitor: &'a dyn BuildMonitor,
    is_cancelled: AtomicBool,
}

impl<'a> Latched<'a> {
    pub fn new(monitor: &'a dyn BuildMonitor) -> Self {
        Self {
            monitor,
            is_cancelled: AtomicBool::new(false),
        }
    }
}

impl BuildMonitor for Latched<'_> {
    fn progress(&self, done: f32) {
        self.monitor.progress(done);
    }

    fn cancelled(&self) -> bool {
        if !self.is_cancelled.cancelled() && self.monitor.cancelled() {
            self.is_cancelled.store(true, Ordering::Relaxed);
        }
        self.is_cancelled.cancelled()
    }
}

/// `None` if a build was cancelled.
pub(crate) fn goes_on(monitor: &dyn BuildMonitor) -> Option<()> {
    (!monitor.cancelled()).then_some(())
}

impl BuildMonitor for AtomicBool {
    fn cancelled(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}
