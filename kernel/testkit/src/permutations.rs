//! Permutations of a few items.

/// Calls `visit` with every permutation of `items`, and restores their order.
pub fn permutations<T>(items: &mut [T], visit: &mut impl FnMut(&[T])) {
    permute_from(0, items, visit);
}

fn permute_from<T>(first: usize, items: &mut [T], visit: &mut impl FnMut(&[T])) {
    if first == items.len() {
        visit(items);
    }
    for other in first..items.len() {
        items.swap(first, other);
        permute_from(first + 1, items, visit);
        items.swap(first, other);
    }
}
