//! Rays brought before the kernel, some at a time.

use std::ops::Range;

use antumbra::{Batch, Bvh, Hit, LocalOrigin, Ray, RayColumns, RayOrder};
use antumbra_bake::SightLines;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::Numbers;
use crate::arrays::broadcast::Operand;
use crate::arrays::memory;
use crate::call::Call;
use crate::call::threads::Threads;

/// Rays of one piece for each thread, after which signals are looked for: as many as the kernel sorts together.
const PIECE: usize = 1 << 18;

/// Rays that a thread brings before the kernel at a time, where arrays are not as the kernel takes them.
const GATHER: usize = 1 << 13;

/// Up to this many rays stay on the calling thread.
pub const FEW: usize = 1 << 14;

/// Rays of a call.
pub trait RaySource: Sync {
    fn len(&self) -> usize;

    /// One of the rays.
    fn get(&self, place: usize) -> Ray;

    /// Some rays where they lie, if the kernel can take them from there.
    fn columns(&self, _first: usize, _len: usize) -> Option<RayColumns<'_>> {
        None
    }

    /// Rays from `first` on, with the conditions of their own that they have.
    fn conditioned<'a>(&'a self, batch: Batch<'a>, _first: usize, _len: usize) -> Batch<'a> {
        batch
    }

    /// Some of the rays.
    fn gather(&self, first: usize, len: usize, rays: &mut Vec<Ray>) {
        rays.clear();
        rays.extend((first..first + len).map(|place| self.get(place)));
    }
}

/// Does work on all rays of a call: `size` rays of each thread at a time.
pub fn in_pieces<R: RaySource>(
    call: &mut Call<'_>,
    (bvh, rays): (&Bvh, &R),
    size: usize,
    mut work: impl FnMut(Piece<'_, R>) -> PyResult<()> + Send,
) -> PyResult<()> {
    call.in_pieces(rays.len(), size, |range, threads| {
        work(Piece {
            bvh,
            rays,
            range,
            threads,
        })
    })
}

/// Traces all rays by `query`. `answers` has as many items.
pub fn trace<R: RaySource, A: Send>(
    call: &mut Call<'_>,
    (bvh, rays): (&Bvh, &R),
    answers: &mut [A],
    query: impl Fn(Batch<'_>, &mut [A]) + Sync + Send,
) -> PyResult<()> {
    let mut memory = Vec::new();
    in_pieces(call, (bvh, rays), PIECE, |piece| {
        let answers = &mut answers[piece.range.clone()];
        piece.trace(&mut memory, Gathering::Few, answers, &query)
    })
}

/// Finds the first hits of all rays, and passes the hits of each piece to `work`.
pub fn first_hits<R: RaySource>(
    call: &mut Call<'_>,
    (bvh, rays): (&Bvh, &R),
    mut work: impl FnMut(&Piece<'_, R>, &[Option<Hit>]) -> PyResult<()> + Send,
) -> PyResult<()> {
    let (mut gathered, mut hits) = (Vec::new(), Vec::new());
    let query = |batch: Batch<'_>, hits: &mut [Option<Hit>]| batch.closed().intersect_into(hits);
    in_pieces(call, (bvh, rays), PIECE, |piece| {
        memory::refill(&mut hits, None, piece.range.len(), "hits")?;
        piece.trace(&mut gathered, Gathering::All, &mut hits, &query)?;
        work(&piece, &hits)
    })
}

/// Some rays of a call, and where they are traced.
pub struct Piece<'a, R> {
    pub bvh: &'a Bvh,
    pub rays: &'a R,
    pub range: Range<usize>,
    pub threads: &'a Threads,
}

/// How many rays are brought together that do not lie as the kernel takes them.
#[derive(Clone, Copy, PartialEq)]
enum Gathering {
    /// So few that they stay in the caches.
    Few,
    /// All of a piece, for queries that sort.
    All,
}

impl<R: RaySource> Piece<'_, R> {
    /// Whether the calling thread does the work.
    pub fn is_alone(&self) -> bool {
        self.threads.count() == 1 || self.range.len() <= FEW
    }

    /// Traces these rays by `query`, in the order that is fastest by the kernel's rule.
    fn trace<A: Send>(
        &self,
        memory: &mut Vec<Ray>,
        gathering: Gathering,
        answers: &mut [A],
        query: &(impl Fn(Batch<'_>, &mut [A]) + Sync),
    ) -> PyResult<()> {
        let (first, len, alone) = (self.range.start, self.range.len(), self.is_alone());
        let here = |batch: Batch<'_>, answers: &mut [A]| {
            let batch = batch.order(RayOrder::ByRule);
            let batch = self.rays.conditioned(batch, first, len);
            query(if alone { batch.on_this_thread() } else { batch }, answers);
        };
        let columns = self.rays.columns(first, len);
        let is_gathered = columns.is_none() && gathering == Gathering::All && len > FEW;
        if is_gathered {
            memory.clear();
            memory::grow(memory, len, "rays")?;
        }
        self.run(|| match columns {
            Some(columns) => here(self.bvh.batch(columns), answers),
            None if is_gathered => {
                if alone {
                    self.rays.gather(first, len, memory);
                } else {
                    let places = self.range.clone().into_par_iter();
                    let rays = places.map(|place| self.rays.get(place));
                    rays.collect_into_vec(memory);
                }
                here(self.bvh.batch(&*memory), answers);
            }
            None => {
                let part = |rays: &mut Vec<Ray>, (index, answers): (usize, &mut [A])| {
                    let (first, len) = (first + index * GATHER, answers.len());
                    self.rays.gather(first, len, rays);
                    let batch = self.bvh.batch(&*rays).on_this_thread();
                    query(self.rays.conditioned(batch, first, len), answers);
                };
                if alone {
                    let parts = answers.chunks_mut(GATHER).enumerate();
                    parts.for_each(|answers| part(memory, answers));
                } else {
                    let parts = answers.par_chunks_mut(GATHER).enumerate();
                    parts.for_each_init(Vec::new, part);
                }
            }
        });
        Ok(())
    }

    /// Does work on the calling thread or in the pool.
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        if self.is_alone() {
            work()
        } else {
            self.threads.run(work)
        }
    }
}

/// Lines of sight between points of the world.
pub struct Segments<'a> {
    len: usize,
    from: Operand<'a>,
    to: Operand<'a>,
    lines: SightLines<'a>,
    local: LocalOrigin,
}

impl<'a> Segments<'a> {
    pub fn new(
        from: &'a Numbers<'_>,
        to: &'a Numbers<'_>,
        shape: &[usize],
        lines: SightLines<'a>,
        local: LocalOrigin,
    ) -> Self {
        Self {
            len: shape.iter().product(),
            from: Operand::new(from, 3, shape),
            to: Operand::new(to, 3, shape),
            lines,
            local,
        }
    }

    /// Whether both ends of a segment are points.
    pub fn is_finite(&self, place: usize) -> bool {
        let ends = [self.from.vector(place), self.to.vector(place)];
        ends.as_flattened().iter().all(|x| x.is_finite())
    }
}

impl RaySource for Segments<'_> {
    fn len(&self) -> usize {
        self.len
    }

    fn get(&self, place: usize) -> Ray {
        let (from, to) = (self.from.vector(place), self.to.vector(place));
        self.lines.ray(&self.local, from, to)
    }
}
