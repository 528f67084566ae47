//! Ctrl-C: the first one asks for an orderly end, the second one ends.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::exit::Failure;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Starts listening.
pub fn install() -> Result<(), Failure> {
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|source| Failure::Work(format!("cannot listen for Ctrl-C: {source}")))
}

/// Whether Ctrl-C was pressed.
pub fn requested() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Ends here if Ctrl-C was pressed.
pub fn check() -> Result<(), Failure> {
    if requested() {
        Err(Failure::Interrupted)
    } else {
        Ok(())
    }
}
