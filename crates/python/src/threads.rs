//! Threads of this process. A pool does not survive `fork`: a process that finds another's makes its own.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Most threads that a call may ask for.
const MOST: usize = 1 << 12;

#[derive(Default)]
struct Pools {
    /// Process that the pools belong to.
    process: u32,
    /// Threads of calls that do not say; 0 for as many as rayon chooses.
    default: usize,
    /// By number of threads; 0 as above.
    pools: HashMap<usize, Arc<ThreadPool>>,
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

/// Threads of a call.
#[derive(Clone)]
pub struct Threads {
    pool: Arc<ThreadPool>,
}

impl Threads {
    /// `threads` of a call.
    pub fn of(threads: Option<usize>) -> PyResult<Self> {
        let threads = threads.map(checked).transpose()?;
        let pool = with_pools(|pools| {
            let threads = threads.unwrap_or(pools.default);
            if let Some(pool) = pools.pools.get(&threads) {
                return Ok(pool.clone());
            }
            let pool = ThreadPoolBuilder::new()
                .num_threads(threads)
                .thread_name(|index| format!("antumbra-{index}"))
                .build()?;
            let pool = Arc::new(pool);
            pools.pools.insert(threads, pool.clone());
            Ok::<_, rayon::ThreadPoolBuildError>(pool)
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

fn checked(threads: usize) -> PyResult<usize> {
    match threads {
        1..=MOST => Ok(threads),
        _ => Err(PyValueError::new_err(format!(
            "threads: found {threads}, wanted 1 to {MOST}"
        ))),
    }
}

/// Sets the number of threads of calls that do not say `threads`; `None` for one per core, or as many as
/// the environment variable RAYON_NUM_THREADS says.
#[pyfunction]
#[pyo3(signature = (threads=None))]
pub fn set_threads(threads: Option<usize>) -> PyResult<()> {
    let threads = threads.map_or(Ok(0), checked)?;
    with_pools(|pools| pools.default = threads);
    Ok(())
}

/// Number of threads of calls that do not say `threads`.
#[pyfunction]
pub fn get_threads() -> PyResult<usize> {
    Ok(Threads::of(None)?.count())
}
