//! The class `Scene`: meshes that stay where they are.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyType;

use crate::methods::{Queries, read_masks};
use crate::rays::{Call, Conditions, RayArguments, RaySource};
use crate::saved::Reduced;
use crate::scene::{self, Quality, SceneData};
use crate::threads::ThreadCount;
use crate::{file, memory, meshes, saved};

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
#[pyclass(frozen, extends = Queries, module = "antumbra")]
pub struct Scene;

impl Scene {
    fn with(py: Python<'_>, data: Arc<SceneData>) -> PyResult<Bound<'_, Self>> {
        Bound::new(
            py,
            PyClassInitializer::from(Queries::from(data)).add_subclass(Self),
        )
    }
}

#[pymethods]
#[allow(clippy::too_many_arguments)]
impl Scene {
    #[new]
    #[pyo3(signature = (vertices, faces=None, *, instances=None, origin=None, masks=None, quality="default", threads=None, progress=None))]
    fn new<'py>(
        py: Python<'py>,
        vertices: &Bound<'py, PyAny>,
        faces: Option<&Bound<'py, PyAny>>,
        instances: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        masks: Option<&Bound<'py, PyAny>>,
        quality: &str,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let quality = Quality::read(quality)?;
        let mut call = Call::new(threads, progress)?;
        let mut parts = meshes::read(vertices, faces, instances, origin)?;
        parts.masks = read_masks(masks, "masks", parts.parts.len())?;
        let data = scene::build(py, parts, &[], quality, &mut call)?;
        Ok(PyClassInitializer::from(Queries::from(data)).add_subclass(Self))
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
    ) -> PyResult<Bound<'py, Self>> {
        let quality = Quality::read(quality)?;
        let mut call = Call::new(threads, progress)?;
        let parts = file::read(py, &path)?;
        Self::with(py, scene::build(py, parts, &[], quality, &mut call)?)
    }

    /// A scene of a grid of heights.
    #[classmethod]
    #[pyo3(signature = (heights, transform=None, *, origin=None, quality="default", threads=None, progress=None))]
    fn from_heights<'py>(
        _class: &Bound<'py, PyType>,
        py: Python<'py>,
        heights: &Bound<'py, PyAny>,
        transform: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        quality: &str,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, Self>> {
        let quality = Quality::read(quality)?;
        let mut call = Call::new(threads, progress)?;
        let grid = py.import("antumbra._meshes")?.getattr("grid")?;
        let (vertices, faces): (Bound<'py, PyAny>, Bound<'py, PyAny>) =
            grid.call1((heights, transform))?.extract()?;
        let parts = meshes::read(&vertices, Some(&faces), None, origin)?;
        Self::with(py, scene::build(py, parts, &[], quality, &mut call)?)
    }

    /// A scene of the same triangles, whose tree is learned from these rays: a few thousand like those to come.
    ///
    /// Arguments are those of ``occluded``. Answers are the same bits. Learning pays where rays differ much from rays between
    /// the surfaces, from which every scene learns.
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, threads=None, progress=None))]
    fn learn<'py>(
        slf: &Bound<'py, Self>,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        distance: Option<&Bound<'py, PyAny>>,
        near: Option<&Bound<'py, PyAny>>,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, Self>> {
        let conditions = Conditions::default();
        let arguments = RayArguments::read(origins, directions, distance, near, conditions)?;
        let mut call = Call::new(threads, progress)?;
        let data = slf.as_super().get().data();
        let rays = arguments.rays(&data)?;
        let closed = |place| rays.get(place).closed();
        let rays = memory::collected((0..rays.len()).map(closed), rays.len(), "rays")?;
        let parts = (*data.parts).clone();
        Self::with(py, scene::build(py, parts, &rays, data.quality, &mut call)?)
    }

    /// Reads a scene that ``save`` wrote. A file that is damaged is a ValueError.
    #[classmethod]
    fn load<'py>(
        _class: &Bound<'py, PyType>,
        py: Python<'py>,
        path: PathBuf,
    ) -> PyResult<Bound<'py, Self>> {
        let data = py.detach(|| saved::load(&path))?;
        saved::expect_world(&data, false)?;
        Self::with(py, data)
    }

    /// Scene of the bytes that pickle keeps.
    #[staticmethod]
    #[pyo3(name = "_from_bytes")]
    fn from_bytes<'py>(
        py: Python<'py>,
        bytes: numpy::PyReadonlyArray1<'_, u8>,
    ) -> PyResult<Bound<'py, Self>> {
        let bytes = bytes.as_slice()?;
        Self::with(py, py.detach(|| saved::from_bytes(bytes))?)
    }

    /// The bytes lie in an array: protocol 5 of pickle need not copy them.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py, (Bound<'py, PyArray1<u8>>,)> {
        let py = slf.py();
        let data = slf.as_super().get().data();
        let bytes = py.detach(|| saved::to_bytes(&data))?;
        let restore = slf.get_type().getattr("_from_bytes")?;
        Ok((restore, (PyArray1::from_vec(py, bytes),)))
    }
}
