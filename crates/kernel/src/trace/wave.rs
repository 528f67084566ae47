//! Many rays in flight on one thread, one step of each in turn.
//!
//! The steps of different rays do not depend on each other, so the CPU overlaps them: the latency of one
//! ray's step, its cache misses and its surprises hide behind the work of the others. Every ray in flight has
//! a *slot* and a stack. A round goes through four phases, none of which branches on what a single ray does:
//!
//! 1. every slot takes its next child from its stack, and three lists say who goes where,
//! 2. slots that are done hand in their answers and take the next rays,
//! 3. one node step for every slot on the list of nodes,
//! 4. one leaf step for every slot on the list of leaves.
//!
//! Where there are instances, their entries and exits are sorted out from the leaves and handled before the third
//! phase: an entry makes the ray ready for the object and goes on with the node step of its root in the same
//! round, an exit makes the ray what it was. The instances are prefetched during the second phase, because a CPU
//! would wait for them longer than all the rest of an entry takes.
//!
//! A pop comes a whole round after the push it may depend on, when that has long been written.
//!
//! Leaves are prefetched, one during each node step: on Zen 4 that changes nothing while the tree fits the
//! caches (sponza, 4 MB) and makes queries 1.3 to 1.5 times as fast beyond (1 and 4 million triangles).
//! Prefetching nodes as well took 5 to 10 % away at every size: many rays pass the upper ones, and the rest
//! arrives during the steps of the other rays.

use antumbra_simd::{Lanes, Mask, Simd, Width, WithSimd};

use super::query::Query;
use super::setup::RaySetup;
use super::stack::{Item, Stack, stack_size};
use super::step::{NodeRay, prefetch_instance, prefetch_leaf};
use crate::bvh::Bvh;
use crate::node::{Child, ChildKind};
use crate::ray::Ray;

/// Rays in flight.
const SLOTS: usize = 32;

/// Slots that are listed at once.
const LANES: usize = 16;

/// Every slot, by name.
const IDS: [u32; SLOTS] = {
    let mut ids = [0; SLOTS];
    let mut id = 0;
    while id < SLOTS {
        ids[id] = id as u32;
        id += 1;
    }
    ids
};

/// Some of the slots.
struct List {
    /// Longer than a list can be, because compression writes [`LANES`] at a time.
    ids: [u32; SLOTS + LANES],
    len: usize,
}

impl List {
    const EMPTY: Self = Self {
        ids: [0; SLOTS + LANES],
        len: 0,
    };

    /// Appends those of `ids` whose lane is true.
    #[inline(always)]
    fn append(&mut self, mask: impl Mask<LANES>, ids: &[u32; LANES]) {
        let window = self.ids[self.len..]
            .first_chunk_mut()
            .expect("no slot is listed twice");
        self.len += mask.compress(ids, window);
    }

    #[inline(always)]
    fn push(&mut self, id: usize) {
        self.ids[self.len] = id as u32;
        self.len += 1;
    }

    /// Moves those slots to `passages` that go on with an instance or come back from one.
    #[inline(always)]
    fn sift(&mut self, next: &[u32; SLOTS], passages: &mut Self) {
        let mut kept = 0;
        for place in 0..self.len {
            let id = slot(self.ids[place]);
            let is_passage = usize::from(Child(next[id]).is_passage());
            // Which it is cannot be guessed, so it goes to the end of both, and only one of them grows.
            self.ids[kept] = id as u32;
            passages.ids[passages.len] = id as u32;
            kept += 1 - is_passage;
            passages.len += is_passage;
        }
        self.len = kept;
    }

    /// Those listed.
    #[inline(always)]
    fn ids(&self) -> &[u32] {
        &self.ids[..self.len]
    }
}

/// A slot by its name. The remainder spares the check of an index made from it.
#[inline(always)]
fn slot(id: u32) -> usize {
    id as usize % SLOTS
}

/// What the slots go on with in this round.
struct Lists {
    nodes: List,
    leaves: List,
    done: List,
    /// Entries into instances and exits from them; among the leaves at first.
    passages: List,
}

/// Answers `rays` in waves; `answers` is as long.
pub(crate) struct Wave<'a, Q: Query, const N: usize> {
    pub bvh: &'a Bvh<N>,
    /// Memory of [`items`] items.
    pub items: &'a mut [Q::Item],
    pub query: Q,
    pub rays: &'a [Ray],
    pub answers: &'a mut [Q::Answer],
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

impl<Q: Query, const N: usize> WithSimd<N> for Wave<'_, Q, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let Self {
            bvh,
            items,
            mut query,
            rays,
            answers,
        } = self;
        let nodes = &bvh.nodes[..];
        let two_levels = !bvh.instances.is_empty();
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
        let mut lists = Lists {
            nodes: List::EMPTY,
            leaves: List::EMPTY,
            done: List::EMPTY,
            passages: List::EMPTY,
        };
        loop {
            lists.nodes.len = 0;
            lists.leaves.len = 0;
            lists.done.len = 0;
            lists.passages.len = 0;
            for id in 0..SLOTS {
                let mut stack = Stack::resume(items, id * stride, tops[id]);
                let child = stack.pop().child();
                next[id] = child.0;
                tops[id] = stack.top();
            }
            for (children, ids) in next.as_chunks().0.iter().zip(IDS.as_chunks().0) {
                let outer = <S as Width<LANES>>::Lanes::high_bits(simd, children);
                let done = <S as Width<LANES>>::Lanes::words_equal(simd, children, Child::DONE.0);
                lists.nodes.append(!outer, ids);
                lists.leaves.append(outer & !done, ids);
                lists.done.append(done, ids);
            }

            if two_levels {
                lists.leaves.sift(&next, &mut lists.passages);
                for &id in lists.passages.ids() {
                    prefetch_instance(simd, bvh, Child(next[slot(id)]));
                }
            }

            for &id in lists.done.ids() {
                let id = slot(id);
                if let Some(answer) = answers.get_mut(ray_indices[id]) {
                    *answer = Q::finish(&states[id]);
                    ray_indices[id] = usize::MAX;
                    in_flight -= 1;
                }
                // The stack is used up, even if nobody needs it now.
                tops[id] = id * stride + 1;
                while let Some(ray) = rays.get(coming) {
                    let index = coming;
                    coming += 1;
                    let state = query.begin(index, ray);
                    if setups[id].set(simd, ray, bvh.reach) {
                        states[id] = state;
                        ray_indices[id] = index;
                        next[id] = Child::ROOT.0;
                        lists.nodes.push(id);
                        in_flight += 1;
                        break;
                    }
                    answers[index] = Q::miss();
                }
            }
            if in_flight == 0 {
                return;
            }

            for &id in lists.passages.ids() {
                let id = slot(id);
                let ChildKind::Instance(index) = Child(next[id]).kind() else {
                    continue;
                };
                if next[id] == Child::EXIT.0 {
                    setups[id] = worlds[id];
                    query.exit(&mut states[id]);
                    continue;
                }
                let placed = &bvh.instances[index];
                worlds[id] = setups[id];
                match placed.placement.enter(simd, &worlds[id], &mut setups[id]) {
                    Some(stay) => {
                        query.enter(&mut states[id], bvh, index, stay);
                        let mut stack = Stack::resume(items, id * stride, tops[id]);
                        stack.push(Q::Item::unordered(Child::EXIT));
                        tops[id] = stack.top();
                        next[id] = Child::inner(placed.root as usize).0;
                        lists.nodes.push(id);
                    }
                    None => setups[id] = worlds[id],
                }
            }

            let mut coming_leaves = lists.leaves.ids().iter();
            for &id in lists.nodes.ids() {
                let id = slot(id);
                if let Some(&leaf) = coming_leaves.next() {
                    prefetch_leaf(simd, bvh, Child(next[slot(leaf)]));
                }
                let ray = &setups[id];
                let index = next[id] as usize;
                let node = &nodes[index];
                let limit = Q::limit(&states[id], ray);
                let (mask, entry) = NodeRay::<S, N>::new(simd, ray).step(simd, node, limit);
                let mut stack = Stack::resume(items, id * stride, tops[id]);
                query.push::<S, N>(&mut stack, index, node, mask, entry);
                tops[id] = stack.top();
            }

            for &id in lists.leaves.ids() {
                let id = slot(id);
                let ChildKind::Leaf(leaf) = Child(next[id]).kind() else {
                    continue;
                };
                let mut stack = Stack::resume(items, id * stride, tops[id]);
                query.leaf::<S, N, true>(&mut states[id], &mut stack, simd, bvh, leaf, &setups[id]);
                tops[id] = stack.top();
            }
        }
    }
}
