//! How a caller watches a rendering and stops it.

use crate::live::LiveTiles;
use crate::resume::Snapshot;
use crate::training::Lesson;

/// Phase of a rendering.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// Collapsing the binary tree, and building it if that was not done before.
    Build,
    /// Tracing the pre-pass, for its training rays.
    Log,
    /// Ordering the tree.
    Sort,
    /// Tracing all other samples.
    Render,
}

/// Observer of a rendering.
///
/// Methods are called from all threads, per tile and per batch of some thousand samples. They should be quick.
pub trait Monitor: Sync {
    /// Reports that `done` of `total` steps of a phase are done. Calls may arrive out of order.
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        let _ = (phase, done, total);
    }

    /// Reports a finished batch of the picture: its samples, and the rays traced for it. Samples of the pre-pass count
    /// when they reach the film, without rays.
    fn traced(&self, samples: u64, rays: u64) {
        let _ = (samples, rays);
    }

    /// Whether to stop. Called between batches, and between the steps of a build.
    fn cancelled(&self) -> bool {
        false
    }

    /// Hands over the training rays, traced or given. Called at most once, before [`Phase::Sort`].
    fn learned(&self, lesson: &Lesson) {
        let _ = lesson;
    }

    /// Tiles to publish the picture in while it is traced. Tiles of another window than the window of the world's film
    /// stay as they are.
    fn tiles(&self) -> Option<&LiveTiles> {
        None
    }

    /// Whether to call [`Monitor::keep`] now. Called between batches while the picture is traced.
    fn wants_snapshot(&self) -> bool {
        false
    }

    /// Hands over the state of the rendering: when wanted, and when the rendering is cancelled, even while it builds and
    /// learns. The calling thread waits until the method returns, other threads go on.
    fn keep(&self, snapshot: Snapshot) {
        let _ = snapshot;
    }
}

/// An observer that ignores everything and never stops.
impl Monitor for () {}
