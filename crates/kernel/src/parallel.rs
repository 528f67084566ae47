//! Work on several threads, or on one when the `parallel` feature is off. Callers divide the work by
//! counts alone, so what they compute does not depend on the number of threads.

use alloc::vec::Vec;
use core::ops::Range;

use antumbra_simd::memory::{Slots, vec_in_huge_pages, vec_of_chunks};

/// Runs both, at the same time when the `parallel` feature is on.
#[cfg(feature = "parallel")]
pub(crate) fn join<A: Send, B: Send>(
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    rayon::join(a, b)
}

/// Runs one after the other.
#[cfg(not(feature = "parallel"))]
pub(crate) fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}

/// Runs `work` on every job, in any order and at the same time when the `parallel` feature is on.
#[cfg(feature = "parallel")]
pub(crate) fn for_each<T: Send>(jobs: Vec<T>, work: impl Fn(T) + Sync + Send) {
    use rayon::iter::{IntoParallelIterator, ParallelIterator};
    jobs.into_par_iter().for_each(work);
}

/// Runs `work` on every job.
#[cfg(not(feature = "parallel"))]
pub(crate) fn for_each<T>(jobs: Vec<T>, work: impl Fn(T)) {
    jobs.into_iter().for_each(work);
}

/// How many of `count` things make one job: enough to be worth a thread's while, and not more jobs than a
/// few per thread of any machine.
pub(crate) fn chunk_len(count: usize) -> usize {
    const MIN_CHUNK: usize = 8192;
    const MAX_CHUNKS: usize = 64;
    count.div_ceil(MAX_CHUNKS).max(MIN_CHUNK)
}

/// `count` items, of which `work` writes a chunk of `chunk` at a time where they are to stand, given their places.
pub(crate) fn fill<T: Send>(
    count: usize,
    chunk: usize,
    work: impl Fn(Range<usize>, &mut Slots<'_, T>) + Sync + Send,
) -> Vec<T> {
    let lens = (0..count)
        .step_by(chunk)
        .map(|first| chunk.min(count - first));
    vec_of_chunks(lens, |chunks| {
        let jobs = chunks.iter_mut().enumerate();
        for_each(jobs.collect(), |(index, slots)| {
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
    vec_of_chunks(pieces.iter().map(Vec::len), |chunks| {
        let jobs = chunks.iter_mut().zip(&pieces);
        for_each(jobs.collect(), |(slots, piece)| {
            for item in piece {
                slots.push(*item);
            }
        });
    })
}

/// `f(0), f(1), … f(count - 1)`, in pieces of at least `least` at a time.
#[cfg(feature = "parallel")]
pub(crate) fn map<T: Send>(
    count: usize,
    least: usize,
    f: impl Fn(usize) -> T + Sync + Send,
) -> Vec<T> {
    use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
    let mut all = vec_in_huge_pages(count);
    (0..count)
        .into_par_iter()
        .with_min_len(least)
        .map(f)
        .collect_into_vec(&mut all);
    all
}

/// `f(0), f(1), … f(count - 1)`; `least` is for when there are threads.
#[cfg(not(feature = "parallel"))]
pub(crate) fn map<T>(count: usize, _least: usize, f: impl Fn(usize) -> T) -> Vec<T> {
    let mut all = vec_in_huge_pages(count);
    all.extend((0..count).map(f));
    all
}
