//! Jobs about many points: visibility, open sky, sun.

use antumbra_bake::{AmbientOcclusion, Place, SunJob, Sunlight};
use numpy::PyArrayDyn;
use pyo3::prelude::*;

use super::Queries;
use crate::arrays::{Numbers, memory};
use crate::bakes::bits::BitMatrix;
use crate::bakes::sky::{orientation, sky, weighting};
use crate::bakes::sun::{directions, suns, time_steps};
use crate::bakes::{Job, sensors};
use crate::call::Call;
use crate::call::threads::ThreadCount;
use crate::errors::failed;

/// Irradiation by the sun and by the sky.
type Irradiation<'py> = (Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArrayDyn<f64>>);

#[pymethods]
#[allow(clippy::too_many_arguments)]
impl Queries {
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
        let mut call = Call::new(py, threads, progress)?;
        let points = |object: &Bound<'_, PyAny>, name| {
            let numbers = Numbers::read(object, name, 3)?;
            numbers.rows()?;
            data.local_points(&numbers)
        };
        let from = points(a, "a")?;
        let seen = match b {
            Some(b) => {
                let to = points(b, "b")?;
                call.watch(|signals| {
                    antumbra_bake::sees_points(data.bvh(), &from, &to, margin, signals)
                })
            }
            None => call.watch(|signals| {
                let all = 0..from.len();
                antumbra_bake::sees_each_other(data.bvh(), &from, all, margin, signals)
            }),
        };
        Ok(seen?.map_err(failed)?.into())
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
        let call = Call::new(py, threads, progress)?;
        let mut job = Job::new(self.data(), points, normals, call)?;
        let towards = self::directions(directions, "directions")?;
        let seen = job.run(|(bvh, points, normals), signals| {
            antumbra_bake::sees_directions(bvh, points, normals, &towards, distance, signals)
        })?;
        Ok(seen.into())
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
        let call = Call::new(py, threads, progress)?;
        let mut job = Job::new(self.data(), points, Some(normals), call)?;
        let options = AmbientOcclusion {
            samples,
            distance,
            two_sided,
            weighting: self::weighting(weighting)?,
            seed,
        };
        if !bent {
            let open = job.run(|(bvh, points, normals), signals| {
                antumbra_bake::ambient_occlusion(bvh, points, normals, &options, signals)
            })?;
            return Ok(job.array(open, &[])?.into_any());
        }
        let found = job.run(|(bvh, points, normals), signals| {
            antumbra_bake::bent_normals(bvh, points, normals, &options, signals)
        })?;
        let open = memory::collected(found.iter().map(|point| point.open), found.len(), "values")?;
        let bent = found.iter().flat_map(|point| point.direction);
        let bent = memory::collected(bent, 3 * found.len(), "numbers of directions")?;
        let both = (job.array(open, &[])?, job.array(bent, &[3])?);
        Ok(both.into_pyobject(py)?.into_any())
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
        let call = Call::new(py, threads, progress)?;
        let mut job = Job::new(self.data(), points, normals, call)?;
        let (patches, orientation) = (sky(patches, uniform)?, orientation(up, north)?);
        let (sky, weighting) = ((&patches, &orientation), self::weighting(weighting)?);
        let parts = job.run(|(bvh, points, normals), signals| {
            antumbra_bake::sky_view(bvh, points, normals, sky, weighting, signals)
        })?;
        job.array(parts, &[])
    }

    /// Hours of direct sun of points.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     Points.
    /// normals : array (..., 3) or None
    ///     As for ``sees``.
    /// suns : SunPositions, or array (k, 3)
    ///     What ``sun_positions`` returns, of which the steps by day count, or directions to the sun above the horizon.
    /// weights : float or array (k,), optional
    ///     Length of each step in hours, or whatever else is to be added up. Positions know the lengths of their steps; directions
    ///     need weights.
    /// up : {"z", "y"}
    ///     Axis that points up. A warning counts directions below the horizon, which count like all others.
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
    ///     An argument has another shape or type, shapes do not fit, or nothing says how long a step is: directions without
    ///     weights, or a single time.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    /// >>> scene.sun_hours([[0.2, 0.2, 0], [5, 5, 0]], None, [[0, 0, 1], [0, 1, 1]], weights=0.5)
    /// array([0.5, 1. ])
    ///
    /// A whole day on an open field, in steps of an hour:
    ///
    /// >>> times = [f"2025-06-21T{hour:02}:30" for hour in range(24)]
    /// >>> sun = am.sun_positions(48.2, 16.4, times, "Europe/Vienna")
    /// >>> float(scene.sun_hours([5, 5, 0], [0, 0, 1], sun))
    /// 16.0
    #[pyo3(signature = (points, normals, suns, weights=None, *, up="z", threads=None, progress=None))]
    fn sun_hours<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        normals: Option<&Bound<'py, PyAny>>,
        suns: &Bound<'py, PyAny>,
        weights: Option<&Bound<'py, PyAny>>,
        up: &str,
        threads: Option<ThreadCount>,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let call = Call::new(py, threads, progress)?;
        let mut job = Job::new(self.data(), points, normals, call)?;
        let (suns, weights) = self::suns(suns, weights, up)?;
        let hours = job.run(|(bvh, points, normals), signals| {
            antumbra_bake::sun_hours(bvh, points, normals, &suns, &weights, signals)
        })?;
        job.array(hours, &[])
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
    ) -> PyResult<Irradiation<'py>> {
        let call = Call::new(py, threads, progress)?;
        let mut job = Job::new(self.data(), points, normals, call)?;
        let (latitude, longitude, height) = place;
        let place = Place {
            latitude,
            longitude,
            height,
        };
        let [hours, direct_normal, diffuse_horizontal] = &steps;
        let steps = time_steps(&times, hours, direct_normal, diffuse_horizontal)?;
        let (patches, uniform, up, north) = sky;
        let (sky, orientation) = (self::sky(patches, uniform)?, orientation(&up, north)?);
        let sunlight = Sunlight::new(&place, steps, true, sky, orientation).map_err(failed)?;
        let found = job.run(|(bvh, points, normals), signals| {
            let job = SunJob::new(points, normals, &sunlight)?;
            antumbra_bake::run(&job, bvh, signals)
        })?;
        let values = found.values;
        Ok((
            job.array(values.direct, &[])?,
            job.array(values.diffuse, &[])?,
        ))
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
    ) -> PyResult<sensors::Cells<'py>> {
        sensors::on_grid(py, &self.data(), spacing, &orientation(up, 0.0)?)
    }
}
