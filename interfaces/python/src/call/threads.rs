//! Threads of this process. A pool does not survive `fork`: a process that finds another's makes its own.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::{PyOverflowError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Most threads that a call may have.
const MOST: usize = 1 << 12;

/// Number of threads for a call, checked.
#[derive(Clone, Copy)]
pub struct ThreadCount(usize);

impl<'py> FromPyObject<'_, 'py> for ThreadCount {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let wrong = || {
            let found = &*object;
            PyValueError::new_err(format!("threads: found {found}, wanted 1 to {MOST}"))
        };
        match object.extract::<usize>() {
            Ok(threads @ 1..=MOST) => Ok(Self(threads)),
            Ok(_) => Err(wrong()),
            // Below zero, or beyond all words.
            Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => Err(wrong()),
            Err(error) => Err(error),
        }
    }
}

/// The pool of the default, and one more. Others end when the calls that use them have ended.
#[derive(Default)]
struct Pools {
    /// Process that the pools belong to.
    process: u32,
    /// Threads of calls that do not say; 0 for as many as rayon chooses.
    default: usize,
    /// By number of threads, 0 as above; the one used last comes first.
    pools: Vec<(usize, Arc<ThreadPool>)>,
}

static POOLS: Mutex<Option<Pools>> = Mutex::new(None);

fn with_pools<T>(f: impl FnOnce(&mut Pools) -> T) -> T {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let pools = pools.get_or_insert_default();
    let process = std::process::id();
    if pools.process != process {
        // Their threads are in the other process: to end the pools would wait for them forever.
        std::mem::forget(std::mem::take(&mut pools.pools));
        pools.process = process;
    }
    f(pools)
}

impl Pools {
    /// The pool of so many threads, which is made if there is none.
    fn pool(&mut self, threads: usize) -> Result<Arc<ThreadPool>, rayon::ThreadPoolBuildError> {
        let is_asked = |(count, _): &(usize, _)| *count == threads;
        let found = match self.pools.iter().position(is_asked) {
            Some(place) => self.pools.remove(place),
            None => {
                let pool = ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .thread_name(|index| format!("antumbra-{index}"))
                    .build()?;
                (threads, Arc::new(pool))
            }
        };
        let pool = found.1.clone();
        self.pools.insert(0, found);
        self.drop_others();
        Ok(pool)
    }

    /// Keeps the pool of the default, and of all others the one used last.
    fn drop_others(&mut self) {
        let (default, mut others) = (self.default, 0);
        self.pools.retain(|(count, _)| {
            others += usize::from(*count != default);
            *count == default || others == 1
        });
    }
}

/// Threads of a call.
#[derive(Clone)]
pub struct Threads {
    pool: Arc<ThreadPool>,
}

impl Threads {
    /// `threads` of a call.
    pub fn of(threads: Option<ThreadCount>) -> PyResult<Self> {
        let pool = with_pools(|pools| {
            let threads = threads.map_or(pools.default, |threads| threads.0);
            pools.pool(threads)
        });
        let pool = pool.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
        Ok(Self { pool })
    }

    pub fn count(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs work that shares itself among the threads of the pool it runs in.
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.pool.install(work)
    }
}

/// Sets the number of threads of calls that do not say ``threads``.
///
/// Parameters
/// ----------
/// threads : int, optional
///     1 to 4096. None for one per core, or as many as the environment variable RAYON_NUM_THREADS says.
///
/// Raises
/// ------
/// ValueError
///     The number is another one.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> am.set_threads(2)
/// >>> am.get_threads()
/// 2
/// >>> am.set_threads(None)
#[pyfunction]
#[pyo3(signature = (threads=None))]
pub fn set_threads(threads: Option<ThreadCount>) {
    with_pools(|pools| {
        pools.default = threads.map_or(0, |threads| threads.0);
        pools.drop_others();
    });
}

/// Number of threads of calls that do not say ``threads``.
///
/// Returns
/// -------
/// int
///
/// Raises
/// ------
/// RuntimeError
///     The system has no more threads.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> am.get_threads() >= 1
/// True
#[pyfunction]
pub fn get_threads() -> PyResult<usize> {
    Ok(Threads::of(None)?.count())
}
