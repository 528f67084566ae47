//! The class `Scene`: meshes that stay where they are.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyType;

use super::Queries;
use crate::arrays::masks;
use crate::call::Call;
use crate::call::threads::ThreadCount;
use crate::rays::arguments::RayArguments;
use crate::scene::{self, Quality, SceneData, Use, file, meshes, saved};

/// Meshes that stay where they are, ready for queries about rays and points.
///
/// ``Scene(vertices, faces)`` has one mesh. ``Scene(meshes)`` has several, or the mesh of an object of another package.
/// ``Scene(meshes, instances=...)`` places some of them any number of times.
///
/// Parameters
/// ----------
/// vertices : array (n, 3) of float32, float64 or integers, a mesh, or a list of meshes
///     Vertices, or without faces: a pair ``(vertices, faces)`` or an object with these attributes, such as ``trimesh.Trimesh``; a
///     ``TriangleMesh`` of Open3D, legacy or of tensors; ``pyvista.PolyData``; ``meshio.Mesh``; or a list of these. Polygons are
///     cut into triangles, quads from their first corner. ``Curves`` are hairs, grass or wires. A ``trimesh.Scene`` has one instance for each node of its graph, in the order of
///     ``scene.graph.nodes_geometry``.
/// faces : array (m, 3) of integers, optional
///     Three vertices per triangle.
/// instances : sequence of Instance or of (mesh, transform), optional
///     Placements. A mesh that any instance names is in the world by its instances only. An ``Assembly`` in the list of meshes has
///     instances that are placed together.
/// origin : "auto" or (3,), optional
///     Point that the tree has as its zero. Vertices and rays are brought there in double precision, and are then rounded
///     to float32. "auto" is the middle of the vertices where they are far from zero for their extent, as maps are, and zero
///     elsewhere.
/// masks : int or array (meshes,) of integers, optional
///     Masks of the meshes: see ``set_masks``.
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
/// Notes
/// -----
/// Triangles that can never be hit are left out, with a ``DegenerateWarning``. A scene may be empty. Arrays of any package are taken
/// by ``__array__`` or ``__dlpack__``.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
/// >>> scene
/// <antumbra.Scene: 1 meshes, 1 triangles>
/// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
/// >>> import numpy as np
/// >>> am.Scene([roof], instances=[(0, np.eye(4)), (0, np.diag([2, 2, 2, 1]))])
/// <antumbra.Scene: 1 meshes, 1 triangles, 2 instances>
#[pyclass(frozen, extends = Queries, module = "antumbra")]
pub struct Scene;

impl Scene {
    fn with(py: Python<'_>, data: Arc<SceneData>) -> PyResult<Bound<'_, Self>> {
        Bound::new(py, Queries::extended(data, Self))
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
        let mut call = Call::new(py, threads, progress)?;
        let mut parts = meshes::read(vertices, faces, instances, origin)?;
        parts.masks = self::masks(masks, "masks", parts.parts.len())?;
        let data = scene::build(&mut call, parts, quality, Use::Fixed(&[]))?;
        Ok(Queries::extended(data, Self))
    }

    /// Reads a scene from a file.
    ///
    /// Meshes of the world come first, then meshes of objects that instances place. Alpha masks and spheres of .pbrt files count. Materials
    /// and images that are missing in a mesh file are a UserWarning each, with their place.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     .ply, .stl, .obj, .gltf, .glb or .pbrt, or ``builtin:NAME[:TRIANGLES]``, such as ``builtin:city:20000``.
    /// quality : "default" or "fast"
    ///     As for ``Scene``.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// Scene
    ///
    /// Raises
    /// ------
    /// FileNotFoundError
    ///     There is no such file.
    /// ValueError
    ///     There are mistakes in it: all of them are listed.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> am.Scene.from_file("builtin:city:2000").report["triangles"] >= 2000
    /// True
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
        let mut call = Call::new(py, threads, progress)?;
        let parts = file::read(py, &path)?;
        let data = scene::build(&mut call, parts, quality, Use::Fixed(&[]))?;
        Self::with(py, data)
    }

    /// A scene of a grid of heights, such as a digital elevation model.
    ///
    /// Each cell between four heights is two triangles, cut from its north-western to its south-eastern corner (the least x with the greatest
    /// y, and the reverse) in whatever order the heights are stored, so that ``from_file`` of the same raster has the same triangles. Turned
    /// grids are cut from ``heights[i, j]`` to ``heights[i + 1, j + 1]``. Normals point up. A cell with one corner that is NaN or infinite is
    /// one triangle, and one with more is a hole. The vertex of ``heights[i, j]`` has the number ``i * columns + j`` in ``faces``.
    ///
    /// Parameters
    /// ----------
    /// heights : array (rows, columns) of real numbers, or xarray.DataArray
    ///     z of the vertices. What is masked in a masked array is a hole. A DataArray has the dimensions y and x with coordinates,
    ///     which need not be evenly spaced; others have the length 1.
    /// transform : (dx, dy), (a, b, c, d, e, f) or rasterio's Affine, optional
    ///     Where the heights are. (dx, dy): ``x = dx * column``, ``y = dy * row``; (1, 1) without it. Six numbers in the order of
    ///     rasterio's ``transform``: ``x = a * (column + 0.5) + b * (row + 0.5) + c``, ``y = d * (column + 0.5) + e * (row + 0.5) + f``, so that heights are
    ///     in the middle of the pixels. GDAL's ``GetGeoTransform()`` has the order (c, a, b, f, d, e).
    /// origin : "auto" or (3,), optional
    ///     As for ``Scene``.
    /// quality : "default" or "fast"
    ///     As for ``Scene``.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// Scene
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     The heights have another shape or type, there are fewer than 2 rows or columns, or the transform is none.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene.from_heights([[0, 0, 0], [0, 2, 0], [0, 0, 0]], (10, -10))
    /// >>> hits = scene.intersect([[10, -10, 9], [5, -5, 9]], [0, 0, -1])
    /// >>> hits.point[:, 2]
    /// array([2., 1.])
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
        let mut call = Call::new(py, threads, progress)?;
        let grid = py.import("antumbra._meshes")?.getattr("grid")?;
        let (vertices, faces): (Bound<'py, PyAny>, Bound<'py, PyAny>) =
            grid.call1((heights, transform))?.extract()?;
        let parts = meshes::read(&vertices, Some(&faces), None, origin)?;
        let data = scene::build(&mut call, parts, quality, Use::Fixed(&[]))?;
        Self::with(py, data)
    }

    /// A scene of the same triangles, whose tree is learned from these rays: a few thousand like those to come.
    ///
    /// Answers are the same bits. Learning pays where rays differ much from rays between the surfaces, from which every scene learns. The
    /// lock of the interpreter is released: another thread may go on with this scene, and change to the new one when it is there.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : arrays (..., 3)
    ///     Rays. Leading shapes are broadcast: one origin or one direction may stand for all. Directions have any length but 0.
    ///     Without directions, origins are (..., 6): origin and direction in a row.
    /// distance, near : numbers or arrays (...), optional
    ///     Ends of the rays in lengths of their directions: inf and 0. Both ends count.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    /// progress : optional
    ///     Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.
    ///
    /// Returns
    /// -------
    /// Scene
    ///     Meshes, instances and masks stay the same.
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
    /// >>> learned = scene.learn([[0.2, 0.2, 0], [0.4, 0.1, 0]], [0, 0, 1])
    /// >>> learned.report["training_rays"] > 0
    /// True
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
        let arguments = RayArguments::read((origins, directions), (near, distance), (None, None))?;
        let mut call = Call::new(py, threads, progress)?;
        let data = slf.as_super().get().data();
        let rays = arguments.closed(&data)?;
        let (parts, quality) = ((*data.parts).clone(), data.quality);
        Self::with(
            py,
            scene::build(&mut call, parts, quality, Use::Fixed(&rays))?,
        )
    }

    /// Reads a scene that ``save`` wrote.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     File to be read.
    ///
    /// Returns
    /// -------
    /// Scene
    ///
    /// Raises
    /// ------
    /// FileNotFoundError
    ///     There is no such file.
    /// ValueError
    ///     The file is damaged, or has no scene.
    ///
    /// Examples
    /// --------
    /// >>> import os, tempfile
    /// >>> import antumbra as am
    /// >>> path = os.path.join(tempfile.mkdtemp(), "scene")
    /// >>> am.Scene([]).save(path)
    /// >>> am.Scene.load(path)
    /// <antumbra.Scene: 0 meshes, 0 triangles>
    #[classmethod]
    fn load<'py>(
        _class: &Bound<'py, PyType>,
        py: Python<'py>,
        path: PathBuf,
    ) -> PyResult<Bound<'py, Self>> {
        Self::with(py, saved::load(py, &path, false)?)
    }

    /// Scene of the bytes that pickle keeps.
    #[staticmethod]
    #[pyo3(name = "_from_bytes")]
    fn from_bytes<'py>(
        py: Python<'py>,
        bytes: PyReadonlyArray1<'_, u8>,
    ) -> PyResult<Bound<'py, Self>> {
        Self::with(py, saved::from_array(py, &bytes)?)
    }
}
