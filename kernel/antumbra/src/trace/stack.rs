//! The traversal stacks: sized from the tree, owned by the caller, reused for every ray.

use crate::tree::node::Child;

/// Items that a stack must hold for nodes of `width` children on `depth` levels, counted from its bottom.
///
/// One lies at the bottom. A node takes one item and pushes at most `width`, so no path holds more than
/// `(width - 1) * depth + 1` above that, and one more, the exit from an instance. Pushes write `width` items at once and
/// culling reads and writes [`LANES`], hence as many more. Overflow is impossible; were a tree deeper than it said,
/// index checks would panic rather than corrupt memory.
pub(crate) fn stack_size(width: usize, depth: usize) -> usize {
    (width - 1) * depth + 3 + width.max(LANES)
}

/// Items that are culled at once.
const LANES: usize = 8;

/// An item on a stack: a child, perhaps with its distance.
pub(crate) trait Item: Copy {
    /// Lies at the bottom; its child is [`Child::DONE`].
    const BOTTOM: Self;

    fn child(self) -> Child;

    /// A child to be popped next, and never to be culled.
    fn unordered(child: Child) -> Self;
}

/// A child without a distance.
impl Item for u32 {
    const BOTTOM: Self = Child::DONE.0;

    #[inline(always)]
    fn child(self) -> Child {
        Child(self)
    }

    #[inline(always)]
    fn unordered(child: Child) -> Self {
        child.0
    }
}

/// A child in the lower half; in the upper half the bits of the distance at which its box is entered, or of 0
/// where that is negative.
impl Item for u64 {
    const BOTTOM: Self = Child::DONE.0 as u64;

    #[inline(always)]
    fn child(self) -> Child {
        Child(self as u32)
    }

    #[inline(always)]
    fn unordered(child: Child) -> Self {
        child.0.into()
    }
}

/// Children still to visit, in a part of `items`.
pub(crate) struct Stack<'a, T> {
    items: &'a mut [T],
    /// Index of the bottom item in `items`.
    base: usize,
    /// One above the top. Shorter than an index, so that nothing overflows when it is looked behind the top, and one check
    /// is enough.
    top: u32,
}

impl<'a, T: Item> Stack<'a, T> {
    /// An empty stack that begins at `base`, with room for [`stack_size`] items from there. Places are below 2³², as all
    /// stacks of a stream together would otherwise take more than 16 GiB.
    #[inline(always)]
    pub fn new(items: &'a mut [T], base: usize) -> Self {
        items[base] = T::BOTTOM;
        Self {
            items,
            base,
            top: base as u32 + 1,
        }
    }

    /// A stack left at [`Stack::top`] before.
    #[inline(always)]
    pub fn resume(items: &'a mut [T], base: usize, top: u32) -> Self {
        Self { items, base, top }
    }

    #[inline(always)]
    pub fn top(&self) -> u32 {
        self.top
    }

    #[inline(always)]
    pub fn push(&mut self, item: T) {
        self.items[self.top as usize] = item;
        self.top += 1;
    }

    /// The next `N` places above the top, to be written and then [`Stack::grow`]n over.
    #[inline(always)]
    pub fn window<const N: usize>(&mut self) -> &mut [T; N] {
        let top = self.top as usize;
        let window = self.items[top..top + N].first_chunk_mut();
        window.expect("as long")
    }

    /// Takes the first `count` items of the window as pushed.
    #[inline(always)]
    pub fn grow(&mut self, count: usize) {
        self.top += count as u32;
    }

    /// Drops everything above the bottom if `all` holds, without a branch.
    #[inline(always)]
    pub fn clear_if(&mut self, all: bool) {
        self.top = core::hint::select_unpredictable(all, self.base as u32 + 1, self.top);
    }

    /// The top item, if the stack is not used up.
    #[inline(always)]
    pub fn peek(&self) -> Option<T> {
        self.items.get(self.top.wrapping_sub(1) as usize).copied()
    }

    /// The top item; the bottom one when nothing is left, and then the stack is used up.
    #[inline(always)]
    pub fn pop(&mut self) -> T {
        self.top -= 1;
        self.items[self.top as usize]
    }
}

impl Stack<'_, u64> {
    /// Pushes a child whose box is entered at this distance.
    #[inline(always)]
    pub fn push_entered(&mut self, distance: f32, child: Child) {
        let distance = if distance > 0.0 { distance } else { 0.0 };
        self.push(u64::from(distance.to_bits()) << 32 | u64::from(child.0));
    }

    /// Drops what is entered beyond `limit`, which is not negative; the rest stays in order.
    #[inline(always)]
    pub fn cull<S: antumbra_simd::Simd>(&mut self, simd: S, limit: f32) {
        let (limit, mut kept) = (limit.to_bits(), self.base + 1);
        let top = self.top as usize;
        for place in (self.base + 1..top).step_by(LANES) {
            let items: [u64; LANES] = *self.items[place..]
                .first_chunk()
                .expect("what may be pushed still fits above the top");
            let present = LANES.min(top - place);
            let kept_items = self.items[kept..].first_chunk_mut().expect("as above");
            kept += simd.compress_within(&items, limit, present, kept_items);
        }
        self.top = kept as u32;
    }
}
