//! Visits of the hits of many rays, with a state for each ray.

use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use core::ops::Range;
use core::sync::atomic::{AtomicUsize, Ordering};

use super::batch::Batch;
use super::bvh::Bvh;
use crate::geometry::best::TreeHit;
use crate::parallel::for_each;
use crate::ray::{Hit, Ray};
use crate::trace::memory::Memory;
use crate::trace::ray_batch::{LocatedHit, RayBatch, Report};
use crate::trace::ray_sort::Key;
use crate::trace::several::{Nearest, NearestHits};
use crate::trace::visit::Visit;

/// Rays that one thread takes at a time.
const CHUNK: usize = 1 << 12;

impl Batch<'_> {
    /// Calls `visit` with the hits of each ray, front to back, and with the state of the ray: `states[i]` belongs to ray `i`.
    /// Hits come as in [`RayQuery::visit_hits`](crate::RayQuery::visit_hits), until the closure accepts one or stops.
    ///
    /// Rays go together: first to their closest hits, then those whose hit is rejected to their next eight. Where rays have
    /// many hits, they begin with eight. Rays are traced in the order given.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe, Visit};
    /// let triangle = |z| vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
    /// let panes = [1.0, 2.0].map(|z| Geometry::triangles(triangle(z), vec![[0, 1, 2]]));
    /// let bvh = Bvh::build(&panes, &Recipe::default())?;
    /// let rays = [0.0, 1.5, 9.0].map(|z| Ray::new([0.2, 0.2, z], [0.0, 0.0, 1.0]));
    /// let mut light = [1.0; 3];
    /// bvh.batch(&rays).visit_hits(&mut light, |light, _| {
    ///     *light *= 0.5;
    ///     Visit::Reject
    /// });
    /// assert_eq!(light, [0.25, 0.5, 1.0]);
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Panics
    /// If there are not as many states as rays.
    pub fn visit_hits<T: Send>(
        self,
        states: &mut [T],
        visit: impl Fn(&mut T, Hit) -> Visit + Sync,
    ) {
        assert_eq!(self.rays.len(), states.len(), "one state per ray");
        let hits = HitsSoFar::default();
        let piece = |(index, states): (usize, &mut [T])| {
            (self.bvh.pool)
                .with(|memory| self.visit_piece(memory, index * CHUNK, states, &visit, &hits));
        };
        if self.among_threads && states.len() > CHUNK {
            for_each(states.chunks_mut(CHUNK).enumerate().collect(), piece);
        } else {
            states.chunks_mut(CHUNK).enumerate().for_each(piece);
        }
    }

    fn visit_piece<T>(
        &self,
        memory: &mut Memory,
        first: usize,
        states: &mut [T],
        visit: &impl Fn(&mut T, Hit) -> Visit,
        so_far: &HitsSoFar,
    ) {
        for (span, bvh) in self.trees() {
            let open = Open::new(self, span, first..first + states.len());
            self.visit_open(memory, bvh, open, states, visit, so_far);
        }
    }

    /// Visits what rays of one span hit.
    fn visit_open<T>(
        &self,
        memory: &mut Memory,
        bvh: &Bvh,
        mut open: Open,
        states: &mut [T],
        visit: &impl Fn(&mut T, Hit) -> Visit,
        so_far: &HitsSoFar,
    ) {
        let len = open.rays.len();
        if !bvh.is_worth_a_stream(len) {
            let batch = open.batch().under(self.conditions());
            for (index, ray) in open.rays.iter().enumerate() {
                let (state, moment) = (
                    &mut states[open.keys[index].index()],
                    bvh.moment_of(&batch, index),
                );
                batch.with_condition(index, |condition| {
                    let visit = &mut |hit| visit(state, hit);
                    moment.visit_ahead(&mut memory.ahead, ray, condition, visit)
                });
            }
            return;
        }
        let mut visited = 0;
        let mut goes_on = |place: usize, hit: &TreeHit| {
            visited += 1;
            visit(&mut states[place], hit.told()) == Visit::Reject
        };
        if !so_far.are_many() {
            let (mut found, mut closest) = (vec![None; len], vec![None; len]);
            let cells = Cell::from_mut(&mut found[..]).as_slice_of_cells();
            let report =
                |index: usize, _: &Ray, found: &LocatedHit| cells[index].set(Some(found.hit));
            let batch = open.batch().under(self.conditions());
            let batch = batch.reporting(Report::Surface(&report));
            bvh.intersect_many(memory, &batch, &mut closest);
            open.retain(|index, place| {
                let found = found[index].filter(|found| goes_on(place, found))?;
                Some(found.hit)
            });
        }
        let mut lists = vec![NearestHits::default(); open.rays.len()];
        let pending: Vec<u32> = (0..lists.len() as u32).collect();
        while !open.rays.is_empty() {
            let len = open.rays.len();
            let batch = open.batch().under(self.conditions());
            let batch = batch.behind(&open.after);
            bvh.stream::<Nearest>(memory, &batch, &pending[..len], &mut lists[..len]);
            open.retain(|index, place| {
                let list = &lists[index];
                let is_open = list.hits().iter().all(|hit| goes_on(place, hit));
                list.last().filter(|_| is_open).map(|last| last.hit)
            });
        }
        so_far.add(len, visited);
    }
}

/// Rays whose visit has not ended.
struct Open {
    /// The place of this part in the batch.
    first: usize,
    rays: Vec<Ray>,
    /// Per ray, its place in this part of the batch.
    keys: Vec<Key>,
    /// Per ray, its share of the span at which it looks at a tree that moves.
    shares: Option<Vec<f32>>,
    /// Per ray, the hit behind which its visit continues.
    after: Vec<Hit>,
}

impl Open {
    /// Opens the visits of the rays of a span at these places of a batch.
    fn new(batch: &Batch<'_>, span: usize, places: Range<usize>) -> Self {
        /// A hit before all hits.
        const FIRST: Hit = Hit {
            t: f32::NEG_INFINITY,
            ..Hit::none(0.0)
        };
        let first = places.start;
        let own = places.filter(|place| batch.is_in(span, *place));
        let keys: Vec<Key> = own.map(|place| Key::at(place - first)).collect();
        let places = keys.iter().map(|key| first + key.index());
        Self {
            first,
            rays: places.clone().map(|place| batch.ray(place)).collect(),
            shares: places.map(|place| batch.share(place)).collect(),
            after: vec![FIRST; keys.len()],
            keys,
        }
    }

    /// The rays as a part of the batch.
    fn batch(&self) -> RayBatch<'_> {
        RayBatch::by_keys(&self.rays, self.first, &self.keys).at(self.shares.as_deref())
    }

    /// Keeps the rays whose visit continues behind a hit. `goes_on` is called with index and place of each ray, and
    /// returns that hit.
    fn retain(&mut self, mut goes_on: impl FnMut(usize, usize) -> Option<Hit>) {
        let mut next = 0;
        for index in 0..self.rays.len() {
            if let Some(hit) = goes_on(index, self.keys[index].index()) {
                (self.rays[next], self.keys[next]) = (self.rays[index], self.keys[index]);
                if let Some(shares) = &mut self.shares {
                    shares[next] = shares[index];
                }
                self.after[next] = hit;
                next += 1;
            }
        }
        self.rays.truncate(next);
        self.keys.truncate(next);
        self.shares
            .iter_mut()
            .for_each(|shares| shares.truncate(next));
        self.after.truncate(next);
    }
}

/// Hits that earlier rays of a batch visited: where they are many, the first one is not found by itself. Answers do not depend
/// on it.
#[derive(Default)]
struct HitsSoFar {
    rays: AtomicUsize,
    hits: AtomicUsize,
}

impl HitsSoFar {
    fn are_many(&self) -> bool {
        let [rays, hits] = [&self.rays, &self.hits].map(|count| count.load(Ordering::Relaxed));
        hits > 2 * rays
    }

    fn add(&self, rays: usize, hits: usize) {
        self.rays.fetch_add(rays, Ordering::Relaxed);
        self.hits.fetch_add(hits, Ordering::Relaxed);
    }
}
