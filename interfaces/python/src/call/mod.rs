//! What every call may say: its threads, and where it shows progress. Ctrl-C ends it.
//!
//! - `threads`: pools of threads, and `fork`;  `watch`: work that takes long

pub mod threads;
pub mod watch;

use std::ops::Range;

use pyo3::prelude::*;

use threads::{ThreadCount, Threads};
use watch::{Progress, Signals, watch};

/// Where the work of a call runs.
pub struct Call<'py> {
    pub py: Python<'py>,
    pub threads: Threads,
    pub progress: Progress<'py>,
}

impl<'py> Call<'py> {
    pub fn new(
        py: Python<'py>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        Ok(Self {
            py,
            threads: Threads::of(threads)?,
            progress: Progress::new(progress)?,
        })
    }

    /// Does work without the lock of the interpreter, and looks for signals meanwhile.
    pub fn watch<T: Send>(&mut self, work: impl FnOnce(&Signals) -> T + Send) -> PyResult<T> {
        watch(self.py, &self.threads, &mut self.progress, work)
    }

    /// Does work on some of `count` things at a time: `piece` for each thread. Looks for signals in between.
    pub fn in_pieces(
        &mut self,
        count: usize,
        piece: usize,
        mut work: impl FnMut(Range<usize>, &Threads) -> PyResult<()> + Send,
    ) -> PyResult<()> {
        let piece = piece * self.threads.count();
        for first in (0..count).step_by(piece) {
            let range = first..count.min(first + piece);
            let end = range.end;
            let (work, threads) = (&mut work, &self.threads);
            self.py.detach(|| work(range, threads))?;
            self.py.check_signals()?;
            self.progress.tell(end as u64, count as u64)?;
        }
        Ok(())
    }
}
