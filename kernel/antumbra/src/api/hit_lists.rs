//! All hits of many rays, and how many there are.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
#[cfg(feature = "std")]
use std::sync::{Mutex, PoisonError};

use super::batch::Batch;
use super::moving::Moment;
use crate::geometry::QueryKind;
use crate::ray::Hit;
use crate::trace::memory::Memory;
use crate::trace::ray_batch::RayBatch;
use crate::trace::visit::Visit;

/// Rays that one thread takes at a time. A visit takes longer than other queries.
const CHUNK: usize = 1 << 10;

/// Hits of many rays, one list after the other. The list of ray `i` is `hits[splits[i]..splits[i + 1]]`.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::Ray;
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let rays = [[0.2, 0.2, 0.0], [5.0, 5.0, 0.0]].map(|from| Ray::new(from, [0.0, 0.0, 1.0]));
/// let lists = bvh.batch(&rays).all_hits();
/// assert_eq!((lists.of(0).len(), lists.of(1).len()), (1, 0));
/// # Ok::<(), antumbra::Error>(())
/// ```
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
        for place in places {
            joined
                .hits
                .extend_from_slice(&lists[place.list][place.range()]);
            joined.splits.push(joined.hits.len());
        }
        joined
    }

    /// Hits in lists as threads found them. `places` receives where the hits of each ray are.
    #[cfg(feature = "std")]
    fn hits_in_pieces(&self, places: &mut [Place]) -> Vec<Vec<Hit>> {
        let lists = Mutex::new(Vec::new());
        self.run_range(
            QueryKind::Intersect,
            CHUNK,
            0..places.len(),
            places,
            &|bvh, memory, batch, places: &mut [Place]| {
                let mut hits = Vec::new();
                for (index, place) in places.iter_mut().enumerate() {
                    *place = hits_of(
                        bvh.moment_of(batch, index),
                        memory,
                        (batch, index),
                        &mut hits,
                    );
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
        let mut hits = Vec::new();
        self.bvh.pool.with(|memory| {
            for (index, place) in places.iter_mut().enumerate() {
                let rays = [self.ray(index)];
                let batch = RayBatch::new(&rays, index).under(self.conditions());
                *place = hits_of(self.moment(index), memory, (&batch, 0), &mut hits);
            }
        });
        vec![hits]
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
            &|bvh, memory, batch, counts| {
                for (index, count) in counts.iter_mut().enumerate() {
                    *count = 0;
                    let (ray, moment) = (&batch.rays[index], bvh.moment_of(batch, index));
                    batch.with_condition(index, |condition| {
                        moment.visit_ahead(&mut memory.ahead, ray, condition, &mut |_| {
                            *count += 1;
                            Visit::Reject
                        })
                    });
                }
            },
        );
        counts
    }
}

/// Adds the hits of a ray to a list.
fn hits_of(
    moment: Moment<'_>,
    memory: &mut Memory,
    (batch, index): (&RayBatch<'_>, usize),
    hits: &mut Vec<Hit>,
) -> Place {
    let first = hits.len();
    let ray = &batch.rays[index];
    batch.with_condition(index, |condition| {
        moment.visit_ahead(&mut memory.ahead, ray, condition, &mut |hit| {
            hits.push(hit);
            Visit::Reject
        })
    });
    Place {
        list: 0,
        first,
        len: hits.len() - first,
    }
}
