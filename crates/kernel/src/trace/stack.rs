//! The traversal stacks: sized from the tree, owned by the caller, reused for every ray.

use crate::node::Child;

/// Items that a stack must hold for nodes of `width` children on `depth` levels.
///
/// One lies at the bottom. A node takes one item and pushes at most `width`, so no path holds more than
/// `(width - 1) * depth + 1` above that. Pushes write `width` items at once, hence `width` more. Overflow is
/// impossible; were a tree deeper than it said, index checks would panic rather than corrupt memory.
pub(crate) fn stack_size(width: usize, depth: usize) -> usize {
    (width - 1) * depth + 2 + width
}

/// What lies on a stack: a child, perhaps with its distance.
pub(crate) trait Item: Copy {
    /// Lies at the bottom; its child is [`Child::DONE`].
    const BOTTOM: Self;

    fn child(self) -> Child;
}

/// A child alone.
impl Item for u32 {
    const BOTTOM: Self = Child::DONE.0;

    #[inline(always)]
    fn child(self) -> Child {
        Child(self)
    }
}

/// A child and the distance at which its box is entered, ordered by distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Entry(u64);

impl Item for Entry {
    /// Nearer than anything, so that no culling drops it.
    const BOTTOM: Self = Self(Child::DONE.0 as u64);

    #[inline(always)]
    fn child(self) -> Child {
        Child(self.0 as u32)
    }
}

impl Entry {
    /// `distance` is at least 0: such floats are ordered as their bits are.
    #[inline(always)]
    pub fn new(distance: u32, child: u32) -> Self {
        Self(u64::from(distance) << 32 | u64::from(child))
    }

    /// Whether the box is entered at or before `distance`; for a negative one, at or before 0.
    #[inline(always)]
    pub fn within(self, distance: f32) -> bool {
        (self.0 >> 32) as u32 <= distance.max(0.0).to_bits()
    }

    /// The entry where `keep` is all ones; where it is 0, one that is nearer than anything.
    #[inline(always)]
    pub fn masked(self, keep: u64) -> Self {
        Self(self.0 & keep)
    }

    /// The farther one, then the nearer one.
    #[inline(always)]
    pub fn sorted(self, other: Self) -> (Self, Self) {
        (self.max(other), self.min(other))
    }
}

/// Children still to visit.
pub(crate) struct Stack<'a, T> {
    items: &'a mut [T],
    len: usize,
}

impl<'a, T: Item> Stack<'a, T> {
    /// An empty stack in memory of [`stack_size`] items.
    #[inline(always)]
    pub fn new(items: &'a mut [T]) -> Self {
        items[0] = T::BOTTOM;
        Self { items, len: 1 }
    }

    /// A stack left at [`Stack::len`] items before.
    #[inline(always)]
    pub fn resume(items: &'a mut [T], len: usize) -> Self {
        Self { items, len }
    }

    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    pub fn push(&mut self, item: T) {
        self.items[self.len] = item;
        self.len += 1;
    }

    /// The next `N` places above the top, to be written and then [`Stack::grow`]n over.
    #[inline(always)]
    pub fn window<const N: usize>(&mut self) -> &mut [T; N] {
        self.items[self.len..]
            .first_chunk_mut()
            .expect("sized from the tree")
    }

    /// Takes the first `count` items of the window as pushed.
    #[inline(always)]
    pub fn grow(&mut self, count: usize) {
        self.len += count;
    }

    /// The top item; the bottom one when nothing is left, and then the stack is used up.
    #[inline(always)]
    pub fn pop(&mut self) -> T {
        self.len -= 1;
        self.items[self.len]
    }
}
