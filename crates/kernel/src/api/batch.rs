//! Batches: many rays at once, among threads or on one, in the order given or in one that is faster.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;

use super::bvh::Bvh;
use super::columns::Rays;
use super::ray_order::{RayOrder, piece_len};
use crate::geometry::QueryKind;
use crate::parallel::{for_each, threads};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::memory::Memory;
use crate::trace::query::Closest;
use crate::trace::ray_sort::Grid;

/// Rays that one thread takes at a time.
pub(crate) const CHUNK: usize = 1 << 14;

/// Rays that are brought together at a time: half of a small second cache.
const GATHER: usize = 1 << 12;

/// Many rays and how to trace them. Made by [`Bvh::batch`]; nothing happens before the last call, which names the query.
///
/// No choice changes an answer, or its place.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Ray, Recipe};
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let rays = [Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 1.0])];
/// let occluded = bvh.batch(&rays).on_this_thread().occluded();
/// assert_eq!(occluded, [false], "the triangle lies where the open segment ends");
/// let mut occluded = [false];
/// bvh.batch(&rays).closed().occluded_into(&mut occluded);
/// assert_eq!(occluded, [true]);
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy)]
#[must_use = "a batch does nothing until its last call"]
pub struct Batch<'a> {
    pub(super) bvh: &'a Bvh,
    pub(super) rays: Rays<'a>,
    among_threads: bool,
    pub(super) closed: bool,
    except: Option<&'a [PrimId]>,
    mask: Option<RayMasks<'a>>,
    filter: Option<Filter<'a>>,
    order: RayOrder,
}

/// Masks of the rays of a batch.
#[derive(Clone, Copy, Debug)]
enum RayMasks<'a> {
    Same(u32),
    Each(&'a [u32]),
}

/// Decision about a hit of a ray, given by its place in the batch.
type Filter<'a> = &'a (dyn Fn(usize, &Hit) -> bool + Sync);

impl Bvh {
    /// Rays to be traced together: a list of [`Ray`]s, or [`RayColumns`](crate::RayColumns).
    pub fn batch<'a>(&'a self, rays: impl Into<Rays<'a>>) -> Batch<'a> {
        Batch {
            bvh: self,
            rays: rays.into(),
            among_threads: true,
            closed: false,
            except: None,
            mask: None,
            filter: None,
            order: RayOrder::default(),
        }
    }

    /// Whether anything lies in the interval of each ray: `occluded[i]` answers `rays[i]`. Short for
    /// `bvh.batch(rays).occluded_into(occluded)`.
    ///
    /// More than 16 384 rays are shared among the threads of the current rayon pool, if the `parallel` feature is on; up to as
    /// many stay on the calling thread. [`Batch::on_this_thread`] keeps all of them there.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.batch(rays).occluded_into(occluded);
    }

    /// The closest hit of each ray: `hits[i]` answers `rays[i]`. At equal distances the smallest
    /// (inst_id, geom_id, prim_id) wins. Shared among threads as in [`Bvh::occluded_batch`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.batch(rays).intersect_into(hits);
    }
}

impl<'a> Batch<'a> {
    /// Traces all rays on the calling thread. Otherwise more than 16 384 rays are shared among the threads of the current
    /// rayon pool, if the `parallel` feature is on: the pool that the call is made in, or else the global one.
    pub fn on_this_thread(self) -> Self {
        Self {
            among_threads: false,
            ..self
        }
    }

    /// Counts hits at either end of the interval as well: traces [`Ray::closed`] of every ray.
    pub fn closed(self) -> Self {
        Self {
            closed: true,
            ..self
        }
    }

    /// Leaves out one primitive for each ray: ray `i` does not hit the primitive `excluded[i]`, which may be
    /// [`PrimId::NONE`]. For rays that start on surfaces, see
    /// [`RayQuery::except`](crate::RayQuery::except).
    ///
    /// The batch is traced as if nothing was left out. Then rays that hit anything are asked again one by one, and in a query
    /// of closest hits only those whose closest primitive is the excluded one.
    ///
    /// # Panics
    /// If there are not as many primitives as rays.
    pub fn except(self, excluded: &'a [PrimId]) -> Self {
        assert_eq!(self.rays.len(), excluded.len(), "one primitive per ray");
        Self {
            except: Some(excluded),
            ..self
        }
    }

    /// Sees only geometries and instances whose [masks](crate::Masks) have a bit in common with `mask`: see
    /// [`RayQuery::mask`](crate::RayQuery::mask).
    ///
    /// The batch is traced as if nothing was hidden, and rays are asked again as with [`Batch::except`]. If the scene has no
    /// masks, nothing is asked again.
    pub fn mask(self, mask: u32) -> Self {
        Self {
            mask: Some(RayMasks::Same(mask)),
            ..self
        }
    }

    /// [`Batch::mask`] with a mask for each ray.
    ///
    /// # Panics
    /// If there are not as many masks as rays.
    pub fn masks(self, masks: &'a [u32]) -> Self {
        assert_eq!(self.rays.len(), masks.len(), "one mask per ray");
        Self {
            mask: Some(RayMasks::Each(masks)),
            ..self
        }
    }

    /// Order in which the rays are traced; [`RayOrder::AsGiven`] unless told otherwise.
    pub fn order(self, order: RayOrder) -> Self {
        Self { order, ..self }
    }

    /// Counts only hits for which `filter` returns true, with the number of the ray in the batch. `filter` is called on
    /// whatever thread has the ray: see [`RayQuery::filter`](crate::RayQuery::filter).
    ///
    /// Rays that nothing occludes, or whose closest hit counts, cost no more than without a filter. The others are traced
    /// again one by one.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]); 2];
    /// let ignored = [0, 7];
    /// let filter = |ray: usize, hit: &antumbra::Hit| hit.geom_id != ignored[ray];
    /// assert_eq!(bvh.batch(&rays).filter(&filter).occluded(), [false, true]);
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    pub fn filter(self, filter: &'a (dyn Fn(usize, &Hit) -> bool + Sync)) -> Self {
        Self {
            filter: Some(filter),
            ..self
        }
    }

    /// Whether anything lies in the interval of each ray: item `i` answers ray `i`.
    #[must_use]
    pub fn occluded(self) -> Vec<bool> {
        let mut occluded = vec![false; self.rays.len()];
        self.occluded_into(&mut occluded);
        occluded
    }

    /// [`Batch::occluded`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as rays.
    pub fn occluded_into(self, occluded: &mut [bool]) {
        assert_eq!(self.rays.len(), occluded.len(), "one answer per ray");
        self.occluded_range(0..occluded.len(), occluded);
    }

    /// [`Batch::occluded`] with one bit per ray: bit `i % 64` of `bits[i / 64]` answers ray `i`. Bits behind the last ray
    /// become 0.
    ///
    /// # Panics
    /// If there are not `⌈rays / 64⌉` words.
    pub fn occluded_bits_into(self, bits: &mut [u64]) {
        assert_eq!(self.rays.len().div_ceil(64), bits.len(), "64 rays per word");
        let pool = &self.bvh.pool;
        let mut occluded = pool.with(|memory| core::mem::take(&mut memory.answers));
        for (index, bits) in bits.chunks_mut(CHUNK).enumerate() {
            let first = 64 * CHUNK * index;
            let range = first..self.rays.len().min(first + 64 * CHUNK);
            occluded.clear();
            occluded.resize(range.len(), false);
            self.occluded_range(range, &mut occluded);
            for (word, occluded) in bits.iter_mut().zip(occluded.chunks(64)) {
                *word = occluded
                    .iter()
                    .rev()
                    .fold(0, |word, &occluded| word << 1 | u64::from(occluded));
            }
        }
        pool.with(|memory| memory.answers = occluded);
    }

    /// The closest hit of each ray: item `i` answers ray `i`. At equal distances the smallest (inst_id, geom_id, prim_id)
    /// wins.
    #[must_use]
    pub fn intersect(self) -> Vec<Option<Hit>> {
        let mut hits = vec![None; self.rays.len()];
        self.intersect_into(&mut hits);
        hits
    }

    /// [`Batch::intersect`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as rays.
    pub fn intersect_into(self, hits: &mut [Option<Hit>]) {
        assert_eq!(self.rays.len(), hits.len(), "one answer per ray");
        self.run_range(
            QueryKind::Intersect,
            CHUNK,
            0..hits.len(),
            hits,
            &|memory: &mut Memory, rays: &[Ray], hits: &mut [Option<Hit>]| {
                self.bvh.many::<Closest>(memory, rays, hits);
            },
        );
        self.mend(0, hits, |ray, condition, hit| {
            *hit = self.bvh.closest_when(ray, condition, *hit);
        });
    }

    /// Whether anything that counts occludes the rays of a range.
    fn occluded_range(&self, range: Range<usize>, occluded: &mut [bool]) {
        let first = range.start;
        self.run_range(
            QueryKind::Occluded,
            CHUNK,
            range,
            occluded,
            &|memory: &mut Memory, rays: &[Ray], occluded: &mut [bool]| {
                self.bvh.occluded_many(memory, rays, occluded);
            },
        );
        self.mend(first, occluded, |ray, condition, occluded| {
            *occluded = *occluded && self.bvh.occluded_when(ray, condition);
        });
    }

    /// Whether any hit may not count.
    pub(super) fn has_conditions(&self) -> bool {
        self.except.is_some() || self.mask.is_some() || self.filter.is_some()
    }

    /// Runs `work` with the condition that hits of a ray have to meet.
    pub(super) fn with_condition<R>(
        &self,
        place: usize,
        work: impl FnOnce(&Condition<'_>) -> R,
    ) -> R {
        let filter = self
            .filter
            .map(|filter| move |hit: &Hit| filter(place, hit));
        work(&Condition {
            excluded: self.except.map_or(PrimId::NONE, |except| except[place]),
            mask: self.mask.map(|mask| match mask {
                RayMasks::Same(mask) => mask,
                RayMasks::Each(masks) => masks[place],
            }),
            masks: self.bvh.masks.as_deref(),
            accept: match &filter {
                Some(filter) => Some(filter),
                None => None,
            },
        })
    }

    /// Corrects answers that were given as if every hit counted, those of ray `first` and the rays behind it.
    pub(super) fn mend<A: Send>(
        &self,
        first: usize,
        answers: &mut [A],
        mend: impl Fn(&Ray, &Condition<'_>, &mut A) + Sync + Send,
    ) {
        if !self.has_conditions() {
            return;
        }
        let piece = |(index, answers): (usize, &mut [A])| {
            for (answer, place) in answers.iter_mut().zip(first + index * CHUNK..) {
                self.with_condition(place, |condition| {
                    if !condition.is_none() {
                        let ray = self.rays.get(place);
                        let ray = if self.closed { ray.closed() } else { ray };
                        mend(&ray, condition, answer);
                    }
                });
            }
        };
        if self.among_threads {
            for_each(answers.chunks_mut(CHUNK).enumerate().collect(), piece);
        } else {
            answers.chunks_mut(CHUNK).enumerate().for_each(piece);
        }
    }

    /// Asks about the rays of a range, in pieces that threads share: so many rays at a time, unless they are sorted.
    pub(super) fn run_range<A: Copy + Default + Send>(
        &self,
        kind: QueryKind,
        chunk: usize,
        range: Range<usize>,
        answers: &mut [A],
        query: &(impl Fn(&mut Memory, &[Ray], &mut [A]) + Sync),
    ) {
        let threads = if self.among_threads { threads() } else { 1 };
        let grid = (self.order).grid(&self.rays, self.bvh, kind, threads);
        let len = match &grid {
            None => chunk,
            Some(_) => piece_len(range.len(), threads),
        };
        let piece = |(index, answers): (usize, &mut [A])| {
            let first = range.start + index * len;
            let range = first..first + answers.len();
            (self.bvh.pool).with(|memory| self.piece(memory, range, answers, grid.as_ref(), query));
        };
        if threads == 1 || answers.len() <= chunk {
            answers.chunks_mut(len).enumerate().for_each(piece);
        } else {
            for_each(answers.chunks_mut(len).enumerate().collect(), piece);
        }
    }

    /// Asks about the rays of a range on this thread.
    fn piece<A: Copy + Default>(
        &self,
        memory: &mut Memory,
        range: Range<usize>,
        answers: &mut [A],
        grid: Option<&Grid>,
        query: &impl Fn(&mut Memory, &[Ray], &mut [A]),
    ) {
        if let (Rays::List(rays), false, None) = (&self.rays, self.closed, grid) {
            return query(memory, &rays[range], answers);
        }
        let mut rays = core::mem::take(&mut memory.rays);
        let close = |rays: &mut [Ray]| {
            if self.closed {
                rays.iter_mut().for_each(|ray| *ray = ray.closed());
            }
        };
        match grid {
            None => {
                for (index, answers) in answers.chunks_mut(GATHER).enumerate() {
                    let first = range.start + index * GATHER;
                    self.rays.pick(first..first + answers.len(), &mut rays);
                    close(&mut rays);
                    query(memory, &rays, answers);
                }
            }
            Some(grid) => {
                let mut keys = core::mem::take(&mut memory.keys);
                let sorted = match &self.rays {
                    Rays::List(rays) => keys.sort(grid, rays[range.clone()].iter().copied()),
                    Rays::Columns(rays) => keys.sort(grid, range.clone().map(|ray| rays.get(ray))),
                };
                let mut found = vec![A::default(); GATHER.min(answers.len())];
                for keys in sorted.chunks(GATHER) {
                    let here = keys.iter().map(|key| range.start + key.index());
                    self.rays.pick(here, &mut rays);
                    close(&mut rays);
                    let found = &mut found[..keys.len()];
                    query(memory, &rays, found);
                    for (key, answer) in keys.iter().zip(found) {
                        answers[key.index()] = *answer;
                    }
                }
                memory.keys = keys;
            }
        }
        memory.rays = rays;
    }
}

impl fmt::Debug for Batch<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Batch")
            .field("rays", &self.rays.len())
            .field("among_threads", &self.among_threads)
            .field("closed", &self.closed)
            .field("has_conditions", &self.has_conditions())
            .field("order", &self.order)
            .finish_non_exhaustive()
    }
}
