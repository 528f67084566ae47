//! Progress and cancellation.

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
