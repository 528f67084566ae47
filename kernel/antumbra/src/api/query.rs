//! How every query reaches the traversal that answers it.

use alloc::vec;
use alloc::vec::Vec;

use antumbra_simd::Level;

use super::batch::CHUNK;
use super::bvh::Bvh;
use super::moving::Moment;
use crate::geometry::ray_setup::RaySetup;
use crate::learn::ray_log::{Following, RayLog};
use crate::ray::{Hit, Ray};
use crate::trace::closest_with_leaf::closest_with_leaf;
use crate::trace::engine::{Streams, Table, Traces};
use crate::trace::memory::{Memory, Stored};
use crate::trace::observe::{Cost, Counting, Nothing, Observer};
use crate::trace::packet::PacketQuery;
use crate::trace::pick::Pick;
use crate::trace::query::{Closest, Occlusion, StreamQuery};
use crate::trace::ray_batch::RayBatch;
use crate::trace::stack::stack_size;
use crate::trace::stream;
use crate::trace::view::on_view;
use crate::tree::any::on_tree;

/// Fewer rays than this are not worth a stream.
pub(super) const FEW: usize = 12;

impl Bvh {
    /// Follows rays to their ends, whatever they hit on the way, and logs the boxes and occluders that they hit.
    pub(crate) fn follow(&self, rays: &[Ray], log: &mut RayLog) {
        let mut occluded = vec![false; rays.len()];
        self.observe(Pick::Slots, &mut Following::new(log), rays, &mut occluded);
    }

    /// Occlusion of many rays, in a stream or ray by ray, whichever is faster for this number.
    pub(crate) fn occluded_many(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        occluded: &mut [bool],
    ) {
        assert_eq!(batch.rays.len(), occluded.len(), "one answer per ray");
        if self.is_worth_a_stream(batch.rays.len()) && self.tree.pick.is_none() {
            return self.many::<Occlusion>(memory, batch, occluded);
        }
        if !batch.decides() {
            return self.occluded_each(memory, batch, occluded);
        }
        for (index, occluded) in occluded.iter_mut().enumerate() {
            let (ray, moment) = (&batch.rays[index], self.moment_of(batch, index));
            let occluder =
                batch.with_condition(index, |condition| moment.occluder_when(ray, condition));
            *occluded = occluder.is_some();
            if let Some(occluder) = occluder {
                batch.report_occluder(index, occluder);
            }
        }
    }

    /// Closest hits of many rays, in a stream or ray by ray, whichever is faster for this number.
    pub(crate) fn intersect_many(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        hits: &mut [Option<Hit>],
    ) {
        assert_eq!(batch.rays.len(), hits.len(), "one answer per ray");
        if self.is_worth_a_stream(batch.rays.len()) {
            return self.many::<Closest>(memory, batch, hits);
        }
        if batch.reports_surfaces() {
            return match self.isa().level() {
                Level::Scalar => self.closest_with_leaves(memory, batch, hits),
                // Streams report leaves, single rays do not.
                _ => self.many::<Closest>(memory, batch, hits),
            };
        }
        self.each::<Closest>(memory, batch, hits);
        if batch.decides() {
            for (index, hit) in hits.iter_mut().enumerate() {
                let (ray, moment) = (&batch.rays[index], self.moment_of(batch, index));
                *hit = batch
                    .with_condition(index, |condition| moment.closest_when(ray, condition, *hit));
            }
        }
    }

    /// Closest hits ray by ray, with reports of their leaves.
    fn closest_with_leaves(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        hits: &mut [Option<Hit>],
    ) {
        let stack: &mut [u64] =
            Stored::at_least(memory, stack_size(self.width().lanes(), self.depth()));
        for (index, (ray, hit)) in batch.rays.iter().zip(hits).enumerate() {
            let found = batch.with_condition(index, |condition| {
                on_tree!(&self.tree, bvh => on_view!(batch.share(index), view => {
                    closest_with_leaf((bvh, view), stack, ray, condition)
                }))
            });
            *hit = found.map(|found| found.hit.told());
            if let Some(found) = found {
                batch.report_surface(index, &found);
            }
        }
    }

    /// Whether this many rays are answered sooner in a stream. Without vectors a step is long enough to fill the CPU by
    /// itself: ray by ray is 1.3 times as fast (sponza, 4 wide).
    pub(super) fn is_worth_a_stream(&self, rays: usize) -> bool {
        rays >= FEW && self.isa().level() != Level::Scalar
    }

    /// Occlusion ray by ray.
    pub(crate) fn occluded_each(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        occluded: &mut [bool],
    ) {
        match self.tree.pick {
            None => self.each::<Occlusion>(memory, batch, occluded),
            Some(_) => self.instrumented(memory, Pick::Rule, &mut Nothing, batch.rays, occluded),
        }
    }

    /// Occlusion ray by ray in any order, with an observer.
    pub(crate) fn observe(
        &self,
        pick: Pick,
        observer: &mut dyn Observer,
        rays: &[Ray],
        occluded: &mut [bool],
    ) {
        self.pool
            .with(|memory| self.instrumented(memory, pick, observer, rays, occluded));
    }

    fn instrumented(
        &self,
        memory: &mut Memory,
        pick: Pick,
        observer: &mut dyn Observer,
        rays: &[Ray],
        answers: &mut [bool],
    ) {
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        let (stack, observer) = (&mut memory.open, (pick, observer));
        (self.engine.0).observe(&self.tree, stack, observer, rays, answers);
    }

    /// A query of many rays: first in packets, then in streams what these leave over.
    fn many<Q: PacketQuery<Item: Stored>>(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        answers: &mut [Q::Answer],
    ) where
        dyn Table: Traces<Q>,
    {
        let mut pending = core::mem::take(&mut memory.pending);
        // The list of pending rays stays in the cache.
        for (index, answers) in answers.chunks_mut(CHUNK).enumerate() {
            let first = index * CHUNK;
            let batch = &batch.part(first..first + answers.len());
            pending.clear();
            self.packets::<Q>(memory, batch, answers, &mut pending);
            if !pending.is_empty() {
                self.stream::<Q>(memory, batch, &pending, answers);
            }
        }
        memory.pending = pending;
    }

    /// Answers the rays that go in packets; the others become pending, and so do all that look at times.
    fn packets<Q: PacketQuery<Item: Stored>>(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        answers: &mut [Q::Answer],
        pending: &mut Vec<u32>,
    ) where
        dyn Table: Traces<Q>,
    {
        if batch.shares().is_some() {
            return pending.extend(0..batch.rays.len() as u32);
        }
        let stack = Stored::at_least(memory, stack_size(self.width().lanes(), self.depth()));
        (self.engine.0).packets(&self.tree, stack, batch, answers, pending);
    }

    /// Answers the pending rays in a stream.
    pub(super) fn stream<Q: PacketQuery<Item: Stored>>(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        pending: &[u32],
        answers: &mut [Q::Answer],
    ) where
        dyn Table: Traces<Q>,
    {
        if batch.decides() || batch.reports_surfaces() {
            return self.careful_stream::<Q>(memory, batch, pending, answers);
        }
        self.with_stream(memory, |memory, prefetch| {
            (self.engine.0).plain_stream(&self.tree, memory, batch, pending, answers, prefetch);
        });
    }

    /// Answers the pending rays in a stream that decides about every hit and notes leaves.
    pub(super) fn careful_stream<Q: StreamQuery<Item: Stored>>(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        pending: &[u32],
        answers: &mut [Q::Answer],
    ) where
        dyn Table: Streams<Q>,
    {
        self.with_stream(memory, |memory, prefetch| {
            (self.engine.0).careful_stream(&self.tree, memory, batch, pending, answers, prefetch);
        });
    }

    /// Runs `work` with memory of a stream, and whether it prefetches.
    fn with_stream<T: Stored>(
        &self,
        memory: &mut Memory,
        work: impl FnOnce((&mut [T], &mut [RaySetup]), bool),
    ) {
        let mut setups = core::mem::take(&mut memory.setups);
        setups.resize(stream::SETUPS, RaySetup::IDLE);
        let items = T::at_least(memory, stream::items(self.width().lanes(), self.depth()));
        work((items, &mut setups), self.prefetches());
        memory.setups = setups;
    }

    /// A plain query, ray by ray.
    pub(crate) fn each<Q: PacketQuery<Item: Stored>>(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        answers: &mut [Q::Answer],
    ) where
        dyn Table: Traces<Q>,
    {
        let rays = batch.rays;
        assert_eq!(rays.len(), answers.len(), "one answer per ray");
        let stack = Stored::at_least(memory, stack_size(self.width().lanes(), self.depth()));
        (self.engine.0).each(&self.tree, batch.shares(), stack, rays, answers);
    }

    /// This tree as a ray of a batch looks at it.
    pub(super) fn moment_of(&self, batch: &RayBatch<'_>, index: usize) -> Moment<'_> {
        Moment {
            bvh: self,
            share: batch.share(index),
        }
    }

    pub(crate) fn counting<'a>(&self, costs: &'a mut [Cost]) -> Counting<'a> {
        Counting::new(costs, self.tree.top_nodes())
    }

    pub(super) fn depth(&self) -> usize {
        self.tree.depth
    }
}
