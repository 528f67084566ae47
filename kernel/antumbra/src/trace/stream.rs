//! Ray streams: many rays in flight on one thread, one step of each in turn.
//!
//! The steps of different rays do not depend on each other, so the CPU overlaps them: the latency of one
//! ray's step, its cache misses and its wrong guesses hide behind the work of the others. Every ray in flight has
//! a *slot* and a stack. A round goes through the phases of the table; words say which slots take part in a phase, a bit
//! per slot, so that no phase branches on the kind of a single child.
//!
//! | phase | slots | what happens |
//! |---|---|---|
//! | `pop`, `arrivals` | all | takes the next child; sorts the slots by its kind |
//! | `exit_instances` | at the end of an instance | the ray becomes what it was in the world |
//! | `hand_in` | done | hands in the answer and takes the next ray |
//! | `visit_nodes` | at nodes | one node step |
//! | `collect_cutouts` | at leaves of cut-outs | defers the hits, see [`crate::trace::deferred`] |
//! | `enter_instances` | at instances | makes the ray ready for the object and visits its root |
//! | `test_leaves` | at other leaves | finds the lanes that may be hit; occlusion without a condition is decided by that |
//! | `judge_leaves` | with such lanes, but for that | judges them, see [`crate::trace::judge`] |
//! | `settle_cutouts` | with deferred hits | judges these |
//!
//! A pop comes a whole round after the push it may depend on, when that has long been written. Instances and micromaps
//! are prefetched a phase or more before they are needed.
//!
//! A node is prefetched a few node steps before its own, a leaf during a node step of the same round. Prefetching pays
//! once the tree is larger than the caches. Prefetching all nodes at the beginning of the phase does not: what comes
//! early goes early. The figures are in `docs/src/performance.md`.

use antumbra_simd::{Lanes, Mask, Simd, Width, WithSimd};

use crate::geometry::QueryKind;
use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::ray_setup::RaySetup;
use crate::trace::condition::Condition;
use crate::trace::deferred::Deferred;
use crate::trace::judge::Owner;
use crate::trace::leaf_places::LeafPlaces;
use crate::trace::pick::Children;
use crate::trace::query::Query;
use crate::trace::ray_batch::RayBatch;
use crate::trace::stack::{Item, Stack, stack_size};
use crate::trace::step::{NodeTest, judge_lanes, leaf_lanes};
use crate::trace::view::{View, Views};
use crate::tree::node::{Child, ChildKind, Leaf};
use crate::tree::wide::WideTree;

/// Rays in flight in one stream.
const SLOTS: usize = 64;

/// Node steps between prefetching a node and testing it. A node prefetched much earlier does not stay in the first
/// cache.
const AHEAD: usize = 4;

/// Slots whose children are compared at once.
const LANES: usize = 16;

/// Some of the slots: bit `i` is slot `i`. Iterates over them.
#[derive(Clone, Copy)]
struct Slots(u64);

impl Slots {
    /// The first `count` slots, or all.
    #[inline(always)]
    fn first(count: usize) -> Self {
        match count {
            0..SLOTS => Self((1 << count) - 1),
            _ => Self(u64::MAX),
        }
    }

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

/// The block of cut-outs that a slot goes on with.
#[inline(always)]
fn block<'a, const N: usize>(
    bvh: &'a WideTree<'a, N>,
    next: &[u32; SLOTS],
    id: usize,
) -> &'a CutoutBlock {
    &bvh.blocks.cutouts[Child(next[id]).index()]
}

/// Answers rays in a stream; `answers` is as long.
pub(crate) struct Stream<'a, Q: Query, V, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    pub views: V,
    /// Memory of [`items`] items.
    pub items: &'a mut [Q::Item],
    /// Memory of [`SETUPS`] rays. What is in it does not matter.
    pub setups: &'a mut [RaySetup],
    pub batch: &'a RayBatch<'a>,
    /// Indices of the rays that are traced.
    pub pending: &'a [u32],
    pub answers: &'a mut [Q::Answer],
    /// Whether nodes and leaves are prefetched.
    pub prefetch: bool,
}

/// Rays made ready that a stream has memory for: one for each slot, as it is where it is now, and as it was in the world.
pub(crate) const SETUPS: usize = 2 * SLOTS;

/// Items that the stacks of a stream take together.
pub(crate) fn items(width: usize, depth: usize) -> usize {
    stride(stack_size(width, depth)) * SLOTS
}

/// Items between the stacks of two slots: a number of cache lines that is odd, so that the tops of many
/// stacks do not compete for the same sets of the cache.
fn stride(size: usize) -> usize {
    16 * (size.div_ceil(16) | 1)
}

impl<Q: Query, V: Views, const N: usize> WithSimd<N> for Stream<'_, Q, V, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let has_cutouts = !self.bvh.blocks.cutouts.is_empty();
        let has_instances = !self.bvh.instances.is_empty();
        let ([setups, worlds], _) = self.setups.as_chunks_mut::<SLOTS>() else {
            unreachable!("memory for two rays in each slot");
        };
        let mut flight = Flight::<S, Q, V, N> {
            simd,
            bvh: self.bvh,
            views: self.views,
            leaf_places: &LeafPlaces::new(self.bvh),
            prefetch: self.prefetch,
            batch: self.batch,
            pending: self.pending.iter(),
            answers: self.answers,
            items: self.items,
            stride: stride(stack_size(N, self.bvh.depth)),
            setups,
            worlds,
            ray_indices: &mut [usize::MAX; SLOTS],
            states: &mut [Q::IDLE; SLOTS],
            tops: &mut [0; SLOTS],
            next: &mut [Child::DONE.0; SLOTS],
            lanes: &mut [0; SLOTS],
            deferred: &mut Deferred::new(if has_cutouts { SLOTS } else { 0 }),
            live: Slots::first(self.pending.len()),
        };
        flight.empty_stacks();
        loop {
            flight.pop();
            let mut at = flight.arrivals(has_cutouts || has_instances);
            flight.exit_instances(at.exits);
            flight.hand_in(at.done, &mut at.nodes);
            if flight.live.0 == 0 {
                return;
            }
            flight.visit_nodes(at.nodes, Slots(at.leaves.0 | at.cutouts.0));
            if has_cutouts {
                flight.collect_cutouts(at.cutouts);
            }
            flight.enter_instances(at.entries);
            let waiting = flight.test_leaves(at.leaves);
            if Q::JUDGES {
                flight.judge_leaves(waiting);
            }
            flight.settle_cutouts();
        }
    }
}

/// The slots, sorted by the kind of their next child.
struct Arrivals {
    nodes: Slots,
    /// Slots at leaves of anything but cut-outs.
    leaves: Slots,
    cutouts: Slots,
    /// Slots at instances.
    entries: Slots,
    /// Slots at the end of an instance.
    exits: Slots,
    /// Slots whose ray is at its end, or that have none yet.
    done: Slots,
}

/// Settles a deferred hit by the condition of its ray. Whether the state has changed.
///
/// No method: the compiler keeps nothing of a stream in registers whose reference goes to a function that is not inlined.
#[inline(never)]
fn settle_when<Q: Query>(
    state: &mut Q::State,
    hit: &CutoutHit<'_>,
    ray: &RaySetup,
    filters: &Filters,
    owner: Owner<'_>,
) -> bool {
    owner.with(|condition| Q::settle(state, hit, ray, filters, condition))
}

/// A stream on its way. The arrays are separate variables behind references, so that the compiler sees that a write to
/// one of them does not change another.
struct Flight<'a, S, Q: Query, V, const N: usize> {
    simd: S,
    bvh: &'a WideTree<'a, N>,
    views: V,
    leaf_places: &'a LeafPlaces,
    prefetch: bool,
    batch: &'a RayBatch<'a>,
    /// Indices of the rays to come.
    pending: core::slice::Iter<'a, u32>,
    answers: &'a mut [Q::Answer],
    /// The stacks, one every `stride` items.
    items: &'a mut [Q::Item],
    stride: usize,
    /// Per slot: the ray.
    setups: &'a mut [RaySetup; SLOTS],
    /// Per slot: the ray as it was in the world, when it is in an instance.
    worlds: &'a mut [RaySetup; SLOTS],
    /// Per slot: which ray of the batch it is.
    ray_indices: &'a mut [usize; SLOTS],
    /// Per slot: what is known of the ray.
    states: &'a mut [Q::State; SLOTS],
    /// Per slot: the top of its stack.
    tops: &'a mut [u32; SLOTS],
    /// Per slot: the child that the ray goes on with.
    next: &'a mut [u32; SLOTS],
    /// Per slot: the lanes of its leaf that are left to be judged, as bits.
    lanes: &'a mut [u32; SLOTS],
    deferred: &'a mut Deferred,
    /// Slots that have a ray, or are to take one. The others are skipped: a few rays cost no more than they must.
    live: Slots,
}

impl<'a, S: Simd + Width<N>, Q: Query, V: Views, const N: usize> Flight<'a, S, Q, V, N> {
    #[inline(always)]
    fn empty_stacks(&mut self) {
        for id in self.live {
            self.tops[id] = Stack::new(self.items, id * self.stride).top();
        }
    }

    /// Every slot takes its next child.
    #[inline(always)]
    fn pop(&mut self) {
        if self.live.0 == u64::MAX {
            for id in 0..SLOTS {
                self.pop_of(id);
            }
        } else {
            for id in self.live {
                self.pop_of(id);
            }
        }
    }

    #[inline(always)]
    fn pop_of(&mut self, id: usize) {
        let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
        let child = stack.pop().child();
        self.next[id] = child.0;
        self.tops[id] = stack.top();
    }

    /// Sorts the slots by what they have come to. Instances are prefetched, as they are needed last.
    #[inline(always)]
    fn arrivals(&self, has_more_kinds: bool) -> Arrivals {
        let outer = self.at_least(Child::FIRST_OUTER);
        let done = self.at_least(Child::DONE);
        let mut at = Arrivals {
            nodes: Slots(self.live.0 & !outer),
            leaves: Slots(outer & !done),
            cutouts: Slots(0),
            entries: Slots(0),
            exits: Slots(0),
            done: Slots(done),
        };
        if has_more_kinds {
            let beyond_leaves = self.at_least(Child::FIRST_CUTOUTS);
            let passages = self.at_least(Child::FIRST_INSTANCE);
            let exits = self.at_least(Child::EXIT);
            at.leaves = Slots(outer & !beyond_leaves);
            at.cutouts = Slots(beyond_leaves & !passages);
            at.entries = Slots(passages & !exits);
            at.exits = Slots(exits & !done);
            for id in at.entries {
                let instance = &self.bvh.instances[Child(self.next[id]).index()];
                self.simd.prefetch(instance);
            }
        }
        at
    }

    /// The slots that go on with this child or one of a higher number.
    #[inline(always)]
    fn at_least(&self, child: Child) -> u64 {
        let mut slots = 0;
        let used = SLOTS - self.live.0.leading_zeros() as usize;
        let chunks = &self.next.as_chunks().0[..used.div_ceil(LANES)];
        for (chunk, children) in chunks.iter().enumerate() {
            let is_there = <S as Width<LANES>>::Lanes::words_at_least(self.simd, children, child.0);
            slots |= u64::from(is_there.bits()) << (LANES * chunk);
        }
        slots & self.live.0
    }

    /// Rays that leave an instance become what they were in the world.
    #[inline(always)]
    fn exit_instances(&mut self, slots: Slots) {
        for id in slots {
            self.setups[id] = self.worlds[id];
            Q::exit(&mut self.states[id]);
        }
    }

    /// Slots that are done hand in their answers and take the next rays, which begin at the root.
    #[inline(always)]
    fn hand_in(&mut self, done: Slots, nodes: &mut Slots) {
        for id in done {
            if let Some(answer) = self.answers.get_mut(self.ray_indices[id]) {
                *answer = Q::finish(&self.states[id]);
                Q::report(&self.states[id], self.batch, self.ray_indices[id]);
                self.ray_indices[id] = usize::MAX;
            }
            let mut is_used_up = true;
            // The stack is used up.
            self.tops[id] = (id * self.stride) as u32 + 1;
            for &index in self.pending.by_ref() {
                let index = index as usize;
                let ray = &self.batch.rays[index];
                if self.setups[id].set(self.simd, ray, self.bvh.reach) {
                    self.states[id] = Q::begin(ray);
                    self.ray_indices[id] = index;
                    self.next[id] = Child::ROOT.0;
                    nodes.add(id);
                    is_used_up = false;
                    break;
                }
                self.answers[index] = Q::miss();
            }
            self.live.0 &= !(u64::from(is_used_up) << id);
        }
    }

    /// One node step for every slot that has come to a node. Meanwhile `leaves` are prefetched, and nodes that are soon
    /// to be visited.
    #[inline(always)]
    fn visit_nodes(&mut self, nodes: Slots, leaves: Slots) {
        let (mut coming_leaves, mut coming_nodes) = if self.prefetch {
            (leaves, nodes)
        } else {
            (Slots(0), Slots(0))
        };
        for id in coming_nodes.by_ref().take(AHEAD) {
            self.prefetch_node(id);
        }
        for id in nodes {
            if let Some(coming) = coming_nodes.next() {
                self.prefetch_node(coming);
            }
            if let Some(leaf) = coming_leaves.next() {
                self.leaf_places.prefetch(self.simd, Child(self.next[leaf]));
            }
            self.visit_node(id, self.next[id] as usize);
        }
    }

    /// How the ray of a slot sees the tree.
    #[inline(always)]
    fn view(&self, id: usize) -> V::View {
        self.views.of(self.ray_indices[id])
    }

    #[inline(always)]
    fn prefetch_node(&self, id: usize) {
        V::View::prefetch(self.simd, self.bvh, self.next[id] as usize);
    }

    /// A node step: tests the children of node `index` and pushes those that are hit.
    #[inline(always)]
    fn visit_node(&mut self, id: usize, index: usize) {
        let view = self.view(id);
        let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
        let (node, ray) = (&self.bvh.nodes[index], &self.setups[id]);
        let limit = Q::limit(&self.states[id], ray);
        let test = NodeTest::<S, N>::new(self.simd, ray);
        let (mask, entry) = view.step(self.simd, self.bvh, index, &test, limit);
        Q::Item::push(&mut stack, node, mask, entry);
        self.tops[id] = stack.top();
    }

    /// Leaves of cut-outs are tested. Their hits are deferred, and the micromaps that decide whether these count are
    /// prefetched.
    #[inline(always)]
    fn collect_cutouts(&mut self, slots: Slots) {
        for id in slots {
            let block = block(self.bvh, self.next, id);
            let ray = &self.setups[id];
            let found = match Q::KIND {
                QueryKind::Occluded => block.triangles.vector_occluders(self.simd, ray),
                QueryKind::Intersect => {
                    let limit = Q::limit(&self.states[id], ray);
                    block.triangles.vector_hits(self.simd, ray, limit)
                }
            };
            self.deferred.add(id, &found);
        }
        self.deferred.look_up(self.simd, &self.bvh.filters, |id| {
            block(self.bvh, self.next, id)
        });
    }

    /// Rays that enter an instance are made ready for the object and visit its root at once, for many miss all that it
    /// holds.
    #[inline(always)]
    fn enter_instances(&mut self, slots: Slots) {
        for id in slots {
            let index = Child(self.next[id]).index();
            let placed = &self.bvh.instances[index];
            self.worlds[id] = self.setups[id];
            let (view, owner, inst_id) = (self.view(id), self.owner(id), placed.placement.inst_id);
            let (world, object) = (&self.worlds[id], &mut self.setups[id]);
            let enters = !Q::CONDITIONAL || owner.enters(inst_id);
            let entered = match enters {
                true => view.place(self.simd, self.bvh, index, world, object),
                false => None,
            };
            match entered {
                Some(interval) => {
                    Q::enter(&mut self.states[id], inst_id, index, interval);
                    let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
                    stack.push(Q::Item::unordered(Child::EXIT));
                    self.tops[id] = stack.top();
                    self.visit_node(id, placed.root as usize);
                }
                None => self.setups[id] = self.worlds[id],
            }
        }
    }

    /// The first half of a leaf step for every slot that has come to a leaf of anything but cut-outs. Returns the slots in which
    /// lanes are left to be judged.
    #[inline(always)]
    fn test_leaves(&mut self, slots: Slots) -> Slots {
        let mut waiting = Slots(0);
        for id in slots {
            let seen = (self.bvh.tree, self.view(id));
            let (state, ray) = (&self.states[id], &self.setups[id]);
            // Known last, so that nothing stands between it and what is done by its kind.
            let Some(leaf) = self.leaf(id) else {
                continue;
            };
            let lanes = leaf_lanes::<S, Q, _, true>(state, self.simd, seen, leaf, ray);
            if Q::JUDGES {
                self.lanes[id] = lanes;
                waiting.0 |= u64::from(lanes != 0) << id;
            } else {
                self.prune(id, lanes != 0);
            }
        }
        waiting
    }

    /// The second half: judges the lanes that are left.
    #[inline(always)]
    fn judge_leaves(&mut self, slots: Slots) {
        for id in slots {
            let Some(leaf) = self.leaf(id) else {
                continue;
            };
            let (seen, owner) = ((self.bvh.tree, self.view(id)), self.owner(id));
            let at = (leaf, self.lanes[id]);
            let (state, ray) = (&mut self.states[id], &self.setups[id]);
            let changed = judge_lanes::<S, Q, _>(state, self.simd, seen, at, ray, owner);
            self.prune(id, changed);
        }
    }

    /// The ray of a slot, as the owner of its condition.
    #[inline(always)]
    fn owner(&self, id: usize) -> Owner<'a> {
        Owner {
            batch: Q::CONDITIONAL.then_some(self.batch),
            index: self.ray_indices[id],
        }
    }

    /// Drops from the stack of a slot what its leaf has made needless.
    #[inline(always)]
    fn prune(&mut self, id: usize, changed: bool) {
        let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
        let leaf = Child(self.next[id]);
        Q::prune(&mut self.states[id], &mut stack, self.simd, leaf, changed);
        self.tops[id] = stack.top();
    }

    /// The leaf to which a slot has come.
    #[inline(always)]
    fn leaf(&self, id: usize) -> Option<Leaf> {
        match Child(self.next[id]).kind() {
            ChildKind::Leaf(leaf) => Some(leaf),
            _ => None,
        }
    }

    /// Judges the deferred hits.
    #[inline(always)]
    fn settle_cutouts(&mut self) {
        for index in 0..self.deferred.clear() {
            let (id, hit) = self
                .deferred
                .get(index, |id| block(self.bvh, self.next, id));
            let owner = self.owner(id);
            let (state, ray) = (&mut self.states[id], &self.setups[id]);
            let filters = &self.bvh.filters;
            let changed = match Q::CONDITIONAL {
                false => Q::settle(state, &hit, ray, filters, &Condition::NONE),
                true => settle_when::<Q>(state, &hit, ray, filters, owner),
            };
            self.prune(id, changed);
        }
    }
}
