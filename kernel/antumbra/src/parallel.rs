//! Work on several threads, or on one when the `parallel` feature is off. Callers divide the work only by counts, so
//! what they compute does not depend on the number of threads.

use alloc::vec::Vec;
use core::mem;
use core::ops::Range;
#[cfg(feature = "parallel")]
use std::sync::{Mutex, PoisonError};

use antumbra_simd::memory::{Slots, vec_of_chunks};

/// Runs both, at the same time when the `parallel` feature is on.
pub(crate) fn join<A: Send, B: Send>(
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    let (mut a, mut b) = (Job::Waits(a), Job::Waits(b));
    both(&mut || a.run(), &mut || b.run());
    (a.result(), b.result())
}

/// Half of a [`join`], before and after.
enum Job<F, R> {
    Waits(F),
    Runs,
    Done(R),
}

impl<R, F: FnOnce() -> R> Job<F, R> {
    fn run(&mut self) {
        if let Self::Waits(work) = mem::replace(self, Self::Runs) {
            *self = Self::Done(work());
        }
    }

    fn result(self) -> R {
        match self {
            Self::Done(result) => result,
            Self::Waits(_) | Self::Runs => unreachable!("both halves were run"),
        }
    }
}

/// Runs `work` on every job, in any order and at the same time when the `parallel` feature is on.
pub(crate) fn for_each<T: Send>(jobs: Vec<T>, work: impl Fn(T) + Sync) {
    let mut jobs: Vec<_> = jobs.into_iter().map(Some).collect();
    for_each_mut(&mut jobs, &|_, job| {
        job.take().into_iter().for_each(&work);
    });
}

/// Runs `work` on every item and its index, in any order and at the same time when the `parallel` feature is on.
#[cfg(feature = "parallel")]
fn for_each_mut<T: Send>(items: &mut [T], work: &(dyn Fn(usize, &mut T) + Sync)) {
    let items: Vec<_> = items.iter_mut().map(Mutex::new).collect();
    run(0..items.len(), &|index| {
        let mut item = items[index].lock().unwrap_or_else(PoisonError::into_inner);
        work(index, &mut item);
    });
}

/// Runs `work` on every item and its index.
#[cfg(not(feature = "parallel"))]
fn for_each_mut<T>(items: &mut [T], work: &dyn Fn(usize, &mut T)) {
    items
        .iter_mut()
        .enumerate()
        .for_each(|(index, item)| work(index, item));
}

/// Runs `work` on every number. It is compiled once: what rayon has for iterators is compiled again for every closure
/// and was a quarter of this crate's code.
#[cfg(feature = "parallel")]
fn run(numbers: Range<usize>, work: &(dyn Fn(usize) + Sync)) {
    match numbers.len() {
        0 => {}
        1 => work(numbers.start),
        len => {
            let middle = numbers.start + len / 2;
            both(&mut || run(numbers.start..middle, work), &mut || {
                run(middle..numbers.end, work)
            });
        }
    }
}

/// Runs both.
#[cfg(feature = "parallel")]
fn both(a: &mut (dyn FnMut() + Send), b: &mut (dyn FnMut() + Send)) {
    rayon_core::join(a, b);
}

/// Runs one after the other.
#[cfg(not(feature = "parallel"))]
fn both(a: &mut dyn FnMut(), b: &mut dyn FnMut()) {
    a();
    b();
}

/// Threads of the current pool.
#[cfg(feature = "parallel")]
pub(crate) fn threads() -> usize {
    rayon_core::current_num_threads()
}

/// The calling one.
#[cfg(not(feature = "parallel"))]
pub(crate) fn threads() -> usize {
    1
}

/// How many of `count` things make one job: enough to be worth a thread's while, and not more jobs than a
/// few per thread of any machine.
pub(crate) fn chunk_len(count: usize) -> usize {
    const MIN_CHUNK: usize = 8192;
    const MAX_CHUNKS: usize = 64;
    count.div_ceil(MAX_CHUNKS).max(MIN_CHUNK)
}

/// `count` items. `work` writes chunks of `chunk` items, given their places, to where they belong in the list.
pub(crate) fn fill<T: Send>(
    count: usize,
    chunk: usize,
    work: impl Fn(Range<usize>, &mut Slots<'_, T>) + Sync,
) -> Vec<T> {
    let lens = (0..count)
        .step_by(chunk)
        .map(|first| chunk.min(count - first));
    vec_of_chunks(lens.collect(), &mut |chunks| {
        for_each_mut(chunks, &|index, slots| {
            let first = index * chunk;
            work(first..count.min(first + chunk), slots);
        });
    })
}

/// All pieces as one.
pub(crate) fn concat<T: Copy + Send + Sync>(mut pieces: Vec<Vec<T>>) -> Vec<T> {
    if pieces.len() == 1 {
        return pieces.pop().unwrap_or_default();
    }
    vec_of_chunks(pieces.iter().map(Vec::len).collect(), &mut |chunks| {
        for_each_mut(chunks, &|index, slots| {
            for item in &pieces[index] {
                slots.push(*item);
            }
        });
    })
}

/// `f(0), f(1), … f(count - 1)`, in pieces of at least `least` at a time.
pub(crate) fn map<T: Send>(count: usize, least: usize, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
    /// Pieces per thread, so that a piece that takes long is made up for.
    const PIECES: usize = 8;
    let chunk = count.div_ceil(PIECES * threads()).max(least).max(1);
    fill(count, chunk, |range, slots| {
        for index in range {
            slots.push(f(index));
        }
    })
}
