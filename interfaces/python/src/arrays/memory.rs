//! Lists as long as the shapes of a call: a `MemoryError` with the size where there is no memory for them.
//!
//! A list of Rust's own ends the process instead. Every list whose length a caller chooses is therefore made here.

use pyo3::PyResult;
use pyo3::exceptions::PyMemoryError;

/// An empty list with room for so many items. `what` names them.
pub fn room<T>(items: usize, what: &str) -> PyResult<Vec<T>> {
    let mut list = Vec::new();
    grow(&mut list, items, what)?;
    Ok(list)
}

/// A list of equal items.
pub fn filled<T: Clone>(value: T, items: usize, what: &str) -> PyResult<Vec<T>> {
    let mut list = room(items, what)?;
    list.resize(items, value);
    Ok(list)
}

/// A list of the first so many values of an iterator.
pub fn collected<T>(
    values: impl IntoIterator<Item = T>,
    items: usize,
    what: &str,
) -> PyResult<Vec<T>> {
    let mut list = room(items, what)?;
    list.extend(values.into_iter().take(items));
    Ok(list)
}

/// Makes room for more items of a list.
pub fn grow<T>(list: &mut Vec<T>, more: usize, what: &str) -> PyResult<()> {
    let items = list.len().saturating_add(more);
    list.try_reserve(more)
        .map_err(|_| too_large(items, what, items as u128 * size_of::<T>() as u128))
}

/// Makes a list one of equal items, in the memory that it has as far as possible.
pub fn refill<T: Clone>(list: &mut Vec<T>, value: T, items: usize, what: &str) -> PyResult<()> {
    list.clear();
    grow(list, items, what)?;
    list.resize(items, value);
    Ok(())
}

/// Whether there is memory for work outside of this package that takes so many bytes for each item.
pub fn check(items: usize, bytes_each: usize, what: &str) -> PyResult<()> {
    let bytes = items as u128 * bytes_each as u128;
    let mut probe: Vec<u8> = Vec::new();
    let len = usize::try_from(bytes).unwrap_or(usize::MAX);
    probe
        .try_reserve_exact(len)
        .map_err(|_| too_large(items, what, bytes))
}

fn too_large(items: usize, what: &str, bytes: u128) -> pyo3::PyErr {
    let gigabytes = bytes as f64 / 1e9;
    PyMemoryError::new_err(format!(
        "not enough memory for {items} {what}: {bytes} bytes, {gigabytes:.3} GB"
    ))
}
