//! Queries about points: what is nearest, and what is inside.

use numpy::PyArrayDyn;
use pyo3::prelude::*;

use super::Queries;
use crate::arrays::{Numbers, shaped};
use crate::call::Call;
use crate::call::threads::ThreadCount;
use crate::points::{self, Closest};

#[pymethods]
impl Queries {
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
        let points = Numbers::read(points, "points", 3)?;
        let mut call = Call::new(py, threads, progress)?;
        let inside = points::asked(
            &mut call,
            &self.data(),
            &points,
            (false, "answers"),
            |bvh, points, inside| bvh.points(points).inside_into(inside),
        )?;
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
        let points = Numbers::read(points, "points", 3)?;
        let mut call = Call::new(py, threads, progress)?;
        points::closest(&mut call, &self.data(), &points, max_distance)
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
        let points = Numbers::read(points, "points", 3)?;
        let mut call = Call::new(py, threads, progress)?;
        let distances = points::asked(
            &mut call,
            &self.data(),
            &points,
            (f32::INFINITY, "distances"),
            |bvh, points, distances| bvh.points(points).signed_distances_into(distances),
        )?;
        shaped(py, distances, points.lead(3))
    }
}
