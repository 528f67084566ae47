//! Which hit child an occlusion query visits next.

use antumbra_simd::{Lanes, Mask};

use super::stack::{Item, Stack};
use crate::hash;
use crate::node::{Child, Node};
use crate::ray::Ray;

/// Chooses among the hit children of a node.
pub(crate) trait Pick {
    /// What lies on the stack.
    type Item: Item;

    /// A new ray begins.
    #[inline(always)]
    fn begin(&mut self, _ray: &Ray) {}

    /// Pushes the hit children so that they are popped in the order chosen. `mask` are the hit lanes, `entry`
    /// the distances at which their boxes are entered.
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, Self::Item>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    );

    /// [`Pick::push`], then a pop, by the shortest way.
    #[inline(always)]
    fn push_pop<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, Self::Item>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) -> Child {
        self.push::<N, L>(stack, node, mask, entry);
        stack.pop().child()
    }
}

/// Ascending slots: whatever order the tree was given. Costs nothing.
pub(crate) struct InOrder;

impl Pick for InOrder {
    type Item = u32;

    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: L::Mask,
        _entry: L,
    ) {
        let count = mask.compress(&node.children, stack.window());
        stack.grow(count);
    }

    #[inline(always)]
    fn push_pop<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: L::Mask,
        _entry: L,
    ) -> Child {
        let bits = mask.bits();
        if bits == 0 {
            return stack.pop().child();
        }
        let count = mask.compress(&node.children, stack.window());
        // The first child comes from the node: a detour through the stack would put a store and a load
        // into the chain that a lone ray waits for.
        stack.grow(count - 1);
        Child(node.children[bits.ilog2() as usize % N])
    }
}

/// By entry distance, nearest first.
pub(crate) struct FrontToBack;

impl Pick for FrontToBack {
    type Item = u64;

    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, u64>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) {
        push_sorted::<N, L>(stack, node, mask, entry);
    }
}

/// Pushes the hit children so that nearer ones are nearer to the top; of equally near ones the lower slot is.
/// Shared with the closest-hit query. Boxes around or behind the origin count as entered there: equally near,
/// and never culled too early.
#[inline(always)]
pub(crate) fn push_sorted<const N: usize, L: Lanes<N>>(
    stack: &mut Stack<'_, u64>,
    node: &Node<N>,
    mask: L::Mask,
    entry: L,
) {
    let count = entry.compress_sorted(mask, &node.children, stack.window());
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

    #[inline(always)]
    fn random(&mut self) -> u64 {
        self.state = self.state.wrapping_add(hash::STEP);
        hash::mixed(self.state)
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
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: L::Mask,
        _entry: L,
    ) {
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
    }
}
