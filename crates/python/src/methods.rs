//! The class `Queries`: what scenes and worlds answer.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use antumbra::Batch;
use antumbra_bake::{AmbientOcclusion, Place, SightLines, Sunlight, vertex_normals};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Numbers, output, shaped, wrong_shape};
use crate::bake::{self, Places};
use crate::bits::BitMatrix;
use crate::hits::{HitList, Hits, Source};
use crate::points::{self, Closest};
use crate::queries::Choice;
use crate::rays::{Call, Conditions, RayArguments, RaySource, Segments, mask};
use crate::scene::SceneData;
use crate::threads::ThreadCount;
use crate::{broadcast, distinct, html, memory, queries, saved};

/// Queries that scenes and worlds have in common: see ``Scene`` and ``World``.
///
/// Calls may run in any number of threads at once. Long ones release the lock of the interpreter.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> isinstance(am.Scene([]), am.Queries)
/// True
#[pyclass(frozen, subclass, weakref, module = "antumbra")]
pub struct Queries {
    data: Mutex<Arc<SceneData>>,
}

impl From<Arc<SceneData>> for Queries {
    fn from(data: Arc<SceneData>) -> Self {
        Self {
            data: Mutex::new(data),
        }
    }
}

impl Queries {
    /// What is asked, as it is now. Whoever moves it meanwhile moves a copy.
    pub fn data(&self) -> Arc<SceneData> {
        self.held().clone()
    }

    /// Changes what is asked. Calls that are running go on with what they have.
    pub fn change<T>(&self, change: impl FnOnce(&mut SceneData) -> T) -> T {
        change(Arc::make_mut(&mut self.held()))
    }

    fn held(&self) -> MutexGuard<'_, Arc<SceneData>> {
        self.data.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What tells where hits lie.
fn source(data: &Arc<SceneData>, rays: &impl RaySource) -> PyResult<Source> {
    let all = (0..rays.len()).map(|place| rays.get(place));
    Source::new(data, all, rays.len())
}

#[pymethods]
#[allow(clippy::too_many_arguments)]
impl Queries {
    /// Whether anything is in the way of each ray.
    ///
    /// Rays with NaN, and rays without a direction, hit nothing.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : arrays (..., 3)
    ///     Rays. Leading shapes are broadcast: one origin or one direction may stand for all. Directions have any length but 0.
    ///     Without directions, origins are (..., 6): origin and direction in a row.
    /// distance, near : numbers or arrays (...), optional
    ///     Ends of the rays in lengths of their directions: inf and 0. Both ends count.
    /// mask : int or array (...) of integers, optional
    ///     32 bits. A ray sees meshes and instances that have a bit in common with it: see ``set_masks``. Without it, it sees all.
    /// exclude : Hits, Occluders, tuple or array of integers, optional
    ///     One triangle that each ray does not hit, such as the one it starts on: hits of as many rays, ``(triangle, mesh)``,
    ///     ``(triangle, mesh, instance)``, or triangles of the first mesh. -1 leaves out nothing.
    /// out : array (...) of bool, optional
    ///     Where to write the answers: in C order. No other array is made.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// array (...) of bool
    ///     In the shape of the rays.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.occluded([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
    /// array([ True, False])
    /// >>> scene.occluded([0.2, 0.2, 0], [0, 0, 1], distance=[0.5, 1.0])
    /// array([False,  True])
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, mask=None, exclude=None, out=None, threads=None, progress=None))]
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        mask: Option<&Bound<'py, PyAny>>,
        exclude: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        let data = self.data();
        let arguments = RayArguments::read(
            origins,
            directions,
            distance,
            near,
            Conditions { mask, exclude },
        )?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(&data)?;
        let group = rays.group(&data)?;
        let query = |batch: Batch<'_>, answers: &mut [bool]| batch.closed().occluded_into(answers);
        answered(py, out, &arguments.shape, |answers| match group {
            Some(group) => group.occluded(py, &data, answers, &mut call),
            None => call.ask(py, data.bvh(), &rays, answers, query),
        })
    }

    /// Whether nothing is between points.
    ///
    /// Points may be on surfaces. Both sides of such a surface count as outside: points on one closed body see each other through its
    /// inside. ``visible(a[:, None], b)`` has every pair, and ``visibility`` has them in one bit each. A point sees itself here.
    ///
    /// Parameters
    /// ----------
    /// a, b : arrays (..., 3)
    ///     Points. Leading shapes are broadcast. A point that is not finite sees nothing.
    /// margin : float, optional
    ///     Length that is left out at both ends of a segment. Without it, about 4 millionths of the largest coordinate, seen from
    ///     ``origin``, of the scene and of the point at that end: the origin offset. A point on a surface is rounded, and its
    ///     surface would hide it now and then. Lines within about one degree of the surface may still be hidden. 0 is the
    ///     bare segment.
    /// out : array (...) of bool, optional
    ///     Where to write the answers: in C order. No other array is made.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// array (...) of bool
    ///     In the common shape of both.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.visible([0.2, 0.2, 0], [[0.2, 0.2, 2], [2, 2, 2]])
    /// array([False,  True])
    #[pyo3(signature = (a, b, *, margin=None, out=None, threads=None, progress=None))]
    fn visible<'py>(
        &self,
        py: Python<'py>,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
        margin: Option<f32>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        let data = self.data();
        let (a, b) = (Numbers::read(a, "a", 3)?, Numbers::read(b, "b", 3)?);
        let shape = broadcast::common_shape(&[(&a, 3), (&b, 3)])?;
        let mut call = Call::new(threads, progress)?;
        let lines = SightLines::new(data.bvh(), margin).map_err(bake::failed)?;
        let segments = Segments::new(&a, &b, &shape, lines, data.local());
        let query = |batch: Batch<'_>, answers: &mut [bool]| batch.occluded_into(answers);
        answered(py, out, &shape, |answers| {
            call.ask(py, data.bvh(), &segments, answers, query)?;
            py.detach(|| {
                for (place, answer) in answers.iter_mut().enumerate() {
                    *answer = !*answer && segments.is_finite(place);
                }
            });
            Ok(())
        })
    }

    /// Something that is in the way of each ray: any triangle, which need not be the first.
    ///
    /// Takes little longer than ``occluded``. Which triangle it is depends on the tree. Whether there is one does not.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : arrays (..., 3)
    ///     Rays. Leading shapes are broadcast: one origin or one direction may stand for all. Directions have any length but 0.
    ///     Without directions, origins are (..., 6): origin and direction in a row.
    /// distance, near : numbers or arrays (...), optional
    ///     Ends of the rays in lengths of their directions: inf and 0. Both ends count.
    /// mask : int or array (...) of integers, optional
    ///     32 bits. A ray sees meshes and instances that have a bit in common with it: see ``set_masks``. Without it, it sees all.
    /// exclude : Hits, Occluders, tuple or array of integers, optional
    ///     One triangle that each ray does not hit, such as the one it starts on: hits of as many rays, ``(triangle, mesh)``,
    ///     ``(triangle, mesh, instance)``, or triangles of the first mesh. -1 leaves out nothing.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// Occluders
    ///     Arrays ``triangle``, ``mesh`` and ``instance`` in the shape of the rays, -1 where nothing is in the way.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.occluder([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1]).triangle
    /// array([ 0, -1], dtype=int32)
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, mask=None, exclude=None, threads=None, progress=None))]
    fn occluder<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        mask: Option<&Bound<'py, PyAny>>,
        exclude: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let data = self.data();
        let arguments = RayArguments::read(
            origins,
            directions,
            distance,
            near,
            Conditions { mask, exclude },
        )?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(&data)?;
        let [triangle, mesh, instance] = queries::occluders(py, &data, &rays, &mut call)?;
        let ids = (
            shaped(py, triangle, &arguments.shape)?,
            shaped(py, mesh, &arguments.shape)?,
            shaped(py, instance, &arguments.shape)?,
        );
        py.import("antumbra")?.getattr("Occluders")?.call1(ids)
    }

    /// First hit of each ray.
    ///
    /// Of several triangles at one distance, the one of the smallest numbers is hit.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : arrays (..., 3)
    ///     Rays. Leading shapes are broadcast: one origin or one direction may stand for all. Directions have any length but 0.
    ///     Without directions, origins are (..., 6): origin and direction in a row.
    /// distance, near : numbers or arrays (...), optional
    ///     Ends of the rays in lengths of their directions: inf and 0. Both ends count.
    /// mask : int or array (...) of integers, optional
    ///     32 bits. A ray sees meshes and instances that have a bit in common with it: see ``set_masks``. Without it, it sees all.
    /// exclude : Hits, Occluders, tuple or array of integers, optional
    ///     One triangle that each ray does not hit, such as the one it starts on: hits of as many rays, ``(triangle, mesh)``,
    ///     ``(triangle, mesh, instance)``, or triangles of the first mesh. -1 leaves out nothing.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// Hits
    ///     In the shape of the rays.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> hits = scene.intersect([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
    /// >>> hits.t, hits.triangle
    /// (array([ 1., inf], dtype=float32), array([ 0, -1], dtype=int32))
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, mask=None, exclude=None, threads=None, progress=None))]
    fn intersect<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        mask: Option<&Bound<'py, PyAny>>,
        exclude: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let data = self.data();
        let arguments = RayArguments::read(
            origins,
            directions,
            distance,
            near,
            Conditions { mask, exclude },
        )?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(&data)?;
        let columns = queries::first_hits(py, &data, &rays, &mut call)?;
        Hits::new(py, columns, &arguments.shape, source(&data, &rays)?)
    }

    /// All hits of each ray, the nearest first.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : arrays (..., 3)
    ///     Rays. Leading shapes are broadcast: one origin or one direction may stand for all. Directions have any length but 0.
    ///     Without directions, origins are (..., 6): origin and direction in a row.
    /// distance, near : numbers or arrays (...), optional
    ///     Ends of the rays in lengths of their directions: inf and 0. Both ends count.
    /// max_hits : int, optional
    ///     Number of hits of a ray that are kept.
    /// distinct : bool
    ///     Whether hits of one mesh at one place, as far as rounding reaches, count once for each side of the surface. Without it, a
    ///     ray through an edge hits the triangles on both sides of it.
    /// mask : int or array (...) of integers, optional
    ///     32 bits. A ray sees meshes and instances that have a bit in common with it: see ``set_masks``. Without it, it sees all.
    /// exclude : Hits, Occluders, tuple or array of integers, optional
    ///     One triangle that each ray does not hit, such as the one it starts on: hits of as many rays, ``(triangle, mesh)``,
    ///     ``(triangle, mesh, instance)``, or triangles of the first mesh. -1 leaves out nothing.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// HitList
    ///     Hits of all rays, rays in C order.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> hits = scene.intersect_all([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
    /// >>> hits.splits
    /// array([0, 1, 1])
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, max_hits=None, distinct=false, mask=None, exclude=None, threads=None, progress=None))]
    fn intersect_all<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        max_hits: Option<usize>,
        distinct: bool,
        mask: Option<&Bound<'py, PyAny>>,
        exclude: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, HitList>> {
        let data = self.data();
        let arguments = RayArguments::read(
            origins,
            directions,
            distance,
            near,
            Conditions { mask, exclude },
        )?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(&data)?;
        let choice = Choice {
            most: max_hits.unwrap_or(usize::MAX),
            distinct,
        };
        let lists = queries::all_hits(py, &data, &rays, choice, &mut call)?;
        let of_hits = lists.rays().map(|ray| rays.get(ray));
        let source = Source::new(&data, of_hits, lists.columns.t.len())?;
        HitList::new(py, lists.splits, lists.columns, source)
    }

    /// Number of hits of each ray.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : arrays (..., 3)
    ///     Rays. Leading shapes are broadcast: one origin or one direction may stand for all. Directions have any length but 0.
    ///     Without directions, origins are (..., 6): origin and direction in a row.
    /// distance, near : numbers or arrays (...), optional
    ///     Ends of the rays in lengths of their directions: inf and 0. Both ends count.
    /// distinct : bool
    ///     Whether a hit on an edge counts once, as for ``intersect_all``.
    /// mask : int or array (...) of integers, optional
    ///     32 bits. A ray sees meshes and instances that have a bit in common with it: see ``set_masks``. Without it, it sees all.
    /// exclude : Hits, Occluders, tuple or array of integers, optional
    ///     One triangle that each ray does not hit, such as the one it starts on: hits of as many rays, ``(triangle, mesh)``,
    ///     ``(triangle, mesh, instance)``, or triangles of the first mesh. -1 leaves out nothing.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// array (...) of int32
    ///     In the shape of the rays.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> square = am.Scene([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], [[0, 1, 2], [0, 2, 3]])
    /// >>> middle, up = [0.5, 0.5, 0], [0, 0, 1]
    /// >>> int(square.count(middle, up)), int(square.count(middle, up, distinct=True))
    /// (2, 1)
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, distinct=false, mask=None, exclude=None, threads=None, progress=None))]
    fn count<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        distinct: bool,
        mask: Option<&Bound<'py, PyAny>>,
        exclude: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<i32>>> {
        let data = self.data();
        let arguments = RayArguments::read(
            origins,
            directions,
            distance,
            near,
            Conditions { mask, exclude },
        )?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(&data)?;
        if distinct {
            let choice = Choice {
                most: usize::MAX,
                distinct,
            };
            let lists = queries::all_hits(py, &data, &rays, choice, &mut call)?;
            let counts = lists.splits.windows(2);
            let counts = counts.map(|ends| (ends[1] - ends[0]) as i32);
            let counts = memory::collected(counts, rays.len(), "counts")?;
            return shaped(py, counts, &arguments.shape);
        }
        let mut counts = memory::filled(0, rays.len(), "counts")?;
        let query = |batch: Batch<'_>, counts: &mut [u32]| {
            counts.copy_from_slice(&batch.closed().count_hits());
        };
        call.ask(py, data.bvh(), &rays, &mut counts, query)?;
        let counts = counts.into_iter().map(|count| count as i32).collect();
        shaped(py, counts, &arguments.shape)
    }

    /// Whether points are inside closed meshes.
    ///
    /// Which way triangles run does not matter. For meshes with holes the answer means little. A point that is not finite is outside.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     Points.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// array (...) of bool
    ///     In the shape of the points.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    /// >>> scene = am.Scene(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    /// >>> scene.contains([[0.2, 0.2, 0.2], [1, 1, 1]])
    /// array([ True, False])
    #[pyo3(signature = (points, *, threads=None, progress=None))]
    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        let data = self.data();
        let points = Numbers::read(points, "points", 3)?;
        let mut call = Call::new(threads, progress)?;
        let inside = points::contains(py, &data, &points, &mut call)?;
        shaped(py, inside, points.lead(3))
    }

    /// Nearest point of the surfaces to each point.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     Points.
    /// max_distance : float or array (...), optional
    ///     How far the nearest point may be: one number for all points, or one for each. inf without it.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// Closest
    ///     In the shape of the points.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> near = scene.closest([[0.25, 0.25, 3], [0.25, 0.25, 0]], max_distance=[1, 2])
    /// >>> near.distance
    /// array([inf,  1.], dtype=float32)
    #[pyo3(signature = (points, max_distance=None, *, threads=None, progress=None))]
    fn closest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, Closest>> {
        let data = self.data();
        let points = Numbers::read(points, "points", 3)?;
        let mut call = Call::new(threads, progress)?;
        points::closest(py, &data, &points, max_distance, &mut call)
    }

    /// Distance of each point to the nearest surface, negative inside closed meshes.
    ///
    /// inf for a point that is not finite, and where there is no surface.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     Points.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// array (...) of float32
    ///     In the shape of the points, in units of the scene.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    /// >>> scene = am.Scene(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    /// >>> scene.signed_distance([[0.25, 0.25, 0.125], [0, 0, 3]])
    /// array([-0.125,  2.   ], dtype=float32)
    #[pyo3(signature = (points, *, threads=None, progress=None))]
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let data = self.data();
        let points = Numbers::read(points, "points", 3)?;
        let mut call = Call::new(threads, progress)?;
        let distances = points::signed_distances(py, &data, &points, &mut call)?;
        shaped(py, distances, points.lead(3))
    }

    /// Visibility between points, one bit for each pair.
    ///
    /// Points see each other if nothing is strictly between them, as for ``visible``. They are rounded as vertices are. A point that is
    /// not finite sees nothing. A matrix of 100 000 by 100 000 points takes 1.25 GB: compute parts of ``a`` one after the other.
    ///
    /// Parameters
    /// ----------
    /// a : array (n, 3)
    ///     Points.
    /// b : array (m, 3), optional
    ///     Without them, ``a`` is compared with itself. The matrix is symmetric then, and its diagonal is false: no point counts
    ///     as seeing itself.
    /// margin : float, optional
    ///     Length that is left out at both ends of a segment, as for ``visible``.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// BitMatrix
    ///     Of shape (n, m).
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    /// MemoryError
    ///     There is no memory for the matrix.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> seen = scene.visibility([[0.2, 0.2, 0], [2, 2, 0]], [[0.2, 0.2, 2], [2, 2, 2]])
    /// >>> seen[0], int(seen.count())
    /// (array([False,  True]), 3)
    #[pyo3(signature = (a, b=None, *, margin=None, threads=None, progress=None))]
    fn visibility<'py>(
        &self,
        py: Python<'py>,
        a: &Bound<'py, PyAny>,
        b: Option<&Bound<'py, PyAny>>,
        margin: Option<f32>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<BitMatrix> {
        let data = self.data();
        let mut call = Call::new(threads, progress)?;
        bake::visibility(py, &data, a, b, margin, &mut call)
    }

    /// Which directions points see.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     Points.
    /// normals : array (..., 3) or None
    ///     Normals of surfaces, of any length: a direction below the surface is not seen, and rays begin a little above it.
    ///     With None, points may be in free space or on surfaces, of which both sides count as outside. Rays then begin a
    ///     little along their direction. Give normals for points on open sheets, such as terrain.
    /// directions : array (k, 3)
    ///     Directions of any length, such as those to the sun.
    /// distance : float
    ///     Length up to which surfaces are in the way, in units of the scene.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// BitMatrix
    ///     Of shape (n, k), points in C order.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.sees([[0.2, 0.2, 0]], None, [[0, 0, 1], [1, 0, 0]])[0]
    /// array([False,  True])
    #[pyo3(signature = (points, normals, directions, *, distance=f32::INFINITY, threads=None, progress=None))]
    fn sees<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        normals: Option<&Bound<'py, PyAny>>,
        directions: &Bound<'py, PyAny>,
        distance: f32,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<BitMatrix> {
        let data = self.data();
        let places = Places::read(&data, points, normals)?;
        let mut call = Call::new(threads, progress)?;
        bake::sees(py, &data, &places, directions, distance, &mut call)
    }

    /// Open part of the sky above points of surfaces.
    ///
    /// Parameters
    /// ----------
    /// points, normals : arrays (..., 3)
    ///     Normals have any length but 0. Values of others are NaN.
    /// samples : int
    ///     Rays per point. Powers of two are spread most evenly.
    /// distance : float
    ///     Length up to which surfaces are in the way, in units of the scene.
    /// two_sided : bool
    ///     Whether the more open side of a point counts, for normals that point anywhere.
    /// weighting : "cosine" or "uniform"
    ///     How much each part of the sky counts.
    /// seed : int
    ///     Seed of the directions.
    /// bent : bool
    ///     Whether to return also the mean open directions.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// array (...) of float32
    ///     From 0 (closed in) to 1. With ``bent``, a pair of it and the mean open directions: float32 of shape (..., 3).
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.ambient_occlusion([[0.2, 0.2, 2], [5, 5, 0]], [0, 0, 1], 64)
    /// array([1., 1.], dtype=float32)
    #[pyo3(signature = (points, normals, samples=256, distance=f32::INFINITY, *, two_sided=false, weighting="cosine", seed=0, bent=false, threads=None, progress=None))]
    fn ambient_occlusion<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        normals: &Bound<'py, PyAny>,
        samples: u32,
        distance: f32,
        two_sided: bool,
        weighting: &str,
        seed: u64,
        bent: bool,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let data = self.data();
        let places = Places::read(&data, points, Some(normals))?;
        let options = AmbientOcclusion {
            samples,
            distance,
            two_sided,
            weighting: bake::weighting(weighting)?,
            seed,
        };
        let mut call = Call::new(threads, progress)?;
        let (open, bent) = bake::ambient_occlusion(py, &data, &places, &options, bent, &mut call)?;
        match bent {
            None => Ok(open.into_any()),
            Some(bent) => Ok((open, bent).into_pyobject(py)?.into_any()),
        }
    }

    /// Part of the sky that points see, by its patches.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     Points.
    /// normals : array (..., 3), optional
    ///     Normals of surfaces, as for ``sees``. Without them, the sky is weighted for a level surface.
    /// patches, uniform, up, north
    ///     The sky, as for ``sky_patches``.
    /// weighting : "cosine" or "uniform"
    ///     "cosine" is the light that a surface receives from an even sky, relative to a level and free one. "uniform" is the
    ///     solid angle.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// array (...) of float32
    ///     From 0 to 1, in the shape of the points.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.sky_view([[5, 5, 2]])
    /// array([1.], dtype=float32)
    #[pyo3(signature = (points, normals=None, patches=145, *, uniform=false, weighting="cosine", up="z", north=0.0, threads=None, progress=None))]
    fn sky_view<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        normals: Option<&Bound<'py, PyAny>>,
        patches: u32,
        uniform: bool,
        weighting: &str,
        up: &str,
        north: f64,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let data = self.data();
        let places = Places::read(&data, points, normals)?;
        let (sky, orientation) = (bake::sky(patches, uniform)?, bake::orientation(up, north)?);
        let weighting = bake::weighting(weighting)?;
        let mut call = Call::new(threads, progress)?;
        let sky = (&sky, &orientation);
        bake::sky_view(py, &data, &places, sky, weighting, &mut call)
    }

    /// Hours of direct sun of points.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     Points.
    /// normals : array (..., 3) or None
    ///     As for ``sees``.
    /// sun_directions : array (k, 3)
    ///     Directions to the sun above the horizon, one for each step of time: see ``sun_positions``.
    /// weights : float or array (k,), optional
    ///     Length of each step in hours, or whatever else is to be added up: 1.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// array (...) of float64
    ///     In the shape of the points.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.sun_hours([[0.2, 0.2, 0], [5, 5, 0]], None, [[0, 0, 1], [0, 1, 1]], weights=0.5)
    /// array([0.5, 1. ])
    #[pyo3(signature = (points, normals, sun_directions, weights=None, *, threads=None, progress=None))]
    fn sun_hours<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        normals: Option<&Bound<'py, PyAny>>,
        sun_directions: &Bound<'py, PyAny>,
        weights: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let data = self.data();
        let places = Places::read(&data, points, normals)?;
        let mut call = Call::new(threads, progress)?;
        let one = 1.0f64.into_pyobject(py)?.into_any();
        let weights = weights.unwrap_or(&one);
        bake::sun_hours(py, &data, &places, sun_directions, weights, &mut call)
    }

    /// Irradiation of points by the sun and by the sky: see ``antumbra.irradiation``.
    #[pyo3(name = "_irradiation")]
    fn irradiation<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        normals: Option<&Bound<'py, PyAny>>,
        place: (f64, f64, f64),
        times: Vec<f64>,
        steps: [Bound<'py, PyAny>; 3],
        sky: (u32, bool, String, f64),
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<bake::Irradiation<'py>> {
        let data = self.data();
        let places = Places::read(&data, points, normals)?;
        let (latitude, longitude, height) = place;
        let place = Place {
            latitude,
            longitude,
            height,
        };
        let [hours, direct_normal, diffuse_horizontal] = &steps;
        let steps = bake::time_steps(&times, hours, direct_normal, diffuse_horizontal)?;
        let (patches, uniform, up, north) = sky;
        let (sky, orientation) = (bake::sky(patches, uniform)?, bake::orientation(&up, north)?);
        let sunlight = Sunlight::new(&place, steps, true, sky, orientation);
        let sunlight = sunlight.map_err(bake::failed)?;
        let mut call = Call::new(threads, progress)?;
        bake::irradiation(py, &data, &places, &sunlight, &mut call)
    }

    /// Points on the surfaces that are seen from above, in the middle of square cells over the bounds of the scene.
    ///
    /// Parameters
    /// ----------
    /// spacing : float
    ///     Side of a cell, in units of the scene.
    /// up : "z" or "y"
    ///     Axis that points up, as for ``sky_patches``.
    ///
    /// Returns
    /// -------
    /// points : float64 of shape (k, 3)
    ///     Uppermost points, row by row from north to south.
    /// normals : float32 of shape (k, 3)
    ///     Normals of the surfaces there, turned upwards.
    /// cells : int64 of shape (rows, columns)
    ///     Number of the point of each cell, -1 where no surface is.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The spacing is not above 0, makes more than 100 million cells, or no surface is seen from above.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [2, 0, 1], [0, 3, 1]], [[0, 1, 2]])
    /// >>> points, normals, cells = scene.sensor_grid(1.0)
    /// >>> cells
    /// array([[-1, -1],
    ///        [ 0, -1],
    ///        [ 1,  2]])
    #[pyo3(signature = (spacing, *, up="z"))]
    fn sensor_grid<'py>(
        &self,
        py: Python<'py>,
        spacing: f64,
        up: &str,
    ) -> PyResult<bake::Cells<'py>> {
        let data = self.data();
        let orientation = bake::orientation(up, 0.0)?;
        bake::sensor_grid(py, &data, spacing, &orientation)
    }

    /// Writes the scene or the world to a file, tree and all. ``load`` reads it on any machine.
    ///
    /// A file that exists is replaced when the new one is complete.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     File to be written.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     The file cannot be written.
    /// ValueError
    ///     There are alpha masks, which cannot be saved.
    ///
    /// Examples
    /// --------
    /// >>> import os, tempfile
    /// >>> import antumbra as am
    /// >>> path = os.path.join(tempfile.mkdtemp(), "scene")
    /// >>> am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]]).save(path)
    /// >>> am.Scene.load(path)
    /// <antumbra.Scene: 1 meshes, 1 triangles>
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let data = self.data();
        py.detach(|| saved::save(&data, &path))
    }

    /// Numbers about the tree: triangles (with spheres and segments of curves), instances, dropped, nodes, depth, bytes, width, training_rays.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let data = self.data();
        let report = data.bvh().report();
        let numbers = PyDict::new(py);
        for (name, value) in [
            ("triangles", report.primitives),
            ("instances", report.instances),
            ("dropped", report.dropped),
            ("nodes", report.nodes),
            ("depth", report.depth),
            ("bytes", report.bytes),
            ("width", data.bvh().width().lanes()),
            ("training_rays", report.training_rays as usize),
        ] {
            numbers.set_item(name, value)?;
        }
        Ok(numbers)
    }

    /// Point that the tree has as its zero: (x, y, z).
    #[getter]
    fn origin(&self) -> (f64, f64, f64) {
        let data = self.data();
        data.local().origin.into()
    }

    /// How each instance is reached: int64 of shape (instances, depth), places in the list of instances of the scene, then in those of the
    /// ``Assembly`` that is placed there, and so on. -1 behind the last place.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> am.Scene([roof], instances=[(0, np.eye(4)), (0, np.diag([2, 2, 2, 1]))]).paths
    /// array([[0],
    ///        [1]])
    #[getter]
    fn paths<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let data = self.data();
        let (paths, count) = (&data.parts.paths, data.parts.instances.len());
        let depth = paths.len().checked_div(count).unwrap_or(0).max(1);
        let places = (0..count * depth).map(|place| match paths.get(place) {
            Some(&place) => i64::from(place),
            None => place as i64,
        });
        let places = memory::collected(places, count * depth, "paths")?;
        shaped(py, places, &[count, depth])
    }

    /// Smallest box around everything: float64 of shape (2, 3), NaN if there is nothing.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let data = self.data();
        let bounds = data.bvh().bounds();
        let is_empty = bounds.min[0] > bounds.max[0];
        let local = data.local();
        let corners = [bounds.min, bounds.max].map(|corner| match is_empty {
            true => [f64::NAN; 3],
            false => local.world(corner),
        });
        shaped(py, corners.concat(), &[2, 3])
    }

    /// Vertices of all triangles in the world: float64 of shape (n, 3), as the tree has them, rounded around ``origin``.
    ///
    /// Meshes that no instance places come first, then the meshes of every instance, at its place. Spheres and
    /// curves are left out. Computed on every use from what the scene keeps beside its tree: 12 bytes for each vertex and 12 for each triangle, which
    /// ``sys.getsizeof`` counts.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.vertices
    /// array([[0., 0., 1.],
    ///        [1., 0., 1.],
    ///        [0., 1., 1.]])
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let data = self.data();
        let parts = &data.parts;
        let mut count = 0;
        parts.placed(|positions, _, _| count += positions.len());
        let mut vertices = memory::room(count, "vertices")?;
        py.detach(|| {
            parts.placed(|positions, _, place| {
                vertices.extend(
                    positions
                        .iter()
                        .map(|&point| parts.world_point(point, place)),
                );
            });
        });
        shaped(py, vertices.into_flattened(), &[count, 3])
    }

    /// Triangles of all meshes: int64 of shape (m, 3), rows of ``vertices``. Those that can never be hit are among them.
    ///
    /// Meshes that no instance places come first, then the meshes of every instance, at its place. Spheres and
    /// curves are left out. Computed on every use from what the scene keeps beside its tree: 12 bytes for each vertex and 12 for each triangle, which
    /// ``sys.getsizeof`` counts.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.faces
    /// array([[0, 1, 2]])
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let data = self.data();
        let parts = &data.parts;
        let mut count = 0;
        parts.placed(|_, indices, _| count += indices.len());
        let mut faces = memory::room(count, "faces")?;
        py.detach(|| {
            let mut first = 0;
            parts.placed(|positions, indices, _| {
                let face = |face: &[u32; 3]| face.map(|corner| first + i64::from(corner));
                faces.extend(indices.iter().map(face));
                first += positions.len() as i64;
            });
        });
        shaped(py, faces.into_flattened(), &[count, 3])
    }

    /// Normals of ``vertices``: float32 of shape (n, 3), means of the triangles around a vertex, weighted by area, of length 1.
    ///
    /// Triangles have their corners counterclockwise seen from where their normals point. A vertex without triangles has the normal 0.
    ///
    /// Meshes that no instance places come first, then the meshes of every instance, at its place. Spheres and
    /// curves are left out. Computed on every use from what the scene keeps beside its tree: 12 bytes for each vertex and 12 for each triangle, which
    /// ``sys.getsizeof`` counts.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.normals[0]
    /// array([0., 0., 1.], dtype=float32)
    /// >>> open_sky = scene.ambient_occlusion(scene.vertices, scene.normals, 16)
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let data = self.data();
        let parts = &data.parts;
        let mut count = 0;
        parts.placed(|positions, _, _| count += positions.len());
        // Sums in double precision, and the vertices of a mesh as they are placed.
        memory::check(count, 2 * size_of::<[f64; 3]>(), "normals")?;
        let mut normals = memory::room(count, "normals")?;
        py.detach(|| {
            parts.placed(|positions, indices, place| match place {
                None => normals.extend(vertex_normals(positions, indices)),
                Some(rows) => {
                    let placed = positions.iter().map(|&point| {
                        let [x, y, z] = point;
                        rows.map(|[a, b, c, _]| a * x + b * y + c * z)
                    });
                    let placed: Vec<_> = placed.collect();
                    normals.extend(vertex_normals(&placed, indices));
                }
            });
        });
        shaped(py, normals.into_flattened(), &[count, 3])
    }

    fn __sizeof__(&self) -> usize {
        let data = self.data();
        size_of::<Self>() + data.bytes()
    }

    /// Gives masks to meshes and instances, for queries with a ``mask``. They replace the masks given before.
    ///
    /// A ray sees what has a bit in common with its mask: the mesh and, if it is placed by one, the instance. Rays without a mask see
    /// everything, and masks cost them nothing. So do queries about points, sky and sun. Masks go along with files, pickles and ``learn``.
    ///
    /// Parameters
    /// ----------
    /// masks : int, array (meshes,) of integers or None
    ///     32 bits for each mesh. None for all bits.
    /// instances : int, array (k,) of integers or None
    ///     32 bits for each instance. None for all bits.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     There are not as many masks, or a mask is no integer from 0 to 4294967295.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> low, high = ([[0, 0, z], [1, 0, z], [0, 1, z]] for z in (1, 2))
    /// >>> scene = am.Scene([(low, [[0, 1, 2]]), (high, [[0, 1, 2]])])
    /// >>> scene.set_masks([0b01, 0b10])
    /// >>> scene.intersect([0.2, 0.2, 0], [0, 0, 1], mask=[0b01, 0b10, 0b11]).mesh
    /// array([0, 1, 0], dtype=int32)
    #[pyo3(signature = (masks, instances=None))]
    fn set_masks(
        &self,
        py: Python<'_>,
        masks: Option<&Bound<'_, PyAny>>,
        instances: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let data = self.data();
        let (meshes, placed) = (data.parts.parts.len(), data.parts.instances.len());
        let masks = read_masks(masks, "masks", meshes)?;
        let instances = read_masks(instances, "instances", placed)?;
        drop(data);
        py.detach(|| self.change(|data| data.set_masks(masks, instances)));
        Ok(())
    }

    /// First triangle of each ray, -1 for none: int64, in the shape of the rays.
    #[pyo3(signature = (origins, directions, *, threads=None))]
    #[pyo3(name = "_first_triangles")]
    fn first_triangles<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        threads: Option<ThreadCount>,
    ) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let data = self.data();
        let arguments =
            RayArguments::read(origins, Some(directions), None, None, Conditions::default())?;
        let mut call = Call::new(threads, None)?;
        let rays = arguments.rays(&data)?;
        let triangles = queries::first_triangles(py, &data, &rays, &mut call)?;
        shaped(py, triangles, &arguments.shape)
    }

    /// Triangle, ray and place of hits in double precision, no two of one ray at the same place: see ``antumbra.trimesh``.
    #[pyo3(signature = (origins, directions, vertices, *, max_hits, offset, threads=None))]
    #[pyo3(name = "_distinct_hits")]
    fn distinct_hits<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        vertices: &Bound<'py, PyAny>,
        max_hits: usize,
        offset: f64,
        threads: Option<ThreadCount>,
    ) -> PyResult<distinct::Told<'py>> {
        let data = self.data();
        let arguments =
            RayArguments::read(origins, Some(directions), None, None, Conditions::default())?;
        let vertices = Numbers::read(vertices, "vertices", 3)?;
        let choices = distinct::choices(&data, &vertices, max_hits, offset)?;
        let mut call = Call::new(threads, None)?;
        let rays = arguments.rays(&data)?;
        distinct::hits(py, &data, &rays, &choices, &mut call)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let data = slf.get().data();
        let report = data.bvh().report();
        let instances = match report.instances {
            0 => String::new(),
            count => format!(", {count} instances"),
        };
        let (meshes, primitives) = (data.parts.parts.len(), report.primitives);
        let kind = match data.has_others {
            true => "primitives",
            false => "triangles",
        };
        let name = slf.get_type().name()?;
        Ok(format!(
            "<antumbra.{name}: {meshes} meshes, {primitives} {kind}{instances}>"
        ))
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        let data = slf.get().data();
        let report = data.bvh().report();
        let bounds = data.bvh().bounds();
        let corner = |corner| {
            let [x, y, z] = data.local().world(corner);
            format!("({x:.6}, {y:.6}, {z:.6})")
        };
        let mut rows = vec![
            ("meshes", data.parts.parts.len().to_string()),
            ("triangles", report.primitives.to_string()),
            ("instances", report.instances.to_string()),
            ("left out", report.dropped.to_string()),
            ("nodes", report.nodes.to_string()),
            ("MB", format!("{:.1}", data.bytes() as f64 / 1e6)),
        ];
        if bounds.min[0] <= bounds.max[0] {
            let (low, high) = (corner(bounds.min), corner(bounds.max));
            rows.push(("bounds", format!("{low} to {high}")));
        }
        let name = slf.get_type().name()?;
        Ok(html::table(&format!("antumbra.{name}"), &rows))
    }
}

/// Masks of an argument: one for all of `count` things, or one for each. All bits without an argument.
pub fn read_masks(
    object: Option<&Bound<'_, PyAny>>,
    name: &'static str,
    count: usize,
) -> PyResult<Vec<u32>> {
    let Some(object) = object else {
        return Ok(Vec::new());
    };
    let numbers = Numbers::whole(object, name)?;
    if !numbers.shape().is_empty() && numbers.shape() != [count] {
        let wanted = format!("() or ({count},)");
        return Err(wrong_shape(name, numbers.shape(), &wanted));
    }
    bake::each(&numbers, count)?.into_iter().map(mask).collect()
}

/// Answers of a call, in the array of the caller if there is one.
fn answered<'py>(
    py: Python<'py>,
    out: Option<&Bound<'py, PyAny>>,
    shape: &[usize],
    answer: impl FnOnce(&mut [bool]) -> PyResult<()>,
) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
    let Some(out) = out else {
        let mut answers = memory::filled(false, shape.iter().product(), "answers")?;
        answer(&mut answers)?;
        return shaped(py, answers, shape);
    };
    {
        let mut array = output::<bool>(out, shape, "bool")?;
        answer(array.as_slice_mut()?)?;
    }
    Ok(out.cast::<PyArrayDyn<bool>>()?.clone())
}
