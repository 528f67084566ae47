//! Questions about points: what is nearest, and what lies inside.

use antumbra::ClosestPoint;
use numpy::PyArrayDyn;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{Numbers, shaped};
use crate::geometry::Ids;
use crate::rays::Call;
use crate::saved::Reduced;
use crate::scene::SceneData;

/// Points of one thread between two looks for signals.
const PIECE: usize = 1 << 14;

pub fn contains(
    py: Python<'_>,
    scene: &SceneData,
    points: &Numbers<'_>,
    call: &mut Call<'_>,
) -> PyResult<Vec<bool>> {
    let points = scene.local_points(points);
    let mut inside = vec![false; points.len()];
    call.in_pieces(py, points.len(), PIECE, |range, threads| {
        let (points, inside) = (&points[range.clone()], &mut inside[range]);
        py.detach(|| threads.run(|| scene.bvh.contains_batch(points, inside)));
        Ok(())
    })?;
    Ok(inside)
}

/// Nearest points of the surfaces. Arrays have the shape of the points that were asked about.
///
/// Where nothing is near enough, ``distance`` is inf, ids are -1, ``uv`` is 0 and ``point`` is NaN.
#[pyclass(frozen, module = "antumbra")]
pub struct Closest {
    /// Distance in units of the scene: float32.
    #[pyo3(get)]
    distance: Py<PyArrayDyn<f32>>,
    /// Nearest point: float64 of shape (..., 3).
    #[pyo3(get)]
    point: Py<PyArrayDyn<f64>>,
    /// Place of the triangle in the faces of its mesh: int32.
    #[pyo3(get)]
    triangle: Py<PyArrayDyn<i32>>,
    /// Place of the mesh in the list of meshes: int32.
    #[pyo3(get)]
    mesh: Py<PyArrayDyn<i32>>,
    /// Place of the instance in the list of instances, -1 for meshes that stand in the world themselves: int32.
    #[pyo3(get)]
    instance: Py<PyArrayDyn<i32>>,
    /// Weights of the second and third corner of the triangle: float32 of shape (..., 2).
    #[pyo3(get)]
    uv: Py<PyArrayDyn<f32>>,
}

type State = (
    Py<PyArrayDyn<f32>>,
    Py<PyArrayDyn<f64>>,
    Py<PyArrayDyn<i32>>,
    Py<PyArrayDyn<i32>>,
    Py<PyArrayDyn<i32>>,
    Py<PyArrayDyn<f32>>,
);

#[pymethods]
impl Closest {
    #[staticmethod]
    #[pyo3(name = "_restore")]
    fn restore(state: State) -> Self {
        let (distance, point, triangle, mesh, instance, uv) = state;
        Self {
            distance,
            point,
            triangle,
            mesh,
            instance,
            uv,
        }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py, (State,)> {
        let (py, found) = (slf.py(), slf.get());
        let state = (
            found.distance.clone_ref(py),
            found.point.clone_ref(py),
            found.triangle.clone_ref(py),
            found.mesh.clone_ref(py),
            found.instance.clone_ref(py),
            found.uv.clone_ref(py),
        );
        Ok((slf.get_type().getattr("_restore")?, (state,)))
    }
}

pub fn closest(
    py: Python<'_>,
    scene: &SceneData,
    numbers: &Numbers<'_>,
    max_distance: f32,
    call: &mut Call<'_>,
) -> PyResult<Closest> {
    if !(max_distance >= 0.0) {
        return Err(PyValueError::new_err(format!(
            "max_distance: found {max_distance}, wanted a number of at least 0, or inf"
        )));
    }
    let points = scene.local_points(numbers);
    let mut found: Vec<Option<ClosestPoint>> = vec![None; points.len()];
    call.in_pieces(py, points.len(), PIECE, |range, threads| {
        let (points, found) = (&points[range.clone()], &mut found[range]);
        let bvh = &scene.bvh;
        py.detach(|| threads.run(|| bvh.closest_points(points, max_distance, found)));
        Ok(())
    })?;
    let local = scene.local();
    let ids: Vec<_> = found
        .iter()
        .map(|near| {
            near.as_ref()
                .map_or(Ids::NONE, |near| Ids::of_point(scene, near))
        })
        .collect();
    let shape = numbers.lead(3);
    let with = |last| [shape, &[last]].concat();
    let distances = found
        .iter()
        .map(|near| near.map_or(f32::INFINITY, |near| near.distance));
    let places = found.iter().flat_map(|near| match near {
        Some(near) => local.world(near.position),
        None => [f64::NAN; 3],
    });
    let weights = found
        .iter()
        .flat_map(|near| near.map_or([0.0; 2], |near| [near.u, near.v]));
    let numbers_of = |of: fn(&Ids) -> i32| shaped(py, ids.iter().map(of).collect(), shape);
    Ok(Closest {
        distance: shaped(py, distances.collect(), shape)?.unbind(),
        point: shaped(py, places.collect(), &with(3))?.unbind(),
        triangle: numbers_of(|ids| ids.triangle)?.unbind(),
        mesh: numbers_of(|ids| ids.mesh)?.unbind(),
        instance: numbers_of(|ids| ids.instance)?.unbind(),
        uv: shaped(py, weights.collect(), &with(2))?.unbind(),
    })
}
