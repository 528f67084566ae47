//! The class `Scene`.

use std::path::PathBuf;
use std::sync::Arc;

use antumbra::Batch;
use antumbra_bake::{AmbientOcclusion, Place, SightLines, Sunlight};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};

use crate::arrays::{Numbers, shaped};
use crate::bake::{self, Places};
use crate::bits::BitMatrix;
use crate::hits::{HitList, Hits, Source};
use crate::points::{self, Closest};
use crate::rays::{Call, RayArguments, RaySource, Segments};
use crate::saved::Reduced;
use crate::scene::{self, Quality, SceneData};
use crate::threads::ThreadCount;
use crate::{broadcast, distinct, file, memory, meshes, queries, saved};

/// Triangles, ready for questions about rays and points.
///
/// ``Scene(vertices, faces)`` has one mesh. ``Scene(meshes)`` has several: pairs ``(vertices, faces)``, or objects with
/// these two attributes, as trimesh has them. ``Scene(meshes, instances=...)`` places some of them any number of times.
///
/// Parameters
/// ----------
/// vertices : array (n, 3) of float32, float64 or integers
///     Corners of triangles.
/// faces : array (m, 3) of integers
///     Three vertices per triangle.
/// instances : sequence of Instance or of (mesh, transform), optional
///     Placements. A mesh that any instance names stands in the world by its instances alone.
/// origin : "auto" or (3,), optional
///     Point that the tree has as its zero. Vertices and rays are brought there in double precision, and are then rounded
///     to float32. "auto" is the middle of the vertices where they lie far from zero for their extent, as maps do, and zero
///     elsewhere.
/// quality : "default" or "fast"
///     "fast" builds sooner, and makes a slower tree.
/// threads : int, optional
///     Number of threads of the build. The scene is the same for any number.
/// progress : optional
///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
///
/// Raises
/// ------
/// IndexError
///     A face names a vertex that is not there, or an instance a mesh.
/// ValueError, TypeError
///     An argument has another shape or type.
///
/// Triangles that can never be hit are left out, with a ``DegenerateWarning``. A scene may be empty.
#[pyclass(frozen, module = "antumbra")]
pub struct Scene {
    data: Arc<SceneData>,
}

impl From<Arc<SceneData>> for Scene {
    fn from(data: Arc<SceneData>) -> Self {
        Self { data }
    }
}

impl Scene {
    pub fn data(&self) -> &Arc<SceneData> {
        &self.data
    }

    /// What tells where hits lie.
    fn source(&self, rays: &impl RaySource) -> PyResult<Source> {
        let all = (0..rays.len()).map(|place| rays.get(place));
        Source::new(&self.data, all, rays.len())
    }
}

#[pymethods]
#[allow(clippy::too_many_arguments)]
impl Scene {
    #[new]
    #[pyo3(signature = (vertices, faces=None, *, instances=None, origin=None, quality="default", threads=None, progress=None))]
    fn new<'py>(
        py: Python<'py>,
        vertices: &Bound<'py, PyAny>,
        faces: Option<&Bound<'py, PyAny>>,
        instances: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        quality: &str,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let quality = Quality::read(quality)?;
        let mut call = Call::new(threads, progress)?;
        let parts = meshes::read(vertices, faces, instances, origin)?;
        Ok(scene::build(py, parts, &[], quality, &mut call)?.into())
    }

    /// Reads a scene: .ply, .obj, .gltf, .glb or .pbrt, or ``builtin:NAME[:TRIANGLES]``, such as ``builtin:city:20000``.
    ///
    /// Meshes of the world come first, then those of objects that instances place. Alpha masks and spheres of .pbrt files
    /// count. Mistakes in a file are a ValueError that lists all of them. Materials and images that are missing in a mesh file
    /// are a UserWarning each, with their place.
    #[classmethod]
    #[pyo3(signature = (path, *, quality="default", threads=None, progress=None))]
    fn from_file<'py>(
        _class: &Bound<'py, PyType>,
        py: Python<'py>,
        path: PathBuf,
        quality: &str,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let quality = Quality::read(quality)?;
        let mut call = Call::new(threads, progress)?;
        let parts = file::read(py, &path)?;
        Ok(scene::build(py, parts, &[], quality, &mut call)?.into())
    }

    /// A scene of the same triangles, whose tree is learned from these rays: a few thousand like those to come.
    ///
    /// Arguments are those of ``occluded``. Answers are the same bits. Learning pays where rays differ much from rays between
    /// the surfaces, from which every scene learns.
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, threads=None, progress=None))]
    fn learn<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let arguments = RayArguments::read(origins, directions, distance, near)?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(self.data.local());
        let closed = |place| rays.get(place).closed();
        let rays = memory::collected((0..rays.len()).map(closed), rays.len(), "rays")?;
        let (parts, quality) = (self.data.parts.clone(), self.data.quality);
        Ok(scene::build(py, parts, &rays, quality, &mut call)?.into())
    }

    /// Whether anything is in the way of each ray: bool, in the shape of the rays.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : arrays (..., 3)
    ///     Leading shapes are broadcast: one origin or one direction may stand for all. Directions have any length but 0. Without
    ///     directions, origins are (..., 6): origin and direction in a row.
    /// distance, near : numbers or arrays (...), optional
    ///     Ends of the rays in lengths of their directions: inf and 0. Both ends count.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     As for ``Scene``.
    ///
    /// Rays with NaN, and rays without a direction, hit nothing.
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, threads=None, progress=None))]
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        let arguments = RayArguments::read(origins, directions, distance, near)?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(self.data.local());
        let mut answers = memory::filled(false, rays.len(), "answers")?;
        let query = |batch: Batch<'_>, answers: &mut [bool]| batch.closed().occluded_into(answers);
        call.ask(py, &self.data.bvh, &rays, &mut answers, query)?;
        shaped(py, answers, &arguments.shape)
    }

    /// Whether nothing is between points: bool, in the common shape of both.
    ///
    /// Points may be on surfaces. Both sides of such a surface count as outside: points on one closed body see each other
    /// through its inside. ``visible(a[:, None], b)`` has every pair, and ``visibility`` has them in one bit each. A point sees
    /// itself here.
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
    #[pyo3(signature = (a, b, *, margin=None, threads=None, progress=None))]
    fn visible<'py>(
        &self,
        py: Python<'py>,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
        margin: Option<f32>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        let (a, b) = (Numbers::read(a, "a", 3)?, Numbers::read(b, "b", 3)?);
        let shape = broadcast::common_shape(&[(&a, 3), (&b, 3)])?;
        let mut call = Call::new(threads, progress)?;
        let lines = SightLines::new(&self.data.bvh, margin).map_err(bake::failed)?;
        let segments = Segments::new(&a, &b, &shape, lines, self.data.local());
        let mut answers = memory::filled(false, segments.len(), "answers")?;
        let query = |batch: Batch<'_>, answers: &mut [bool]| batch.occluded_into(answers);
        call.ask(py, &self.data.bvh, &segments, &mut answers, query)?;
        py.detach(|| {
            for (place, answer) in answers.iter_mut().enumerate() {
                *answer = !*answer && segments.is_finite(place);
            }
        });
        shaped(py, answers, &shape)
    }

    /// First hit of each ray.
    ///
    /// Arguments are those of ``occluded``. Of several triangles at one distance, the one of the smallest numbers is hit.
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, threads=None, progress=None))]
    fn intersect<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Hits> {
        let arguments = RayArguments::read(origins, directions, distance, near)?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(self.data.local());
        let columns = queries::first_hits(py, &self.data, &rays, &mut call)?;
        Hits::new(py, columns, &arguments.shape, self.source(&rays)?)
    }

    /// All hits of each ray, the nearest first.
    ///
    /// Arguments are those of ``occluded``. A surface that a ray meets twice at one place, on an edge, is told of twice.
    ///
    /// Parameters
    /// ----------
    /// max_hits : int, optional
    ///     Number of hits of a ray that are kept.
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, max_hits=None, threads=None, progress=None))]
    fn intersect_all<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        max_hits: Option<usize>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, HitList>> {
        let arguments = RayArguments::read(origins, directions, distance, near)?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(self.data.local());
        let most = max_hits.unwrap_or(usize::MAX);
        let lists = queries::all_hits(py, &self.data, &rays, most, &mut call)?;
        let of_hits = lists.rays().map(|ray| rays.get(ray));
        let source = Source::new(&self.data, of_hits, lists.columns.t.len())?;
        HitList::new(py, lists.splits, lists.columns, source)
    }

    /// Number of hits of each ray: int32, in the shape of the rays.
    ///
    /// Arguments are those of ``occluded``.
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, threads=None, progress=None))]
    fn count<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<i32>>> {
        let arguments = RayArguments::read(origins, directions, distance, near)?;
        let mut call = Call::new(threads, progress)?;
        let rays = arguments.rays(self.data.local());
        let mut counts = memory::filled(0, rays.len(), "counts")?;
        let query = |batch: Batch<'_>, counts: &mut [u32]| {
            counts.copy_from_slice(&batch.closed().count_hits());
        };
        call.ask(py, &self.data.bvh, &rays, &mut counts, query)?;
        let counts = counts.into_iter().map(|count| count as i32).collect();
        shaped(py, counts, &arguments.shape)
    }

    /// Whether points lie inside closed meshes: bool, in the shape of the points.
    ///
    /// Which way triangles run does not matter. For meshes with holes the answer means little. A point that is not finite
    /// lies outside.
    #[pyo3(signature = (points, *, threads=None, progress=None))]
    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        let points = Numbers::read(points, "points", 3)?;
        let mut call = Call::new(threads, progress)?;
        let inside = points::contains(py, &self.data, &points, &mut call)?;
        shaped(py, inside, points.lead(3))
    }

    /// Nearest point of the surfaces to each point, if it lies at most ``max_distance`` away.
    #[pyo3(signature = (points, max_distance=f32::INFINITY, *, threads=None, progress=None))]
    fn closest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        max_distance: f32,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, Closest>> {
        let points = Numbers::read(points, "points", 3)?;
        let mut call = Call::new(threads, progress)?;
        points::closest(py, &self.data, &points, max_distance, &mut call)
    }

    /// Visibility between points: a BitMatrix of shape (n, m), one bit for each point of ``a`` and of ``b``.
    ///
    /// Points see each other if nothing is strictly between them, as for ``visible``. They are rounded as vertices are. A point
    /// that is not finite sees nothing. A matrix of 100 000 by 100 000 points takes 1.25 GB; parts of ``a`` may be asked for one after the other.
    ///
    /// Parameters
    /// ----------
    /// a : array (n, 3)
    /// b : array (m, 3), optional
    ///     Without them, ``a`` is compared with itself. The matrix is symmetric then, and its diagonal is false: no point counts
    ///     as seeing itself.
    /// margin : float, optional
    ///     Length that is left out at both ends of a segment, as for ``visible``.
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
        let mut call = Call::new(threads, progress)?;
        bake::visibility(py, &self.data, a, b, margin, &mut call)
    }

    /// Which directions points see: a BitMatrix of shape (n, k), points in C order.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    /// normals : array (..., 3) or None
    ///     Normals of surfaces, of any length: a direction below the surface is not seen, and rays begin a little above it.
    ///     With None, points may be in free space or on surfaces, of which both sides count as outside. Rays then begin a
    ///     little along their direction. Give normals for points on open sheets, such as terrain.
    /// directions : array (k, 3)
    ///     Directions of any length, such as those to the sun.
    /// distance : float
    ///     Length up to which surfaces are in the way, in units of the scene.
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
        let places = Places::read(&self.data, points, normals)?;
        let mut call = Call::new(threads, progress)?;
        bake::sees(py, &self.data, &places, directions, distance, &mut call)
    }

    /// Open part of the sky above points of surfaces: float32 from 0 (closed in) to 1, in the shape of the points.
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
    ///     Whether to return also the mean open directions: float32 of shape (..., 3).
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
        let places = Places::read(&self.data, points, Some(normals))?;
        let options = AmbientOcclusion {
            samples,
            distance,
            two_sided,
            weighting: bake::weighting(weighting)?,
            seed,
        };
        let mut call = Call::new(threads, progress)?;
        let (open, bent) =
            bake::ambient_occlusion(py, &self.data, &places, &options, bent, &mut call)?;
        match bent {
            None => Ok(open.into_any()),
            Some(bent) => Ok((open, bent).into_pyobject(py)?.into_any()),
        }
    }

    /// Part of the sky that points see, by its patches: float32 from 0 to 1, in the shape of the points.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    /// normals : array (..., 3), optional
    ///     Normals of surfaces, as for ``sees``. Without them, the sky is weighted for a level surface.
    /// patches, uniform, up, north
    ///     The sky, as for ``sky_patches``.
    /// weighting : "cosine" or "uniform"
    ///     "cosine" is the light that a surface receives from an even sky, relative to a level and free one. "uniform" is the
    ///     solid angle.
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
        let places = Places::read(&self.data, points, normals)?;
        let (sky, orientation) = (bake::sky(patches, uniform)?, bake::orientation(up, north)?);
        let weighting = bake::weighting(weighting)?;
        let mut call = Call::new(threads, progress)?;
        let sky = (&sky, &orientation);
        bake::sky_view(py, &self.data, &places, sky, weighting, &mut call)
    }

    /// Hours of direct sun of points: float64, in the shape of the points.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    /// normals : array (..., 3) or None
    ///     As for ``sees``.
    /// sun_directions : array (k, 3)
    ///     Directions to the sun above the horizon, one for each step of time: see ``sun_positions``.
    /// weights : float or array (k,)
    ///     Length of each step in hours, or whatever else is to be added up.
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
        let places = Places::read(&self.data, points, normals)?;
        let mut call = Call::new(threads, progress)?;
        let one = 1.0f64.into_pyobject(py)?.into_any();
        let weights = weights.unwrap_or(&one);
        bake::sun_hours(py, &self.data, &places, sun_directions, weights, &mut call)
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
        let places = Places::read(&self.data, points, normals)?;
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
        bake::irradiation(py, &self.data, &places, &sunlight, &mut call)
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
        let orientation = bake::orientation(up, 0.0)?;
        bake::sensor_grid(py, &self.data, spacing, &orientation)
    }

    /// Writes the scene to a file, tree and all. ``Scene.load`` reads it on any machine.
    ///
    /// A file that exists is replaced when the new one is complete. Scenes with alpha masks cannot be saved: a ValueError.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| saved::save(&self.data, &path))
    }

    /// Reads a scene that ``save`` wrote. A file that is damaged is a ValueError.
    #[classmethod]
    fn load(_class: &Bound<'_, PyType>, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(py.detach(|| saved::load(&path))?.into())
    }

    /// Scene of the bytes that pickle keeps.
    #[staticmethod]
    #[pyo3(name = "_from_bytes")]
    fn from_bytes(py: Python<'_>, bytes: numpy::PyReadonlyArray1<'_, u8>) -> PyResult<Self> {
        let bytes = bytes.as_slice()?;
        Ok(py.detach(|| saved::from_bytes(bytes))?.into())
    }

    /// The bytes lie in an array: protocol 5 of pickle need not copy them.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py, (Bound<'py, PyArray1<u8>>,)> {
        let py = slf.py();
        let data = &slf.get().data;
        let bytes = py.detach(|| saved::to_bytes(data))?;
        let restore = slf.get_type().getattr("_from_bytes")?;
        Ok((restore, (PyArray1::from_vec(py, bytes),)))
    }

    /// Numbers about the tree: triangles, instances, dropped, nodes, depth, bytes, width, training_rays.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let report = self.data.bvh.report();
        let numbers = PyDict::new(py);
        for (name, value) in [
            ("triangles", report.primitives),
            ("instances", report.instances),
            ("dropped", report.dropped),
            ("nodes", report.nodes),
            ("depth", report.depth),
            ("bytes", report.bytes),
            ("width", self.data.bvh.width().lanes()),
            ("training_rays", report.training_rays as usize),
        ] {
            numbers.set_item(name, value)?;
        }
        Ok(numbers)
    }

    /// Point that the tree has as its zero: (x, y, z).
    #[getter]
    fn origin(&self) -> (f64, f64, f64) {
        self.data.local().origin.into()
    }

    /// Smallest box around everything: float64 of shape (2, 3), NaN if there is nothing.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let bounds = self.data.bvh.bounds();
        let is_empty = bounds.min[0] > bounds.max[0];
        let local = self.data.local();
        let corners = [bounds.min, bounds.max].map(|corner| match is_empty {
            true => [f64::NAN; 3],
            false => local.world(corner),
        });
        shaped(py, corners.concat(), &[2, 3])
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
        let arguments = RayArguments::read(origins, Some(directions), None, None)?;
        let mut call = Call::new(threads, None)?;
        let rays = arguments.rays(self.data.local());
        let triangles = queries::first_triangles(py, &self.data, &rays, &mut call)?;
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
        let arguments = RayArguments::read(origins, Some(directions), None, None)?;
        let vertices = Numbers::read(vertices, "vertices", 3)?;
        let choices = distinct::choices(&self.data, &vertices, max_hits, offset)?;
        let mut call = Call::new(threads, None)?;
        let rays = arguments.rays(self.data.local());
        distinct::hits(py, &self.data, &rays, &choices, &mut call)
    }

    fn __repr__(&self) -> String {
        let report = self.data.bvh.report();
        let instances = match report.instances {
            0 => String::new(),
            count => format!(", {count} instances"),
        };
        let (meshes, triangles) = (self.data.parts.parts.len(), report.primitives);
        format!("<antumbra.Scene: {meshes} meshes, {triangles} triangles{instances}>")
    }
}
