//! The traversal stacks: sized from the tree, owned by the caller, reused for every ray.

use antumbra_simd::Mask;

/// Children still to visit, for a tree of `depth` levels of nodes.
///
/// A node pops one entry and pushes at most `N`, so no path holds more than `(N - 1) * depth + 1`. Pushes
/// write `N` entries at once, hence `N` more. Overflow is impossible; were the tree deeper than it said,
/// the index checks would panic rather than corrupt memory.
#[derive(Debug)]
pub(crate) struct Stack {
    children: Vec<u32>,
    /// Entry distances, for queries that cull at the pop; parallel to `children`.
    entries: Vec<f32>,
    len: usize,
}

impl Stack {
    pub fn new(width: usize, depth: usize) -> Self {
        let size = (width - 1) * depth + 1 + width;
        Self {
            children: vec![0; size],
            entries: vec![0.0; size],
            len: 0,
        }
    }

    #[inline(always)]
    pub fn clear(&mut self) {
        self.len = 0;
    }

    #[inline(always)]
    pub fn push(&mut self, child: u32) {
        self.children[self.len] = child;
        self.len += 1;
    }

    #[inline(always)]
    pub fn pop(&mut self) -> Option<u32> {
        self.len = self.len.checked_sub(1)?;
        Some(self.children[self.len])
    }

    /// Pushes the children of the lanes in `mask` so that the highest lane is on top.
    #[inline(always)]
    pub fn push_lanes<const N: usize>(&mut self, mask: impl Mask<N>, children: &[u32; N]) {
        let top = self.children[self.len..]
            .first_chunk_mut()
            .expect("sized from the tree");
        self.len += mask.compress(children, top);
    }

    #[inline(always)]
    pub fn push_with_entry(&mut self, child: u32, entry: f32) {
        self.entries[self.len] = entry;
        self.push(child);
    }

    /// The top child that is entered at or before `t`; those above it are dropped.
    #[inline(always)]
    pub fn pop_within(&mut self, t: f32) -> Option<u32> {
        loop {
            let child = self.pop()?;
            if self.entries[self.len] <= t {
                return Some(child);
            }
        }
    }
}
