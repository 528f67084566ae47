//! Batches: many rays at once, among threads or on one, in the order given or in one that is faster.

use alloc::borrow::Cow;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use core::fmt;
use core::ops::Range;

use super::bvh::Bvh;
use super::moving::Moment;
use super::query::FEW;
use super::ray_order::{RayOrder, piece_len};
use crate::geometry::QueryKind;
use crate::geometry::motion::locate;
use crate::parallel::{for_each, threads};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::ray_columns::Rays;
use crate::trace::condition::{Condition, Conditions, RayMasks};
use crate::trace::memory::Memory;
use crate::trace::ray_batch::{RayBatch, Report};
use crate::trace::ray_sort::{Grid, Key};
use crate::trace::surface::Surface;

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
    pub(super) among_threads: bool,
    pub(super) closed: bool,
    /// A time for each ray, if anything moves.
    times: Option<&'a [f32]>,
    conditions: Conditions<'a>,
    order: RayOrder,
}

impl Bvh {
    /// Rays to be traced together: a list of [`Ray`]s, or [`RayColumns`](crate::RayColumns).
    ///
    /// More than 16 384 rays are shared among the threads of the current rayon pool, if the `parallel` feature is on; up to as
    /// many stay on the calling thread. [`Batch::on_this_thread`] keeps all of them there.
    ///
    /// ```
    /// # use antumbra::{Bvh, Geometry, Ray, Recipe};
    /// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
    /// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
    /// let rays = [[0.2, 0.2, 0.0], [5.0, 5.0, 0.0]].map(|from| Ray::new(from, [0.0, 0.0, 1.0]));
    /// assert_eq!(bvh.batch(&rays).occluded(), [true, false]);
    /// // Into memory that is there already.
    /// let mut hits = [None; 2];
    /// bvh.batch(&rays).intersect_into(&mut hits);
    /// assert!(hits[0].is_some() && hits[1].is_none());
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    pub fn batch<'a>(&'a self, rays: impl Into<Rays<'a>>) -> Batch<'a> {
        Batch {
            bvh: self,
            rays: rays.into(),
            among_threads: true,
            closed: false,
            times: None,
            conditions: Conditions {
                except: None,
                mask: None,
                masks: self.masks.as_deref(),
                filter: None,
            },
            order: RayOrder::default(),
        }
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

    /// Looks at the scene at a time from 0 to 1 for each ray: see [`Bvh::moving`]. Times outside are clamped, and NaN counts as
    /// 0. Changes nothing where nothing moves.
    ///
    /// ```
    /// use antumbra::{Bvh, Geometry, Ray, Recipe};
    ///
    /// let at = |x: f32| vec![[x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
    /// let mesh = Geometry::moving([at(0.0), at(4.0)], vec![[0, 1, 2]]);
    /// let bvh = Bvh::build(&[mesh], &Recipe::default())?;
    /// let rays = [Ray::new([2.2, 0.2, 0.0], [0.0, 0.0, 1.0]); 2];
    /// assert_eq!(bvh.batch(&rays).at(&[0.0, 0.5]).occluded(), [false, true]);
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    ///
    /// # Panics
    /// If there are not as many times as rays.
    pub fn at(self, times: &'a [f32]) -> Self {
        assert_eq!(self.rays.len(), times.len(), "one time per ray");
        Self {
            times: self.bvh.moves().then_some(times),
            ..self
        }
    }

    /// Order in which the rays are traced. Default: [`RayOrder::AsGiven`].
    pub fn order(self, order: RayOrder) -> Self {
        Self { order, ..self }
    }

    /// Counts only hits for which `filter` returns true, with the number of the ray in the batch. `filter` is called on
    /// whatever thread has the ray: see [`RayQuery::filter`](crate::RayQuery::filter).
    ///
    /// No ray is traced twice: `filter` is called where a ray comes to a hit.
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
        filled(self.rays.len(), false, |found| self.occluded_into(found))
    }

    /// [`Batch::occluded`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as rays.
    pub fn occluded_into(self, occluded: &mut [bool]) {
        assert_eq!(self.rays.len(), occluded.len(), "one answer per ray");
        if occluded.len() < FEW {
            return self.each(occluded, Moment::occluded_when);
        }
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
        filled(self.rays.len(), None, |found| self.intersect_into(found))
    }

    /// [`Batch::intersect`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as rays.
    pub fn intersect_into(self, hits: &mut [Option<Hit>]) {
        assert_eq!(self.rays.len(), hits.len(), "one answer per ray");
        if hits.len() < FEW {
            return self.each(hits, Moment::closest_when);
        }
        let range = 0..hits.len();
        self.run_range(
            QueryKind::Intersect,
            CHUNK,
            range,
            hits,
            &|bvh, memory, batch, hits| {
                bvh.intersect_many(memory, batch, hits);
            },
        );
    }

    /// The closest hit of each ray with its position and normal: item `i` answers ray `i`. Position and normal come from the
    /// leaf of the hit, which is in the cache. The call takes about 1.25 times as long as [`Batch::intersect`].
    #[must_use]
    pub fn surfaces(self) -> Vec<Option<Surface>> {
        filled(self.rays.len(), None, |found| self.surfaces_into(found))
    }

    /// [`Batch::surfaces`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as rays.
    pub fn surfaces_into(self, surfaces: &mut [Option<Surface>]) {
        assert_eq!(self.rays.len(), surfaces.len(), "one answer per ray");
        let range = 0..surfaces.len();
        self.run_range(
            QueryKind::Intersect,
            CHUNK,
            range,
            surfaces,
            &|bvh, memory, batch, answers| {
                bvh.surfaces(memory, batch, answers);
            },
        );
    }

    /// An occluder of each ray, if there is any: item `i` answers ray `i`. The occluder is any primitive in the interval, not
    /// the closest one. Which primitive it is depends on the tree; whether there is one does not. The call takes about 1.1
    /// times as long as [`Batch::occluded`].
    #[must_use]
    pub fn occluders(self) -> Vec<Option<PrimId>> {
        filled(self.rays.len(), None, |found| self.occluders_into(found))
    }

    /// [`Batch::occluders`] into a slice.
    ///
    /// # Panics
    /// If there are not as many answers as rays.
    pub fn occluders_into(self, occluders: &mut [Option<PrimId>]) {
        assert_eq!(self.rays.len(), occluders.len(), "one answer per ray");
        let range = 0..occluders.len();
        self.run_range(
            QueryKind::Occluded,
            CHUNK,
            range,
            occluders,
            &|bvh, memory, batch, answers| {
                answers.fill(None);
                let mut occluded = core::mem::take(&mut memory.answers);
                occluded.clear();
                occluded.resize(answers.len(), false);
                let cells = Cell::from_mut(answers).as_slice_of_cells();
                let report = |index: usize, occluder| cells[index].set(Some(occluder));
                let batch = batch.reporting(Report::Occluder(&report));
                bvh.occluded_many(memory, &batch, &mut occluded);
                memory.answers = occluded;
            },
        );
    }

    /// Answers a few rays one by one, under their conditions.
    fn each<A>(&self, answers: &mut [A], answer: impl Fn(Moment<'a>, &Ray, &Condition<'_>) -> A) {
        for (place, found) in answers.iter_mut().enumerate() {
            let (moment, ray) = (self.moment(place), self.ray(place));
            let answer = |condition: &Condition<'_>| answer(moment, &ray, condition);
            *found = self.conditions.with(place, None, answer);
        }
    }

    /// Whether anything that counts occludes the rays of a range.
    fn occluded_range(&self, range: Range<usize>, occluded: &mut [bool]) {
        self.run_range(
            QueryKind::Occluded,
            CHUNK,
            range,
            occluded,
            &|bvh, memory, batch, occluded| {
                bvh.occluded_many(memory, batch, occluded);
            },
        );
    }

    /// Runs `query` on the rays of `range`, in pieces that threads share: `chunk` rays each, or `piece_len` where rays
    /// are sorted.
    pub(super) fn run_range<A: Copy + Default + Send>(
        &self,
        kind: QueryKind,
        chunk: usize,
        range: Range<usize>,
        answers: &mut [A],
        query: &(impl Fn(&Bvh, &mut Memory, &RayBatch<'_>, &mut [A]) + Sync),
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

    /// Conditions that hits must satisfy; `None` if there are none.
    pub(super) fn conditions(&self) -> Option<&Conditions<'a>> {
        (!self.conditions.are_none()).then_some(&self.conditions)
    }

    /// The trees that rays look at, by spans.
    pub(super) fn trees(&self) -> impl Iterator<Item = (usize, &'a Bvh)> {
        let spans = self.times.map_or(1, |_| usize::MAX);
        self.bvh.spans().take(spans).enumerate()
    }

    /// Whether ray `place` looks at the tree of a span.
    pub(super) fn is_in(&self, span: usize, place: usize) -> bool {
        let spans = self.bvh.spans().count();
        (self.times).is_none_or(|times| locate(times[place], spans).0 == span)
    }

    /// Tree and moment that ray `place` looks at.
    pub(super) fn moment(&self, place: usize) -> Moment<'a> {
        self.bvh.moment(self.times.map(|times| times[place]))
    }

    /// The share of the span at which ray `place` looks.
    pub(super) fn share(&self, place: usize) -> Option<f32> {
        self.moment(place).share
    }

    /// Ray `place` as it is traced.
    pub(super) fn ray(&self, place: usize) -> Ray {
        let ray = self.rays.get(place);
        if self.closed { ray.closed() } else { ray }
    }

    /// Runs `query` on the rays of `range` on this thread, sorted by `grid` if there is one.
    fn piece<A: Copy + Default>(
        &self,
        memory: &mut Memory,
        range: Range<usize>,
        answers: &mut [A],
        grid: Option<&Grid>,
        query: &impl Fn(&Bvh, &mut Memory, &RayBatch<'_>, &mut [A]),
    ) {
        let (first, conditions) = (range.start, self.conditions());
        let is_alike = self.order == RayOrder::Alike;
        let is_keyed = grid.is_some() || self.times.is_some();
        if let (Rays::List(rays), false, false) = (&self.rays, self.closed, is_keyed) {
            let batch = RayBatch::new(&rays[range], first).under(conditions);
            return query(self.bvh, memory, &batch.alike(is_alike), answers);
        }
        let mut rays = core::mem::take(&mut memory.rays);
        match is_keyed {
            false => {
                for (index, answers) in answers.chunks_mut(GATHER).enumerate() {
                    let first = first + index * GATHER;
                    rays.clear();
                    rays.extend((first..first + answers.len()).map(|place| self.ray(place)));
                    let batch = RayBatch::new(&rays, first).under(conditions);
                    query(self.bvh, memory, &batch.alike(is_alike), answers);
                }
            }
            true => {
                let mut keys = core::mem::take(&mut memory.keys);
                let sorted = match grid {
                    Some(grid) => keys.sort(grid, range.map(|place| self.rays.get(place))),
                    None => keys.as_given(range.len()),
                };
                let mut found = vec![A::default(); GATHER.min(answers.len())];
                for (span, bvh) in self.trees() {
                    let own = match self.times {
                        None => Cow::Borrowed(sorted),
                        Some(_) => {
                            let own = |key: &&Key| self.is_in(span, first + key.index());
                            sorted.iter().filter(own).copied().collect()
                        }
                    };
                    for keys in own.chunks(GATHER) {
                        let places = keys.iter().map(|key| first + key.index());
                        rays.clear();
                        rays.extend(places.clone().map(|place| self.ray(place)));
                        let shares: Option<Vec<f32>> =
                            places.map(|place| self.share(place)).collect();
                        let found = &mut found[..keys.len()];
                        let batch = RayBatch::by_keys(&rays, first, keys).under(conditions);
                        query(bvh, memory, &batch.at(shares.as_deref()), found);
                        for (key, answer) in keys.iter().zip(found) {
                            answers[key.index()] = *answer;
                        }
                    }
                }
                memory.keys = keys;
            }
        }
        memory.rays = rays;
    }
}

/// A list that `fill` fills.
pub(super) fn filled<A: Clone>(len: usize, empty: A, fill: impl FnOnce(&mut [A])) -> Vec<A> {
    let mut answers = vec![empty; len];
    fill(&mut answers);
    answers
}

impl fmt::Debug for Batch<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Batch")
            .field("rays", &self.rays.len())
            .field("among_threads", &self.among_threads)
            .field("closed", &self.closed)
            .field("has_times", &self.times.is_some())
            .field("has_conditions", &!self.conditions.are_none())
            .field("order", &self.order)
            .finish_non_exhaustive()
    }
}
