//! Work that takes long: Ctrl-C ends it, and progress is reported.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use super::threads::Threads;

/// Time between two checks for Python's signals, and between two reports of progress.
const TICK: Duration = Duration::from_millis(100);

/// Receiver of a call's progress: an object with a method `update(n)`, as tqdm's bars have, or a function of
/// `(done, total)`.
pub struct Progress<'py> {
    callback: Option<Callback<'py>>,
    told: u64,
}

enum Callback<'py> {
    Bar(Bound<'py, PyAny>),
    Function(Bound<'py, PyAny>),
}

impl<'py> Progress<'py> {
    pub fn new(progress: Option<Bound<'py, PyAny>>) -> PyResult<Self> {
        let callback = match progress {
            None => None,
            Some(bar) if bar.hasattr("update")? => Some(Callback::Bar(bar)),
            Some(function) if function.is_callable() => Some(Callback::Function(function)),
            Some(other) => {
                let found = other.get_type().name()?;
                return Err(PyTypeError::new_err(format!(
                    "progress: found {found}, wanted a function of (done, total) or an object with update(n)"
                )));
            }
        };
        Ok(Self { callback, told: 0 })
    }

    /// Reports that `done` of `total` are done, unless the receiver knows as many.
    pub fn tell(&mut self, done: u64, total: u64) -> PyResult<()> {
        if done <= self.told {
            return Ok(());
        }
        match &self.callback {
            None => {}
            Some(Callback::Function(function)) => {
                function.call1((done, total))?;
            }
            Some(Callback::Bar(bar)) => {
                // A bar that was made without a total learns it.
                if self.told == 0 && bar.getattr("total").is_ok_and(|total| total.is_none()) {
                    bar.setattr("total", total)?;
                }
                bar.call_method1("update", (done - self.told,))?;
            }
        }
        self.told = done;
        Ok(())
    }
}

/// State shared by the threads of long work and the thread that waits for it.
#[derive(Default)]
pub struct Signals {
    stop: AtomicBool,
    done: AtomicU64,
    total: AtomicU64,
}

impl Signals {
    pub fn reached(&self, done: u64, total: u64) {
        self.total.store(total, Ordering::Relaxed);
        self.done.fetch_max(done, Ordering::Relaxed);
    }

    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl antumbra::BuildMonitor for Signals {
    fn progress(&self, done: f32) {
        self.reached((1000.0 * done) as u64, 1000);
    }

    fn cancelled(&self) -> bool {
        self.is_stopped()
    }
}

impl antumbra_bake::Monitor for Signals {
    fn progress(&self, done: usize, total: usize) {
        self.reached(done as u64, total as u64);
    }

    fn cancelled(&self) -> bool {
        self.is_stopped()
    }
}

/// Does work in a pool, without the lock of the interpreter. Meanwhile the thread of the caller looks for signals and reports
/// progress. An exception of either stops the work, and is raised when it has ended.
pub fn watch<T: Send>(
    py: Python<'_>,
    threads: &Threads,
    progress: &mut Progress<'_>,
    work: impl FnOnce(&Signals) -> T + Send,
) -> PyResult<T> {
    let signals = Signals::default();
    let (send, receive) = mpsc::channel();
    let receive = Mutex::new(receive);
    std::thread::scope(|scope| {
        let (signals, threads) = (&signals, &threads);
        scope.spawn(move || {
            let made = threads.run(|| work(signals));
            // Nobody listens to a panic: the scope raises it.
            let _ = send.send(made);
        });
        let mut raised = None;
        loop {
            let waited = py.detach(|| {
                let receive = receive
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
                receive.recv_timeout(TICK)
            });
            let at = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
            match waited {
                Ok(made) => {
                    let told = progress.tell(at(&signals.done), at(&signals.total));
                    return match raised {
                        Some(error) => Err(error),
                        None => told.map(|()| made),
                    };
                }
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    return Err(pyo3::exceptions::PyRuntimeError::new_err(
                        "a thread ended before its work was done",
                    ));
                }
                Err(mpsc::RecvTimeoutError::Timeout) if raised.is_some() => {}
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    let asked = py.check_signals();
                    let told =
                        asked.and_then(|()| progress.tell(at(&signals.done), at(&signals.total)));
                    if let Err(error) = told {
                        signals.stop.store(true, Ordering::Relaxed);
                        raised = Some(error);
                    }
                }
            }
        }
    })
}
