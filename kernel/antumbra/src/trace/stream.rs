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
//! | `test_leaves` | at other leaves | one leaf step |
//! | `confirm_hits` | at leaves with candidates | computes the distances of closest hits |
//! | `settle_cutouts` | with deferred hits | decides whether they count |
//!
//! A pop comes a whole round after the push it may depend on, when that has long been written. Instances and micromaps
//! are prefetched a phase or more before they are needed.
//!
//! A node is prefetched a few node steps before its own, a leaf during a node step of the same round. Prefetching pays
//! once the tree is larger than the caches. Prefetching all nodes at the beginning of the phase does not: what comes
//! early goes early. The figures are in `docs/src/performance.md`.

use antumbra_simd::{Lanes, Mask, Simd, Width, WithSimd};

use crate::geometry::QueryKind;
use crate::geometry::cutout::{CutoutBlock, Filters};
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::{LanesOf, TriangleBlock};
use crate::trace::condition::Condition;
use crate::trace::conditional::{named, reported};
use crate::trace::deferred::Deferred;
use crate::trace::leaf_places::LeafPlaces;
use crate::trace::pick::Children;
use crate::trace::query::StreamQuery;
use crate::trace::ray_batch::{LocatedHit, RayBatch};
use crate::trace::stack::{Item, Stack, stack_size};
use crate::trace::step::NodeTest;
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

/// Answers rays in a stream; `answers` is as long. A `CAREFUL` stream decides about every hit, or notes the leaves of hits.
pub(crate) struct Stream<'a, Q: StreamQuery, V, const N: usize, const CAREFUL: bool> {
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

impl<Q: StreamQuery, V: Views, const N: usize, const CAREFUL: bool> WithSimd<N>
    for Stream<'_, Q, V, N, CAREFUL>
{
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let has_cutouts = !self.bvh.blocks.cutouts.is_empty();
        let has_instances = !self.bvh.instances.is_empty();
        let ([setups, worlds], _) = self.setups.as_chunks_mut::<SLOTS>() else {
            unreachable!("memory for two rays in each slot");
        };
        let mut flight = Flight::<S, Q, V, N, CAREFUL> {
            simd,
            bvh: self.bvh,
            views: self.views,
            leaf_places: &LeafPlaces::new(self.bvh),
            prefetch: self.prefetch,
            batch: self.batch,
            decides: CAREFUL && self.batch.decides(),
            by_name: CAREFUL && self.batch.decides_by_name(),
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
            spaces: &mut [Space::WORLD; SLOTS],
            leaves: &mut [(Child::EMPTY, LocatedHit::WORLD); SLOTS],
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
            let undecided = flight.test_leaves(at.leaves);
            if CAREFUL && flight.decides {
                for id in undecided {
                    flight.confirm_leaf(id);
                }
            } else if Q::CONFIRMS {
                flight.confirm_hits(undecided);
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

/// The instance where a ray is, or the world.
#[derive(Clone, Copy)]
struct Space {
    interval: Interval,
    /// Index of the instance, or [`LocatedHit::WORLD`].
    instance: u32,
}

impl Space {
    const WORLD: Self = Self {
        interval: Interval::WORLD,
        instance: LocatedHit::WORLD,
    };
}

/// Decides which lanes of a leaf fulfil the condition of their ray. Returns whether the ray goes on with a better hit.
///
/// No method: the compiler keeps nothing of a stream in registers whose reference goes to a function that is not inlined.
#[inline(never)]
fn confirm_when<Q: StreamQuery, V: View, const N: usize>(
    (bvh, view): (&WideTree<N>, V),
    (batch, index): (&RayBatch<'_>, usize),
    (child, lanes): (Child, u32),
    ray: (&RaySetup, Interval),
    (state, stack): (&mut Q::State, &mut Stack<'_, Q::Item>),
) -> bool {
    let ChildKind::Leaf(leaf) = child.kind() else {
        return false;
    };
    let (improved, occluder) = batch.with_condition(index, |condition| {
        Q::confirm_when(state, stack, (bvh, view), (leaf, lanes), ray, condition)
    });
    if let Some(occluder) = occluder {
        batch.report_occluder(index, occluder);
    }
    improved
}

/// Whether the filter of a batch accepts the hit on a triangle that may count.
#[inline(never)]
fn accepts(
    (batch, index): (&RayBatch<'_>, usize),
    (block, lane): (&TriangleBlock, usize),
    (ray, interval): (&RaySetup, Interval),
    filters: &Filters,
) -> bool {
    let hit = block.hit(lane, ray, filters, QueryKind::Occluded);
    hit.is_some_and(|hit| batch.accepts(index, &reported(hit, ray, interval)))
}

/// Reports the hit of a ray.
#[inline(never)]
fn report_surface<Q: StreamQuery>(
    batch: &RayBatch<'_>,
    index: usize,
    state: &Q::State,
    (leaf, instance): (Child, u32),
) {
    if let Some(hit) = Q::hit(state) {
        let found = LocatedHit {
            hit,
            leaf,
            instance,
        };
        batch.report_surface(index, &found);
    }
}

/// A stream on its way. The arrays are separate variables behind references, so that the compiler sees that a write to
/// one of them does not change another.
struct Flight<'a, S, Q: StreamQuery, V, const N: usize, const CAREFUL: bool> {
    simd: S,
    bvh: &'a WideTree<'a, N>,
    views: V,
    leaf_places: &'a LeafPlaces,
    prefetch: bool,
    batch: &'a RayBatch<'a>,
    /// Whether the stream decides about every hit.
    decides: bool,
    /// Whether it decides by which primitive it is.
    by_name: bool,
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
    /// Per slot: the lanes of its leaf that are left to be confirmed, as bits.
    lanes: &'a mut [u32; SLOTS],
    /// Per slot: the instance where the ray is, or the world.
    spaces: &'a mut [Space; SLOTS],
    /// Per slot: the leaf of the best hit, and the index of its instance.
    leaves: &'a mut [(Child, u32); SLOTS],
    deferred: &'a mut Deferred,
    /// Slots that have a ray, or are to take one. The others are skipped: a few rays cost no more than they must.
    live: Slots,
}

impl<S: Simd + Width<N>, Q: StreamQuery, V: Views, const N: usize, const CAREFUL: bool>
    Flight<'_, S, Q, V, N, CAREFUL>
{
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
            if CAREFUL {
                self.spaces[id] = Space::WORLD;
            }
            Q::exit(&mut self.states[id]);
        }
    }

    /// Slots that are done hand in their answers and take the next rays, which begin at the root.
    #[inline(always)]
    fn hand_in(&mut self, done: Slots, nodes: &mut Slots) {
        for id in done {
            if let Some(answer) = self.answers.get_mut(self.ray_indices[id]) {
                *answer = Q::finish(&self.states[id]);
                if CAREFUL && Q::CONFIRMS && self.batch.reports_surfaces() {
                    let index = self.ray_indices[id];
                    report_surface::<Q>(self.batch, index, &self.states[id], self.leaves[id]);
                }
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
                    if CAREFUL {
                        self.spaces[id] = Space::WORLD;
                    }
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
            let found = Q::cutout_hits(&self.states[id], self.simd, block, &self.setups[id]);
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
            let view = self.view(id);
            let (world, object) = (&self.worlds[id], &mut self.setups[id]);
            let inst_id = placed.placement.inst_id;
            let may_count = |condition: &Condition<'_>| condition.enters(inst_id);
            let enters =
                !self.decides || (self.batch).with_condition(self.ray_indices[id], may_count);
            let entered = match enters {
                true => view.place(self.simd, self.bvh, index, world, object),
                false => None,
            };
            match entered {
                Some(interval) => {
                    Q::enter(&mut self.states[id], self.bvh, index, interval);
                    if CAREFUL {
                        self.spaces[id] = Space {
                            interval,
                            instance: index as u32,
                        };
                    }
                    let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
                    stack.push(Q::Item::unordered(Child::EXIT));
                    self.tops[id] = stack.top();
                    self.visit_node(id, placed.root as usize);
                }
                None => self.setups[id] = self.worlds[id],
            }
        }
    }

    /// One leaf step for every slot that has come to a leaf of anything but cut-outs. Returns the slots in
    /// which lanes are left to be confirmed.
    #[inline(always)]
    fn test_leaves(&mut self, slots: Slots) -> Slots {
        let mut undecided = Slots(0);
        for id in slots {
            let Some(leaf) = self.leaf(id) else {
                continue;
            };
            let (simd, view) = (self.simd, self.view(id));
            let decides = CAREFUL && self.decides;
            let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
            let (state, ray) = (&mut self.states[id], &self.setups[id]);
            let left =
                Q::leaf_in_stream(state, &mut stack, simd, self.bvh, view, leaf, ray, decides);
            self.tops[id] = stack.top();
            self.lanes[id] = left;
            undecided.0 |= u64::from(left != 0) << id;
        }
        undecided
    }

    /// Decides about the lanes that are left.
    #[inline(always)]
    fn confirm_hits(&mut self, slots: Slots) {
        for id in slots {
            let Some(leaf) = self.leaf(id) else {
                continue;
            };
            let (at, view) = ((leaf, self.lanes[id]), self.view(id));
            let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
            let (state, ray) = (&mut self.states[id], &self.setups[id]);
            let improved = Q::confirm(state, &mut stack, self.simd, self.bvh, view, at, ray);
            self.tops[id] = stack.top();
            if CAREFUL && improved {
                self.note_leaf(id);
            }
        }
    }

    /// Decides which lanes of a leaf that are left fulfil the condition of their ray. Occlusion by triangles is decided
    /// in this function, because they are surely hit, anything else in `confirm_when`.
    #[inline(always)]
    fn confirm_leaf(&mut self, id: usize) {
        let lanes = self.lanes[id];
        let block = match self.leaf(id) {
            Some(leaf) if !Q::CONFIRMS && leaf.kind == PrimKind::Triangle => {
                self.view(id).triangles(self.simd, self.bvh, leaf.index)
            }
            _ => return self.confirm_when(id, lanes),
        };
        let index = self.ray_indices[id];
        for lane in LanesOf(lanes) {
            let occluder = named(block.id(lane), &self.setups[id]);
            if self.batch.may_count(index, occluder)
                && (self.by_name || {
                    let ray = (&self.setups[id], self.spaces[id].interval);
                    accepts((self.batch, index), (&block, lane), ray, &self.bvh.filters)
                })
            {
                let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
                Q::occlude(&mut self.states[id], &mut stack);
                self.tops[id] = stack.top();
                self.batch.report_occluder(index, occluder);
                return;
            }
        }
    }

    /// Decides which of these lanes of the leaf of a slot fulfil the condition of its ray.
    #[inline(always)]
    fn confirm_when(&mut self, id: usize, lanes: u32) {
        let (child, view) = (Child(self.next[id]), self.view(id));
        let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
        let (state, index) = (&mut self.states[id], self.ray_indices[id]);
        let ray = (&self.setups[id], self.spaces[id].interval);
        let improved = confirm_when::<Q, _, N>(
            (self.bvh, view),
            (self.batch, index),
            (child, lanes),
            ray,
            (state, &mut stack),
        );
        self.tops[id] = stack.top();
        if improved {
            self.note_leaf(id);
        }
    }

    /// The best hit of a slot is in the leaf where it is.
    #[inline(always)]
    fn note_leaf(&mut self, id: usize) {
        self.leaves[id] = (Child(self.next[id]), self.spaces[id].instance);
    }

    /// The leaf of anything but cut-outs to which a slot has come.
    #[inline(always)]
    fn leaf(&self, id: usize) -> Option<Leaf> {
        match Child(self.next[id]).kind() {
            ChildKind::Leaf(leaf) if leaf.kind != PrimKind::Cutout => Some(leaf),
            _ => None,
        }
    }

    /// Decides about the deferred hits.
    #[inline(always)]
    fn settle_cutouts(&mut self) {
        for index in 0..self.deferred.clear() {
            let (id, hit) = self
                .deferred
                .get(index, |id| block(self.bvh, self.next, id));
            if CAREFUL && self.decides {
                self.confirm_when(id, 1 << hit.lane);
                continue;
            }
            let mut stack = Stack::resume(self.items, id * self.stride, self.tops[id]);
            let (state, ray) = (&mut self.states[id], &self.setups[id]);
            let improved = Q::settle(state, &mut stack, self.simd, &hit, ray, &self.bvh.filters);
            self.tops[id] = stack.top();
            if CAREFUL && improved {
                self.note_leaf(id);
            }
        }
    }
}
