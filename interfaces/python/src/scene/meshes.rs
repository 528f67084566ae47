//! Meshes and instances as callers give them.

use std::sync::Arc;

use antumbra::LocalOrigin;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::curves;
use super::parts::{Part, Parts};
use super::placements::{self, Placement};
use crate::arrays::broadcast::Operand;
use crate::arrays::{Numbers, memory, read_faces, wrong_shape};

/// Coordinates this many times as large as the scene is long are brought to an origin of their own: then single precision
/// would lose more than two of its bits.
const FAR: f64 = 2.0;

/// One mesh that is not yet rounded.
struct Mesh<'py> {
    vertices: Numbers<'py>,
    /// Room for the rounded vertices.
    positions: Vec<[f32; 3]>,
    faces: Vec<[u32; 3]>,
}

/// What has a place in the list of meshes, not yet rounded.
enum Item<'py> {
    Mesh(Mesh<'py>),
    Curves(curves::Given<'py>),
    /// Instances that are placed together.
    Assembly(Bound<'py, PyAny>),
}

pub fn read<'py>(
    vertices: &Bound<'py, PyAny>,
    faces: Option<&Bound<'py, PyAny>>,
    instances: Option<&Bound<'py, PyAny>>,
    origin: Option<&Bound<'py, PyAny>>,
) -> PyResult<Parts> {
    let (meshes, placements) = match faces {
        Some(faces) => (vec![Item::Mesh(mesh(vertices, faces)?)], Vec::new()),
        None => list(vertices)?,
    };
    let placements = match instances {
        Some(_) if !placements.is_empty() => {
            return Err(PyValueError::new_err(
                "instances: found beside a scene that places its meshes itself, wanted one of both",
            ));
        }
        Some(instances) => placements::placements(instances, meshes.len())?,
        None => placements,
    };
    let mut is_placed = vec![false; meshes.len()];
    let (placements, paths) = flat(&meshes, placements, &mut is_placed)?;
    let parts = assembled(meshes, &is_placed, &placements, origin)?;
    Ok(Parts {
        paths,
        origins: Vec::new(),
        ..parts
    })
}

/// Placements of meshes only, and paths to them if there are assemblies: places in the lists from the world inwards.
fn flat(
    items: &[Item<'_>],
    placements: Vec<Placement>,
    is_placed: &mut [bool],
) -> PyResult<(Vec<Placement>, Vec<i32>)> {
    let held = |(index, item): (usize, &Item<'_>)| match item {
        Item::Assembly(instances) => placements::placements(instances, items.len())
            .map(Some)
            .map_err(|error| in_item(instances.py(), index, &error)),
        _ => Ok(None),
    };
    let inside = items.iter().enumerate().map(held);
    let inside = inside.collect::<PyResult<Vec<_>>>()?;
    // From the world inwards: assemblies that only place each other are not placed.
    let mut list = &placements[..];
    let mut open = Vec::new();
    loop {
        for placement in list {
            if !is_placed[placement.mesh] {
                is_placed[placement.mesh] = true;
                open.push(placement.mesh);
            }
        }
        let Some(mesh) = open.pop() else { break };
        list = inside[mesh].as_deref().unwrap_or(&[]);
    }
    let is_lost =
        |(held, is_placed): (&Option<Vec<Placement>>, &bool)| held.is_some() && !is_placed;
    if let Some(lost) = inside.iter().zip(&*is_placed).position(is_lost) {
        return Err(PyValueError::new_err(format!(
            "meshes[{lost}]: found an Assembly that nothing places, wanted an instance of it"
        )));
    }
    if inside.iter().all(Option::is_none) {
        return Ok((placements, Vec::new()));
    }
    let flat = placements::flat(&placements, &inside)?;
    Ok((flat.placements, flat.paths))
}

/// Objects of a world, one for each mesh, and the meshes of its ground behind them. `rows` are the
/// placements to come, with the object of each, by which the origin is chosen.
pub fn objects<'py>(
    meshes: &Bound<'py, PyAny>,
    ground: Option<&Bound<'py, PyAny>>,
    rows: (Option<&Bound<'py, PyAny>>, Option<&Bound<'py, PyAny>>),
    origin: Option<&Bound<'py, PyAny>>,
) -> PyResult<Parts> {
    let plain = |list: &Bound<'py, PyAny>, name: &str| {
        let (meshes, placements) = self::list(list)?;
        let is_assembly = |item: &Item<'_>| matches!(item, Item::Assembly(_));
        match placements.is_empty() && !meshes.iter().any(is_assembly) {
            true => Ok(meshes),
            false => Err(PyValueError::new_err(format!(
                "{name}: found a scene or an Assembly that places its meshes itself, wanted meshes"
            ))),
        }
    };
    let mut all = plain(meshes, "meshes")?;
    let objects = all.len();
    let placements = placements::of_arrays(rows, objects, &[])?;
    if let Some(ground) = ground {
        all.extend(plain(ground, "ground")?);
    }
    let is_object: Vec<_> = (0..all.len()).map(|mesh| mesh < objects).collect();
    assembled(all, &is_object, &placements, origin)
}

/// Rounds meshes around one origin. Those that are objects have origins of their own, which their placements make good.
fn assembled<'py>(
    items: Vec<Item<'py>>,
    is_object: &[bool],
    placements: &[Placement],
    origin: Option<&Bound<'py, PyAny>>,
) -> PyResult<Parts> {
    let origin = match origin {
        Some(origin) if !is_auto(origin)? => point(origin)?,
        _ => automatic(&items, is_object, placements),
    };
    let local = LocalOrigin { origin };
    let mut parts = Parts {
        local,
        ..Parts::default()
    };
    let mut objects = vec![None; items.len()];
    for (index, item) in items.into_iter().enumerate() {
        let mut own = local;
        if matches!(item, Item::Assembly(_)) {
            // Its instances are placed one by one.
        } else if is_object[index] {
            own.origin = far_middle(bounds(item.points()));
            objects[index] = Some(parts.objects.len());
            parts.objects.push(vec![index as u32]);
            parts.origins.push(own.origin);
        } else {
            parts.world.push(index as u32);
        }
        parts.parts.push(Arc::new(item.rounded(&own)?));
    }
    memory::grow(&mut parts.instances, placements.len(), "instances")?;
    for Placement { mesh, rows } in placements {
        // The loop above made an object of every mesh that is placed.
        let Some(object) = objects[*mesh] else {
            continue;
        };
        let own = parts.origins[object];
        let instance = placements::placed(object as u32, rows, own, local.origin);
        parts.instances.push(instance);
    }
    Ok(parts)
}

fn is_auto(origin: &Bound<'_, PyAny>) -> PyResult<bool> {
    let Ok(name) = origin.extract::<String>() else {
        return Ok(false);
    };
    match &name[..] {
        "auto" => Ok(true),
        _ => Err(PyValueError::new_err(format!(
            "origin: found {name:?}, wanted \"auto\" or three numbers"
        ))),
    }
}

fn point(origin: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    let numbers = Numbers::read(origin, "origin", 3)?;
    if numbers.shape() != [3] {
        return Err(wrong_shape("origin", numbers.shape(), "(3,)"));
    }
    let point = Operand::new(&numbers, 3, &[]).vector(0);
    match point.iter().all(|x| x.is_finite()) {
        true => Ok(point),
        false => Err(PyValueError::new_err(format!(
            "origin: found {point:?}, wanted finite numbers"
        ))),
    }
}

fn mesh<'py>(vertices: &Bound<'py, PyAny>, faces: &Bound<'py, PyAny>) -> PyResult<Mesh<'py>> {
    let vertices = Numbers::read(vertices, "vertices", 3)?;
    let rows = vertices.rows()?;
    let positions = memory::room(rows, "vertices")?;
    let faces = read_faces(faces, "faces", rows)?;
    Ok(Mesh {
        vertices,
        positions,
        faces,
    })
}

/// Meshes of a list or of one object, and placements if that places them. What objects of other packages hold is written in
/// Python.
fn list<'py>(meshes: &Bound<'py, PyAny>) -> PyResult<(Vec<Item<'py>>, Vec<Placement>)> {
    let py = meshes.py();
    let read = py.import("antumbra._meshes")?.getattr("meshes")?;
    let (items, instances): (Vec<Bound<'py, PyAny>>, Bound<'py, PyAny>) =
        read.call1((meshes,))?.extract()?;
    let is_one = items.len() == 1;
    let read = |(index, given): (usize, Bound<'py, PyAny>)| {
        item(&given).map_err(|error| {
            if is_one {
                error
            } else {
                in_item(py, index, &error)
            }
        })
    };
    let found: Vec<_> = items
        .into_iter()
        .enumerate()
        .map(read)
        .collect::<PyResult<_>>()?;
    let placements = placements::placements(&instances, found.len())?;
    Ok((found, placements))
}

/// One item, as the function in Python gives it: `Curves`, an `Assembly`, or vertices and faces.
fn item<'py>(given: &Bound<'py, PyAny>) -> PyResult<Item<'py>> {
    if given.hasattr("instances")? {
        return Ok(Item::Assembly(given.getattr("instances")?));
    }
    if given.hasattr("radii")? {
        return Ok(Item::Curves(curves::Given::read(given)?));
    }
    let (vertices, faces): (Bound<'py, PyAny>, Bound<'py, PyAny>) = given.extract()?;
    Ok(Item::Mesh(mesh(&vertices, &faces)?))
}

/// The error, with the place in the list.
fn in_item(py: Python<'_>, index: usize, error: &PyErr) -> PyErr {
    let text = format!("meshes[{index}]: {}", error.value(py));
    PyErr::from_type(error.get_type(py), text)
}

type Bounds = [[f64; 3]; 2];

const NOTHING: Bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];

fn add(bounds: &mut Bounds, point: [f64; 3]) {
    if point.iter().all(|x| x.is_finite()) {
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(point[axis]);
            bounds[1][axis] = bounds[1][axis].max(point[axis]);
        }
    }
}

/// Box around the finite points of an item.
fn bounds(points: Option<&Numbers<'_>>) -> Bounds {
    let Some(vertices) = points else {
        return NOTHING;
    };
    let lead = vertices.lead(3);
    let operand = Operand::new(vertices, 3, lead);
    let mut bounds = NOTHING;
    for place in 0..lead.iter().product() {
        add(&mut bounds, operand.vector(place));
    }
    bounds
}

/// The middle of a box that lies far away for its size; zero for others, so that coordinates stay as they are.
fn far_middle([low, high]: Bounds) -> [f64; 3] {
    let axes = [0, 1, 2];
    let longest = axes
        .map(|axis| high[axis] - low[axis])
        .into_iter()
        .fold(0.0, f64::max);
    let farthest = axes.map(|axis| low[axis].abs().max(high[axis].abs()));
    let farthest = farthest.into_iter().fold(0.0, f64::max);
    if low[0] > high[0] || farthest <= FAR * longest {
        return [0.0; 3];
    }
    // Halved first: the sum of two large coordinates may overflow.
    axes.map(|axis| 0.5 * low[axis] + 0.5 * high[axis])
}

/// Origin of a scene: zero if all its vertices are rounded already, and instances keep them so.
fn automatic(meshes: &[Item<'_>], is_placed: &[bool], placements: &[Placement]) -> [f64; 3] {
    if placements.is_empty()
        && meshes
            .iter()
            .all(|mesh| !mesh.points().is_some_and(Numbers::is_f64))
    {
        return [0.0; 3];
    }
    let mut all = NOTHING;
    let boxes: Vec<_> = meshes.iter().map(|mesh| bounds(mesh.points())).collect();
    for (bounds, is_placed) in boxes.iter().zip(is_placed) {
        if !is_placed {
            bounds.iter().for_each(|&corner| add(&mut all, corner));
        }
    }
    for placement in placements {
        let bounds = &boxes[placement.mesh];
        for corner in 0..8 {
            let point = [0, 1, 2].map(|axis| bounds[corner >> axis & 1][axis]);
            let [x, y, z] = point;
            add(
                &mut all,
                placement.rows.map(|[a, b, c, d]| a * x + b * y + c * z + d),
            );
        }
    }
    far_middle(all)
}

impl<'py> Item<'py> {
    fn points(&self) -> Option<&Numbers<'py>> {
        match self {
            Self::Mesh(mesh) => Some(&mesh.vertices),
            Self::Curves(curves) => Some(&curves.points),
            Self::Assembly(_) => None,
        }
    }

    fn rounded(self, local: &LocalOrigin) -> PyResult<Part> {
        match self {
            Self::Mesh(mesh) => Ok(mesh.rounded(local)),
            Self::Curves(curves) => curves.rounded(local).map(Part::Curves),
            // Takes a number in the list of meshes.
            Self::Assembly(_) => Ok(Part::Mesh {
                positions: Vec::new(),
                indices: Vec::new(),
                opacity: None,
            }),
        }
    }
}

impl Mesh<'_> {
    fn rounded(mut self, local: &LocalOrigin) -> Part {
        let lead = self.vertices.lead(3);
        let operand = Operand::new(&self.vertices, 3, lead);
        let count = lead.iter().product();
        let points = (0..count).map(|place| local.local(operand.vector(place)));
        self.positions.extend(points);
        Part::Mesh {
            positions: self.positions,
            indices: self.faces,
            opacity: None,
        }
    }
}
