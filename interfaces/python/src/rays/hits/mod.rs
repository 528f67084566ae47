//! Results about rays that hit something.
//!
//! - here: the class `Hits`, one for each ray;  `list`: the class `HitList`, all of each ray
//! - `columns`: ids and places before they become arrays;  `source`: points and normals of hits

mod columns;
mod list;
mod source;

use numpy::{Element, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::basic::CompareOp;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PySlice};
use rayon::prelude::*;

pub use columns::{Columns, Row};
pub use list::HitList;
use source::Meshes;
pub use source::Source;

use crate::arrays::{memory, shape_text, shaped};
use crate::call::threads::Threads;
use crate::errors::wrong;
use crate::html;
use crate::scene::parts::Ids;
use crate::scene::saved::Reduced;

/// Hits whose points or normals a thread computes at a time. Fewer stay on the calling thread.
const SOME: usize = 1 << 13;

/// One hit of the arrays, and its place in them.
#[derive(Clone, Copy)]
struct At {
    ids: Ids,
    uv: [f32; 2],
    t: f32,
    place: usize,
}

fn gone() -> PyErr {
    pyo3::exceptions::PyRuntimeError::new_err(
        "hits that were pickled have no scene: point and normal go along if they were used before",
    )
}

/// First hits of rays. Arrays have the shape of the rays.
///
/// Where a ray hits nothing, ``t`` is inf, ids are -1, ``uv`` is 0, and ``point`` and ``normal`` are NaN.
///
/// An index chooses hits as in an array of numpy, and makes a copy of them: ``hits[3]``, ``hits[2:5]``, ``hits[hits.hit]``,
/// ``hits[[0, 7]]``. ``len(hits)`` is the length of the first axis.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
/// >>> hits = scene.intersect([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
/// >>> len(hits), hits.hit
/// (2, array([ True, False]))
/// >>> hits[hits.hit].point
/// array([[0.2, 0.2, 1. ]])
#[pyclass(frozen, subclass, weakref, module = "antumbra")]
pub struct Hits {
    /// Distance in lengths of the direction: float32.
    #[pyo3(get)]
    t: Py<PyArrayDyn<f32>>,
    /// Place of the triangle in the faces of its mesh, or of the segment in its curves: int32.
    #[pyo3(get)]
    triangle: Py<PyArrayDyn<i32>>,
    /// Place of the mesh in the list of meshes: int32.
    #[pyo3(get)]
    mesh: Py<PyArrayDyn<i32>>,
    /// Place of the instance in the list of instances, -1 for meshes in the world itself: int32.
    #[pyo3(get)]
    instance: Py<PyArrayDyn<i32>>,
    /// Weights of the second and third corner of the triangle: float32 of shape (..., 2). On a curve, the share of the
    /// segment's length, and the place across the curve from 0 to 1.
    #[pyo3(get)]
    uv: Py<PyArrayDyn<f32>>,
    point: PyOnceLock<Py<PyArrayDyn<f64>>>,
    normal: PyOnceLock<Py<PyArrayDyn<f32>>>,
    source: Option<Source>,
}

impl Hits {
    pub fn new(
        py: Python<'_>,
        columns: Columns,
        shape: &[usize],
        source: Source,
    ) -> PyResult<Self> {
        let of_uv = [shape, &[2]].concat();
        Ok(Self {
            t: shaped(py, columns.t, shape)?.unbind(),
            triangle: shaped(py, columns.triangle, shape)?.unbind(),
            mesh: shaped(py, columns.mesh, shape)?.unbind(),
            instance: shaped(py, columns.instance, shape)?.unbind(),
            uv: shaped(py, columns.uv, &of_uv)?.unbind(),
            point: PyOnceLock::new(),
            normal: PyOnceLock::new(),
            source: Some(source),
        })
    }

    /// The hits with points that are known already.
    pub fn with_points(self, py: Python<'_>, points: Vec<f64>) -> PyResult<Self> {
        let points = shaped(py, points, &self.shape_of_vectors(py))?;
        // Nobody has read them yet.
        let _ = self.point.set(py, points.unbind());
        Ok(self)
    }

    /// Hits at these places in C order, an array of any shape.
    pub fn of(&self, places: &Bound<'_, PyAny>) -> PyResult<Self> {
        let source = match &self.source {
            None => None,
            Some(source) => {
                // Only hits with rays of their own have to know which they are.
                let chosen: Vec<usize> = match source.rays.is_empty() {
                    true => Vec::new(),
                    false => places.call_method1("reshape", (-1,))?.extract()?,
                };
                Some(source.of(&chosen)?)
            }
        };
        Ok(Self::of_state(self.taken(places)?, source))
    }

    /// Places in C order of the hits that an index chooses, in the shape that numpy gives them.
    pub fn chosen<'py>(
        &self,
        py: Python<'py>,
        index: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let shape = self.lengths(py);
        let count: usize = shape.iter().product();
        let numpy = py.import("numpy")?;
        let all = numpy.call_method1("arange", (count,))?;
        let all = all.call_method1("reshape", (shape,))?;
        numpy.call_method1("asarray", (all.get_item(index)?,))
    }

    /// Columns of a table, one row for each hit.
    pub fn columns<'py>(
        &self,
        py: Python<'py>,
        names: (&str, bool, bool),
    ) -> PyResult<Bound<'py, PyDict>> {
        let (distance, point, normal) = names;
        let columns = PyDict::new(py);
        let flat = |array: &Bound<'py, PyAny>| array.call_method1("reshape", (-1,));
        columns.set_item(distance, flat(self.t.bind(py))?)?;
        columns.set_item("triangle", flat(self.triangle.bind(py))?)?;
        columns.set_item("mesh", flat(self.mesh.bind(py))?)?;
        columns.set_item("instance", flat(self.instance.bind(py))?)?;
        let mut vectors = vec![(self.uv.bind(py).as_any().clone(), &["u", "v"][..])];
        if point {
            vectors.push((self.point(py)?.into_any(), &["x", "y", "z"]));
        }
        if normal {
            vectors.push((self.normal(py)?.into_any(), &["nx", "ny", "nz"]));
        }
        for (array, names) in vectors {
            let rows = array.call_method1("reshape", (-1, names.len()))?;
            for (axis, name) in names.iter().enumerate() {
                let column = rows.get_item((PySlice::full(py), axis))?;
                columns.set_item(name, column)?;
            }
        }
        Ok(columns)
    }

    /// Number of hits, and of rays.
    pub fn counts(&self, py: Python<'_>) -> PyResult<(usize, usize)> {
        let hits = self.hit(py)?.call_method0("sum")?.extract()?;
        Ok((hits, self.lengths(py).iter().product()))
    }

    /// What notebooks show.
    pub fn html(&self, py: Python<'_>, name: &str, asked: &str) -> PyResult<String> {
        let (hits, all) = self.counts(py)?;
        let share = html::percent(hits as f64 / all as f64);
        let shape = shape_text(&self.lengths(py));
        let hits = format!("{hits} of {all} {asked} ({share})");
        Ok(html::table(name, &[("shape", shape), ("hit", hits)]))
    }

    pub fn restore(state: State<'_>) -> Self {
        Self::of_state(state, None)
    }
}

/// Columns, and then point and normal where they are known.
pub type State<'py> = (
    Bound<'py, PyArrayDyn<f32>>,
    Bound<'py, PyArrayDyn<i32>>,
    Bound<'py, PyArrayDyn<i32>>,
    Bound<'py, PyArrayDyn<i32>>,
    Bound<'py, PyArrayDyn<f32>>,
    Option<Bound<'py, PyArrayDyn<f64>>>,
    Option<Bound<'py, PyArrayDyn<f32>>>,
);

impl Hits {
    fn lengths(&self, py: Python<'_>) -> Vec<usize> {
        self.t.bind(py).shape().to_vec()
    }

    /// Something for every hit: `of` computes it from the ids, the weights, the distance and the place in the list.
    /// Work is done by the threads of the default, without the lock of the interpreter.
    fn each<T: Copy + Send + Sync>(
        &self,
        py: Python<'_>,
        nothing: T,
        of: impl Fn(At) -> Option<T> + Sync + Send,
    ) -> PyResult<Vec<T>> {
        let read = |array: &Py<PyArrayDyn<i32>>| array.bind(py).try_readonly().map_err(wrong);
        let ids = [
            read(&self.triangle)?,
            read(&self.mesh)?,
            read(&self.instance)?,
        ];
        let t = self.t.bind(py).try_readonly().map_err(wrong)?;
        let uv = self.uv.bind(py).try_readonly().map_err(wrong)?;
        let (t, uv) = (t.as_slice()?, uv.as_slice()?);
        let [triangle, mesh, instance] = &ids;
        let (triangle, mesh, instance) =
            (triangle.as_slice()?, mesh.as_slice()?, instance.as_slice()?);
        let item = |place: usize| {
            let hit = At {
                ids: Ids {
                    triangle: triangle[place],
                    mesh: mesh[place],
                    instance: instance[place],
                },
                uv: [uv[2 * place], uv[2 * place + 1]],
                t: t[place],
                place,
            };
            of(hit).unwrap_or(nothing)
        };
        let threads = Threads::of(None)?;
        let count = triangle.len();
        py.detach(|| {
            // Written once: memory that is touched for the first time costs more than most of what is computed.
            let mut all = memory::room(count, "places of hits")?;
            if count <= SOME || threads.count() == 1 {
                all.extend((0..count).map(item));
            } else {
                let places = (0..count).into_par_iter().with_min_len(SOME);
                threads.run(|| places.map(item).collect_into_vec(&mut all));
            }
            Ok(all)
        })
    }

    /// Vectors of hits, `nothing` for misses, computed once.
    fn vectors<'py, T: Element + Copy + Sync>(
        &self,
        py: Python<'py>,
        known: &PyOnceLock<Py<PyArrayDyn<T>>>,
        nothing: T,
        of: impl Fn(&Source, &Meshes<'_>, At) -> Option<[T; 3]> + Sync + Send,
    ) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
        let made = known.get_or_try_init(py, || {
            let source = self.source.as_ref().ok_or_else(gone)?;
            let meshes = Meshes::of(&source.parts);
            let vectors = self.each(py, [nothing; 3], |hit| {
                (hit.ids.triangle >= 0).then(|| of(source, &meshes, hit))?
            })?;
            let vectors = shaped(py, vectors.into_flattened(), &self.shape_of_vectors(py))?;
            Ok::<_, PyErr>(vectors.unbind())
        })?;
        Ok(made.bind(py).clone())
    }

    fn shape_of_vectors(&self, py: Python<'_>) -> Vec<usize> {
        let mut shape = self.lengths(py);
        shape.push(3);
        shape
    }

    /// Some of the hits, given by their places in C order in an array of any shape.
    fn taken<'py>(&self, places: &Bound<'py, PyAny>) -> PyResult<State<'py>> {
        let py = places.py();
        fn of<'py, T: Element>(
            array: &Py<PyArrayDyn<T>>,
            places: &Bound<'py, PyAny>,
            item: Option<usize>,
        ) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
            let py = places.py();
            let flat = match item {
                None => array.bind(py).call_method1("reshape", (-1,))?,
                Some(item) => array.bind(py).call_method1("reshape", (-1, item))?,
            };
            // A number of numpy for one hit becomes an array of the shape ().
            let taken = flat.call_method1("take", (places, 0))?;
            let taken = py.import("numpy")?.call_method1("asarray", (taken,))?;
            Ok(taken.cast_into::<PyArrayDyn<T>>()?)
        }
        let point = self.point.get(py).map(|array| of(array, places, Some(3)));
        let normal = self.normal.get(py).map(|array| of(array, places, Some(3)));
        Ok((
            of(&self.t, places, None)?,
            of(&self.triangle, places, None)?,
            of(&self.mesh, places, None)?,
            of(&self.instance, places, None)?,
            of(&self.uv, places, Some(2))?,
            point.transpose()?,
            normal.transpose()?,
        ))
    }

    fn state<'py>(&self, py: Python<'py>) -> State<'py> {
        (
            self.t.bind(py).clone(),
            self.triangle.bind(py).clone(),
            self.mesh.bind(py).clone(),
            self.instance.bind(py).clone(),
            self.uv.bind(py).clone(),
            self.point.get(py).map(|array| array.bind(py).clone()),
            self.normal.get(py).map(|array| array.bind(py).clone()),
        )
    }

    fn of_state(state: State<'_>, source: Option<Source>) -> Self {
        let (t, triangle, mesh, instance, uv, point, normal) = state;
        let py = t.py();
        let hits = Self {
            t: t.unbind(),
            triangle: triangle.unbind(),
            mesh: mesh.unbind(),
            instance: instance.unbind(),
            uv: uv.unbind(),
            point: PyOnceLock::new(),
            normal: PyOnceLock::new(),
            source,
        };
        if let Some(point) = point {
            let _ = hits.point.set(py, point.unbind());
        }
        if let Some(normal) = normal {
            let _ = hits.normal.set(py, normal.unbind());
        }
        hits
    }
}

#[pymethods]
impl Hits {
    /// Whether the ray hits anything: bool.
    #[getter]
    fn hit<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let triangle = self.triangle.bind(py);
        triangle.rich_compare(0, CompareOp::Ge)
    }

    /// Point of the triangle that is hit: float64 of shape (..., 3). Made on first use.
    #[getter]
    fn point<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let of = |source: &Source, meshes: &Meshes<'_>, hit: At| {
            let point = meshes.point(hit.ids, hit.uv);
            point.or_else(|| source.point_on_ray(hit.t, hit.place))
        };
        self.vectors(py, &self.point, f64::NAN, of)
    }

    /// Geometric normal, of length 1: float32 of shape (..., 3). A triangle's corners run counterclockwise seen from where
    /// it points. The normal of a curve is perpendicular to its axis and faces the ray. Made on first use.
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let of = |source: &Source, meshes: &Meshes<'_>, hit: At| {
            meshes.normal(hit.ids).or_else(|| source.normal_on_ray(hit))
        };
        self.vectors(py, &self.normal, f32::NAN, of)
    }

    /// Number of the curve in its ``Curves``, -1 for hits on anything else: int32. Made on every use.
    #[getter]
    fn curve<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i32>>> {
        let parts = &self.source.as_ref().ok_or_else(gone)?.parts;
        let of = |hit: At| Some(parts.along_curve(hit.ids, hit.uv[0])?.0);
        let curves = self.each(py, -1, of)?;
        shaped(py, curves, &self.lengths(py))
    }

    /// How far along the curve, each of whose pieces is 1 long: float32. NaN for hits on anything else. Made on every use.
    ///
    /// A piece of a linear curve goes from point to point, and a piece of a Bezier curve from each third point to the next. B-splines and
    /// Catmull-Rom splines of n points have n - 3 pieces.
    #[getter]
    fn along<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let parts = &self.source.as_ref().ok_or_else(gone)?.parts;
        let of = |hit: At| Some(parts.along_curve(hit.ids, hit.uv[0])?.1);
        let along = self.each(py, f32::NAN, of)?;
        shaped(py, along, &self.lengths(py))
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        let shape = self.lengths(py);
        let len = shape.first().copied();
        len.ok_or_else(|| PyTypeError::new_err("one hit has no length"))
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> PyResult<Self> {
        self.of(&self.chosen(py, index)?)
    }

    /// A table of the hits, such as ``pandas.DataFrame`` takes: one row for each ray, in C order.
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
    ///     ``t``, ``triangle``, ``mesh``, ``instance``, ``u``, ``v``.
    ///
    /// Raises
    /// ------
    /// RuntimeError
    ///     The hits were pickled without the points or normals that are wanted.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> hits = scene.intersect([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
    /// >>> hits.to_dict()["triangle"]
    /// array([ 0, -1], dtype=int32)
    #[pyo3(signature = (*, point=false, normal=false))]
    fn to_dict<'py>(
        &self,
        py: Python<'py>,
        point: bool,
        normal: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        self.columns(py, ("t", point, normal))
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        self.html(py, "antumbra.Hits", "rays")
    }

    fn __sizeof__(&self, py: Python<'_>) -> usize {
        let count: usize = self.lengths(py).iter().product();
        let point = self.point.get(py).map_or(0, |_| 24);
        let normal = self.normal.get(py).map_or(0, |_| 12);
        size_of::<Self>() + count * (24 + point + normal)
    }

    /// Shape of the rays.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyTuple>> {
        pyo3::types::PyTuple::new(py, self.lengths(py))
    }

    #[staticmethod]
    #[pyo3(name = "_restore")]
    fn restore_hits(state: State<'_>) -> Self {
        Self::restore(state)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py, (State<'py>,)> {
        let py = slf.py();
        Ok((slf.get_type().getattr("_restore")?, (slf.get().state(py),)))
    }

    /// Refuses ``np.asarray``: hits are several arrays.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__(
        &self,
        dtype: Option<&Bound<'_, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Py<PyAny>> {
        let _ = (dtype, copy);
        Err(PyTypeError::new_err(
            "Hits are several arrays: take one, such as hits.t, hits.point or hits.triangle",
        ))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (hits, rays) = self.counts(py)?;
        Ok(format!("<antumbra.Hits: {hits} of {rays} rays hit>"))
    }
}
