//! Results about rays that hit something: `Hits`, one for each ray, and `HitList`, all of each ray.

use std::ops::Range;
use std::sync::Arc;

use antumbra::{ClosestPoint, Hit, Instance, Ray};
use numpy::{Element, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PySlice};
use rayon::prelude::*;

use crate::arrays::shaped;
use crate::geometry::{Ids, Part, Parts};
use crate::html;
use crate::memory;
use crate::saved::Reduced;
use crate::scene::SceneData;
use crate::threads::Threads;

/// Ids and places of hits, one column for each.
#[derive(Default)]
pub struct Columns {
    pub t: Vec<f32>,
    pub triangle: Vec<i32>,
    pub mesh: Vec<i32>,
    pub instance: Vec<i32>,
    pub uv: Vec<f32>,
}

/// Names of what columns hold, where there is no memory for it.
const HITS: &str = "hits";
const WEIGHTS: &str = "weights of hits";

/// Hits whose points or normals a thread computes at a time. Fewer stay on the thread that asks.
const SOME: usize = 1 << 13;

/// Some rows of columns.
pub struct Rows<'a> {
    t: &'a mut [f32],
    triangle: &'a mut [i32],
    mesh: &'a mut [i32],
    instance: &'a mut [i32],
    uv: &'a mut [[f32; 2]],
}

impl Columns {
    /// Rows of rays that hit nothing.
    pub fn missed(len: usize) -> PyResult<Self> {
        Ok(Self {
            t: memory::filled(f32::INFINITY, len, HITS)?,
            triangle: memory::filled(-1, len, HITS)?,
            mesh: memory::filled(-1, len, HITS)?,
            instance: memory::filled(-1, len, HITS)?,
            uv: memory::filled(0.0, 2 * len, WEIGHTS)?,
        })
    }

    /// Makes room for more rows.
    pub fn grow(&mut self, more: usize) -> PyResult<()> {
        memory::grow(&mut self.t, more, HITS)?;
        memory::grow(&mut self.triangle, more, HITS)?;
        memory::grow(&mut self.mesh, more, HITS)?;
        memory::grow(&mut self.instance, more, HITS)?;
        memory::grow(&mut self.uv, 2 * more, WEIGHTS)
    }

    pub fn rows(&mut self, range: Range<usize>) -> Rows<'_> {
        Rows {
            t: &mut self.t[range.clone()],
            triangle: &mut self.triangle[range.clone()],
            mesh: &mut self.mesh[range.clone()],
            instance: &mut self.instance[range.clone()],
            uv: &mut self.uv.as_chunks_mut().0[range],
        }
    }

    pub fn push(&mut self, scene: &SceneData, hit: &Hit) {
        let ids = Ids::of_hit(scene, hit);
        self.t.push(hit.t);
        self.triangle.push(ids.triangle);
        self.mesh.push(ids.mesh);
        self.instance.push(ids.instance);
        self.uv.extend([hit.u, hit.v]);
    }
}

impl Rows<'_> {
    /// Writes hits of as many rays; what is missed stays as it is.
    pub fn fill(self, scene: &SceneData, hits: &[Option<Hit>]) {
        for (row, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                let ids = Ids::of_hit(scene, hit);
                self.t[row] = hit.t;
                self.triangle[row] = ids.triangle;
                self.mesh[row] = ids.mesh;
                self.instance[row] = ids.instance;
                self.uv[row] = [hit.u, hit.v];
            }
        }
    }

    /// Writes nearest points of as many points.
    pub fn fill_near(self, scene: &SceneData, found: &[Option<ClosestPoint>]) {
        for (row, near) in found.iter().enumerate() {
            if let Some(near) = near {
                let ids = Ids::of_point(scene, near);
                self.t[row] = near.distance;
                self.triangle[row] = ids.triangle;
                self.mesh[row] = ids.mesh;
                self.instance[row] = ids.instance;
                self.uv[row] = [near.u, near.v];
            }
        }
    }

    /// As many rows each as told, the last ones perhaps fewer.
    pub fn chunks(self, len: usize) -> Vec<Self> {
        let columns = self.t.chunks_mut(len).zip(self.triangle.chunks_mut(len));
        let columns = columns
            .zip(self.mesh.chunks_mut(len))
            .zip(self.instance.chunks_mut(len));
        let columns = columns.zip(self.uv.chunks_mut(len));
        columns
            .map(|((((t, triangle), mesh), instance), uv)| Self {
                t,
                triangle,
                mesh,
                instance,
                uv,
            })
            .collect()
    }
}

/// Arrays of hits, in a shape.
struct Arrays {
    t: Py<PyArrayDyn<f32>>,
    triangle: Py<PyArrayDyn<i32>>,
    mesh: Py<PyArrayDyn<i32>>,
    instance: Py<PyArrayDyn<i32>>,
    uv: Py<PyArrayDyn<f32>>,
    point: PyOnceLock<Py<PyArrayDyn<f64>>>,
    normal: PyOnceLock<Py<PyArrayDyn<f32>>>,
}

/// What knows where a hit lies.
#[derive(Clone)]
pub struct Source {
    parts: Arc<Parts>,
    /// The tree where the scene has spheres, which alone know their normals.
    spheres: Option<Arc<SceneData>>,
    /// Rays of the hits where the scene has spheres, on which ids and weights do not tell the place.
    rays: Vec<Ray>,
}

impl Arrays {
    fn new(py: Python<'_>, columns: Columns, shape: &[usize]) -> PyResult<Self> {
        let mut of_uv = shape.to_vec();
        of_uv.push(2);
        Ok(Self {
            t: shaped(py, columns.t, shape)?.unbind(),
            triangle: shaped(py, columns.triangle, shape)?.unbind(),
            mesh: shaped(py, columns.mesh, shape)?.unbind(),
            instance: shaped(py, columns.instance, shape)?.unbind(),
            uv: shaped(py, columns.uv, &of_uv)?.unbind(),
            point: PyOnceLock::new(),
            normal: PyOnceLock::new(),
        })
    }

    fn shape(&self, py: Python<'_>) -> Vec<usize> {
        self.t.bind(py).shape().to_vec()
    }

    /// Numbers of every hit, three each: `of` computes them from the ids, the weights, the distance and the place in the list.
    /// Work is done by the threads of the default, without the lock of the interpreter.
    fn vectors<T: Copy + Send + Sync>(
        &self,
        py: Python<'_>,
        nothing: T,
        of: impl Fn(Ids, [f32; 2], f32, usize) -> Option<[T; 3]> + Sync + Send,
    ) -> PyResult<Vec<T>> {
        let read = |array: &Py<PyArrayDyn<i32>>| array.bind(py).try_readonly();
        let error =
            |error: numpy::BorrowError| pyo3::exceptions::PyValueError::new_err(error.to_string());
        let triangle = read(&self.triangle).map_err(error)?;
        let mesh = read(&self.mesh).map_err(error)?;
        let instance = read(&self.instance).map_err(error)?;
        let t = self.t.bind(py).try_readonly().map_err(error)?;
        let uv = self.uv.bind(py).try_readonly().map_err(error)?;
        let uv = uv.as_slice()?;
        let (triangle, mesh, instance) =
            (triangle.as_slice()?, mesh.as_slice()?, instance.as_slice()?);
        let t = t.as_slice()?;
        let vector = |place: usize| {
            let ids = Ids {
                triangle: triangle[place],
                mesh: mesh[place],
                instance: instance[place],
            };
            let weights = [uv[2 * place], uv[2 * place + 1]];
            of(ids, weights, t[place], place).unwrap_or([nothing; 3])
        };
        let threads = Threads::of(None)?;
        let count = triangle.len();
        py.detach(|| {
            // Written once: memory that is touched for the first time costs more than most of what is computed.
            let mut all = memory::room(count, "vectors")?;
            if count <= SOME || threads.count() == 1 {
                all.extend((0..count).map(vector));
            } else {
                let places = (0..count).into_par_iter().with_min_len(SOME);
                threads.run(|| places.map(vector).collect_into_vec(&mut all));
            }
            Ok(all.into_flattened())
        })
    }

    fn point<'py>(
        &self,
        py: Python<'py>,
        source: Option<&Source>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let made = self.point.get_or_try_init(py, || {
            let source = source.ok_or_else(gone)?;
            let meshes = Meshes::of(&source.parts);
            let points = self.vectors(py, f64::NAN, |ids, uv, t, place| {
                if ids.triangle < 0 {
                    return None;
                }
                meshes
                    .point(ids, uv)
                    .or_else(|| source.point_on_ray(t, place))
            })?;
            Ok::<_, PyErr>(shaped(py, points, &self.shape_of_vectors(py))?.unbind())
        })?;
        Ok(made.bind(py).clone())
    }

    fn normal<'py>(
        &self,
        py: Python<'py>,
        source: Option<&Source>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let made = self.normal.get_or_try_init(py, || {
            let source = source.ok_or_else(gone)?;
            let meshes = Meshes::of(&source.parts);
            let normals = self.vectors(py, f32::NAN, |ids, uv, t, place| {
                if ids.triangle < 0 {
                    return None;
                }
                meshes
                    .normal(ids)
                    .or_else(|| source.normal_on_ray(ids, uv, t, place))
            })?;
            Ok::<_, PyErr>(shaped(py, normals, &self.shape_of_vectors(py))?.unbind())
        })?;
        Ok(made.bind(py).clone())
    }

    fn shape_of_vectors(&self, py: Python<'_>) -> Vec<usize> {
        let mut shape = self.shape(py);
        shape.push(3);
        shape
    }
}

fn gone() -> PyErr {
    pyo3::exceptions::PyRuntimeError::new_err(
        "hits that were pickled have no scene: ask for point and normal before, and they go along",
    )
}

impl Source {
    /// `rays` has the ray of each of so many hits, and is used if that is needed.
    pub fn new(
        scene: &Arc<SceneData>,
        rays: impl Iterator<Item = Ray>,
        hits: usize,
    ) -> PyResult<Self> {
        let rays = match scene.has_spheres {
            true => memory::collected(rays, hits, "rays")?,
            false => Vec::new(),
        };
        Ok(Self {
            parts: scene.parts.clone(),
            spheres: scene.has_spheres.then(|| scene.clone()),
            rays,
        })
    }

    /// What knows where some of the hits lie.
    fn of(&self, places: &[usize]) -> PyResult<Self> {
        let rays = match self.rays.is_empty() {
            true => Vec::new(),
            false => {
                let rays = places.iter().map(|&place| self.rays[place]);
                memory::collected(rays, places.len(), "rays")?
            }
        };
        Ok(Self {
            rays,
            ..self.clone()
        })
    }

    /// Point of a hit of something that has no triangles.
    #[cold]
    fn point_on_ray(&self, t: f32, place: usize) -> Option<[f64; 3]> {
        let ray = self.rays.get(place)?;
        Some([0, 1, 2].map(|axis| {
            let here = f64::from(ray.org[axis]) + f64::from(t) * f64::from(ray.dir[axis]);
            here + self.parts.local.origin[axis]
        }))
    }

    /// Normal of a hit of something that has no triangles.
    #[cold]
    fn normal_on_ray(&self, ids: Ids, [u, v]: [f32; 2], t: f32, place: usize) -> Option<[f32; 3]> {
        let ray = self.rays.get(place)?;
        let [geom_id, inst_id] = self.parts.kernel_ids(ids)?;
        let hit = Hit {
            t,
            u,
            v,
            prim_id: ids.triangle as u32,
            geom_id,
            inst_id,
        };
        self.spheres.as_ref()?.bvh().normal(ray, &hit)
    }
}

/// Vertices and faces of a mesh.
type Triangles<'a> = (&'a [[f32; 3]], &'a [[u32; 3]]);

/// Meshes by their numbers, to find the corners of many hits.
struct Meshes<'a> {
    meshes: Vec<Triangles<'a>>,
    instances: &'a [Instance],
    origin: [f64; 3],
}

impl<'a> Meshes<'a> {
    fn of(parts: &'a Parts) -> Self {
        let meshes = parts.parts.iter().map(|part| match &**part {
            Part::Mesh {
                positions, indices, ..
            } => (&positions[..], &indices[..]),
            Part::Spheres(_) => (&[][..], &[][..]),
        });
        Self {
            meshes: meshes.collect(),
            instances: &parts.instances,
            origin: parts.local.origin,
        }
    }

    /// Corners of a triangle in its mesh.
    #[inline(always)]
    fn corners(&self, ids: Ids) -> Option<[[f64; 3]; 3]> {
        // Ids of what is not there are negative, and therefore beyond all lists.
        let (positions, indices) = self.meshes.get(ids.mesh as usize)?;
        let [a, b, c] = *indices.get(ids.triangle as usize)?;
        let corner = |corner: u32| positions.get(corner as usize);
        let corners = [corner(a)?, corner(b)?, corner(c)?];
        Some(corners.map(|corner| corner.map(f64::from)))
    }

    #[inline(always)]
    fn point(&self, ids: Ids, uv: [f32; 2]) -> Option<[f64; 3]> {
        let [a, b, c] = self.corners(ids)?;
        let [u, v] = uv.map(f64::from);
        let w = 1.0 - u - v;
        let [x, y, z] = [0, 1, 2].map(|axis| w * a[axis] + u * b[axis] + v * c[axis]);
        let placed = match self.instances.get(ids.instance as usize) {
            None => [x, y, z],
            Some(instance) => instance.transform.map(|row| {
                let [a, b, c, d] = row.map(f64::from);
                a * x + b * y + c * z + d
            }),
        };
        Some([0, 1, 2].map(|axis| placed[axis] + self.origin[axis]))
    }

    #[inline(always)]
    fn normal(&self, ids: Ids) -> Option<[f32; 3]> {
        let [a, b, c] = self.corners(ids)?;
        let [p, q] = [b, c].map(|corner| [0, 1, 2].map(|axis| corner[axis] - a[axis]));
        match self.instances.get(ids.instance as usize) {
            None => unit_normal(p, q),
            Some(instance) => {
                let placed = |[x, y, z]: [f64; 3]| {
                    instance.transform.map(|row| {
                        let [a, b, c, _] = row.map(f64::from);
                        a * x + b * y + c * z
                    })
                };
                unit_normal(placed(p), placed(q))
            }
        }
    }
}

/// Normal of a triangle with these sides, of length 1; `None` if it has no area.
#[inline(always)]
fn unit_normal([a, b, c]: [f64; 3], [d, e, f]: [f64; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = [b * f - c * e, c * d - a * f, a * e - b * d];
    let squared = x * x + y * y + z * z;
    let scale = 1.0 / squared.sqrt();
    (squared > 0.0).then(|| [x, y, z].map(|x| (x * scale) as f32))
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
/// array([[0.19999999, 0.19999999, 1.        ]])
#[pyclass(frozen, subclass, weakref, module = "antumbra")]
pub struct Hits {
    arrays: Arrays,
    source: Option<Source>,
}

impl Hits {
    pub fn new(
        py: Python<'_>,
        columns: Columns,
        shape: &[usize],
        source: Source,
    ) -> PyResult<Self> {
        Ok(Self {
            arrays: Arrays::new(py, columns, shape)?,
            source: Some(source),
        })
    }

    /// The hits with points that are known already.
    pub fn with_points(self, py: Python<'_>, points: Vec<f64>) -> PyResult<Self> {
        let points = shaped(py, points, &self.arrays.shape_of_vectors(py))?;
        // Nobody has asked for them yet.
        let _ = self.arrays.point.set(py, points.unbind());
        Ok(self)
    }

    /// Hits at these places in C order, an array of any shape.
    pub fn of<'py>(&self, py: Python<'py>, places: &Bound<'py, PyAny>) -> PyResult<Self> {
        let arrays = Arrays::of_state(self.arrays.of(py, places)?);
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
        Ok(Self { arrays, source })
    }

    /// Places in C order of the hits that an index chooses, in the shape that numpy gives them.
    pub fn chosen<'py>(
        &self,
        py: Python<'py>,
        index: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let shape = self.arrays.shape(py);
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
        let arrays = &self.arrays;
        let columns = PyDict::new(py);
        let flat = |array: &Bound<'py, PyAny>| array.call_method1("reshape", (-1,));
        columns.set_item(distance, flat(arrays.t.bind(py))?)?;
        columns.set_item("triangle", flat(arrays.triangle.bind(py))?)?;
        columns.set_item("mesh", flat(arrays.mesh.bind(py))?)?;
        columns.set_item("instance", flat(arrays.instance.bind(py))?)?;
        let mut vectors = vec![(arrays.uv.bind(py).as_any().clone(), &["u", "v"][..])];
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

    /// Number of hits, and of what was asked.
    pub fn counts(&self, py: Python<'_>) -> PyResult<(usize, usize)> {
        let hits = self.hit(py)?.call_method0("sum")?.extract()?;
        Ok((hits, self.arrays.shape(py).iter().product()))
    }

    /// What notebooks show.
    pub fn html(&self, py: Python<'_>, name: &str, asked: &str) -> PyResult<String> {
        let (hits, all) = self.counts(py)?;
        let share = html::percent(hits as f64 / all as f64);
        let shape = crate::arrays::shape_text(&self.arrays.shape(py));
        let hits = format!("{hits} of {all} {asked} ({share})");
        Ok(html::table(name, &[("shape", shape), ("hit", hits)]))
    }

    pub fn restore(state: State<'_>) -> Self {
        Self {
            arrays: Arrays::of_state(state),
            source: None,
        }
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

impl Arrays {
    /// Some of the hits, given by their places in C order in an array of any shape.
    fn of<'py>(&self, py: Python<'py>, places: &Bound<'py, PyAny>) -> PyResult<State<'py>> {
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

    fn of_state(state: State<'_>) -> Self {
        let (t, triangle, mesh, instance, uv, point, normal) = state;
        let py = t.py();
        let arrays = Self {
            t: t.unbind(),
            triangle: triangle.unbind(),
            mesh: mesh.unbind(),
            instance: instance.unbind(),
            uv: uv.unbind(),
            point: PyOnceLock::new(),
            normal: PyOnceLock::new(),
        };
        if let Some(point) = point {
            let _ = arrays.point.set(py, point.unbind());
        }
        if let Some(normal) = normal {
            let _ = arrays.normal.set(py, normal.unbind());
        }
        arrays
    }
}

#[pymethods]
impl Hits {
    /// Distance in lengths of the direction: float32.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArrayDyn<f32>> {
        self.arrays.t.bind(py).clone()
    }

    /// Place of the triangle in the faces of its mesh: int32.
    #[getter]
    fn triangle<'py>(&self, py: Python<'py>) -> Bound<'py, PyArrayDyn<i32>> {
        self.arrays.triangle.bind(py).clone()
    }

    /// Place of the mesh in the list of meshes: int32.
    #[getter]
    fn mesh<'py>(&self, py: Python<'py>) -> Bound<'py, PyArrayDyn<i32>> {
        self.arrays.mesh.bind(py).clone()
    }

    /// Place of the instance in the list of instances, -1 for meshes that stand in the world themselves: int32.
    #[getter]
    fn instance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArrayDyn<i32>> {
        self.arrays.instance.bind(py).clone()
    }

    /// Weights of the second and third corner of the triangle: float32 of shape (..., 2).
    #[getter]
    fn uv<'py>(&self, py: Python<'py>) -> Bound<'py, PyArrayDyn<f32>> {
        self.arrays.uv.bind(py).clone()
    }

    /// Whether the ray hits anything: bool.
    #[getter]
    fn hit<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.arrays
            .triangle
            .bind(py)
            .rich_compare(0, pyo3::basic::CompareOp::Ge)
    }

    /// Point of the triangle that is hit: float64 of shape (..., 3). Made on first use.
    #[getter]
    fn point<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.arrays.point(py, self.source.as_ref())
    }

    /// Geometric normal, of length 1: float32 of shape (..., 3). A triangle's corners run counterclockwise seen from where
    /// it points. Made on first use.
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        self.arrays.normal(py, self.source.as_ref())
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        let shape = self.arrays.shape(py);
        let len = shape.first().copied();
        len.ok_or_else(|| PyTypeError::new_err("one hit has no length"))
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> PyResult<Self> {
        self.of(py, &self.chosen(py, index)?)
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
        let arrays = &self.arrays;
        let count: usize = arrays.shape(py).iter().product();
        let point = arrays.point.get(py).map_or(0, |_| 24);
        let normal = arrays.normal.get(py).map_or(0, |_| 12);
        size_of::<Self>() + count * (24 + point + normal)
    }

    /// Shape of the rays.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyTuple>> {
        pyo3::types::PyTuple::new(py, self.arrays.shape(py))
    }

    #[staticmethod]
    #[pyo3(name = "_restore")]
    fn restore_hits(state: State<'_>) -> Self {
        Self::restore(state)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py, (State<'py>,)> {
        let py = slf.py();
        Ok((
            slf.get_type().getattr("_restore")?,
            (slf.get().arrays.state(py),),
        ))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (hits, rays) = self.counts(py)?;
        Ok(format!("<antumbra.Hits: {hits} of {rays} rays hit>"))
    }
}

/// All hits of rays, one list after the other: hits of ray ``i`` are at ``splits[i]:splits[i + 1]``, the nearest first.
///
/// The arrays of ``Hits``, with one item for each hit. ``hits[i]`` are the ``Hits`` of ray ``i``, and ``len(hits)`` is the number of rays.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
/// >>> hits = scene.intersect_all([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
/// >>> [len(of_ray) for of_ray in hits]
/// [1, 0]
#[pyclass(frozen, extends = Hits, module = "antumbra")]
pub struct HitList {
    splits: Py<PyArrayDyn<i64>>,
}

impl HitList {
    pub fn new<'py>(
        py: Python<'py>,
        splits: Vec<i64>,
        columns: Columns,
        source: Source,
    ) -> PyResult<Bound<'py, Self>> {
        let (rays, hits) = (splits.len(), columns.t.len());
        let list = Self {
            splits: shaped(py, splits, &[rays])?.unbind(),
        };
        Bound::new(py, (list, Hits::new(py, columns, &[hits], source)?))
    }
}

#[pymethods]
impl HitList {
    /// Where the hits of each ray begin, and the number of hits at the end: int64 of shape (n + 1,), rays in C order.
    #[getter]
    fn splits<'py>(&self, py: Python<'py>) -> Bound<'py, PyArrayDyn<i64>> {
        self.splits.bind(py).clone()
    }

    /// Ray of each hit: int64.
    #[getter]
    fn ray<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let py = slf.py();
        let splits = slf.get().splits.bind(py).try_readonly();
        let splits =
            splits.map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))?;
        let hits = slf.as_super().get().arrays.t.bind(py).len();
        let mut rays = memory::room(hits, "rays of hits")?;
        for (ray, ends) in splits.as_slice()?.windows(2).enumerate() {
            rays.extend((ends[0]..ends[1]).map(|_| ray as i64));
        }
        let hits = rays.len();
        shaped(py, rays, &[hits])
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.splits.bind(py).len() - 1
    }

    fn __getitem__<'py>(slf: &Bound<'py, Self>, ray: &Bound<'py, PyAny>) -> PyResult<Hits> {
        let py = slf.py();
        let splits = slf.get().splits.bind(py);
        let rays = splits.len() - 1;
        let Ok(index) = ray.extract::<isize>() else {
            let found = ray.get_type().name()?;
            return Err(PyTypeError::new_err(format!(
                "index: found {found}, wanted the number of one ray; arrays such as .t and .ray have all hits"
            )));
        };
        let place = match index < 0 {
            true => index.saturating_add_unsigned(rays),
            false => index,
        };
        let place = match usize::try_from(place) {
            Ok(place) if place < rays => place,
            _ => {
                return Err(PyIndexError::new_err(format!(
                    "ray {index} of hits of {rays} rays"
                )));
            }
        };
        let ends: [i64; 2] = [
            splits.get_item(place)?.extract()?,
            splits.get_item(place + 1)?.extract()?,
        ];
        let hits = slf.as_super().get();
        let places = PySlice::new(py, ends[0] as isize, ends[1] as isize, 1);
        hits.of(py, &hits.chosen(py, &places)?)
    }

    /// A table of all hits, such as ``pandas.DataFrame`` takes: one row for each hit.
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
    /// dict of str to array (m,)
    ///     ``ray``, ``t``, ``triangle``, ``mesh``, ``instance``, ``u``, ``v``.
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
    /// >>> list(scene.intersect_all([[0.2, 0.2, 0]], [0, 0, 1]).to_dict())
    /// ['ray', 't', 'triangle', 'mesh', 'instance', 'u', 'v']
    #[pyo3(signature = (*, point=false, normal=false))]
    fn to_dict<'py>(
        slf: &Bound<'py, Self>,
        point: bool,
        normal: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let py = slf.py();
        let columns = PyDict::new(py);
        columns.set_item("ray", Self::ray(slf)?)?;
        let hits = slf.as_super().get().columns(py, ("t", point, normal))?;
        columns.update(hits.as_mapping())?;
        Ok(columns)
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        let py = slf.py();
        let rays = (slf.get().splits.bind(py).len() - 1).to_string();
        let hits = slf.as_super().get().arrays.t.bind(py).len().to_string();
        Ok(html::table(
            "antumbra.HitList",
            &[("rays", rays), ("hits", hits)],
        ))
    }

    #[staticmethod]
    #[pyo3(name = "_restore_list")]
    fn restore_list<'py>(
        py: Python<'py>,
        splits: Bound<'py, PyArrayDyn<i64>>,
        state: State<'py>,
    ) -> PyResult<Bound<'py, Self>> {
        let list = Self {
            splits: splits.unbind(),
        };
        Bound::new(py, (list, Hits::restore(state)))
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> Reduced<'py, (Bound<'py, PyArrayDyn<i64>>, State<'py>)> {
        let (py, list) = (slf.py(), slf.get());
        let restore = slf.get_type().getattr("_restore_list")?;
        let state = slf.as_super().get().arrays.state(py);
        Ok((restore, (list.splits.bind(py).clone(), state)))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let (py, rays) = (slf.py(), slf.get().splits.bind(slf.py()).len() - 1);
        let hits = slf.as_super().get().arrays.t.bind(py).len();
        format!("<antumbra.HitList: {hits} hits of {rays} rays>")
    }
}
