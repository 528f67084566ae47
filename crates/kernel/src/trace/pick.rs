//! Which hit child an occlusion query visits next.

use antumbra_simd::{Lanes, Mask};

use super::stack::{Entry, Stack};
use crate::node::{Child, Node};
use crate::ray::Ray;

/// Chooses among the hit children of a node: returns the first and pushes the others so that they pop in
/// the picked order.
pub(crate) trait Pick {
    /// A new ray begins.
    #[inline(always)]
    fn begin(&mut self, _ray: &Ray) {}

    /// The next of the children pushed before.
    #[inline(always)]
    fn pop(stack: &mut Stack) -> Option<u32> {
        stack.pop()
    }

    /// `mask` are the hit lanes, `entry` the distances at which their boxes are entered.
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) -> Option<Child>;
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
    ) -> Option<Child> {
        stack.push_lanes(mask, &node.children)
    }
}

/// By entry distance, nearest first.
pub(crate) struct FrontToBack;

impl Pick for FrontToBack {
    #[inline(always)]
    fn pop(stack: &mut Stack) -> Option<u32> {
        stack.pop_entry()
    }

    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        &mut self,
        stack: &mut Stack,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) -> Option<Child> {
        push_by_entry(stack, node, mask, entry)
    }
}

/// Returns the nearest of the hit children and pushes the others so that nearer ones are nearer to the
/// top; equally near ones come in no particular, but always the same order. Shared with the closest-hit
/// query.
#[inline(always)]
pub(crate) fn push_by_entry<const N: usize, L: Lanes<N>>(
    stack: &mut Stack,
    node: &Node<N>,
    mask: L::Mask,
    entry: L,
) -> Option<Child> {
    let mut bits = mask.bits();
    if bits == 0 {
        return None;
    }
    let mut entries = [0.0; N];
    entry.store(&mut entries);
    let mut next = || {
        let lane = bits.trailing_zeros() as usize % N;
        bits &= bits - 1;
        (
            Entry::new(entries[lane], Child(node.children[lane])),
            bits == 0,
        )
    };
    // One, two and three hits are most of them. Their comparisons become selects; a loop would be
    // mispredicted at every other node.
    let (a, last) = next();
    if last {
        return Some(a.child());
    }
    let (b, last) = next();
    let (near, far) = a.sorted(b);
    if last {
        stack.push_entry(far);
        return Some(near.child());
    }
    let (c, last) = next();
    let (far, farthest) = far.sorted(c);
    let (near, far) = near.sorted(far);
    if last {
        stack.push_entry(farthest);
        stack.push_entry(far);
        return Some(near.child());
    }
    let mut sorted = [farthest; N];
    sorted[1] = far;
    sorted[2] = near;
    let mut count = 3;
    loop {
        let (entry, last) = next();
        let mut place = count;
        while place > 0 && sorted[place - 1] < entry {
            sorted[place] = sorted[place - 1];
            place -= 1;
        }
        sorted[place] = entry;
        count += 1;
        if last {
            break;
        }
    }
    for entry in &sorted[..count - 1] {
        stack.push_entry(*entry);
    }
    Some(sorted[count - 1].child())
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
    ) -> Option<Child> {
        let mut hit = [0; N];
        let count = mask.compress(&node.children, &mut hit);
        // Fisher and Yates, by multiply and shift instead of a division.
        for last in (1..count).rev() {
            let random = self.next() >> 32;
            hit.swap(last, ((random * (last as u64 + 1)) >> 32) as usize);
        }
        let (first, others) = hit[..count].split_last()?;
        for &child in others {
            stack.push(child);
        }
        Some(Child(*first))
    }
}
