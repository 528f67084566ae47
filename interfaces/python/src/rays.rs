//! Rays as callers give them, brought before the kernel some at a time.

use std::ops::Range;

use antumbra::inputs::{Column, Distance};
use antumbra::{Batch, Bvh, INVALID_ID, LocalOrigin, PrimId, Ray, RayColumns, RayOrder};
use antumbra_bake::SightLines;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;

use crate::arrays::{Numbers, Values};
use crate::broadcast::{Index, Operand, common_shape};
use crate::groups::{self, RayGroup};
use crate::memory;
use crate::scene::SceneData;
use crate::threads::{ThreadCount, Threads};
use crate::watch::Progress;

/// Rays of one piece for each thread, after which signals are looked for: as many as the kernel sorts together.
pub const PIECE: usize = 1 << 18;

/// Rays that a thread brings before the kernel at a time, where arrays are not as the kernel takes them.
const GATHER: usize = 1 << 13;

/// Up to this many rays stay on the calling thread.
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

    /// Traces all rays by `query` in pieces. `answers` has as many items.
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

    /// Traces these rays by `query`, in the order that is fastest by the kernel's rule.
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

/// Conditions of rays, as callers give them.
#[derive(Default)]
pub struct Conditions<'a, 'py> {
    pub mask: Option<&'a Bound<'py, PyAny>>,
    pub exclude: Option<&'a Bound<'py, PyAny>>,
}

/// Arguments of a call about rays.
pub struct RayArguments<'py> {
    origins: Numbers<'py>,
    directions: Option<Numbers<'py>>,
    distance: Option<Numbers<'py>>,
    near: Option<Numbers<'py>>,
    mask: Option<Numbers<'py>>,
    exclude: Option<[Numbers<'py>; 3]>,
    pub shape: Vec<usize>,
}

impl<'py> RayArguments<'py> {
    /// Reads the arguments. Without directions, rows of origins are origins and directions.
    pub fn read(
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        conditions: Conditions<'_, 'py>,
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
        let mask = conditions.mask.map(|mask| Numbers::whole(mask, "mask"));
        let mask = mask.transpose()?;
        let exclude = conditions.exclude.map(excluded).transpose()?;
        let mut all = vec![(&origins, item)];
        all.extend(directions.iter().map(|directions| (directions, 3)));
        all.extend(distance.iter().chain(&near).map(|numbers| (numbers, 1)));
        all.extend(mask.iter().map(|numbers| (numbers, 1)));
        all.extend(exclude.iter().flatten().map(|numbers| (numbers, 1)));
        let shape = common_shape(&all)?;
        Ok(Self {
            origins,
            directions,
            distance,
            near,
            mask,
            exclude,
            shape,
        })
    }

    /// The rays as a scene has them.
    pub fn rays(&self, scene: &SceneData) -> PyResult<RayArrays<'_>> {
        let operand = |numbers, item| Operand::new(numbers, item, &self.shape);
        let (origins, directions) = match &self.directions {
            Some(directions) => (operand(&self.origins, 3), operand(directions, 3)),
            None => {
                let rows = || operand(&self.origins, 6);
                (rows(), rows().skip(3))
            }
        };
        let len = self.shape.iter().product();
        let masks = match &self.mask {
            None => Masks::None,
            Some(numbers) => {
                let operand = operand(numbers, 1);
                match operand.index {
                    Index::One if len > 0 => Masks::Same(mask(operand.number(0))?),
                    _ => {
                        let mut masks = memory::room(len, "masks")?;
                        for place in 0..len {
                            masks.push(mask(operand.number(place))?);
                        }
                        Masks::Each(masks)
                    }
                }
            }
        };
        let excluded = match &self.exclude {
            None => Vec::new(),
            Some(numbers) => {
                let [triangle, mesh, instance] = [0, 1, 2].map(|which| operand(&numbers[which], 1));
                let places = scene.parts.places();
                let mut excluded = memory::room(len, "primitives left out")?;
                for ray in 0..len {
                    let ids = [&triangle, &mesh, &instance].map(|ids| ids.number(ray) as i64);
                    excluded.push(prim_id(scene, &places, ids)?);
                }
                excluded
            }
        };
        Ok(RayArrays {
            len,
            origins,
            directions,
            far: self.distance.as_ref().map(|numbers| operand(numbers, 1)),
            near: self.near.as_ref().map(|numbers| operand(numbers, 1)),
            local: scene.local(),
            masks,
            excluded,
        })
    }
}

/// A mask of 32 bits.
pub fn mask(number: f64) -> PyResult<u32> {
    match (0.0..=f64::from(u32::MAX)).contains(&number) {
        true => Ok(number as u32),
        false => Err(PyValueError::new_err(format!(
            "mask: found {number}, wanted 0 to {}",
            u32::MAX
        ))),
    }
}

/// Triangle, mesh and instance of the argument `exclude`: of hits, of a tuple of two or three arrays, or of triangles of the
/// first mesh.
fn excluded<'py>(exclude: &Bound<'py, PyAny>) -> PyResult<[Numbers<'py>; 3]> {
    let py = exclude.py();
    let none = || (-1i64).into_pyobject(py).map(Bound::into_any);
    let names = ["triangle", "mesh", "instance"];
    let parts = if exclude.is_instance_of::<crate::hits::Hits>() || exclude.hasattr("triangle")? {
        names.map(|name| exclude.getattr(name))
    } else if let Ok(parts) = exclude.extract::<[Bound<'py, PyAny>; 3]>()
        && exclude.is_instance_of::<PyTuple>()
    {
        parts.map(Ok)
    } else if let Ok([triangle, mesh]) = exclude.extract::<[Bound<'py, PyAny>; 2]>()
        && exclude.is_instance_of::<PyTuple>()
    {
        [Ok(triangle), Ok(mesh), Ok(none()?)]
    } else if exclude.is_instance_of::<PyTuple>() {
        let found = exclude.len()?;
        return Err(PyValueError::new_err(format!(
            "exclude: found a tuple of {found}, wanted (triangle, mesh) or (triangle, mesh, instance)"
        )));
    } else {
        [
            Ok(exclude.clone()),
            0i64.into_pyobject(py)
                .map(Bound::into_any)
                .map_err(Into::into),
            Ok(none()?),
        ]
    };
    let [triangle, mesh, instance] = parts;
    Ok([
        Numbers::whole(&triangle?, "exclude (triangle)")?,
        Numbers::whole(&mesh?, "exclude (mesh)")?,
        Numbers::whole(&instance?, "exclude (instance)")?,
    ])
}

/// The kernel's name of what is left out; -1 as triangle or mesh is nothing.
fn prim_id(
    scene: &SceneData,
    places: &[(Option<u32>, u32)],
    [triangle, mesh, instance]: [i64; 3],
) -> PyResult<PrimId> {
    if triangle == -1 || mesh == -1 {
        return Ok(PrimId::NONE);
    }
    let parts = &scene.parts;
    let of = |list: usize, number: i64, what: &str| match usize::try_from(number) {
        Ok(place) if place < list => Ok(place),
        _ => Err(PyIndexError::new_err(format!(
            "exclude: found {what} {number}, but there are {list}"
        ))),
    };
    let mesh = of(parts.parts.len(), mesh, "mesh")?;
    let triangle = of(parts.parts[mesh].len(), triangle, "triangle")?;
    let (object, geom_id) = places[mesh];
    let inst_id = match (object, instance) {
        (None, -1) => INVALID_ID,
        (Some(object), _) if instance != -1 => {
            let instance = of(parts.instances.len(), instance, "instance")?;
            if parts.instances[instance].object != object {
                return Err(PyValueError::new_err(format!(
                    "exclude: found mesh {mesh} with instance {instance}, which places another mesh"
                )));
            }
            instance as u32
        }
        _ => {
            let wanted = match object {
                None => "-1, since the mesh stands in the world itself",
                Some(_) => "an instance of the mesh",
            };
            return Err(PyValueError::new_err(format!(
                "exclude: found mesh {mesh} with instance {instance}, wanted {wanted}"
            )));
        }
    };
    Ok(PrimId {
        inst_id,
        geom_id,
        prim_id: triangle as u32,
    })
}

/// Masks of rays.
enum Masks {
    None,
    Same(u32),
    Each(Vec<u32>),
}

/// Rays in arrays of callers.
pub struct RayArrays<'a> {
    len: usize,
    origins: Operand<'a>,
    directions: Operand<'a>,
    far: Option<Operand<'a>>,
    near: Option<Operand<'a>>,
    local: LocalOrigin,
    masks: Masks,
    /// One primitive for each ray, or an empty list.
    excluded: Vec<PrimId>,
}

impl RayArrays<'_> {
    /// Origin and direction of a ray, not rounded.
    pub fn given(&self, place: usize) -> ([f64; 3], [f64; 3]) {
        (self.origins.vector(place), self.directions.vector(place))
    }

    /// The rays as a group, if they go from every origin in every direction, are many, have one interval, and have no conditions
    /// of their own.
    pub fn group(&self, scene: &SceneData) -> PyResult<Option<RayGroup>> {
        let ends = [&self.near, &self.far];
        let is_one = |end: &Option<Operand<'_>>| {
            (end.as_ref()).is_none_or(|operand| operand.index == Index::One)
        };
        let is_plain = matches!(self.masks, Masks::None) && self.excluded.is_empty();
        if self.len <= FEW || !is_plain || !ends.into_iter().all(is_one) {
            return Ok(None);
        }
        let (Some(of_origins), Some(of_directions)) =
            (self.origins.index.pair(), self.directions.index.pair())
        else {
            return Ok(None);
        };
        let (points, directions, is_by_point) = match (of_origins, of_directions) {
            ([(columns, 0), (rows, 1)], [(_, 1), (_, 0)]) => (rows, columns, true),
            ([(columns, 1), (rows, 0)], [(_, 0), (_, 1)]) => (columns, rows, false),
            _ => return Ok(None),
        };
        if directions < groups::FEW_DIRECTIONS {
            return Ok(None);
        }
        // Along the axis of columns, items are next to each other in the shape of all.
        let (of_point, of_direction) = match is_by_point {
            true => (directions, 1),
            false => (1, points),
        };
        let origin = |point| self.local.local(self.origins.vector(point * of_point));
        let direction = |place| {
            self.directions
                .vector(place * of_direction)
                .map(|x| x as f32)
        };
        let origins = memory::collected((0..points).map(origin), points, "points")?;
        let all = memory::collected((0..directions).map(direction), directions, "directions")?;
        let ends = self.get(0);
        Ok(RayGroup::new(scene, (origins, all), ends, is_by_point))
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

    fn conditioned<'a>(&'a self, batch: Batch<'a>, first: usize, len: usize) -> Batch<'a> {
        let batch = match &self.masks {
            Masks::None => batch,
            Masks::Same(mask) => batch.mask(*mask),
            Masks::Each(masks) => batch.masks(&masks[first..first + len]),
        };
        match self.excluded.is_empty() {
            true => batch,
            false => batch.except(&self.excluded[first..first + len]),
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
