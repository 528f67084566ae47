//! Instances as callers give them, and instances of instances made flat.

use antumbra::{Instance, NestedInstances};
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::broadcast::Operand;
use crate::arrays::{Numbers, memory, wrong_shape};
use crate::errors::raised;

/// A placement before it is rounded: rows of a matrix.
#[derive(Clone, Copy)]
pub struct Placement {
    pub mesh: usize,
    pub rows: [[f64; 4]; 3],
}

impl Placement {
    /// The placement inside of another one.
    fn within(&self, outer: &[[f64; 4]; 3]) -> Self {
        let product = |row: [f64; 4]| {
            let column = |column: usize| {
                let sum: f64 = (0..3).map(|k| row[k] * self.rows[k][column]).sum();
                if column == 3 { sum + row[3] } else { sum }
            };
            [0, 1, 2, 3].map(column)
        };
        Self {
            mesh: self.mesh,
            rows: outer.map(product),
        }
    }

    /// As the kernel has it where objects and world have no origins of their own.
    fn instance(&self) -> Instance {
        placed(self.mesh as u32, &self.rows, [0.0; 3], [0.0; 3])
    }
}

/// Placements of meshes, and how each is reached.
pub struct Flat {
    pub placements: Vec<Placement>,
    /// Places in the lists from the world inwards, as many for each placement: -1 behind the last one.
    pub paths: Vec<i32>,
}

/// Makes placements flat: `inside` are those that an item of the list of meshes holds, `None` for a mesh.
pub fn flat(world: &[Placement], inside: &[Option<Vec<Placement>>]) -> PyResult<Flat> {
    let instances =
        |list: &[Placement]| -> Vec<Instance> { list.iter().map(Placement::instance).collect() };
    let held = |item: &Option<Vec<Placement>>| instances(item.as_deref().unwrap_or(&[]));
    let lists: Vec<_> = inside.iter().map(held).collect();
    let is_mesh = |object: u32| inside[object as usize].is_none();
    let nested = NestedInstances::new(&instances(world), &lists, is_mesh).map_err(raised)?;
    let count = nested.instances().len();
    let mut placements = memory::room(count, "instances")?;
    let (mut steps, mut depth) = (Vec::new(), 1);
    for index in 0..count {
        let path = nested.path(index as u32);
        depth = depth.max(path.len());
        // Products in double precision: rounding comes at the end.
        let (mut list, mut outer) = (world, None);
        for &place in &path {
            let placement = list[place as usize];
            let product = match &outer {
                None => placement,
                Some(Placement { rows, .. }) => placement.within(rows),
            };
            list = inside[placement.mesh].as_deref().unwrap_or(&[]);
            outer = Some(product);
        }
        placements.extend(outer);
        memory::grow(&mut steps, 1, "paths")?;
        steps.push(path);
    }
    let mut paths = memory::room(count * depth, "paths")?;
    for path in steps {
        let end = (paths.len() / depth + 1) * depth;
        paths.extend(path.iter().map(|&place| place as i32));
        paths.resize(end, -1);
    }
    Ok(Flat { placements, paths })
}

/// An instance of an object that has an origin of its own, in a world that has one, too.
pub fn placed(object: u32, rows: &[[f64; 4]; 3], [x, y, z]: [f64; 3], world: [f64; 3]) -> Instance {
    let transform = [0, 1, 2].map(|axis| {
        let [a, b, c, d] = rows[axis];
        let moved = a * x + b * y + c * z + d - world[axis];
        [a, b, c, moved].map(|number| number as f32)
    });
    Instance::new(object, transform)
}

/// Reads instances, each of one of so many meshes.
pub fn placements(instances: &Bound<'_, PyAny>, meshes: usize) -> PyResult<Vec<Placement>> {
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
        let &[count @ (3 | 4), 4] = matrix.shape() else {
            return Err(wrong_shape("transform", matrix.shape(), "(4, 4) or (3, 4)"));
        };
        let operand = Operand::new(&matrix, 4, matrix.lead(4));
        memory::grow(&mut placements, 1, "instances")?;
        placements.push(Placement {
            mesh,
            rows: affine("transform", &operand, index, 0, count)?,
        });
    }
    Ok(placements)
}

/// Rows of the affine map of an instance, which begin at `first`: three, or four of which the last one says nothing.
fn affine(
    name: &str,
    operand: &Operand<'_>,
    instance: usize,
    first: usize,
    count: usize,
) -> PyResult<[[f64; 4]; 3]> {
    let row = |place| operand.row(first + place);
    if count == 4 && row(3) != [0.0, 0.0, 0.0, 1.0] {
        return Err(PyValueError::new_err(format!(
            "{name}: the last row of instance {instance} is {:?}, wanted [0, 0, 0, 1]",
            row(3)
        )));
    }
    Ok([0, 1, 2].map(row))
}

/// Reads matrices, and which of `count` objects each of them places. Without objects, instances place what they placed before,
/// or the one object.
pub fn of_arrays(
    (transforms, objects): (Option<&Bound<'_, PyAny>>, Option<&Bound<'_, PyAny>>),
    count: usize,
    before: &[u32],
) -> PyResult<Vec<Placement>> {
    let Some(transforms) = transforms else {
        return match objects {
            None => Ok(Vec::new()),
            Some(_) => Err(PyValueError::new_err(
                "transforms: found none beside objects, wanted shape (k, 4, 4) or (k, 3, 4)",
            )),
        };
    };
    let matrices = Numbers::read(transforms, "transforms", 4)?;
    let (instances, rows) = match *matrices.shape() {
        [instances, rows @ (3 | 4), 4] => (instances, rows),
        [0, 4] => (0, 4),
        _ => {
            let wanted = "(k, 4, 4) or (k, 3, 4)";
            return Err(wrong_shape("transforms", matrices.shape(), wanted));
        }
    };
    let named = match objects {
        Some(objects) => Numbers::whole(objects, "objects")?.each(instances)?,
        None if before.len() == instances => before.iter().map(|&object| object.into()).collect(),
        None if count == 1 || instances == 0 => memory::filled(0.0, instances, "instances")?,
        None => {
            return Err(PyValueError::new_err(format!(
                "objects: found none, wanted which of {count} meshes each of {instances} instances places"
            )));
        }
    };
    // A matrix that stands for all is in memory once.
    let operand = Operand::new(&matrices, 4, matrices.lead(4));
    let mut placements = memory::room(instances, "instances")?;
    for (instance, &object) in named.iter().enumerate() {
        if !(object >= 0.0 && object < count as f64) {
            return Err(PyIndexError::new_err(format!(
                "objects: instance {instance} names mesh {object}, but there are {count} meshes"
            )));
        }
        placements.push(Placement {
            mesh: object as usize,
            rows: affine("transforms", &operand, instance, instance * rows, rows)?,
        });
    }
    Ok(placements)
}
