//! Which hit child an occlusion query visits next.

use antumbra_simd::{Lanes, Mask};

use crate::geometry::ray_setup::RaySetup;
use crate::hash;
use crate::ray::Ray;
use crate::trace::stack::{Item, Stack};
use crate::tree::directed::DirectedOrder;
use crate::tree::node::{Child, Node};

/// Chooses among the hit children of a node.
pub(crate) trait Pick {
    /// What lies on the stack.
    type Item: Item;

    /// A new ray begins.
    #[inline(always)]
    fn begin(&mut self, _ray: &Ray) {}

    /// Pushes the hit children of node `index` so that they are popped in the order chosen. `mask` are the lanes
    /// that `ray` hit, `entry` the distances at which it enters their boxes.
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, Self::Item>,
        index: usize,
        node: &Node<N>,
        ray: &RaySetup,
        mask: L::Mask,
        entry: L,
    );

    /// [`Pick::push`], then a pop, by the shortest way.
    #[inline(always)]
    fn push_pop<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, Self::Item>,
        index: usize,
        node: &Node<N>,
        ray: &RaySetup,
        mask: L::Mask,
        entry: L,
    ) -> Child {
        self.push::<N, L>(stack, index, node, ray, mask, entry);
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
        _: usize,
        node: &Node<N>,
        _: &RaySetup,
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
        _: usize,
        node: &Node<N>,
        _: &RaySetup,
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
        _: usize,
        node: &Node<N>,
        _: &RaySetup,
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

/// By one of several orders that a node has, chosen by the signs of the ray's direction.
///
/// Takes as many steps as a node has lanes, without a branch, where [`InOrder`] takes one.
pub(crate) struct Directed<'a> {
    pub order: &'a DirectedOrder,
}

impl Pick for Directed<'_> {
    type Item = u32;

    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, u32>,
        index: usize,
        node: &Node<N>,
        ray: &RaySetup,
        mask: L::Mask,
        _entry: L,
    ) {
        let bits = mask.bits();
        let window = stack.window::<N>();
        let mut count = 0;
        for &lane in self.order.lanes::<N>(index, ray.octant()) {
            // Written whether hit or not, and overwritten by the next one if not.
            window[count % N] = node.children[lane as usize % N];
            count += (bits >> lane & 1) as usize;
        }
        stack.grow(count);
    }
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
        self.state = hash::of_ray(self.seed, ray);
    }

    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack<'_, u32>,
        _: usize,
        node: &Node<N>,
        _: &RaySetup,
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
