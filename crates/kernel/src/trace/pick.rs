//! Which hit child an occlusion query visits next.

use antumbra_simd::{Lanes, Mask};

use super::stack::Stack;
use crate::node::Node;
use crate::ray::Ray;

/// Pushes the hit children of a node so that they pop in the picked order.
pub(crate) trait Pick {
    /// A new ray begins.
    #[inline(always)]
    fn begin(&mut self, _ray: &Ray) {}

    /// `mask` are the hit lanes, `entry` the distances at which their boxes are entered.
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    );
}

/// Ascending slots: whatever order the tree was given. Costs nothing.
pub(crate) struct InOrder;

impl Pick for InOrder {
    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack,
        node: &Node<N>,
        mask: L::Mask,
        _entry: L,
    ) {
        stack.push_lanes(mask, &node.children);
    }
}

/// By entry distance, nearest first; equal ones in ascending slots.
pub(crate) struct FrontToBack;

impl Pick for FrontToBack {
    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) {
        push_by_entry(stack, node, mask, entry);
    }
}

/// Pushes the hit children with their entry distances, so that the nearest is on top. Shared with the
/// closest-hit query.
#[inline(always)]
pub(crate) fn push_by_entry<const N: usize, L: Lanes<N>>(
    stack: &mut Stack,
    node: &Node<N>,
    mask: L::Mask,
    entry: L,
) {
    let mut entries = [0.0; N];
    entry.store(&mut entries);
    // Insertion from the nearest end: few lanes are hit, and ascending lanes (descending slots) that are
    // inserted *behind* equal ones leave the lowest slot on top.
    let mut lanes = [0u8; N];
    let mut count = 0;
    let mut bits = mask.bits();
    while bits != 0 {
        let lane = bits.trailing_zeros() as usize % N;
        bits &= bits - 1;
        let mut place = count;
        while place > 0 && entries[lanes[place - 1] as usize % N] < entries[lane] {
            lanes[place] = lanes[place - 1];
            place -= 1;
        }
        lanes[place] = lane as u8;
        count += 1;
    }
    for &lane in &lanes[..count] {
        let lane = lane as usize % N;
        stack.push_with_entry(node.children[lane], entries[lane]);
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

    /// Steele, Lea and Flood (2014): SplitMix64.
    #[inline(always)]
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

impl Pick for Shuffled {
    #[inline(always)]
    fn begin(&mut self, ray: &Ray) {
        self.state = self.seed;
        for x in ray.org.iter().chain(&ray.dir) {
            self.state ^= u64::from(x.to_bits());
            self.state = self.next();
        }
    }

    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack,
        node: &Node<N>,
        mask: L::Mask,
        _entry: L,
    ) {
        let mut hit = [0; N];
        let count = mask.compress(&node.children, &mut hit);
        // Fisher and Yates, by multiply and shift instead of a division.
        for last in (1..count).rev() {
            let random = self.next() >> 32;
            hit.swap(last, ((random * (last as u64 + 1)) >> 32) as usize);
        }
        for &child in &hit[..count] {
            stack.push(child);
        }
    }
}
