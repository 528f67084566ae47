//! Whether batches prefetch nodes and leaves. What pays depends on the tree, the rays and the caches of the machine, so
//! it can be timed.
//!
//! Prefetching is a fifth of the instructions of a node step (AVX2), and gains nothing if the tree stays in the first
//! cache. Trees of 30 thousand to two million triangles are 1.03 to 1.43 times as fast with it
//! (`docs/src/performance.md`).

use alloc::vec::Vec;
use core::time::Duration;

use super::bvh::Bvh;
use super::recipe::Recipe;
use super::times::Stopwatch;
use crate::ray::Ray;
use crate::trace::memory::Memory;
use crate::trace::ray_batch::RayBatch;

/// Rays between two readings of the clock: four times as many as a stream has in flight.
const CHUNK: usize = 256;

/// Batches stop prefetching if three of four measurements are at least this many times as fast without. The bound is
/// above 1, because a few rays find more in the caches than many, and no tree was found yet that is slower with
/// prefetching beyond noise.
const GAIN: f64 = 1.03;

impl Bvh {
    /// Has batches prefetch or not: as the recipe says, or else as a short timing of `rays` by its clock decides.
    pub(crate) fn choose_prefetch(&mut self, rays: &[Ray], recipe: &Recipe) {
        match (recipe.prefetch, recipe.clock) {
            (Some(prefetch), _) => self.set_prefetch(prefetch),
            (None, Some(clock)) => {
                let mut stopwatch = Stopwatch::new(Some(clock));
                self.time_prefetch(rays, clock);
                if let Some(times) = &mut self.times {
                    times.prefetch = stopwatch.lap();
                }
            }
            (None, None) => {}
        }
    }

    /// Has batches prefetch nodes and leaves from now on, or not.
    pub(crate) fn set_prefetch(&mut self, prefetch: bool) {
        self.prefetch = prefetch;
    }

    /// Times `rays`, as occlusion queries on the calling thread, with and without prefetching of nodes and leaves.
    /// Keeps what is faster and returns it. `clock` returns the time that has passed since some moment: the kernel has
    /// no clock.
    ///
    /// A few thousand rays like the ones to come are enough. Rays traced for the first time say more than rays that
    /// were just traced. With fewer than 512 rays, or a clock that does not advance, the setting stays as it is.
    pub(crate) fn time_prefetch(&mut self, rays: &[Ray], clock: impl Fn() -> Duration) -> bool {
        let before = self.prefetch;
        let mut memory = Memory::default();
        let mut occluded = [false; CHUNK];
        let mut seconds = |prefetch, rays: &[Ray]| {
            self.prefetch = prefetch;
            let start = clock();
            self.occluded_many(
                &mut memory,
                &RayBatch::new(rays, 0),
                &mut occluded[..rays.len()],
            );
            clock().saturating_sub(start).as_secs_f64()
        };
        let mut gains = Vec::with_capacity(rays.len() / (2 * CHUNK));
        for pair in rays.chunks_exact(2 * CHUNK) {
            // Each setting is timed once on rays that the cache knows, and once on rays that it does not know.
            let (first, second) = pair.split_at(CHUNK);
            let mut with = seconds(true, first);
            let mut without = seconds(false, first);
            without += seconds(false, second);
            with += seconds(true, second);
            gains.push(with / without);
        }
        gains.retain(|gain| gain.is_finite() && *gain > 0.0);
        gains.sort_by(f64::total_cmp);
        self.prefetch = match gains.get(gains.len() / 4) {
            Some(&quartile) => quartile < GAIN,
            None => before,
        };
        self.prefetch
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;
    use crate::geometry::Geometry;
    use antumbra_testkit::{Rng, mesh};
    use core::cell::Cell;

    /// A clock by which measurements take so many nanoseconds, in turn and over and over. Counts how often it is looked at:
    /// before and after each.
    fn scripted(steps: [u64; 4], looks: &Cell<u64>) -> Duration {
        let done = looks.get().div_ceil(2);
        looks.set(looks.get() + 1);
        let round: u64 = steps.iter().sum();
        let begun: u64 = steps[..done as usize % 4].iter().sum();
        Duration::from_nanos(done / 4 * round + begun)
    }

    #[test]
    fn what_is_faster_is_kept() {
        let mut rng = Rng::new(77);
        let mesh = mesh::soup(&mut rng, 300);
        let geometries = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let mut bvh = Bvh::build(&geometries, &Recipe::default()).expect("in range");
        assert!(bvh.prefetch);
        let rays: Vec<Ray> = (0..5 * CHUNK)
            .map(|_| Ray::new(rng.point(2.0), rng.direction()))
            .collect();
        let mut answers = vec![false; rays.len()];
        bvh.occluded_batch(&rays, &mut answers);

        // With, without, without, with.
        for (steps, before, after) in [
            ([100, 100, 100, 100], false, true),
            ([108, 100, 100, 100], true, false),
            ([150, 100, 150, 100], false, true),
            ([101, 100, 100, 101], false, true),
            ([90, 100, 100, 100], false, true),
            // A clock that does not advance.
            ([0, 0, 0, 0], true, true),
            ([0, 0, 0, 0], false, false),
        ] {
            let looks = Cell::new(0);
            bvh.set_prefetch(before);
            let found = bvh.time_prefetch(&rays, || scripted(steps, &looks));
            assert_eq!(found, after, "{steps:?}");
            assert_eq!(bvh.prefetch, after);
            assert_eq!(looks.get(), 16, "two pairs of chunks; the rest is too few");
            let mut occluded = vec![false; rays.len()];
            bvh.occluded_batch(&rays, &mut occluded);
            assert_eq!(occluded, answers);
        }
        // Too few for a decision.
        bvh.set_prefetch(true);
        let few = &rays[..2 * CHUNK - 1];
        assert!(bvh.time_prefetch(few, || panic!("nothing to time")));
    }
}
