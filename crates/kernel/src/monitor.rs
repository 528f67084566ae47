//! Whoever watches a build, and may stop it.

use core::sync::atomic::{AtomicBool, Ordering};

/// Hears how far a build is, and may stop it.
///
/// Asked from the threads of the build, often and in any order. An [`AtomicBool`] is a monitor that stops builds from when it
/// is true; `()` watches nothing.
pub trait BuildMonitor: Sync {
    /// So much of the build is done: from 0 to 1, never less than before. A rough estimate of the time.
    fn progress(&self, _done: f32) {}

    /// Whether to give up.
    fn cancelled(&self) -> bool {
        false
    }
}

impl BuildMonitor for () {}

impl BuildMonitor for AtomicBool {
    fn cancelled(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}
