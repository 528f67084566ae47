//! The traversal stacks: sized from the tree, owned by the caller, reused for every ray.

use antumbra_simd::Mask;

use crate::node::Child;

/// Children still to visit, for a tree of `depth` levels of nodes.
///
/// A node pops one entry and pushes at most `N`, so no path holds more than `(N - 1) * depth + 1`. Pushes
/// write `N` entries at once, hence `N` more. Overflow is impossible; were the tree deeper than it said,
/// the index checks would panic rather than corrupt memory.
#[derive(Debug)]
pub(crate) struct Stack {
    children: Vec<u32>,
    /// The same for queries that need distances; one traversal uses only one of the two.
    entries: Vec<Entry>,
    len: usize,
}

/// A child and the distance at which its box is entered, ordered by distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Entry(u64);

impl Entry {
    #[inline(always)]
    pub fn new(distance: f32, child: Child) -> Self {
        Self(u64::from(rank(distance)) << 32 | u64::from(child.0))
    }

    #[inline(always)]
    pub fn child(self) -> Child {
        Child(self.0 as u32)
    }

    /// The nearer one, then the farther one.
    #[inline(always)]
    pub fn sorted(self, other: Self) -> (Self, Self) {
        (self.min(other), self.max(other))
    }
}

/// A whole number that is ordered as the distances are (NaN aside, which no hit box has).
#[inline(always)]
fn rank(distance: f32) -> u32 {
    let bits = distance.to_bits();
    // Negative numbers are ordered backwards: flip all their bits, and the sign of the others.
    bits ^ ((bits as i32 >> 31) as u32 | 1 << 31)
}

impl Stack {
    pub fn new(width: usize, depth: usize) -> Self {
        let size = (width - 1) * depth + 1 + width;
        Self {
            children: vec![0; size],
            entries: vec![Entry(0); size],
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

    /// Takes the children of the lanes in `mask`: returns that of the highest and pushes the others so that
    /// higher ones are nearer to the top.
    #[inline(always)]
    pub fn push_lanes<const N: usize>(
        &mut self,
        mask: impl Mask<N>,
        children: &[u32; N],
    ) -> Option<Child> {
        let bits = mask.bits();
        if bits == 0 {
            return None;
        }
        let top = self.children[self.len..]
            .first_chunk_mut()
            .expect("sized from the tree");
        self.len += mask.compress(children, top) - 1;
        Some(Child(children[bits.ilog2() as usize % N]))
    }

    #[inline(always)]
    pub fn push_entry(&mut self, entry: Entry) {
        self.entries[self.len] = entry;
        self.len += 1;
    }

    /// The child of the top entry.
    #[inline(always)]
    pub fn pop_entry(&mut self) -> Option<u32> {
        self.len = self.len.checked_sub(1)?;
        Some(self.entries[self.len].child().0)
    }

    /// The top child that is entered at or before `t`; those above it are dropped.
    #[inline(always)]
    pub fn pop_within(&mut self, t: f32) -> Option<u32> {
        let limit = rank(t);
        loop {
            self.len = self.len.checked_sub(1)?;
            let entry = self.entries[self.len];
            if (entry.0 >> 32) as u32 <= limit {
                return Some(entry.child().0);
            }
        }
    }
}
