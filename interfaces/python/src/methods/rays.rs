//! Queries about rays: what is in the way, and what is hit.

use std::sync::Arc;

use antumbra::Batch;
use antumbra_bake::SightLines;
use numpy::PyArrayDyn;
use pyo3::prelude::*;

use super::Queries;
use crate::arrays::{Numbers, broadcast, memory, output, shaped};
use crate::call::Call;
use crate::call::threads::ThreadCount;
use crate::errors::failed;
use crate::rays::arguments::RayArguments;
use crate::rays::distinct;
use crate::rays::hits::{HitList, Hits, Source};
use crate::rays::piece::{self, RaySource, Segments};
use crate::rays::queries::{self, Choice};
use crate::scene::SceneData;

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
        let arguments =
            RayArguments::read((origins, directions), (near, distance), (mask, exclude))?;
        let mut call = Call::new(py, threads, progress)?;
        let rays = arguments.rays(&data)?;
        let group = rays.group(&data)?;
        let query = |batch: Batch<'_>, answers: &mut [bool]| batch.closed().occluded_into(answers);
        answered(py, out, &arguments.shape, |answers| match group {
            Some(group) => group.occluded(&mut call, &data, answers),
            None => piece::trace(&mut call, (data.bvh(), &rays), answers, query),
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
    ///     ``origin``, of the point at that end and of the triangles that it lies on: the origin offset. A point on a surface is rounded, and its
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
        let mut call = Call::new(py, threads, progress)?;
        let lines = SightLines::new(data.bvh(), margin).map_err(failed)?;
        let segments = Segments::new(&a, &b, &shape, lines, data.local());
        let query = |batch: Batch<'_>, answers: &mut [bool]| batch.occluded_into(answers);
        answered(py, out, &shape, |answers| {
            piece::trace(&mut call, (data.bvh(), &segments), answers, query)?;
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
        let arguments =
            RayArguments::read((origins, directions), (near, distance), (mask, exclude))?;
        let mut call = Call::new(py, threads, progress)?;
        let rays = arguments.rays(&data)?;
        let [triangle, mesh, instance] = queries::occluders(&mut call, &data, &rays)?;
        let array = |ids| shaped(py, ids, &arguments.shape);
        let ids = (array(triangle)?, array(mesh)?, array(instance)?);
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
        let arguments =
            RayArguments::read((origins, directions), (near, distance), (mask, exclude))?;
        let mut call = Call::new(py, threads, progress)?;
        let rays = arguments.rays(&data)?;
        let columns = queries::first_hits(&mut call, &data, &rays)?;
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
        let arguments =
            RayArguments::read((origins, directions), (near, distance), (mask, exclude))?;
        let mut call = Call::new(py, threads, progress)?;
        let rays = arguments.rays(&data)?;
        let choice = Choice {
            most: max_hits.unwrap_or(usize::MAX),
            distinct,
        };
        let lists = queries::all_hits(&mut call, &data, &rays, choice)?;
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
        let arguments =
            RayArguments::read((origins, directions), (near, distance), (mask, exclude))?;
        let mut call = Call::new(py, threads, progress)?;
        let rays = arguments.rays(&data)?;
        if distinct {
            let choice = Choice {
                most: usize::MAX,
                distinct,
            };
            let lists = queries::all_hits(&mut call, &data, &rays, choice)?;
            let counts = lists.splits.windows(2);
            let counts = counts.map(|ends| (ends[1] - ends[0]) as i32);
            let counts = memory::collected(counts, rays.len(), "counts")?;
            return shaped(py, counts, &arguments.shape);
        }
        let mut counts = memory::filled(0, rays.len(), "counts")?;
        let query = |batch: Batch<'_>, counts: &mut [u32]| {
            counts.copy_from_slice(&batch.closed().count_hits());
        };
        piece::trace(&mut call, (data.bvh(), &rays), &mut counts, query)?;
        let counts = counts.into_iter().map(|count| count as i32).collect();
        shaped(py, counts, &arguments.shape)
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
            RayArguments::read((origins, Some(directions)), (None, None), (None, None))?;
        let mut call = Call::new(py, threads, None)?;
        let rays = arguments.rays(&data)?;
        let triangles = queries::first_triangles(&mut call, &data, &rays)?;
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
            RayArguments::read((origins, Some(directions)), (None, None), (None, None))?;
        let vertices = Numbers::read(vertices, "vertices", 3)?;
        let choices = distinct::choices(&data, &vertices, max_hits, offset)?;
        let mut call = Call::new(py, threads, None)?;
        let rays = arguments.rays(&data)?;
        distinct::hits(&mut call, &data, &rays, &choices)
    }
}

/// Data from which places of hits are computed.
fn source(data: &Arc<SceneData>, rays: &impl RaySource) -> PyResult<Source> {
    let all = (0..rays.len()).map(|place| rays.get(place));
    Source::new(data, all, rays.len())
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
