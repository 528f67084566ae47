//! Points that are made: on a grid over the surfaces of a scene, and in the texels of a mesh.

use antumbra_bake::{Atlas, Layout, Mesh, Orientation, Sensors};
use numpy::PyArrayDyn;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::broadcast::Operand;
use crate::arrays::{Numbers, memory, read_faces, shaped, wrong_shape};
use crate::errors::failed;
use crate::scene::SceneData;

/// Points, normals, and the number of the point in each cell of a picture, -1 for none.
pub type Cells<'py> = (
    Bound<'py, PyArrayDyn<f64>>,
    Bound<'py, PyArrayDyn<f32>>,
    Bound<'py, PyArrayDyn<i64>>,
);

/// Arrays of points in the world, their normals, and cells of a picture of this shape.
fn cells<'py>(
    py: Python<'py>,
    points: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    cells: Vec<i64>,
    shape: [usize; 2],
) -> PyResult<Cells<'py>> {
    let vectors = [points.len(), 3];
    Ok((
        shaped(py, points.into_flattened(), &vectors)?,
        shaped(py, normals.into_flattened(), &vectors)?,
        shaped(py, cells, &shape)?,
    ))
}

pub fn on_grid<'py>(
    py: Python<'py>,
    scene: &SceneData,
    spacing: f64,
    orientation: &Orientation,
) -> PyResult<Cells<'py>> {
    let found = py.detach(|| Sensors::on_grid((scene.bvh(), &|_| None), spacing, orientation));
    let sensors = found.map_err(failed)?;
    let local = scene.local();
    let points = sensors.points.iter().map(|&point| local.world(point));
    let points = memory::collected(points, sensors.points.len(), "sensors")?;
    let Layout::Grid(grid) = &sensors.layout else {
        return Err(PyValueError::new_err("the sensors have no grid"));
    };
    let mut numbers = memory::filled(-1, grid.width * grid.height, "cells")?;
    for (sensor, &cell) in (0..).zip(&grid.cells) {
        numbers[cell as usize] = sensor;
    }
    let shape = [grid.height, grid.width];
    cells(py, points, sensors.normals, numbers, shape)
}

/// Bytes that an atlas takes for each vertex while it is made: a copy of the mesh, and sums of normals.
const ATLAS: usize = 64;

/// Points in the middle of the texels of a square texture over a mesh.
///
/// Texture coordinates run from 0 to 1, v upwards from the last row. The first triangle that covers the middle of a texel has it.
///
/// Parameters
/// ----------
/// vertices : array (n, 3)
/// faces : array (m, 3) of integers
/// uvs : array (n, 2)
///     Texture coordinates of the vertices. Triangles with one that is not finite are left out.
/// size : int
///     Texels of a row, and number of rows: 1 to 16384.
/// normals : array (n, 3), optional
///     Normals of the vertices. Without them, the normals of the triangles around a vertex are mixed by their area.
///
/// Returns
/// -------
/// points : float64 of shape (k, 3)
///     Points on the mesh.
/// normals : float32 of shape (k, 3)
///     Normals there, of any length.
/// texels : int64 of shape (size, size)
///     Number of the point of each texel, -1 where no triangle is.
///
/// Raises
/// ------
/// IndexError
///     A face names a vertex that is not there.
/// ValueError
///     No texel is covered, or an argument has another shape.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> corners, uvs = [[0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 0], [1, 0], [0, 1]]
/// >>> points, normals, texels = am.texel_atlas(corners, [[0, 1, 2]], uvs, 2)
/// >>> texels
/// array([[ 0, -1],
///        [ 1,  2]])
#[pyfunction]
#[pyo3(signature = (vertices, faces, uvs, size, normals=None))]
pub fn texel_atlas<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
    uvs: &Bound<'py, PyAny>,
    size: u32,
    normals: Option<&Bound<'py, PyAny>>,
) -> PyResult<Cells<'py>> {
    if !(1..=16384).contains(&size) {
        let text = format!("size: found {size}, wanted 1 to 16384");
        return Err(PyValueError::new_err(text));
    }
    let vertices = Numbers::read(vertices, "vertices", 3)?;
    let count = vertices.rows()?;
    let faces = read_faces(faces, "faces", count)?;
    let uvs = Numbers::read(uvs, "uvs", 2)?;
    if uvs.lead(2) != [count] {
        return Err(wrong_shape("uvs", uvs.shape(), &format!("({count}, 2)")));
    }
    let normals = match normals {
        None => Vec::new(),
        Some(normals) => {
            let normals = Numbers::read(normals, "normals", 3)?;
            if normals.rows()? != count {
                let wanted = format!("({count}, 3)");
                return Err(wrong_shape("normals", normals.shape(), &wanted));
            }
            normals.vectors(&[count])?
        }
    };
    let corners = Operand::new(&vertices, 3, &[count]);
    // Near the first vertex, single precision is good enough on maps, too.
    let first = if count > 0 {
        corners.vector(0)
    } else {
        [0.0; 3]
    };
    let near = |place| {
        let corner = corners.vector(place);
        [0, 1, 2].map(|axis| (corner[axis] - first[axis]) as f32)
    };
    let positions = memory::collected((0..count).map(near), count, "vertices")?;
    let coordinates = Operand::new(&uvs, 2, &[count]);
    let uv = |place| coordinates.pair(place).map(|x| x as f32);
    let uvs = memory::collected((0..count).map(uv), count, "texture coordinates")?;
    memory::check(count, ATLAS, "vertices of an atlas")?;
    let atlas = py.detach(|| {
        let mut mesh = Mesh::default();
        mesh.push((&positions, &faces), &normals, &uvs, false);
        Atlas::new(&mesh, size)
    });
    let atlas = atlas.map_err(failed)?;
    let texels = atlas
        .texels()
        .map(|point| point.map_or(-1, |point| point as i64));
    let texels = memory::collected(texels, size as usize * size as usize, "texels")?;
    let far = |point: &[f32; 3]| [0, 1, 2].map(|axis| first[axis] + f64::from(point[axis]));
    let points = atlas.points.iter().map(far);
    let points = memory::collected(points, atlas.points.len(), "points")?;
    cells(py, points, atlas.normals, texels, [size as usize; 2])
}
