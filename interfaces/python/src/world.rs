//! The class `World`: objects that are built once, and move.

use std::path::PathBuf;
use std::sync::Arc;

use antumbra::{Build, Geometry, LocalOrigin, Object, Recipe};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};

use crate::arrays::{Numbers, shape_text, shaped, wrong_shape};
use crate::bake;
use crate::broadcast::Operand;
use crate::geometry::{Part, Parts};
use crate::memory;
use crate::meshes;
use crate::methods::Queries;
use crate::placements;
use crate::rays::{Call, Conditions, RayArguments, RaySource};
use crate::saved::{self, Reduced};
use crate::scene::{Quality, SceneData, Tree, raised, warn};
use crate::threads::{ThreadCount, Threads};
use crate::watch::watch;

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
        Bound::new(
            py,
            PyClassInitializer::from(Queries::from(data)).add_subclass(Self),
        )
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
        let mut call = Call::new(threads, progress)?;
        let rows = |count| rows(transforms, objects, count, &[]);
        let (mut parts, instances) = meshes::objects(meshes, ground, rows, origin)?;
        let made = watch(py, &call.threads, &mut call.progress, |signals| {
            let recipe = quality.recipe();
            let build = |list: &[u32]| {
                let geometries: Vec<_> = geometries(&parts, list);
                let build = Build::new(&geometries[..]).recipe(&recipe);
                build.monitor(signals).object()
            };
            let objects = parts.objects.iter().map(|list| build(list));
            let objects = objects.collect::<Result<Vec<Object>, _>>()?;
            match parts.world.is_empty() {
                true => antumbra::World::new(&objects, &instances),
                false => antumbra::World::on_ground(&build(&parts.world)?, &objects, &instances),
            }
        })?;
        let world = made.map_err(raised)?;
        parts.instances = instances;
        let data = SceneData::new(Tree::World(Box::new(world)), parts, quality);
        let report = data.bvh().report();
        if report.dropped > 0 {
            warn(py, &report)?;
        }
        Ok(PyClassInitializer::from(Queries::from(Arc::new(data))).add_subclass(Self))
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
        let rows = rows(Some(transforms), objects, parts.objects.len(), &before)?;
        let instances = rows.iter().map(|(object, rows)| {
            let own = parts.origins[*object];
            placements::placed(*object as u32, rows, own, parts.local.origin)
        });
        let instances = memory::collected(instances, rows.len(), "instances")?;
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
        let parts = &data.parts;
        let mut moved = Vec::new();
        for (mesh, vertices) in vertices {
            let mesh: i64 = mesh.extract()?;
            let count = parts.parts.len();
            let Some(place) = usize::try_from(mesh).ok().filter(|&place| place < count) else {
                return Err(PyIndexError::new_err(format!(
                    "vertices: found mesh {mesh}, but there are {count} meshes"
                )));
            };
            let Part::Mesh {
                positions, indices, ..
            } = &*parts.parts[place]
            else {
                return Err(PyValueError::new_err(format!(
                    "vertices: found mesh {place}, which is curves, wanted a mesh of triangles"
                )));
            };
            let numbers = Numbers::read(&vertices, "vertices", 3)?;
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
                indices: indices.clone(),
                opacity: None,
            };
            moved.push((place, Arc::new(part)));
        }
        drop(data);
        Self::change(slf, threads, |world, parts| {
            let mut next = parts.clone();
            for (place, part) in &moved {
                next.parts[*place] = part.clone();
            }
            let objects = next.objects.len();
            let mut lists: Vec<(u32, Vec<Geometry<'_>>)> = Vec::new();
            for &(place, _) in moved.iter().filter(|(place, _)| *place < objects) {
                lists.push((place as u32, geometries(&next, &next.objects[place])));
            }
            if moved.iter().any(|(place, _)| *place >= objects) {
                lists.push((antumbra::World::GROUND, geometries(&next, &next.world)));
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
        let conditions = Conditions::default();
        let arguments = RayArguments::read(origins, directions, distance, near, conditions)?;
        let data = slf.as_super().get().data();
        let rays = arguments.rays(&data)?;
        let closed = |place| rays.get(place).closed();
        let rays = memory::collected((0..rays.len()).map(closed), rays.len(), "rays")?;
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
        let data = py.detach(|| saved::load(&path))?;
        saved::expect_world(&data, true)?;
        Self::with(py, data)
    }

    /// World of the bytes that pickle keeps.
    #[staticmethod]
    #[pyo3(name = "_from_bytes")]
    fn from_bytes<'py>(
        py: Python<'py>,
        bytes: numpy::PyReadonlyArray1<'_, u8>,
    ) -> PyResult<Bound<'py, Self>> {
        let bytes = bytes.as_slice()?;
        Self::with(py, py.detach(|| saved::from_bytes(bytes))?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py, (Bound<'py, PyArray1<u8>>,)> {
        let py = slf.py();
        let data = slf.as_super().get().data();
        let bytes = py.detach(|| saved::to_bytes(&data))?;
        let restore = slf.get_type().getattr("_from_bytes")?;
        Ok((restore, (PyArray1::from_vec(py, bytes),)))
    }
}

/// Geometries of some parts.
fn geometries<'a>(parts: &'a Parts, list: &[u32]) -> Vec<Geometry<'a>> {
    let list = list.iter().map(|&part| &parts.parts[part as usize]);
    list.map(|part| part.geometry()).collect()
}

/// Object and matrix of every instance. Without objects, instances place what they placed before, or the one object.
fn rows(
    transforms: Option<&Bound<'_, PyAny>>,
    objects: Option<&Bound<'_, PyAny>>,
    count: usize,
    before: &[u32],
) -> PyResult<Vec<(usize, [[f64; 4]; 3])>> {
    let Some(transforms) = transforms else {
        return match objects {
            None => Ok(Vec::new()),
            Some(_) => Err(PyValueError::new_err(
                "transforms: found none beside objects, wanted shape (k, 4, 4) or (k, 3, 4)",
            )),
        };
    };
    let matrices = Numbers::read(transforms, "transforms", 4)?;
    let (instances, rows) = match *matrices.shape() {
        [instances, rows @ (3 | 4), 4] => (instances, rows),
        [0, 4] => (0, 4),
        _ => {
            let wanted = "(k, 4, 4) or (k, 3, 4)";
            return Err(wrong_shape("transforms", matrices.shape(), wanted));
        }
    };
    let named = match objects {
        Some(objects) => {
            let numbers = Numbers::whole(objects, "objects")?;
            if !numbers.shape().is_empty() && numbers.shape() != [instances] {
                let wanted = format!("() or ({instances},)");
                return Err(wrong_shape("objects", numbers.shape(), &wanted));
            }
            bake::each(&numbers, instances)?
        }
        None if before.len() == instances => before.iter().map(|&object| object.into()).collect(),
        None if count == 1 || instances == 0 => memory::filled(0.0, instances, "instances")?,
        None => {
            return Err(PyValueError::new_err(format!(
                "objects: found none, wanted which of {count} meshes each of {instances} instances places"
            )));
        }
    };
    // A matrix that stands for all is in memory once.
    let lead = matrices.lead(4);
    let operand = Operand::new(&matrices, 4, lead);
    let row = |place| operand.row(place);
    let mut placements = memory::room(instances, "instances")?;
    for (instance, &object) in named.iter().enumerate() {
        if !(object >= 0.0 && object < count as f64) {
            return Err(PyIndexError::new_err(format!(
                "objects: instance {instance} names mesh {object}, but there are {count} meshes"
            )));
        }
        let first = instance * rows;
        if rows == 4 && row(first + 3) != [0.0, 0.0, 0.0, 1.0] {
            return Err(PyValueError::new_err(format!(
                "transforms: the last row of instance {instance} is {:?}, wanted [0, 0, 0, 1]",
                row(first + 3)
            )));
        }
        placements.push((object as usize, [0, 1, 2].map(|axis| row(first + axis))));
    }
    Ok(placements)
}
