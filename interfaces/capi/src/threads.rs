//! Threads that the caller chooses, and work shared among them.

use std::ops::Range;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::arrays::{Handle, Slot, optional};
use crate::batch::{FEW, THIS_THREAD};
use crate::interface::{frees, functions};
use crate::status::{Failure, Outcome, Status};

/// Most threads of a pool.
const MOST: usize = 1 << 12;

/// A pool of threads, `antumbra_threads`.
pub struct Threads {
    pool: ThreadPool,
}

/// Where a call works.
#[derive(Clone, Copy)]
pub enum Place<'a> {
    /// Only on the calling thread.
    Here,
    /// Among the threads of a pool.
    Pool(&'a ThreadPool),
    /// Threads of the pool of the process.
    Default,
}

impl<'a> Place<'a> {
    /// Where a call works that says `threads`.
    ///
    /// # Safety
    /// As [`optional`].
    pub unsafe fn of(threads: *const Threads) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let threads = unsafe { optional(threads, "threads") }?;
        Ok(threads.map_or(Self::Default, |threads: &'a Threads| {
            Self::Pool(&threads.pool)
        }))
    }

    /// Where a call works that says `threads` and flags.
    ///
    /// # Safety
    /// As [`optional`].
    pub unsafe fn flagged(threads: *const Threads, flags: u32) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let place = unsafe { Self::of(threads) }?;
        Ok(match flags & THIS_THREAD {
            0 => place,
            _ => Self::Here,
        })
    }

    /// Runs work that shares itself among the threads of the pool it runs in.
    pub fn run<T: Send>(self, work: impl FnOnce() -> T + Send) -> T {
        match self {
            Self::Here | Self::Default => work(),
            Self::Pool(pool) => pool.install(work),
        }
    }

    /// The calling thread for few rays.
    pub fn unless_few(self, rays: usize) -> Self {
        if rays <= FEW { Self::Here } else { self }
    }

    /// Whether all work stays on the calling thread.
    pub fn is_here(self) -> bool {
        matches!(self, Self::Here)
    }

    /// Runs `work` on `0..count` in ranges of at most `len`, with memory that a thread keeps. One range stays on the calling
    /// thread.
    pub fn in_pieces<M: Default + Send>(
        self,
        count: usize,
        len: usize,
        work: impl Fn(&mut M, Range<usize>) + Sync + Send,
    ) {
        let pieces = count.div_ceil(len);
        let range = |piece: usize| piece * len..count.min(piece * len + len);
        if self.is_here() || pieces <= 1 {
            let mut memory = M::default();
            (0..pieces).for_each(|piece| work(&mut memory, range(piece)));
            return;
        }
        self.run(|| {
            (0..pieces)
                .into_par_iter()
                .for_each_init(M::default, |memory, piece| work(memory, range(piece)));
        });
    }
}

functions! {
    /// Makes a pool of `count` threads; 0 for one per core. At most 4096.
    ///
    /// Errors: INVALID_ARGUMENT, NO_THREADS.
    fn antumbra_threads_new(count: usize, threads: Handle<Threads>) {
        if count > MOST {
            return Err(Failure::argument(format_args!(
                "{count} threads are more than {MOST}"
            )));
        }
        let pool = ThreadPoolBuilder::new()
            .num_threads(count)
            .thread_name(|index| format!("antumbra-{index}"))
            .build()
            .map_err(|error| Failure::new(Status::NoThreads, error))?;
        threads.give(Threads { pool });
        Ok(())
    }

    /// Returns the number of threads of a pool.
    fn antumbra_threads_count(threads: &Threads, count: Slot<usize>) {
        count.put(threads.pool.current_num_threads());
        Ok(())
    }
}

frees! {
    /// Ends a pool. No call may use it any more.
    fn antumbra_threads_free(threads: Threads);
}
