//! Devices: threads of commits, errors, and the memory monitor. `failure` and `handle` have what all calls share.

mod failure;
#[macro_use]
mod handle;
mod calls;
mod config;

use std::ffi::{CStr, c_int, c_void};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use antumbra::Isa;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::abi::{ErrorCode, ErrorFunction, INVALID, MemoryFunction};
use config::Settings;
pub use failure::{Failure, Outcome};
pub use handle::{Handle, give, guarded, look, look_mut, report, share, share_on, with};

/// A function of the client with the pointer that it wants.
#[derive(Clone, Copy)]
pub struct Callback<F> {
    pub function: F,
    pub user: *mut c_void,
}

// SAFETY: the pointer is only handed back to the client, whose functions may be called from any thread.
unsafe impl<F: Send> Send for Callback<F> {}
// SAFETY: as above.
unsafe impl<F: Sync> Sync for Callback<F> {}

/// `RTCDevice`.
pub struct Device {
    id: u64,
    isa: Option<Isa>,
    /// Threads of commits, if the client chose their number. Otherwise rayon's own.
    pool: Option<ThreadPool>,
    error: Mutex<Option<Callback<ErrorFunction>>>,
    memory: Mutex<Option<Callback<MemoryFunction>>>,
}

impl Handle for Device {
    fn device(&self) -> &Device {
        self
    }
}

impl Device {
    fn new(config: &str) -> Outcome<Self> {
        static LAST_ID: AtomicU64 = AtomicU64::new(0);
        let settings = Settings::parse(config)?;
        let pool = match settings.threads {
            0 => None,
            threads => Some(
                (ThreadPoolBuilder::new().num_threads(threads).build())
                    .map_err(|error| Failure::new(ErrorCode::Unknown, error.to_string()))?,
            ),
        };
        Ok(Self {
            id: LAST_ID.fetch_add(1, Ordering::Relaxed) + 1,
            isa: settings.isa,
            pool,
            error: Mutex::default(),
            memory: Mutex::default(),
        })
    }

    /// A number that no other device has, not 0.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The instruction set that the client chose.
    pub fn isa(&self) -> Option<Isa> {
        self.isa
    }

    /// Runs work on the threads of the device.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    pub fn call_error_function(&self, code: c_int, text: &CStr) {
        let callback = *lock(&self.error);
        if let Some(Callback { function, user }) = callback {
            // SAFETY: the client gave the function with this pointer.
            unsafe { function(user, code, text.as_ptr()) }
        }
    }

    /// Reports bytes that come, or go if negative, to the memory monitor. The monitor may refuse bytes that come.
    pub fn count_memory(&self, bytes: isize) -> Outcome {
        let callback = *lock(&self.memory);
        let Some(Callback { function, user }) = callback else {
            return Ok(());
        };
        // SAFETY: the client gave the function with this pointer.
        let goes_on = unsafe { function(user, bytes, bytes < 0) };
        if goes_on || bytes < 0 {
            Ok(())
        } else {
            Err(Failure::new(
                ErrorCode::Cancelled,
                "memory monitor forced termination",
            ))
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        failure::forget(self.id);
    }
}

/// Locks, also after a panic of another thread: values behind locks are replaced as a whole.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
