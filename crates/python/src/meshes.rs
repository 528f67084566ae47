//! Meshes and instances as callers give them.

use antumbra::{Instance, LocalOrigin};
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{Numbers, read_faces};
use crate::broadcast::Operand;
use crate::geometry::{Part, Parts};
use crate::memory;

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

/// A placement before it is rounded: rows of a matrix.
struct Placement {
    mesh: usize,
    rows: [[f64; 4]; 3],
}

pub fn read<'py>(
    vertices: &Bound<'py, PyAny>,
    faces: Option<&Bound<'py, PyAny>>,
    instances: Option<&Bound<'py, PyAny>>,
    origin: Option<&Bound<'py, PyAny>>,
) -> PyResult<Parts> {
    let meshes = match faces {
        Some(faces) => vec![mesh(vertices, faces)?],
        None => list(vertices)?,
    };
    let placements = match instances {
        Some(instances) => placements(instances, meshes.len())?,
        None => Vec::new(),
    };
    let mut is_placed = vec![false; meshes.len()];
    for placement in &placements {
        is_placed[placement.mesh] = true;
    }
    let local = match origin {
        Some(origin) if !is_auto(origin)? => LocalOrigin {
            origin: point(origin)?,
        },
        _ => LocalOrigin {
            origin: automatic(&meshes, &is_placed, &placements),
        },
    };
    let mut parts = Parts {
        local,
        ..Parts::default()
    };
    // Objects have origins of their own, which their placements make good.
    let mut objects = vec![None; meshes.len()];
    for (index, (mesh, is_placed)) in meshes.into_iter().zip(is_placed).enumerate() {
        let own = if is_placed {
            let own = LocalOrigin {
                origin: far_middle(bounds(&mesh.vertices)),
            };
            objects[index] = Some((parts.objects.len(), own));
            parts.objects.push(vec![index as u32]);
            own
        } else {
            parts.world.push(index as u32);
            local
        };
        parts.parts.push(mesh.rounded(&own));
    }
    memory::grow(&mut parts.instances, placements.len(), "instances")?;
    for placement in placements {
        // The loop above made an object of every mesh that is placed.
        let Some((object, own)) = objects[placement.mesh] else {
            continue;
        };
        let [x, y, z] = own.origin;
        let transform = [0, 1, 2].map(|axis| {
            let [a, b, c, d] = placement.rows[axis];
            let moved = a * x + b * y + c * z + d - local.origin[axis];
            [a, b, c, moved].map(|number| number as f32)
        });
        parts
            .instances
            .push(Instance::new(object as u32, transform));
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
        return Err(crate::arrays::wrong_shape(
            "origin",
            numbers.shape(),
            "(3,)",
        ));
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

/// Meshes of a list, or of one object that has vertices and faces.
fn list<'py>(meshes: &Bound<'py, PyAny>) -> PyResult<Vec<Mesh<'py>>> {
    if let Some(one) = with_attributes(meshes)? {
        return Ok(vec![one]);
    }
    let items = meshes.try_iter().map_err(|_| {
        PyTypeError::new_err(
            "meshes: found one thing, wanted vertices and faces, or a list of pairs of both",
        )
    })?;
    items
        .enumerate()
        .map(|(index, item)| {
            let item = item?;
            if let Some(mesh) = with_attributes(&item)? {
                return Ok(mesh);
            }
            let pair: (Bound<'py, PyAny>, Bound<'py, PyAny>) = item.extract().map_err(|_| {
                PyTypeError::new_err(format!(
                    "meshes: item {index} is neither a pair (vertices, faces) nor an object with these attributes"
                ))
            })?;
            mesh(&pair.0, &pair.1).map_err(|error| in_item(meshes.py(), index, &error))
        })
        .collect()
}

/// The error, with the place in the list.
fn in_item(py: Python<'_>, index: usize, error: &PyErr) -> PyErr {
    let text = format!("meshes[{index}]: {}", error.value(py));
    PyErr::from_type(error.get_type(py), text)
}

fn with_attributes<'py>(object: &Bound<'py, PyAny>) -> PyResult<Option<Mesh<'py>>> {
    if object.hasattr("vertices")? && object.hasattr("faces")? {
        let (vertices, faces) = (object.getattr("vertices")?, object.getattr("faces")?);
        return mesh(&vertices, &faces).map(Some);
    }
    Ok(None)
}

fn placements(instances: &Bound<'_, PyAny>, meshes: usize) -> PyResult<Vec<Placement>> {
    let mut placements = Vec::new();
    for (index, item) in instances.try_iter()?.enumerate() {
        let item = item?;
        let pair = if item.hasattr("mesh")? && item.hasattr("transform")? {
            (item.getattr("mesh")?, item.getattr("transform")?)
        } else {
            item.extract().map_err(|_| {
                PyTypeError::new_err(format!(
                    "instances: item {index} is neither an Instance nor a pair (mesh, transform)"
                ))
            })?
        };
        let mesh: isize = pair.0.extract()?;
        let Some(mesh) = usize::try_from(mesh).ok().filter(|&mesh| mesh < meshes) else {
            return Err(PyIndexError::new_err(format!(
                "instances: item {index} names mesh {mesh}, but there are {meshes} meshes"
            )));
        };
        let matrix = Numbers::read(&pair.1, "transform", 4)?;
        if !matches!(matrix.shape(), [3 | 4, 4]) {
            return Err(crate::arrays::wrong_shape(
                "transform",
                matrix.shape(),
                "(4, 4) or (3, 4)",
            ));
        }
        let number = |place: usize| match matrix.values() {
            crate::arrays::Values::F32(values) => f64::from(values[place]),
            crate::arrays::Values::F64(values) => values[place],
        };
        if matrix.shape()[0] == 4 && [12, 13, 14, 15].map(number) != [0.0, 0.0, 0.0, 1.0] {
            return Err(PyValueError::new_err(format!(
                "transform: the last row of instance {index} is {:?}, wanted [0, 0, 0, 1]",
                [12, 13, 14, 15].map(number)
            )));
        }
        memory::grow(&mut placements, 1, "instances")?;
        let rows = [0, 4, 8].map(|first| [0, 1, 2, 3].map(|column| number(first + column)));
        placements.push(Placement { mesh, rows });
    }
    Ok(placements)
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

/// Box around the finite vertices of a mesh.
fn bounds(vertices: &Numbers<'_>) -> Bounds {
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
fn automatic(meshes: &[Mesh<'_>], is_placed: &[bool], placements: &[Placement]) -> [f64; 3] {
    if placements.is_empty() && meshes.iter().all(|mesh| !mesh.vertices.is_f64()) {
        return [0.0; 3];
    }
    let mut all = NOTHING;
    let boxes: Vec<_> = meshes.iter().map(|mesh| bounds(&mesh.vertices)).collect();
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
