//! Rays as callers give them.

use antumbra::inputs::{Column, Distance};
use antumbra::{Batch, INVALID_ID, LocalOrigin, PrimId, Ray, RayColumns};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::groups::{self, RayGroup};
use super::piece::{FEW, RaySource};
use crate::arrays::broadcast::{Index, Operand, common_shape};
use crate::arrays::{Numbers, Values, mask, memory};
use crate::scene::SceneData;

/// An argument that may be absent.
pub type Given<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

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
        (origins, directions): (&Bound<'py, PyAny>, Given<'_, 'py>),
        (near, distance): (Given<'_, 'py>, Given<'_, 'py>),
        (mask, exclude): (Given<'_, 'py>, Given<'_, 'py>),
    ) -> PyResult<Self> {
        let read = |object: Given<'_, 'py>, name, item| {
            let numbers = object.map(|object| Numbers::read(object, name, item));
            numbers.transpose()
        };
        let item = if directions.is_some() { 3 } else { 6 };
        let origins = Numbers::read(origins, "origins", item)?;
        let directions = read(directions, "directions", 3)?;
        let distance = read(distance, "distance", 1)?;
        let near = read(near, "near", 1)?;
        let mask = mask.map(|mask| Numbers::whole(mask, "mask")).transpose()?;
        let exclude = exclude.map(excluded).transpose()?;
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
        let mut excluded = Vec::new();
        if let Some(numbers) = &self.exclude {
            let ids = numbers.each_ref().map(|numbers| operand(numbers, 1));
            let places = scene.parts.places();
            memory::grow(&mut excluded, len, "primitives left out")?;
            for ray in 0..len {
                let ids = ids.each_ref().map(|ids| ids.number(ray) as i64);
                excluded.push(prim_id(scene, &places, ids)?);
            }
        }
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

    /// The rays over closed intervals, without conditions.
    pub fn closed(&self, scene: &SceneData) -> PyResult<Vec<Ray>> {
        let rays = self.rays(scene)?;
        let closed = |place| rays.get(place).closed();
        memory::collected((0..rays.len()).map(closed), rays.len(), "rays")
    }
}

/// Triangle, mesh and instance of the argument `exclude`: of hits, of a tuple of two or three arrays, or of triangles of the
/// first mesh.
fn excluded<'py>(exclude: &Bound<'py, PyAny>) -> PyResult<[Numbers<'py>; 3]> {
    let whole = |number: i64| Ok::<_, PyErr>(number.into_pyobject(exclude.py())?.into_any());
    let names = ["triangle", "mesh", "instance"];
    let parts = if exclude.hasattr("triangle")? {
        let [triangle, mesh, instance] = names.map(|name| exclude.getattr(name));
        [triangle?, mesh?, instance?]
    } else if !exclude.is_instance_of::<PyTuple>() {
        [exclude.clone(), whole(0)?, whole(-1)?]
    } else if let Ok(parts) = exclude.extract() {
        parts
    } else if let Ok([triangle, mesh]) = exclude.extract::<[Bound<'py, PyAny>; 2]>() {
        [triangle, mesh, whole(-1)?]
    } else {
        let found = exclude.len()?;
        return Err(PyValueError::new_err(format!(
            "exclude: found a tuple of {found}, wanted (triangle, mesh) or (triangle, mesh, instance)"
        )));
    };
    let [triangle, mesh, instance] = &parts;
    Ok([
        Numbers::whole(triangle, "exclude (triangle)")?,
        Numbers::whole(mesh, "exclude (mesh)")?,
        Numbers::whole(instance, "exclude (instance)")?,
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
