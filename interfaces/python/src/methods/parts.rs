//! What a scene or a world has: its geometry, its masks, its file.

use std::path::PathBuf;

use antumbra_bake::vertex_normals;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::Queries;
use crate::arrays::{masks, memory, shaped};
use crate::html;
use crate::scene::saved::{self, Reduced};

#[pymethods]
impl Queries {
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

    /// Path to each instance: int64 of shape (instances, depth), with -1 behind the last place.
    ///
    /// The first place of a path is in the list of instances of the scene, each further one in the list of the ``Assembly`` that the place
    /// before has. Choose hits first: a ray that hits nothing, or a mesh without instances, has the instance -1.
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
                Some(instance) => {
                    let rows = instance.transform;
                    let placed = positions
                        .iter()
                        .map(|&[x, y, z]| rows.map(|[a, b, c, _]| a * x + b * y + c * z));
                    let placed: Vec<_> = placed.collect();
                    normals.extend(vertex_normals(&placed, indices));
                }
            });
        });
        shaped(py, normals.into_flattened(), &[count, 3])
    }

    /// The bytes lie in an array: protocol 5 of pickle need not copy them.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py, (Bound<'py, PyArray1<u8>>,)> {
        let py = slf.py();
        let data = slf.get().data();
        let bytes = py.detach(|| saved::to_bytes(&data))?;
        let restore = slf.get_type().getattr("_from_bytes")?;
        Ok((restore, (PyArray1::from_vec(py, bytes),)))
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
        let masks = self::masks(masks, "masks", meshes)?;
        let instances = self::masks(instances, "instances", placed)?;
        drop(data);
        py.detach(|| self.change(|data| data.set_masks(masks, instances)));
        Ok(())
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let data = slf.get().data();
        let report = data.bvh().report();
        let instances = match report.instances {
            0 => String::new(),
            count => format!(", {count} instances"),
        };
        let (meshes, primitives) = (data.parts.parts.len(), report.primitives);
        let kind = data.kind();
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
            (data.kind(), report.primitives.to_string()),
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
