//! Orders in which an occlusion query may visit the hit children of a node.
//!
//! Plain queries know one order only: ascending slots, compiled into [`crate::trace::query`]. The others are chosen at
//! run time, in [`crate::trace::instrumented`]: logs shuffle, and comparisons look at the ray.

use antumbra_simd::{Lanes, Mask};

use crate::geometry::ray_setup::RaySetup;
use crate::hash;
use crate::ray::Ray;
use crate::trace::stack::Stack;
use crate::tree::node::Node;
#[cfg(feature = "lab")]
use crate::tree::rule::Rule;
use crate::tree::wide::WideTree;

/// Pushes the hit children so that nearer ones are nearer to the top; of equally near ones the lower slot is.
/// Boxes around or behind the origin count as entered there: equally near, and never culled too early.
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

/// Chooses among the hit children of a node.
pub(crate) enum Pick {
    /// Ascending slots, whatever the rule of the tree.
    Slots,
    /// By the rule of the tree.
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
    #[cfg_attr(
        not(feature = "lab"),
        expect(unused_variables, reason = "slots need no look at the ray")
    )]
    pub fn lanes<const N: usize, L: Lanes<N>>(
        &mut self,
        bvh: &WideTree<N>,
        index: usize,
        ray: &RaySetup,
        (mask, entry): (L::Mask, L),
    ) -> ([u32; N], usize) {
        #[cfg(feature = "lab")]
        if let (Self::Rule, Rule::ByRay(rule)) = (&self, &bvh.pick) {
            return rule.lanes((index, &bvh.nodes[index]), ray, mask, entry);
        }
        let all: [u32; N] = core::array::from_fn(|lane| lane as u32);
        let mut lanes = [0; N];
        let count = mask.compress(&all, &mut lanes);
        if let Self::Shuffled(shuffle) = self {
            shuffle.shuffle(&mut lanes[..count]);
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
