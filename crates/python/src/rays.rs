//! Rays as callers give them, brought before the kernel some at a time.

use std::ops::Range;

use antumbra::{Batch, Bvh, Column, Distance, LocalOrigin, Ray, RayColumns, RayOrder};
use antumbra_bake::SightLines;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{Numbers, Values};
use crate::broadcast::{Index, Operand, common_shape};
use crate::memory;
use crate::threads::{ThreadCount, Threads};
use crate::watch::Progress;

/// Rays of one piece for each thread, after which signals are looked for: as many as the kernel sorts together.
pub const PIECE: usize = 1 << 18;

/// Rays that a thread brings before the kernel at a time, where arrays are not as the kernel takes them.
const GATHER: usize = 1 << 13;

/// Fewer rays than this stay on the thread that asks.
const FEW: usize = 1 << 14;

/// Rays of a call.
pub trait RaySource: Sync {
    fn len(&self) -> usize;

    /// One of the rays.
    fn get(&self, place: usize) -> Ray;

    /// Some rays where they lie, if the kernel can take them from there.
    fn columns(&self, _first: usize, _len: usize) -> Option<RayColumns<'_>> {
        None
    }

    /// Some of the rays.
    fn gather(&self, first: usize, len: usize, rays: &mut Vec<Ray>) {
        rays.clear();
        rays.extend((first..first + len).map(|place| self.get(place)));
    }
}

/// What every call about rays or points may say.
pub struct Call<'py> {
    pub threads: Threads,
    pub progress: Progress<'py>,
}

impl<'py> Call<'py> {
    pub fn new(
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        Ok(Self {
            threads: Threads::of(threads)?,
            progress: Progress::new(progress)?,
        })
    }

    /// Does work on some of `count` things at a time: `piece` for each thread. Looks for signals in between.
    pub fn in_pieces(
        &mut self,
        py: Python<'_>,
        count: usize,
        piece: usize,
        mut work: impl FnMut(Range<usize>, &Threads) -> PyResult<()>,
    ) -> PyResult<()> {
        let piece = piece * self.threads.count();
        for first in (0..count).step_by(piece) {
            let range = first..count.min(first + piece);
            let end = range.end;
            work(range, &self.threads)?;
            py.check_signals()?;
            self.progress.tell(end as u64, count as u64)?;
        }
        Ok(())
    }

    /// Asks about all rays, `answers` being as many.
    pub fn ask<A: Send>(
        &mut self,
        py: Python<'_>,
        bvh: &Bvh,
        rays: &impl RaySource,
        answers: &mut [A],
        query: impl Fn(Batch<'_>, &mut [A]) + Sync,
    ) -> PyResult<()> {
        let mut memory = Vec::new();
        self.in_pieces(py, rays.len(), PIECE, |range, threads| {
            let answers = &mut answers[range.clone()];
            let piece = Piece {
                bvh,
                rays,
                range,
                threads,
            };
            py.detach(|| piece.ask(&mut memory, Gathering::Few, answers, &query))
        })
    }
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
pub enum Gathering {
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

    /// Asks about these rays, in the order that is fastest by the kernel's rule.
    pub fn ask<A: Send>(
        &self,
        memory: &mut Vec<Ray>,
        gathering: Gathering,
        answers: &mut [A],
        query: &(impl Fn(Batch<'_>, &mut [A]) + Sync),
    ) -> PyResult<()> {
        let (first, len, alone) = (self.range.start, self.range.len(), self.is_alone());
        let here = |batch: Batch<'_>, answers: &mut [A]| {
            let batch = batch.order(RayOrder::ByRule);
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
                    self.rays
                        .gather(first + index * GATHER, answers.len(), rays);
                    query(self.bvh.batch(&*rays).on_this_thread(), answers);
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
    lines: SightLines,
    local: LocalOrigin,
}

impl<'a> Segments<'a> {
    pub fn new(
        from: &'a Numbers<'_>,
        to: &'a Numbers<'_>,
        shape: &[usize],
        lines: SightLines,
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

/// Arguments of a call about rays.
pub struct RayArguments<'py> {
    origins: Numbers<'py>,
    directions: Option<Numbers<'py>>,
    distance: Option<Numbers<'py>>,
    near: Option<Numbers<'py>>,
    pub shape: Vec<usize>,
}

impl<'py> RayArguments<'py> {
    /// Reads the arguments. Without directions, rows of origins are origins and directions.
    pub fn read(
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let number = |object: Option<&Bound<'py, PyAny>>, name| {
            object
                .map(|object| Numbers::read(object, name, 1))
                .transpose()
        };
        let item = if directions.is_some() { 3 } else { 6 };
        let origins = Numbers::read(origins, "origins", item)?;
        let directions = directions.map(|directions| Numbers::read(directions, "directions", 3));
        let directions = directions.transpose()?;
        let distance = number(distance, "distance")?;
        let near = number(near, "near")?;
        let mut all = vec![(&origins, item)];
        all.extend(directions.iter().map(|directions| (directions, 3)));
        all.extend(distance.iter().chain(&near).map(|numbers| (numbers, 1)));
        let shape = common_shape(&all)?;
        Ok(Self {
            origins,
            directions,
            distance,
            near,
            shape,
        })
    }

    /// The rays as seen from a local origin.
    pub fn rays(&self, local: LocalOrigin) -> RayArrays<'_> {
        let operand = |numbers, item| Operand::new(numbers, item, &self.shape);
        let (origins, directions) = match &self.directions {
            Some(directions) => (operand(&self.origins, 3), operand(directions, 3)),
            None => {
                let rows = || operand(&self.origins, 6);
                (rows(), rows().skip(3))
            }
        };
        RayArrays {
            len: self.shape.iter().product(),
            origins,
            directions,
            far: self.distance.as_ref().map(|numbers| operand(numbers, 1)),
            near: self.near.as_ref().map(|numbers| operand(numbers, 1)),
            local,
        }
    }
}

/// Rays in arrays of callers.
pub struct RayArrays<'a> {
    len: usize,
    origins: Operand<'a>,
    directions: Operand<'a>,
    far: Option<Operand<'a>>,
    near: Option<Operand<'a>>,
    local: LocalOrigin,
}

impl RayArrays<'_> {
    /// Origin and direction of a ray, not rounded.
    pub fn given(&self, place: usize) -> ([f64; 3], [f64; 3]) {
        (self.origins.vector(place), self.directions.vector(place))
    }
}

impl RaySource for RayArrays<'_> {
    fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn get(&self, place: usize) -> Ray {
        let number = |operand: &Option<Operand<'_>>, otherwise| match operand {
            Some(operand) => operand.number(place) as f32,
            None => otherwise,
        };
        Ray {
            org: self.local.local(self.origins.vector(place)),
            dir: self.directions.vector(place).map(|x| x as f32),
            tnear: number(&self.near, 0.0),
            tfar: number(&self.far, f32::INFINITY),
        }
    }

    fn columns(&self, first: usize, len: usize) -> Option<RayColumns<'_>> {
        if len == 0 || self.local != LocalOrigin::default() {
            return None;
        }
        let vectors = |operand| column(operand, first);
        let columns =
            RayColumns::new(len, vectors(&self.origins)?, vectors(&self.directions)?).ok()?;
        let columns = columns
            .far(distance(&self.far, first, f32::INFINITY)?)
            .ok()?;
        columns.near(distance(&self.near, first, 0.0)?).ok()
    }
}

/// Items of an argument from `first` on, if the kernel can take them where they lie.
fn column<'a>(operand: &Operand<'a>, first: usize) -> Option<Column<'a>> {
    let Values::F32(values) = operand.values else {
        return None;
    };
    match operand.index {
        Index::Each => Some(Column::new(&values[operand.place(first)..], operand.item)),
        Index::One => Some(Column::new(&values[operand.place(0)..], 0)),
        Index::Strided(_) => None,
    }
}

fn distance<'a>(
    operand: &Option<Operand<'a>>,
    first: usize,
    otherwise: f32,
) -> Option<Distance<'a>> {
    match operand {
        None => Some(Distance::Same(otherwise)),
        Some(operand) if operand.index == Index::One => {
            Some(Distance::Same(operand.number(0) as f32))
        }
        Some(operand) => column(operand, first).map(Distance::Each),
    }
}
