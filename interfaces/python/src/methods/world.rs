//! The class `World`: objects that are built once, and move.

use std::path::PathBuf;
use std::sync::Arc;

use antumbra::{Geometry, LocalOrigin, Recipe};
use numpy::{PyArrayDyn, PyReadonlyArray1};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};

use super::Queries;
use crate::arrays::broadcast::Operand;
use crate::arrays::{Numbers, memory, shape_text, shaped, wrong_shape};
use crate::call::Call;
use crate::call::threads::{ThreadCount, Threads};
use crate::errors::raised;
use crate::rays::arguments::RayArguments;
use crate::scene::parts::{Part, Parts};
use crate::scene::{self, Quality, SceneData, Use, meshes, placements, saved};

/// Order of the children of a world's tree, which ``World.relearn`` learned and ``World.adopt`` takes.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> import numpy as np
/// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
/// >>> world = am.World([roof], [np.eye(4)])
/// >>> isinstance(world.relearn([0.2, 0.2, 0], [0, 0, 1]), am.ChildOrder)
/// True
#[pyclass(frozen, module = "antumbra")]
pub struct ChildOrder(antumbra::ChildOrder);

/// Objects that are built once, placed by instances that move.
///
/// Each mesh is an object with a tree of its own. ``set_instances`` makes only the few nodes above them again. A ``Scene``
/// with these instances has the same answers, bit for bit, and a tree that is faster where nothing moves.
///
/// A query that runs while another thread moves the world answers for the world as it was when the query began. Hits keep the places
/// that they have.
///
/// Parameters
/// ----------
/// meshes : as for ``Scene``
///     Objects. ``hits.mesh`` is the place in this list.
/// transforms : array (k, 4, 4) or (k, 3, 4), optional
///     Affine map of each instance from its mesh to the world, translation in the last column.
/// objects : int or array (k,) of integers, optional
///     Mesh that each instance places. Not needed for one mesh.
/// ground : as ``meshes``, optional
///     Meshes of the world itself, without an instance. In ``hits.mesh`` they come behind ``meshes``.
/// origin : "auto" or (3,), optional
///     As for ``Scene``. Instances that move far away from it are rounded more.
/// quality : "default" or "fast"
///     As for ``Scene``.
/// threads : int, optional
///     Number of threads; see ``set_threads``.
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
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> import numpy as np
/// >>> def at(x):
/// ...     return np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]])
/// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
/// >>> world = am.World([roof], [at(0), at(5)])
/// >>> world.occluded([[0.2, 0.2, 0], [7.2, 0.2, 0]], [0, 0, 1])
/// array([ True, False])
/// >>> world.set_instances([at(7), at(5)])
/// >>> world.occluded([[0.2, 0.2, 0], [7.2, 0.2, 0]], [0, 0, 1])
/// array([False,  True])
#[pyclass(frozen, extends = Queries, module = "antumbra")]
pub struct World;

impl World {
    fn with(py: Python<'_>, data: Arc<SceneData>) -> PyResult<Bound<'_, Self>> {
        Bound::new(py, Queries::extended(data, Self))
    }

    /// Changes world and meshes without the lock of the interpreter, by the threads of a call.
    fn change(
        slf: &Bound<'_, Self>,
        threads: Option<ThreadCount>,
        change: impl FnOnce(&mut antumbra::World, &mut Parts) -> Result<(), antumbra::Error> + Send,
    ) -> PyResult<()> {
        let threads = Threads::of(threads)?;
        let queries = slf.as_super().get();
        let changed = slf.py().detach(|| {
            queries.change(|data| match data.world_mut() {
                Some((world, parts)) => threads.run(|| change(world, parts)),
                None => Ok(()),
            })
        });
        changed.map_err(raised)
    }
}

#[pymethods]
#[allow(clippy::too_many_arguments)]
impl World {
    #[new]
    #[pyo3(signature = (meshes, transforms=None, objects=None, *, ground=None, origin=None, quality="default", threads=None, progress=None))]
    fn new<'py>(
        py: Python<'py>,
        meshes: &Bound<'py, PyAny>,
        transforms: Option<&Bound<'py, PyAny>>,
        objects: Option<&Bound<'py, PyAny>>,
        ground: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        quality: &str,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let quality = Quality::read(quality)?;
        let mut call = Call::new(py, threads, progress)?;
        let parts = meshes::objects(meshes, ground, (transforms, objects), origin)?;
        let data = scene::build(&mut call, parts, quality, Use::Moving)?;
        Ok(Queries::extended(data, Self))
    }

    /// Replaces the instances: some may have moved, some be new, some be gone.
    ///
    /// Parameters
    /// ----------
    /// transforms : array (k, 4, 4) or (k, 3, 4)
    ///     As for ``World``.
    /// objects : int or array (k,) of integers, optional
    ///     Mesh that each instance places. Without them, as many instances place what they placed before.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    ///
    /// Raises
    /// ------
    /// IndexError
    ///     An instance names a mesh that is not there.
    /// ValueError, TypeError
    ///     An argument has another shape or type. The world stays as it is.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> world = am.World([roof], [np.eye(4)])
    /// >>> world.set_instances(np.stack([np.eye(4), np.diag([2, 2, 2, 1])]))
    /// >>> world.intersect([[0.2, 0.2, 0], [0.8, 0.8, 0]], [0, 0, 1]).instance
    /// array([0, 1], dtype=int32)
    #[pyo3(signature = (transforms, objects=None, *, threads=None))]
    fn set_instances(
        slf: &Bound<'_, Self>,
        transforms: &Bound<'_, PyAny>,
        objects: Option<&Bound<'_, PyAny>>,
        threads: Option<ThreadCount>,
    ) -> PyResult<()> {
        let data = slf.as_super().get().data();
        let parts = &data.parts;
        let before: Vec<_> = parts.instances.iter().map(|placed| placed.object).collect();
        let rows = (Some(transforms), objects);
        let placed = placements::of_arrays(rows, parts.objects.len(), &before)?;
        let instances = placed.iter().map(|placed| {
            let own = parts.origins[placed.mesh];
            placements::placed(placed.mesh as u32, &placed.rows, own, parts.local.origin)
        });
        let instances = memory::collected(instances, placed.len(), "instances")?;
        // A sole owner changes the world in place.
        drop(data);
        Self::change(slf, threads, |world, parts| {
            world.set_instances(&instances)?;
            parts.instances = instances;
            Ok(())
        })
    }

    /// Moves vertices of meshes, in the trees that they have.
    ///
    /// Trees get slower if vertices move far from where they were built. Vertices of an object are rounded as far as it was away from its
    /// own middle when it was built.
    ///
    /// Parameters
    /// ----------
    /// vertices : dict of int to array (n, 3)
    ///     New vertices by the number of the mesh, as many as it has. Meshes of the ground come behind the others.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    ///
    /// Raises
    /// ------
    /// IndexError
    ///     There is no such mesh.
    /// ValueError, TypeError
    ///     An argument has another shape or type, or a triangle could never be hit any more, or could not before. The world stays as it is.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> world = am.World([roof], [np.eye(4)])
    /// >>> world.refit({0: [[0, 0, 3], [1, 0, 3], [0, 1, 3]]})
    /// >>> float(world.intersect([0.2, 0.2, 0], [0, 0, 1]).t)
    /// 3.0
    #[pyo3(signature = (vertices, *, threads=None))]
    fn refit(
        slf: &Bound<'_, Self>,
        vertices: &Bound<'_, PyDict>,
        threads: Option<ThreadCount>,
    ) -> PyResult<()> {
        let data = slf.as_super().get().data();
        let moved = vertices.iter().map(|(mesh, vertices)| {
            let mesh: i64 = mesh.extract()?;
            moved(&data.parts, mesh, &vertices)
        });
        let moved = moved.collect::<PyResult<Vec<_>>>()?;
        drop(data);
        Self::change(slf, threads, |world, parts| {
            let mut next = parts.clone();
            for (place, part) in &moved {
                next.parts[*place] = part.clone();
            }
            let objects = next.objects.len();
            let mut lists: Vec<(u32, Vec<Geometry<'_>>)> = Vec::new();
            for &(place, _) in moved.iter().filter(|(place, _)| *place < objects) {
                lists.push((place as u32, next.geometries(&next.objects[place])));
            }
            if moved.iter().any(|(place, _)| *place >= objects) {
                lists.push((antumbra::World::GROUND, next.geometries(&next.world)));
            }
            let lists: Vec<_> = lists
                .iter()
                .map(|(object, list)| (*object, &list[..]))
                .collect();
            let instances = world.instances().to_vec();
            world.refit(&lists, &instances)?;
            drop(lists);
            *parts = next;
            Ok(())
        })
    }

    /// Learns the order of the tree again, for these rays in the world as it is now.
    ///
    /// Answers stay the same bits. A copy of the world learns: the lock of the interpreter is released, other threads may query and move
    /// the world meanwhile, and the order takes effect at the end. The order is kept when instances move. The example learns beside the frames,
    /// on a thread of its own.
    ///
    /// Parameters
    /// ----------
    /// origins, directions : arrays (..., 3)
    ///     Rays. Leading shapes are broadcast: one origin or one direction may stand for all. Directions have any length but 0.
    ///     Without directions, origins are (..., 6): origin and direction in a row.
    /// distance, near : numbers or arrays (...), optional
    ///     Ends of the rays in lengths of their directions: inf and 0. Both ends count.
    /// adopt : bool
    ///     Whether this world adopts the order at the end. Without it, ``adopt`` does so between two frames.
    /// threads : int, optional
    ///     Number of threads; see ``set_threads``.
    ///
    /// Returns
    /// -------
    /// ChildOrder
    ///     The order, for ``adopt`` of this world and of copies of it.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     An argument has another shape or type, or shapes do not fit.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> from concurrent.futures import ThreadPoolExecutor
    /// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> world = am.World([roof], [np.eye(4)])
    /// >>> rays = np.random.default_rng(0).uniform(0, 1, (100, 3)) * [1, 1, 0], [0, 0, 1]
    /// >>> with ThreadPoolExecutor(1) as pool:
    /// ...     learning = pool.submit(world.relearn, *rays, adopt=False)
    /// ...     while not learning.done():
    /// ...         covered = world.occluded(*rays)
    /// >>> world.adopt(learning.result())
    #[pyo3(signature = (origins, directions=None, distance=None, *, near=None, adopt=true, threads=None))]
    fn relearn(
        slf: &Bound<'_, Self>,
        origins: &Bound<'_, PyAny>,
        directions: Option<&Bound<'_, PyAny>>,
        distance: Option<&Bound<'_, PyAny>>,
        near: Option<&Bound<'_, PyAny>>,
        adopt: bool,
        threads: Option<ThreadCount>,
    ) -> PyResult<ChildOrder> {
        let arguments = RayArguments::read((origins, directions), (near, distance), (None, None))?;
        let data = slf.as_super().get().data();
        let rays = arguments.closed(&data)?;
        let of_call = Threads::of(threads)?;
        let order = slf.py().detach(|| {
            let mut copy = data.world().cloned();
            // The world may move meanwhile without a copy.
            drop(data);
            of_call.run(|| {
                let learn = |world: &mut antumbra::World| world.relearn(&rays, &Recipe::default());
                copy.as_mut().map(learn)
            })
        });
        let order = ChildOrder(order.unwrap_or_default());
        if adopt {
            Self::adopt(slf, &order)?;
        }
        Ok(order)
    }

    /// Puts the children of the tree in an order that ``relearn`` learned, of this world or of a copy of it.
    ///
    /// Answers stay the same bits. Takes less than a millisecond for some hundred thousand triangles. The world may have moved since the
    /// order was learned. The nodes above the instances follow at the next ``set_instances``. The order of another world changes next to nothing.
    ///
    /// Parameters
    /// ----------
    /// order : ChildOrder
    ///     What ``relearn`` returned.
    ///
    /// Raises
    /// ------
    /// TypeError
    ///     The order is no ``ChildOrder``.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> world = am.World([roof], [np.eye(4)])
    /// >>> order = world.relearn([[0.2, 0.2, 0], [0.4, 0.1, 0]], [0, 0, 1], adopt=False)
    /// >>> world.adopt(order)
    fn adopt(slf: &Bound<'_, Self>, order: &ChildOrder) -> PyResult<()> {
        Self::change(slf, None, |world, _| {
            world.adopt(&order.0);
            Ok(())
        })
    }

    /// Transforms of the instances: float64 of shape (k, 3, 4).
    #[getter]
    fn transforms<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let data = slf.as_super().get().data();
        let parts = &data.parts;
        let rows = parts.instances.iter().flat_map(|instance| {
            let [x, y, z] = parts.origins[instance.object as usize];
            [0, 1, 2].map(|axis| {
                let [a, b, c, d] = instance.transform[axis].map(f64::from);
                [
                    a,
                    b,
                    c,
                    d - (a * x + b * y + c * z) + parts.local.origin[axis],
                ]
            })
        });
        let count = parts.instances.len();
        let rows = memory::collected(rows, 3 * count, "transforms")?;
        shaped(slf.py(), rows.into_flattened(), &[count, 3, 4])
    }

    /// Mesh that each instance places: int64 of shape (k,).
    #[getter]
    fn objects<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let data = slf.as_super().get().data();
        let instances = &data.parts.instances;
        let objects = instances.iter().map(|instance| i64::from(instance.object));
        let objects = memory::collected(objects, instances.len(), "objects")?;
        shaped(slf.py(), objects, &[instances.len()])
    }

    /// Reads a world that ``save`` wrote.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///     File to be read.
    ///
    /// Returns
    /// -------
    /// World
    ///
    /// Raises
    /// ------
    /// FileNotFoundError
    ///     There is no such file.
    /// ValueError
    ///     The file is damaged, or has no world.
    ///
    /// Examples
    /// --------
    /// >>> import os, tempfile
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> world = am.World([roof], [np.eye(4)])
    /// >>> path = os.path.join(tempfile.mkdtemp(), "world")
    /// >>> world.save(path)
    /// >>> am.World.load(path)
    /// <antumbra.World: 1 meshes, 1 triangles, 1 instances>
    #[classmethod]
    fn load<'py>(
        _class: &Bound<'py, PyType>,
        py: Python<'py>,
        path: PathBuf,
    ) -> PyResult<Bound<'py, Self>> {
        Self::with(py, saved::load(py, &path, true)?)
    }

    /// World of the bytes that pickle keeps.
    #[staticmethod]
    #[pyo3(name = "_from_bytes")]
    fn from_bytes<'py>(
        py: Python<'py>,
        bytes: PyReadonlyArray1<'_, u8>,
    ) -> PyResult<Bound<'py, Self>> {
        Self::with(py, saved::from_array(py, &bytes)?)
    }
}

/// A mesh of a world with other vertices, and its number.
fn moved(parts: &Parts, mesh: i64, vertices: &Bound<'_, PyAny>) -> PyResult<(usize, Arc<Part>)> {
    let count = parts.parts.len();
    let Some(place) = usize::try_from(mesh).ok().filter(|&place| place < count) else {
        return Err(PyIndexError::new_err(format!(
            "vertices: found mesh {mesh}, but there are {count} meshes"
        )));
    };
    let Some((positions, indices)) = parts.parts[place].triangles() else {
        return Err(PyValueError::new_err(format!(
            "vertices: found mesh {place}, which is curves, wanted a mesh of triangles"
        )));
    };
    let numbers = Numbers::read(vertices, "vertices", 3)?;
    if numbers.rows()? != positions.len() {
        let wanted = shape_text(&[positions.len(), 3]);
        return Err(wrong_shape("vertices", numbers.shape(), &wanted));
    }
    let origin = parts.origins.get(place);
    let local = LocalOrigin {
        origin: *origin.unwrap_or(&parts.local.origin),
    };
    let operand = Operand::new(&numbers, 3, numbers.lead(3));
    let points = (0..positions.len()).map(|vertex| local.local(operand.vector(vertex)));
    let part = Part::Mesh {
        positions: memory::collected(points, positions.len(), "vertices")?,
        indices: indices.to_vec(),
        opacity: None,
    };
    Ok((place, Arc::new(part)))
}
