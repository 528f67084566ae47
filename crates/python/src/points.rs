//! Questions about points: what is nearest, and what lies inside.

use std::sync::Arc;

use antumbra::{ClosestPoint, Ray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::Numbers;
use crate::hits::{Columns, Hits, Source, State};
use crate::memory;
use crate::rays::Call;
use crate::scene::SceneData;

/// Points of one thread between two looks for signals.
const PIECE: usize = 1 << 14;

pub fn contains(
    py: Python<'_>,
    scene: &SceneData,
    points: &Numbers<'_>,
    call: &mut Call<'_>,
) -> PyResult<Vec<bool>> {
    let points = scene.local_points(points)?;
    let mut inside = memory::filled(false, points.len(), "answers")?;
    call.in_pieces(py, points.len(), PIECE, |range, threads| {
        let (points, inside) = (&points[range.clone()], &mut inside[range]);
        py.detach(|| threads.run(|| scene.bvh.contains_batch(points, inside)));
        Ok(())
    })?;
    Ok(inside)
}

/// Nearest points of the surfaces. Arrays have the shape of the points that were asked about.
///
/// Arrays are those of ``Hits``, of a ray from each point to the nearest one. Where nothing is near enough, ``distance`` is
/// inf, ids are -1, ``uv`` is 0, and ``point`` and ``normal`` are NaN.
#[pyclass(frozen, extends = Hits, module = "antumbra")]
pub struct Closest;

#[pymethods]
impl Closest {
    /// Distance in units of the scene: float32.
    #[getter]
    fn distance<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.getattr("t")
    }

    #[staticmethod]
    #[pyo3(name = "_restore")]
    fn restore<'py>(py: Python<'py>, state: State<'py>) -> PyResult<Bound<'py, Self>> {
        Bound::new(py, (Self, Hits::restore(state)))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let hit = slf.getattr("hit")?;
        let (near, points) = (hit.call_method0("sum")?, hit.getattr("size")?);
        Ok(format!("<antumbra.Closest: {near} of {points} points>"))
    }
}

pub fn closest<'py>(
    py: Python<'py>,
    scene: &Arc<SceneData>,
    numbers: &Numbers<'_>,
    max_distance: f32,
    call: &mut Call<'_>,
) -> PyResult<Bound<'py, Closest>> {
    if !(max_distance >= 0.0) {
        return Err(PyValueError::new_err(format!(
            "max_distance: found {max_distance}, wanted a number of at least 0, or inf"
        )));
    }
    let points = scene.local_points(numbers)?;
    let mut found: Vec<Option<ClosestPoint>> = memory::filled(None, points.len(), "answers")?;
    call.in_pieces(py, points.len(), PIECE, |range, threads| {
        let (points, found) = (&points[range.clone()], &mut found[range]);
        let bvh = &scene.bvh;
        py.detach(|| threads.run(|| bvh.closest_batch(points, max_distance, found)));
        Ok(())
    })?;
    let mut columns = Columns::missed(points.len())?;
    columns.rows(0..points.len()).fill_near(scene, &found);
    let local = scene.local();
    let places = found.iter().flat_map(|near| match near {
        Some(near) => local.world(near.position),
        None => [f64::NAN; 3],
    });
    let places = memory::collected(places, 3 * found.len(), "coordinates")?;
    let rays = points.iter().zip(&found);
    let rays = rays.map(|(&from, near)| to_nearest(from, near));
    let source = Source::new(scene, rays, points.len())?;
    let hits = Hits::new(py, columns, numbers.lead(3), source)?.with_points(py, places)?;
    Bound::new(py, (Closest, hits))
}

/// Ray from a point to the nearest one of a surface, on which distances are those of points.
fn to_nearest(from: [f32; 3], near: &Option<ClosestPoint>) -> Ray {
    let Some(near) = near else {
        return Ray::default();
    };
    let dir = [0, 1, 2].map(|axis| (near.position[axis] - from[axis]) / near.distance);
    Ray::new(from, dir)
}
