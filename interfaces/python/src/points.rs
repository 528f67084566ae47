//! Questions about points: what is nearest, and what lies inside.

use std::sync::Arc;

use antumbra::inputs::Distance;
use antumbra::{Bvh, ClosestPoint, Ray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::broadcast::{Index, Operand, common_shape};
use crate::arrays::{Numbers, memory, shape_text, wrong_shape};
use crate::call::Call;
use crate::rays::hits::{Columns, Hits, Row, Source, State};
use crate::scene::SceneData;

/// Points of one thread between two looks for signals.
const PIECE: usize = 1 << 14;

/// Answers of `query` about all points, some at a time.
pub fn asked<A: Clone + Send>(
    call: &mut Call<'_>,
    scene: &SceneData,
    points: &Numbers<'_>,
    (nothing, what): (A, &str),
    query: impl Fn(&Bvh, &[[f32; 3]], &mut [A]) + Sync + Send,
) -> PyResult<Vec<A>> {
    let points = scene.local_points(points)?;
    let mut answers = memory::filled(nothing, points.len(), what)?;
    call.in_pieces(points.len(), PIECE, |range, threads| {
        let (points, answers) = (&points[range.clone()], &mut answers[range]);
        threads.run(|| query(scene.bvh(), points, answers));
        Ok(())
    })?;
    Ok(answers)
}

/// How far from each point a surface may be: one number for all points, or one for each.
fn limits(points: &Numbers<'_>, max_distance: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f32>> {
    let Some(object) = max_distance else {
        return Ok(vec![f32::INFINITY]);
    };
    let limits = Numbers::read(object, "max_distance", 1)?;
    let shape = points.lead(3);
    if common_shape(&[(points, 3), (&limits, 1)])? != shape {
        let wanted = format!("() or {}", shape_text(shape));
        return Err(wrong_shape("max_distance", limits.shape(), &wanted));
    }
    let operand = Operand::new(&limits, 1, shape);
    let count = match operand.index {
        Index::One => 1,
        _ => shape.iter().product(),
    };
    if count == 0 {
        return Ok(vec![f32::INFINITY]);
    }
    let limits = (0..count).map(|place| operand.number(place) as f32);
    let limits = memory::collected(limits, count, "distances")?;
    match limits.iter().find(|limit| !(**limit >= 0.0)) {
        None => Ok(limits),
        Some(found) => Err(PyValueError::new_err(format!(
            "max_distance: found {found}, wanted numbers of at least 0, or inf"
        ))),
    }
}

/// Nearest points of the surfaces. Arrays have the shape of the points that were given.
///
/// The arrays of ``Hits``, of a ray from each point to the nearest one. Where nothing is near enough, ``distance`` is inf, ids are
/// -1, ``uv`` is 0, and ``point`` and ``normal`` are NaN.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
/// >>> near = scene.closest([[0.25, 0.25, 3], [0, 0, 0]])
/// >>> near.distance, near[0].point
/// (array([2., 1.], dtype=float32), array([0.25, 0.25, 1.  ]))
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

    fn __getitem__<'py>(
        slf: &Bound<'py, Self>,
        index: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, Self>> {
        let (py, hits) = (slf.py(), slf.as_super().get());
        let chosen = hits.of(&hits.chosen(py, index)?)?;
        Bound::new(py, PyClassInitializer::from(chosen).add_subclass(Self))
    }

    /// A table of the points, such as ``pandas.DataFrame`` takes: one row for each, in C order.
    ///
    /// Parameters
    /// ----------
    /// point : bool
    ///     Whether to add ``x``, ``y`` and ``z``.
    /// normal : bool
    ///     Whether to add ``nx``, ``ny`` and ``nz``.
    ///
    /// Returns
    /// -------
    /// dict of str to array (n,)
    ///     ``distance``, ``triangle``, ``mesh``, ``instance``, ``u``, ``v``.
    ///
    /// Raises
    /// ------
    /// RuntimeError
    ///     The points were pickled without the normals that are wanted.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.closest([[0.25, 0.25, 3]]).to_dict()["distance"]
    /// array([2.], dtype=float32)
    #[pyo3(signature = (*, point=false, normal=false))]
    fn to_dict<'py>(
        slf: &Bound<'py, Self>,
        point: bool,
        normal: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let hits = slf.as_super().get();
        hits.columns(slf.py(), ("distance", point, normal))
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        let hits = slf.as_super().get();
        hits.html(slf.py(), "antumbra.Closest", "points")
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let (near, points) = slf.as_super().get().counts(slf.py())?;
        Ok(format!("<antumbra.Closest: {near} of {points} points>"))
    }
}

pub fn closest<'py>(
    call: &mut Call<'py>,
    scene: &Arc<SceneData>,
    numbers: &Numbers<'_>,
    max_distance: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, Closest>> {
    let limits = limits(numbers, max_distance)?;
    let points = scene.local_points(numbers)?;
    let mut found: Vec<Option<ClosestPoint>> = memory::filled(None, points.len(), "answers")?;
    call.in_pieces(points.len(), PIECE, |range, threads| {
        let (points, found) = (&points[range.clone()], &mut found[range.clone()]);
        let limit = match &limits[..] {
            [one] => Distance::Same(*one),
            each => Distance::from(&each[range]),
        };
        let points = scene.bvh().points(points).within(limit);
        threads.run(|| points.closest_into(found));
        Ok(())
    })?;
    let py = call.py;
    let mut columns = Columns::missed(points.len())?;
    let rows = columns.rows(0..points.len());
    rows.fill(&found, |near| Row::of_point(scene, near));
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

/// Ray from a point to the nearest point of a surface. Distances along the ray are distances between points.
fn to_nearest(from: [f32; 3], near: &Option<ClosestPoint>) -> Ray {
    let Some(near) = near else {
        return Ray::default();
    };
    let dir = [0, 1, 2].map(|axis| (near.position[axis] - from[axis]) / near.distance);
    Ray::new(from, dir)
}
