//! Trees taken apart, to be put together with instances.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use crate::aabb::Aabb;

/// Takes a tree apart, the largest boxes first, into at least `count` subtrees or as many as there are leaves.
/// `children` returns the children of an inner node, and `None` for a leaf.
pub(crate) fn take_apart<T: Copy, C: IntoIterator<Item = (T, Aabb)>>(
    root: (T, Aabb),
    count: usize,
    mut children: impl FnMut(T) -> Option<C>,
) -> Vec<(T, Aabb)> {
    // The bits of areas, which are not negative, compare as they do. Of equals the first.
    let entry = |place: usize, bounds: &Aabb| (bounds.half_area().to_bits(), Reverse(place));
    let mut all = vec![root];
    let mut open = BinaryHeap::from([entry(0, &root.1)]);
    let mut kept = Vec::new();
    while open.len() + kept.len() < count
        && let Some((_, Reverse(place))) = open.pop()
    {
        let Some(children) = children(all[place].0) else {
            kept.push(place);
            continue;
        };
        for child in children {
            open.push(entry(all.len(), &child.1));
            all.push(child);
        }
    }
    kept.extend(open.into_iter().map(|(_, Reverse(place))| place));
    kept.sort_unstable();
    kept.into_iter().map(|place| all[place]).collect()
}
