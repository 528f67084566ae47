//! Many rays in flight on one thread, one step of each in turn.
//!
//! The steps of different rays do not depend on each other, so the CPU overlaps them: the latency of one
//! ray's step, its cache misses and its surprises hide behind the work of the others. Every ray in flight has
//! a *slot* and a stack. A round goes through four phases, none of which branches on what a single ray does:
//!
//! 1. every slot takes its next child from its stack, and words say who goes where, a bit per slot,
//! 2. slots that are done hand in their answers and take the next rays,
//! 3. one node step for every slot that has come to a node,
//! 4. one leaf step for every slot that has come to a leaf.
//!
//! Instances and cut-outs have words of their own, because a CPU cannot guess what a slot has come to. Exits from instances
//! come before the second phase: the ray becomes what it was. The others come after the third:
//!
//! - leaves of cut-outs: their hits are collected, and what tells whether these count is asked for (see [`crate::trace::deferred`]),
//! - entries, whose instances have come from memory meanwhile: the ray is made ready for the object and visits its root at
//!   once, for many miss all that it holds (in ecosys every third),
//! - the leaves of the fourth phase; then, behind them, hits of cut-outs are settled.
//!
//! With these apart, occlusion in batches is 1.1 to 1.2 times as fast in a scene of plants (ecosys, Zen 3).
//!
//! A pop comes a whole round after the push it may depend on, when that has long been written.
//!
//! A node is prefetched a few node steps before its own, a leaf during a node step of the same round. On Zen 5 that is
//! 1.1 to 1.2 times as fast as none from half a million triangles on, and makes no difference while the tree fits the caches;
//! to prefetch all nodes at the beginning of the phase is 1.05 to 1.1 times slower, for what comes early goes early.

use antumbra_simd::{Lanes, Mask, Simd, Width, WithSimd};

use crate::geometry::cutout::CutoutBlock;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::Ray;
use crate::trace::deferred::Deferred;
use crate::trace::leaf_places::LeafPlaces;
use crate::trace::query::Query;
use crate::trace::stack::{Item, Stack, stack_size};
use crate::trace::step::NodeRay;
use crate::tree::node::{Child, ChildKind, Leaf};
use crate::tree::wide::Bvh;

/// Rays in flight.
const SLOTS: usize = 64;

/// How many steps before its own a node is asked for. What is asked for much earlier does not interval in the first cache.
const AHEAD: usize = 4;

/// Slots that are looked at at once.
const LANES: usize = 16;

/// Some of the slots: bit `i` is slot `i`. Iterates over them.
#[derive(Clone, Copy)]
struct Slots(u64);

impl Slots {
    #[inline(always)]
    fn add(&mut self, id: usize) {
        self.0 |= 1 << id;
    }
}

impl Iterator for Slots {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let id = self.0.trailing_zeros() as usize;
        self.0 &= self.0.wrapping_sub(1);
        (id < SLOTS).then_some(id)
    }
}

/// The slots that go on with this child or one of a higher number.
#[inline(always)]
fn at_least<S: Simd>(simd: S, next: &[u32; SLOTS], child: Child) -> u64 {
    let mut slots = 0;
    for (chunk, children) in next.as_chunks().0.iter().enumerate() {
        let is_there = <S as Width<LANES>>::Lanes::words_at_least(simd, children, child.0);
        slots |= u64::from(is_there.bits()) << (LANES * chunk);
    }
    slots
}

/// The block of cut-outs that a slot goes on with.
#[inline(always)]
fn block<'a, const N: usize>(bvh: &'a Bvh<N>, next: &[u32; SLOTS], id: usize) -> &'a CutoutBlock {
    &bvh.cutout_blocks[Child(next[id]).index()]
}

/// A node step: tests the children of node `index` and pushes those that are hit.
#[inline(always)]
fn visit_node<S: Simd + Width<N>, const N: usize, Q: Query>(
    simd: S,
    state: &Q::State,
    stack: &mut Stack<'_, Q::Item>,
    bvh: &Bvh<N>,
    index: usize,
    ray: &RaySetup,
) {
    let node = &bvh.nodes[index];
    let limit = Q::limit(state, ray);
    let (mask, entry) = NodeRay::<S, N>::new(simd, ray).step(simd, node, limit);
    Q::push::<S, N>(stack, node, mask, entry);
}

/// Answers `rays` in waves; `answers` is as long.
pub(crate) struct Stream<'a, Q: Query, const N: usize> {
    pub bvh: &'a Bvh<N>,
    /// Memory of [`items`] items.
    pub items: &'a mut [Q::Item],
    pub rays: &'a [Ray],
    /// Indices of those that are asked.
    pub pending: &'a [u32],
    pub answers: &'a mut [Q::Answer],
    /// Whether nodes and leaves are asked for before their turn.
    pub prefetch: bool,
}

/// Items that the stacks of a wave take together.
pub(crate) fn items(width: usize, depth: usize) -> usize {
    stride(stack_size(width, depth)) * SLOTS
}

/// Items between the stacks of two slots: a number of cache lines that is odd, so that the tops of many
/// stacks do not compete for the same sets of the cache.
fn stride(size: usize) -> usize {
    16 * (size.div_ceil(16) | 1)
}

impl<Q: Query, const N: usize> WithSimd<N> for Stream<'_, Q, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let Self {
            bvh,
            items,
            rays,
            pending,
            answers,
            prefetch,
        } = self;
        let nodes = &bvh.nodes[..];
        let leaf_places = LeafPlaces::new(bvh);
        let has_cutouts = !bvh.cutout_blocks.is_empty();
        let has_more_kinds = has_cutouts || !bvh.instances.is_empty();
        let mut waiting = Deferred::new(if has_cutouts { SLOTS } else { 0 });
        let stride = stride(stack_size(N, bvh.depth));
        // Of every slot: the ray and which of the batch it is, what is known of it, its stack, and what it
        // goes on with.
        let mut setups = [RaySetup::IDLE; SLOTS];
        // The setups of rays that are in an instance, as they were in the world.
        let mut worlds = [RaySetup::IDLE; SLOTS];
        let mut ray_indices = [usize::MAX; SLOTS];
        let mut states = [Q::IDLE; SLOTS];
        let mut tops = [0; SLOTS];
        let mut next = [Child::DONE.0; SLOTS];
        for id in 0..SLOTS {
            tops[id] = Stack::new(items, id * stride).top();
        }
        let mut coming = 0;
        let mut in_flight = 0;
        loop {
            for id in 0..SLOTS {
                let mut stack = Stack::resume(items, id * stride, tops[id]);
                let child = stack.pop().child();
                next[id] = child.0;
                tops[id] = stack.top();
            }
            let (outer, done) = (
                at_least(simd, &next, Child::FIRST_OUTER),
                at_least(simd, &next, Child::DONE),
            );
            let mut to_nodes = Slots(!outer);
            let mut to_leaves = Slots(outer & !done);
            let (mut to_cutouts, mut entering) = (Slots(0), Slots(0));
            if has_more_kinds {
                let beyond_leaves = at_least(simd, &next, Child::FIRST_CUTOUTS);
                let passages = at_least(simd, &next, Child::FIRST_INSTANCE);
                let exits = at_least(simd, &next, Child::EXIT);
                to_leaves = Slots(outer & !beyond_leaves);
                to_cutouts = Slots(beyond_leaves & !passages);
                entering = Slots(passages & !exits);
                let leaving = Slots(exits & !done);
                for id in entering {
                    simd.prefetch(&bvh.instances[Child(next[id]).index()]);
                }
                for id in leaving {
                    setups[id] = worlds[id];
                    Q::exit(&mut states[id]);
                }
            }

            for id in Slots(done) {
                if let Some(answer) = answers.get_mut(ray_indices[id]) {
                    *answer = Q::finish(&states[id]);
                    ray_indices[id] = usize::MAX;
                    in_flight -= 1;
                }
                // The stack is used up, even if nobody needs it now.
                tops[id] = id * stride + 1;
                while let Some(&index) = pending.get(coming) {
                    coming += 1;
                    let index = index as usize;
                    let ray = &rays[index];
                    let state = Q::begin(ray);
                    if setups[id].set(simd, ray, bvh.reach) {
                        states[id] = state;
                        ray_indices[id] = index;
                        next[id] = Child::ROOT.0;
                        to_nodes.add(id);
                        in_flight += 1;
                        break;
                    }
                    answers[index] = Q::miss();
                }
            }
            if in_flight == 0 {
                return;
            }

            let (mut coming_leaves, mut coming_nodes) = if prefetch {
                (Slots(to_leaves.0 | to_cutouts.0), to_nodes)
            } else {
                (Slots(0), Slots(0))
            };
            for id in coming_nodes.by_ref().take(AHEAD) {
                simd.prefetch(&nodes[next[id] as usize]);
            }
            for id in to_nodes {
                if let Some(coming) = coming_nodes.next() {
                    simd.prefetch(&nodes[next[coming] as usize]);
                }
                if let Some(leaf) = coming_leaves.next() {
                    leaf_places.prefetch(simd, Child(next[leaf]));
                }
                let mut stack = Stack::resume(items, id * stride, tops[id]);
                let (state, index) = (&states[id], next[id] as usize);
                visit_node::<S, N, Q>(simd, state, &mut stack, bvh, index, &setups[id]);
                tops[id] = stack.top();
            }

            if has_cutouts {
                for id in to_cutouts {
                    let found =
                        Q::cutout_hits(&states[id], simd, block(bvh, &next, id), &setups[id]);
                    waiting.add(id, &found);
                }
                waiting.look_up(simd, &bvh.filters, |id| block(bvh, &next, id));
            }

            for id in entering {
                let index = Child(next[id]).index();
                let placed = &bvh.instances[index];
                worlds[id] = setups[id];
                match placed.placement.enter(simd, &worlds[id], &mut setups[id]) {
                    Some(interval) => {
                        Q::enter(&mut states[id], bvh, index, interval);
                        let mut stack = Stack::resume(items, id * stride, tops[id]);
                        stack.push(Q::Item::unordered(Child::EXIT));
                        let (state, root) = (&states[id], placed.root as usize);
                        visit_node::<S, N, Q>(simd, state, &mut stack, bvh, root, &setups[id]);
                        tops[id] = stack.top();
                    }
                    None => setups[id] = worlds[id],
                }
            }

            for id in to_leaves {
                let ChildKind::Leaf(leaf @ (Leaf::Triangles(_) | Leaf::Spheres(_))) =
                    Child(next[id]).kind()
                else {
                    continue;
                };
                let mut stack = Stack::resume(items, id * stride, tops[id]);
                Q::leaf::<S, N, true>(&mut states[id], &mut stack, simd, bvh, leaf, &setups[id]);
                tops[id] = stack.top();
            }

            for hit in waiting.take(|id| block(bvh, &next, id)) {
                let id = hit.slot;
                let mut stack = Stack::resume(items, id * stride, tops[id]);
                let (state, ray) = (&mut states[id], &setups[id]);
                Q::settle(state, &mut stack, simd, &hit, ray, &bvh.filters);
                tops[id] = stack.top();
            }
        }
    }
}
