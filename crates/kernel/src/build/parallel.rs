//! Work divided among threads when the `parallel` feature is on, in order whether it is or not.

/// `f(0), f(1), … f(count - 1)`, in pieces of at least `least` at a time.
#[cfg(feature = "parallel")]
pub(crate) fn map<T: Send>(
    count: usize,
    least: usize,
    f: impl Fn(usize) -> T + Sync + Send,
) -> Vec<T> {
    use rayon::prelude::*;
    (0..count)
        .into_par_iter()
        .with_min_len(least)
        .map(f)
        .collect()
}

/// `f(0), f(1), … f(count - 1)`; `least` is for when there are threads.
#[cfg(not(feature = "parallel"))]
pub(crate) fn map<T>(count: usize, _least: usize, f: impl Fn(usize) -> T) -> Vec<T> {
    (0..count).map(f).collect()
}
