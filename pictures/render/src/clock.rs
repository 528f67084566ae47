//! The clock by which trees are timed: the kernel has none of its own.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Time since this function was first called.
pub fn clock() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}
