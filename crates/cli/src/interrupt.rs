//! Signals. Ctrl-C (SIGINT) and SIGTERM ask for an orderly end, a second Ctrl-C ends at once; SIGUSR1 asks for
//! a checkpoint.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use crate::exit::Failure;

static INTERRUPTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static CHECKPOINT: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Starts listening.
pub fn install() -> Result<(), Failure> {
    listen().map_err(|reason| Failure::Work(format!("cannot listen for Ctrl-C: {reason}")))
}

#[cfg(unix)]
fn listen() -> std::io::Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
    use signal_hook::flag::{register, register_conditional_shutdown};

    // In this order the first Ctrl-C finds the flag unset.
    register_conditional_shutdown(SIGINT, 130, Arc::clone(&INTERRUPTED))?;
    register(SIGINT, Arc::clone(&INTERRUPTED))?;
    register(SIGTERM, Arc::clone(&INTERRUPTED))?;
    register(SIGUSR1, Arc::clone(&CHECKPOINT))?;
    Ok(())
}

#[cfg(not(unix))]
fn listen() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
}

/// Whether to end.
pub fn requested() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Whether a checkpoint was asked for since this was last asked.
pub fn checkpoint_requested() -> bool {
    // Without the first look every thread would write to the flag all the time.
    CHECKPOINT.load(Ordering::Relaxed) && CHECKPOINT.swap(false, Ordering::Relaxed)
}

/// Ends here if that was asked for.
pub fn check() -> Result<(), Failure> {
    if requested() {
        Err(Failure::Interrupted)
    } else {
        Ok(())
    }
}
