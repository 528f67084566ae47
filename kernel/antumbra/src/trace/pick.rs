//! Orders in which an occlusion query may visit the hit children of a node.
//!
//! Plain queries know one order only, compiled into their traversals: [`Children`]. The others are chosen at
//! run time, in [`crate::trace::instrumented`]: logs shuffle, and comparisons look at the ray.

use antumbra_simd::{Lanes, Mask};

use crate::hash;
use crate::ray::Ray;
use crate::trace::stack::{Item, Stack};
use crate::tree::node::{Child, Node};
use crate::tree::wide::WideTree;

/// Items of a stack know the order of the children that are pushed.
pub(crate) trait Children: Item {
    /// Pushes the children of a node that were hit so that the one to be visited next is on top. `mask` are the lanes
    /// hit, `entry` their distances.
    fn push<const N: usize, L: Lanes<N>>(
        stack: &mut Stack<'_, Self>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    );

    /// [`Children::push`], then a pop, by the shortest way: for a ray that has the CPU to itself.
    fn push_pop<const N: usize, L: Lanes<N>>(
        stack: &mut Stack<'_, Self>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) -> Child;
}

/// By ascending slots: the order of occlusion queries.
impl Children for u32 {
    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: L::Mask,
        _: L,
    ) {
        let count = mask.compress(&node.children, stack.window());
        stack.grow(count);
    }

    #[inline(always)]
    fn push_pop<const N: usize, L: Lanes<N>>(
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: L::Mask,
        _: L,
    ) -> Child {
        let bits = mask.bits();
        if bits == 0 {
            return stack.pop().child();
        }
        let first = Child(node.children[bits.ilog2() as usize % N]);
        if bits & (bits - 1) == 0 {
            return first;
        }
        let count = mask.compress(&node.children, stack.window());
        // The first child comes from the node: a detour through the stack would put a store and a load
        // into the chain that a lone ray waits for.
        stack.grow(count - 1);
        first
    }
}

/// By distance: the order of closest hits.
impl Children for u64 {
    /// Of equally near children the lower slot is nearer to the top. Boxes around or behind the origin count as entered
    /// there: equally near, and never culled too early.
    #[inline(always)]
    fn push<const N: usize, L: Lanes<N>>(
        stack: &mut Stack<'_, u64>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) {
        let count = entry.compress_sorted(mask, &node.children, stack.window());
        stack.grow(count);
    }

    /// Guesses how many children are hit: one goes on at once, two are compared, more are sorted. A right guess lets the
    /// next node begin before this one has been compressed, sorted, stored and loaded again.
    #[inline(always)]
    fn push_pop<const N: usize, L: Lanes<N>>(
        stack: &mut Stack<'_, u64>,
        node: &Node<N>,
        mask: L::Mask,
        entry: L,
    ) -> Child {
        let bits = mask.bits();
        if bits == 0 {
            return stack.pop().child();
        }
        let others = bits & (bits - 1);
        let slot = |bits: u32| bits.trailing_zeros() as usize % N;
        let [a, b] = [slot(bits), slot(others)];
        let child = |lane: usize| Child(node.children[lane]);
        if others == 0 {
            return child(a);
        }
        if others & (others - 1) != 0 {
            Self::push(stack, node, mask, entry);
            return stack.pop().child();
        }
        let mut distances = [0.0; N];
        entry.store(&mut distances);
        // Of equally near ones the lower slot, which is the upper lane, comes first. Two ways out, so that the CPU guesses.
        if distances[a] < distances[b] {
            stack.push_entered(distances[b], child(b));
            return child(a);
        }
        stack.push_entered(distances[a], child(a));
        child(b)
    }
}

/// Chooses among the hit children of a node.
pub(crate) enum Pick {
    /// Ascending slots, whatever the order of the tree.
    Slots,
    /// As the order of the tree has it.
    Rule,
    /// At random.
    Shuffled(Shuffle),
}

impl Pick {
    /// A new ray begins.
    #[inline(always)]
    pub fn begin(&mut self, ray: &Ray) {
        if let Self::Shuffled(shuffle) = self {
            shuffle.begin(ray);
        }
    }

    /// The lanes of node `index` that `ray` hit, the one to be visited first at the end, and how many they are. `mask`
    /// are these lanes, `entry` the distances at which their boxes are entered.
    #[inline(always)]
    pub fn lanes<const N: usize, L: Lanes<N>>(
        &mut self,
        bvh: &WideTree<N>,
        (mask, entry): (L::Mask, L),
    ) -> ([u32; N], usize) {
        let all: [u32; N] = core::array::from_fn(|lane| lane as u32);
        let mut lanes = [0; N];
        let count = mask.compress(&all, &mut lanes);
        match (self, bvh.pick) {
            (Self::Shuffled(shuffle), _) => shuffle.shuffle(&mut lanes[..count]),
            (Self::Rule, Some(pick)) => {
                let mut entered = [0.0; N];
                entry.store(&mut entered);
                pick.sort(&entered, &mut lanes[..count]);
            }
            _ => {}
        }
        (lanes, count)
    }
}

/// A random order: the remedy of Ogaki and Derouet-Jourdan (section 4.2) against the bias of a log towards the
/// order in force.
///
/// Each ray is its own seed, so the order does not depend on how rays were batched or divided among threads.
pub(crate) struct Shuffle {
    seed: u64,
    state: u64,
}

impl Shuffle {
    pub fn new(seed: u64) -> Self {
        Self { seed, state: 0 }
    }

    fn begin(&mut self, ray: &Ray) {
        self.state = hash::of_ray(self.seed, ray);
    }

    fn random(&mut self) -> u64 {
        self.state = self.state.wrapping_add(hash::STEP);
        hash::mixed(self.state)
    }

    /// Fisher and Yates, by multiply and shift instead of a division.
    fn shuffle(&mut self, lanes: &mut [u32]) {
        for last in (1..lanes.len()).rev() {
            let random = self.random() >> 32;
            lanes.swap(last, ((random * (last as u64 + 1)) >> 32) as usize);
        }
    }
}
