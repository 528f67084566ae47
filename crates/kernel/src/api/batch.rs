//! Batches: many rays at once, among threads or on one, in the order given or in one that is faster.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;

use super::bvh::Bvh;
use super::ray_order::{RayOrder, piece_len};
use crate::geometry::QueryKind;
use crate::parallel::{for_each, threads};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::ray_columns::Rays;
use crate::trace::asked::Asked;
use crate::trace::condition::{Conditions, RayMasks};
use crate::trace::memory::Memory;
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
    conditions: Conditions<'a>,
    order: RayOrder,
}

impl Bvh {
    /// Rays to be traced together: a list of [`Ray`]s, or [`RayColumns`](crate::RayColumns).
    pub fn batch<'a>(&'a self, rays: impl Into<Rays<'a>>) -> Batch<'a> {
        Batch {
            bvh: self,
            rays: rays.into(),
            among_threads: true,
            closed: false,
            conditions: Conditions {
                except: None,
                mask: None,
                masks: self.masks.as_deref(),
                filter: None,
            },
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
    /// # Panics
    /// If there are not as many primitives as rays.
    pub fn except(self, excluded: &'a [PrimId]) -> Self {
        assert_eq!(self.rays.len(), excluded.len(), "one primitive per ray");
        let conditions = Conditions {
            except: Some(excluded),
            ..self.conditions
        };
        Self { conditions, ..self }
    }

    /// Sees only geometries and instances whose [masks](crate::Masks) have a bit in common with `mask`: see
    /// [`RayQuery::mask`](crate::RayQuery::mask).
    ///
    /// Costs nothing if the scene has no masks.
    pub fn mask(self, mask: u32) -> Self {
        let conditions = Conditions {
            mask: Some(RayMasks::Same(mask)),
            ..self.conditions
        };
        Self { conditions, ..self }
    }

    /// [`Batch::mask`] with a mask for each ray.
    ///
    /// # Panics
    /// If there are not as many masks as rays.
    pub fn masks(self, masks: &'a [u32]) -> Self {
        assert_eq!(self.rays.len(), masks.len(), "one mask per ray");
        let conditions = Conditions {
            mask: Some(RayMasks::Each(masks)),
            ..self.conditions
        };
        Self { conditions, ..self }
    }

    /// Order in which the rays are traced; [`RayOrder::AsGiven`] unless told otherwise.
    pub fn order(self, order: RayOrder) -> Self {
        Self { order, ..self }
    }

    /// Counts only hits for which `filter` returns true, with the number of the ray in the batch. `filter` is called on
    /// whatever thread has the ray: see [`RayQuery::filter`](crate::RayQuery::filter).
    ///
    /// It is called where a ray comes to a hit, so that no ray is traced twice.
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
        let conditions = Conditions {
            filter: Some(filter),
            ..self.conditions
        };
        Self { conditions, ..self }
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
        let range = 0..hits.len();
        self.run_range(
            QueryKind::Intersect,
            CHUNK,
            range,
            hits,
            &|memory, asked, hits| {
                self.bvh.intersect_many(memory, asked, hits);
            },
        );
    }

    /// Whether anything that counts occludes the rays of a range.
    fn occluded_range(&self, range: Range<usize>, occluded: &mut [bool]) {
        self.run_range(
            QueryKind::Occluded,
            CHUNK,
            range,
            occluded,
            &|memory, asked, occluded| {
                self.bvh.occluded_many(memory, asked, occluded);
            },
        );
    }

    /// Asks about the rays of a range, in pieces that threads share: so many rays at a time, unless they are sorted.
    pub(super) fn run_range<A: Copy + Default + Send>(
        &self,
        kind: QueryKind,
        chunk: usize,
        range: Range<usize>,
        answers: &mut [A],
        query: &(impl Fn(&mut Memory, &Asked<'_>, &mut [A]) + Sync),
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

    /// The rays, and what their hits have to meet.
    pub(super) fn asked(&self) -> Asked<'_> {
        let conditions = (!self.conditions.are_none()).then_some(&self.conditions);
        (Asked::new(self.rays, 0).closed(self.closed)).under(conditions)
    }

    /// Asks about the rays of a range on this thread.
    fn piece<A: Copy + Default>(
        &self,
        memory: &mut Memory,
        range: Range<usize>,
        answers: &mut [A],
        grid: Option<&Grid>,
        query: &impl Fn(&mut Memory, &Asked<'_>, &mut [A]),
    ) {
        let asked = self.asked().part(range.clone());
        let Some(grid) = grid else {
            return query(memory, &asked, answers);
        };
        let mut rays = core::mem::take(&mut memory.rays);
        let mut keys = core::mem::take(&mut memory.keys);
        let sorted = keys.sort(grid, (0..asked.len()).map(|index| asked.get(index)));
        let mut found = vec![A::default(); GATHER.min(answers.len())];
        for keys in sorted.chunks(GATHER) {
            rays.clear();
            rays.extend(keys.iter().map(|key| asked.get(key.index())));
            let found = &mut found[..keys.len()];
            let together = asked.brought_together(&rays, range.start, keys);
            query(memory, &together, found);
            for (key, answer) in keys.iter().zip(found) {
                answers[key.index()] = *answer;
            }
        }
        memory.keys = keys;
        memory.rays = rays;
    }
}

impl fmt::Debug for Batch<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Batch")
            .field("rays", &self.rays.len())
            .field("among_threads", &self.among_threads)
            .field("closed", &self.closed)
            .field("has_conditions", &!self.conditions.are_none())
            .field("order", &self.order)
            .finish_non_exhaustive()
    }
}
