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
use crate::trace::engine::{Each, Packs, Streams, Table};
use crate::trace::memory::{Memory, Stored};
use crate::trace::observe::{Cost, Counting, Nothing, Observer};
use crate::trace::packet::PacketQuery;
use crate::trace::pick::Pick;
use crate::trace::query::{Closest, Located, Occluder, Occlusion, Query};
use crate::trace::ray_batch::RayBatch;
use crate::trace::stack::stack_size;
use crate::trace::stream;

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
        let goes_together = self.is_worth_a_stream(batch.rays.len()) && self.tree.pick.is_none();
        match (goes_together, batch.is_conditional()) {
            (true, false) => self.many::<Occlusion, Occlusion>(memory, batch, occluded),
            (true, true) => self.many::<Occlusion, Occluder>(memory, batch, occluded),
            (false, false) => self.occluded_each(memory, batch, occluded),
            (false, true) => self.each::<Occluder>(memory, batch, occluded),
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
        let goes_together = self.is_worth_a_stream(batch.rays.len());
        match (
            goes_together,
            batch.is_conditional(),
            batch.reports_surfaces(),
        ) {
            (true, false, false) => self.many::<Closest, Closest>(memory, batch, hits),
            (true, false, true) => self.many::<Closest, Located<false>>(memory, batch, hits),
            (true, true, _) => self.many::<Closest, Located<true>>(memory, batch, hits),
            (false, false, false) => self.each::<Closest>(memory, batch, hits),
            (false, ..) => self.each::<Located<true>>(memory, batch, hits),
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

    /// A query of many rays: `Q` first in packets, then `R` in streams of what these leave over.
    fn many<Q: PacketQuery<Item: Stored>, R: Query<Item: Stored, Answer = Q::Answer>>(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        answers: &mut [Q::Answer],
    ) where
        dyn Table: Packs<Q> + Streams<R>,
    {
        let mut pending = core::mem::take(&mut memory.pending);
        // The list of pending rays stays in the cache.
        for (index, answers) in answers.chunks_mut(CHUNK).enumerate() {
            let first = index * CHUNK;
            let batch = &batch.part(first..first + answers.len());
            pending.clear();
            self.packets::<Q>(memory, batch, answers, &mut pending);
            if !pending.is_empty() {
                self.stream::<R>(memory, batch, &pending, answers);
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
        dyn Table: Packs<Q>,
    {
        if batch.shares().is_some() {
            return pending.extend(0..batch.rays.len() as u32);
        }
        let stack = Stored::at_least(memory, stack_size(self.width().lanes(), self.depth()));
        (self.engine.0).packets(&self.tree, stack, batch, answers, pending);
    }

    /// Answers the pending rays in a stream.
    pub(super) fn stream<Q: Query<Item: Stored>>(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        pending: &[u32],
        answers: &mut [Q::Answer],
    ) where
        dyn Table: Streams<Q>,
    {
        let mut setups = core::mem::take(&mut memory.setups);
        setups.resize(stream::SETUPS, RaySetup::IDLE);
        let items = Stored::at_least(memory, stream::items(self.width().lanes(), self.depth()));
        let (room, prefetch) = ((items, &mut setups[..]), self.prefetches());
        (self.engine.0).stream(&self.tree, room, batch, pending, answers, prefetch);
        memory.setups = setups;
    }

    /// A query ray by ray.
    fn each<Q: Query<Item: Stored>>(
        &self,
        memory: &mut Memory,
        batch: &RayBatch<'_>,
        answers: &mut [Q::Answer],
    ) where
        dyn Table: Each<Q>,
    {
        assert_eq!(batch.rays.len(), answers.len(), "one answer per ray");
        let stack = Stored::at_least(memory, stack_size(self.width().lanes(), self.depth()));
        (self.engine.0).each(&self.tree, stack, batch.rays, Some(batch), answers);
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
