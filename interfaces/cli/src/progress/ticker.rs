//! A thread that says how far the work is: on a terminal in a line that is drawn again, elsewhere in a line every half
//! minute. Silent with `-q`.

use std::sync::{Arc, Condvar, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::line::Line;
use super::lock;
use crate::exit;

/// Time between two drawings.
const DRAW: Duration = Duration::from_millis(100);
/// Time between two lines of a log.
const LOG: Duration = Duration::from_secs(30);

/// A line that is kept up to date. Ends with its owner.
pub struct Ticker {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    stopped: Mutex<bool>,
    wake: Condvar,
}

impl Ticker {
    /// Says what `line` returns, until the ticker is dropped.
    pub fn start(line: impl Fn() -> Line + Send + 'static) -> Self {
        let shared = Arc::new(Shared {
            stopped: Mutex::new(false),
            wake: Condvar::new(),
        });
        if exit::is_quiet() {
            return Self {
                shared,
                thread: None,
            };
        }
        let seen = Arc::clone(&shared);
        let work = move || {
            let every = if exit::is_terminal() { DRAW } else { LOG };
            let mut next = Instant::now() + every;
            let mut stopped = lock(&seen.stopped);
            while !*stopped {
                let left = next.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    drop(stopped);
                    exit::draw(&line());
                    next = Instant::now() + every;
                    stopped = lock(&seen.stopped);
                    continue;
                }
                let waited = seen.wake.wait_timeout(stopped, left);
                stopped = waited.map_or_else(|error| error.into_inner().0, |(stopped, _)| stopped);
            }
        };
        // Without a thread there is no progress to see, and nothing else is lost.
        let thread = thread::Builder::new().name("progress".into()).spawn(work);
        Self {
            shared,
            thread: thread.ok(),
        }
    }

    /// Takes the line away.
    pub fn stop(&mut self) {
        *lock(&self.shared.stopped) = true;
        self.shared.wake.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
            exit::undraw();
        }
    }
}

impl Drop for Ticker {
    fn drop(&mut self) {
        self.stop();
    }
}
