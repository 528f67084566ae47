//! All hits of many rays, and how many there are.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
#[cfg(feature = "std")]
use std::sync::{Mutex, PoisonError};

use super::batch::Batch;
use crate::geometry::QueryKind;
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::memory::Memory;
use crate::trace::visit::Visit;

/// Rays that one thread takes at a time. A visit takes longer than other queries.
const CHUNK: usize = 1 << 10;

/// Every hit counts at first.
const ALL: Condition<'static> = Condition::except(PrimId::NONE);

/// Hits of many rays, one list after the other: those of ray `i` are `hits[splits[i]..splits[i + 1]]`.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct HitLists {
    /// Places in `hits` where the list of each ray begins, and the number of hits at the end: one more than there are rays.
    pub splits: Vec<usize>,
    /// Hits of all rays, each list in the order of [`RayQuery::visit_hits`](crate::RayQuery::visit_hits).
    pub hits: Vec<Hit>,
}

impl HitLists {
    /// Number of rays.
    pub fn len(&self) -> usize {
        self.splits.len().saturating_sub(1)
    }

    /// Whether there are no rays. There may be rays without a hit.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Hits of one ray.
    ///
    /// # Panics
    /// If there is no such ray.
    pub fn of(&self, ray: usize) -> &[Hit] {
        &self.hits[self.splits[ray]..self.splits[ray + 1]]
    }
}

/// Where the hits of a ray lie: in one of several lists.
#[derive(Clone, Copy, Default)]
struct Place {
    list: usize,
    first: usize,
    len: usize,
}

impl Place {
    fn range(self) -> Range<usize> {
        self.first..self.first + self.len
    }
}

impl Batch<'_> {
    /// All hits in the interval of each ray, in the order of [`RayQuery::visit_hits`](crate::RayQuery::visit_hits).
    ///
    /// More than 1024 rays are shared among threads, as in [`Batch::occluded`]. Hits take 24 bytes each, and twice as much
    /// for a moment at the end.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let up = |x| Ray::new([x, 0.2, 0.0], [0.0, 0.0, 1.0]);
    /// let lists = bvh.batch(&[up(5.0), up(0.2)]).all_hits();
    /// assert_eq!(lists.splits, [0, 0, 1]);
    /// assert_eq!(lists.of(1)[0].t, 1.0);
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    #[must_use]
    pub fn all_hits(self) -> HitLists {
        let mut places = vec![Place::default(); self.rays.len()];
        let lists = self.hits_in_pieces(&mut places);
        let mut joined = HitLists {
            splits: Vec::with_capacity(places.len() + 1),
            hits: Vec::with_capacity(lists.iter().map(Vec::len).sum()),
        };
        joined.splits.push(0);
        for (ray, place) in places.into_iter().enumerate() {
            let hits = &lists[place.list][place.range()];
            if self.has_conditions() {
                self.with_condition(ray, |condition| {
                    let counts = |hit: &&Hit| condition.counts(hit);
                    joined.hits.extend(hits.iter().filter(counts));
                });
            } else {
                joined.hits.extend_from_slice(hits);
            }
            joined.splits.push(joined.hits.len());
        }
        joined
    }

    /// Hits in lists as threads found them, and where those of each ray lie.
    #[cfg(feature = "std")]
    fn hits_in_pieces(&self, places: &mut [Place]) -> Vec<Vec<Hit>> {
        let lists = Mutex::new(Vec::new());
        self.run_range(
            QueryKind::Intersect,
            CHUNK,
            0..places.len(),
            places,
            &|memory: &mut Memory, rays: &[Ray], places: &mut [Place]| {
                let mut hits = Vec::new();
                for (ray, place) in rays.iter().zip(&mut *places) {
                    *place = self.hits_of(memory, ray, &mut hits);
                }
                let mut lists = lists.lock().unwrap_or_else(PoisonError::into_inner);
                for place in places {
                    place.list = lists.len();
                }
                lists.push(hits);
            },
        );
        lists.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// Hits in one list: `core` has no lock for several.
    #[cfg(not(feature = "std"))]
    fn hits_in_pieces(&self, places: &mut [Place]) -> Vec<Vec<Hit>> {
        let (mut hits, mut rays) = (Vec::new(), Vec::new());
        self.bvh.pool.with(|memory| {
            for (index, place) in places.iter_mut().enumerate() {
                self.rays.pick(core::iter::once(index), &mut rays);
                let ray = if self.closed {
                    rays[0].closed()
                } else {
                    rays[0]
                };
                *place = self.hits_of(memory, &ray, &mut hits);
            }
        });
        vec![hits]
    }

    /// Adds the hits of a ray to a list.
    fn hits_of(&self, memory: &mut Memory, ray: &Ray, hits: &mut Vec<Hit>) -> Place {
        let first = hits.len();
        self.bvh
            .visit_ahead(&mut memory.ahead, ray, &ALL, &mut |hit| {
                hits.push(hit);
                Visit::Reject
            });
        Place {
            list: 0,
            first,
            len: hits.len() - first,
        }
    }

    /// Number of hits in the interval of each ray: item `i` answers ray `i`. Takes no memory for the hits, and as long as
    /// [`Batch::all_hits`].
    #[must_use]
    pub fn count_hits(self) -> Vec<u32> {
        let mut counts = vec![0; self.rays.len()];
        self.run_range(
            QueryKind::Intersect,
            CHUNK,
            0..counts.len(),
            &mut counts,
            &|memory: &mut Memory, rays: &[Ray], counts: &mut [u32]| {
                for (ray, count) in rays.iter().zip(counts) {
                    *count = 0;
                    self.bvh
                        .visit_ahead(&mut memory.ahead, ray, &ALL, &mut |_| {
                            *count += 1;
                            Visit::Reject
                        });
                }
            },
        );
        self.mend(0, &mut counts, |ray, condition, count| {
            if *count > 0 {
                *count = 0;
                self.bvh.visit_when(ray, condition, &mut |_| {
                    *count += 1;
                    Visit::Reject
                });
            }
        });
        counts
    }
}
