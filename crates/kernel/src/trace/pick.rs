//! Which hit child an occlusion query visits next.

use antumbra_simd::{Lanes, Mask};

use super::stack::{Entry, Item, Stack};
use crate::node::{Child, Node};
use crate::ray::Ray;

/// Chooses among the hit children of a node.
pub(crate) trait Pick {
    /// What lies on the stack.
    type Item: Item;

    /// A new ray begins.
    #[inline(always)]
    fn begin(&mut self, _ray: &Ray) {}

    /// `mask` are the hit lanes, `entry` the distances at which their boxes are entered. Returns the child
    /// to visit next, and leaves the others on the stack in the order in which they are to be popped.
    ///
    /// `WAVE` asks for code without branches that are hard to predict, even if it takes longer from end to
    /// end: other rays fill the gaps, but a wrong guess throws their work away too.
    fn next<const N: usize, const WAVE: bool, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, Self::Item>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) -> Child;
}

/// Ascending slots: whatever order the tree was given. Costs nothing.
pub(crate) struct InOrder;

impl Pick for InOrder {
    type Item = u32;

    #[inline(always)]
    fn next<const N: usize, const WAVE: bool, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: L::Mask,
        _entry: L,
    ) -> Child {
        let bits = mask.bits();
        if !WAVE && bits == 0 {
            return stack.pop().child();
        }
        let count = mask.compress(&node.children, stack.window());
        if WAVE {
            stack.grow(count);
            return stack.pop().child();
        }
        // The first child comes from the node: a detour through the stack would put a store and a load
        // into the chain that a lone ray waits for.
        stack.grow(count - 1);
        Child(node.children[bits.ilog2() as usize % N])
    }
}

/// By entry distance, nearest first.
pub(crate) struct FrontToBack;

impl Pick for FrontToBack {
    type Item = Entry;

    #[inline(always)]
    fn next<const N: usize, const WAVE: bool, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, Entry>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) -> Child {
        push_sorted::<N, L>(stack, node, mask, entry);
        stack.pop().child()
    }
}

/// Pushes the hit children so that nearer ones are nearer to the top; equally near ones in no particular,
/// but always the same order. Shared with the closest-hit query.
#[inline(always)]
pub(crate) fn push_sorted<const N: usize, L: Lanes<N>>(
    stack: &mut Stack<'_, Entry>,
    node: &Node<N>,
    mask: L::Mask,
    entry: L,
) {
    let mut distances = [0.0; N];
    entry.store(&mut distances);
    let mut near = [0; N];
    let mut children = [0; N];
    // Boxes around or behind the origin count as entered there: equally near, and never culled too early.
    let bits = distances.map(|distance| {
        if distance > 0.0 {
            distance.to_bits()
        } else {
            0
        }
    });
    let count = mask.compress(&bits, &mut near);
    mask.compress(&node.children, &mut children);
    let top = stack.window::<N>();
    if count <= 4 {
        // Nearly always. A sorting network has no branches; what is not there is nearer than anything and
        // so ends up behind the others, above the top.
        let [a, b, c, d] = [0, 1, 2, 3].map(|place: usize| {
            Entry::new(near[place], children[place]).masked(u64::from(place < count).wrapping_neg())
        });
        let (a, b) = a.sorted(b);
        let (c, d) = c.sorted(d);
        let (a, c) = a.sorted(c);
        let (b, d) = b.sorted(d);
        let (b, c) = b.sorted(c);
        top[..4].copy_from_slice(&[a, b, c, d]);
    } else {
        for place in 0..count {
            let entry = Entry::new(near[place], children[place]);
            let mut hole = place;
            while hole > 0 && top[hole - 1] < entry {
                top[hole] = top[hole - 1];
                hole -= 1;
            }
            top[hole] = entry;
        }
    }
    stack.grow(count);
}

/// At random: the remedy of Ogaki and Derouet-Jourdan (section 4.2) against the bias of a log towards the
/// order in force. The sequence is seeded from the ray itself, so that it does not depend on how rays
/// were batched or divided among threads.
pub(crate) struct Shuffled {
    seed: u64,
    state: u64,
}

impl Shuffled {
    pub fn new(seed: u64) -> Self {
        Self { seed, state: 0 }
    }

    /// Steele, Lea and Flood (2014): SplitMix64.
    #[inline(always)]
    fn random(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

impl Pick for Shuffled {
    type Item = u32;

    #[inline(always)]
    fn begin(&mut self, ray: &Ray) {
        self.state = self.seed;
        for x in ray.org.iter().chain(&ray.dir) {
            self.state ^= u64::from(x.to_bits());
            self.state = self.random();
        }
    }

    #[inline(always)]
    fn next<const N: usize, const WAVE: bool, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: L::Mask,
        _entry: L,
    ) -> Child {
        let mut hit = [0; N];
        let count = mask.compress(&node.children, &mut hit);
        // Fisher and Yates, by multiply and shift instead of a division.
        for last in (1..count).rev() {
            let random = self.random() >> 32;
            hit.swap(last, ((random * (last as u64 + 1)) >> 32) as usize);
        }
        for &child in &hit[..count] {
            stack.push(child);
        }
        stack.pop().child()
    }
}
