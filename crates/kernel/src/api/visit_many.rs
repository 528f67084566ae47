//! Visits of the hits of many rays, with a state for each ray.

use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;

use super::batch::Batch;
use crate::parallel::for_each;
use crate::ray::{Hit, Ray};
use crate::trace::memory::Memory;
use crate::trace::ray_batch::{LocatedHit, RayBatch, Report};
use crate::trace::ray_sort::Key;
use crate::trace::visit::Visit;

/// Rays that one thread takes at a time.
const CHUNK: usize = 1 << 12;

impl Batch<'_> {
    /// Calls `visit` with the hits of each ray, front to back, and with the state of the ray: `states[i]` belongs to ray `i`.
    /// Hits come as in [`RayQuery::visit_hits`](crate::RayQuery::visit_hits), until the closure accepts one or stops.
    ///
    /// All rays are asked for their closest hits; those whose hit is rejected are asked for the next ones, together. Pays where
    /// rays have few hits before they end, as shadow rays through glass. Rays are traced in the order given.
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
        let piece = |(index, states): (usize, &mut [T])| {
            (self.bvh.pool).with(|memory| self.visit_piece(memory, index * CHUNK, states, &visit));
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
    ) {
        let len = states.len();
        let mut rays: Vec<Ray> = (first..first + len).map(|place| self.ray(place)).collect();
        let mut keys: Vec<Key> = (0..len).map(Key::at).collect();
        let mut after = Vec::<Hit>::new();
        let (mut found, mut hits) = (vec![None; len], vec![None; len]);
        while !rays.is_empty() {
            let open = rays.len();
            found[..open].fill(None);
            let cells = Cell::from_mut(&mut found[..open]).as_slice_of_cells();
            let report =
                |index: usize, _: &Ray, found: &LocatedHit| cells[index].set(Some(found.hit));
            let batch = RayBatch::by_keys(&rays, first, &keys)
                .under(self.conditions())
                .behind((after.len() == open).then_some(&after[..]))
                .reporting(Report::Surface(&report));
            self.bvh.intersect_many(memory, &batch, &mut hits[..open]);
            after.clear();
            for index in 0..open {
                let Some(hit) = found[index] else { continue };
                let state = &mut states[keys[index].index()];
                if visit(state, hit.told()) == Visit::Reject {
                    // Those that go on move to the front.
                    let next = after.len();
                    (rays[next], keys[next]) = (rays[index], keys[index]);
                    after.push(hit);
                }
            }
            rays.truncate(after.len());
            keys.truncate(after.len());
        }
    }
}
