//! Signals. Ctrl-C (SIGINT) and SIGTERM request an orderly end, and a second one ends at once. SIGUSR1 requests a
//! checkpoint.
//!
//! An orderly end waits for nothing but files that are being written: where a run does not look at the flag for some
//! seconds, a thread of this module ends it.

use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::exit::{Failure, say};

static INTERRUPTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static CHECKPOINT: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// Number of threads that write files which must not be cut short.
static WRITING: AtomicUsize = AtomicUsize::new(0);
/// File that the same command goes on from.
static KEPT: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Exit code of a second signal, as of [`Failure::Interrupted`].
const SECOND: i32 = 130;
/// Time that a run has to end by itself.
const PATIENCE: Duration = Duration::from_millis(3500);
/// Time between looks at the flag.
const BETWEEN_LOOKS: Duration = Duration::from_millis(100);

/// Starts listening.
pub fn install() -> Result<(), Failure> {
    listen().map_err(|reason| Failure::Work(format!("cannot listen for Ctrl-C: {reason}")))?;
    let watch = thread::Builder::new().name("signals".into()).spawn(watch);
    watch.map(drop).map_err(Failure::work)
}

#[cfg(unix)]
fn listen() -> std::io::Result<()> {
    use signal_hook::consts::{SIGINT, SIGTERM, SIGUSR1};
    use signal_hook::flag::{register, register_conditional_shutdown};

    register(SIGUSR1, Arc::clone(&CHECKPOINT))?;
    for signal in [SIGINT, SIGTERM] {
        // In this order the first signal finds the flag unset.
        register_conditional_shutdown(signal, SECOND, Arc::clone(&INTERRUPTED))?;
        register(signal, Arc::clone(&INTERRUPTED))?;
    }
    Ok(())
}

#[cfg(not(unix))]
fn listen() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            process::exit(SECOND);
        }
    })
}

/// Ends the process when it does not end by itself.
fn watch() {
    while !requested() {
        thread::sleep(BETWEEN_LOOKS);
    }
    let mut since = Instant::now();
    while since.elapsed() < PATIENCE {
        thread::sleep(BETWEEN_LOOKS);
        if WRITING.load(Ordering::Relaxed) > 0 {
            since = Instant::now();
        }
    }
    let failure = match kept().take() {
        Some(path) => Failure::Continuable(path),
        None => Failure::Interrupted,
    };
    say(format_args!("{failure}"));
    process::exit(i32::from(failure.number()));
}

fn kept() -> std::sync::MutexGuard<'static, Option<PathBuf>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Notes a file that the same command goes on from.
pub fn goes_on_from(path: &Path) {
    *kept() = Some(path.to_path_buf());
}

/// Notes that there is no such file any more.
pub fn goes_on_from_nothing() {
    *kept() = None;
}

/// While it lives, a run is not ended by [`watch`].
pub struct Writing(());

/// Says that files are being written.
pub fn writing() -> Writing {
    WRITING.fetch_add(1, Ordering::Relaxed);
    Writing(())
}

impl Drop for Writing {
    fn drop(&mut self) {
        WRITING.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Whether to end.
pub fn requested() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Whether a checkpoint was requested since the last call.
pub fn checkpoint_requested() -> bool {
    // Without the first look every thread would write to the flag all the time.
    CHECKPOINT.load(Ordering::Relaxed) && CHECKPOINT.swap(false, Ordering::Relaxed)
}

/// Returns [`Failure::Interrupted`] if a signal has requested the end.
pub fn check() -> Result<(), Failure> {
    if requested() {
        Err(Failure::Interrupted)
    } else {
        Ok(())
    }
}
