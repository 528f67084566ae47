//! Numbers about points: ambient occlusion, sky, sun, and visibility between points.

use std::ffi::CString;

use antumbra_bake::{
    AmbientOcclusion, Atlas, Irradiance, Layout, Mesh, Moment, Orientation, Place, Refraction,
    Sensors, SkyDivision, SkyPatches, SunJob, Sunlight, TimeStep, UpAxis, Weighting,
};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::{PyMemoryError, PyUserWarning, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{Numbers, read_faces, shaped, wrong_shape};
use crate::bits::BitMatrix;
use crate::broadcast::Operand;
use crate::memory;
use crate::rays::Call;
use crate::scene::SceneData;
use crate::watch::{Signals, watch};

/// Exception for an error of the library.
pub fn failed(error: antumbra_bake::Error) -> PyErr {
    match error {
        antumbra_bake::Error::TooLarge { .. } | antumbra_bake::Error::NoMemory { .. } => {
            PyMemoryError::new_err(error.to_string())
        }
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// Points, and the normals of surfaces there if there are any.
pub struct Places {
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Shape of the points without the axis of coordinates.
    pub shape: Vec<usize>,
}

impl Places {
    pub fn read(
        scene: &SceneData,
        points: &Bound<'_, PyAny>,
        normals: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let points = Numbers::read(points, "points", 3)?;
        let shape = points.lead(3).to_vec();
        let normals = match normals {
            None => Vec::new(),
            Some(normals) => {
                let normals = Numbers::read(normals, "normals", 3)?;
                let together = crate::broadcast::common_shape(&[(&points, 3), (&normals, 3)])?;
                if together != shape {
                    let wanted = crate::arrays::shape_text(points.shape());
                    return Err(wrong_shape("normals", normals.shape(), &wanted));
                }
                vectors(&normals, &shape)?
            }
        };
        Ok(Self {
            points: scene.local_points(&points)?,
            normals,
            shape,
        })
    }
}

/// Vectors of an argument, rounded, as many as a shape has.
fn vectors(numbers: &Numbers<'_>, shape: &[usize]) -> PyResult<Vec<[f32; 3]>> {
    let operand = Operand::new(numbers, 3, shape);
    let count = shape.iter().product();
    let vectors = (0..count).map(|place| operand.vector(place).map(|x| x as f32));
    memory::collected(vectors, count, numbers.name())
}

/// Directions of an argument of shape (k, 3).
fn directions(object: &Bound<'_, PyAny>, name: &'static str) -> PyResult<Vec<[f32; 3]>> {
    let numbers = Numbers::read(object, name, 3)?;
    match numbers.lead(3) {
        [_] => vectors(&numbers, numbers.lead(3)),
        _ => Err(wrong_shape(name, numbers.shape(), "(k, 3)")),
    }
}

/// Numbers of an argument of shape () or (k,).
fn each_of(object: &Bound<'_, PyAny>, name: &'static str, count: usize) -> PyResult<Vec<f64>> {
    let numbers = Numbers::read(object, name, 1)?;
    let fits = matches!(numbers.shape(), [] | [1]) || numbers.shape() == [count];
    if !fits {
        let wanted = format!("() or ({count},)");
        return Err(wrong_shape(name, numbers.shape(), &wanted));
    }
    each(&numbers, count)
}

/// Numbers of an argument, of which one may stand for all.
pub fn each(numbers: &Numbers<'_>, count: usize) -> PyResult<Vec<f64>> {
    let operand = Operand::new(numbers, 1, &[count]);
    let all = (0..count).map(|place| operand.number(place));
    memory::collected(all, count, numbers.name())
}

pub fn weighting(name: &str) -> PyResult<Weighting> {
    match name {
        "cosine" => Ok(Weighting::Cosine),
        "uniform" => Ok(Weighting::Uniform),
        _ => Err(PyValueError::new_err(format!(
            "weighting: found {name:?}, wanted \"cosine\" or \"uniform\""
        ))),
    }
}

/// Where up and north are, from the arguments `up` and `north`.
pub fn orientation(up: &str, north: f64) -> PyResult<Orientation> {
    let up = match up {
        "y" => UpAxis::Y,
        "z" => UpAxis::Z,
        _ => {
            return Err(PyValueError::new_err(format!(
                "up: found {up:?}, wanted \"y\" or \"z\""
            )));
        }
    };
    Orientation::new(up, north).map_err(failed)
}

/// Patches of the sky from the argument `patches`: a number of patches, or "uniform" and a number of them.
pub fn sky(patches: u32, uniform: bool) -> PyResult<SkyPatches> {
    let division = match (patches, uniform) {
        (count, true) => SkyDivision::Uniform(count),
        (145, false) => SkyDivision::Tregenza,
        (count, false) => {
            let patches = |&parts: &u32| 144 * parts * parts + 1 == count;
            match (2..=80).find(patches) {
                Some(parts) => SkyDivision::Reinhart(parts),
                None => {
                    return Err(PyValueError::new_err(format!(
                        "patches: found {count}, wanted 145 (Tregenza), 577 or 2305 (Reinhart), or uniform=True"
                    )));
                }
            }
        }
    };
    division.patches().map_err(failed)
}

/// Work of the library, watched.
fn done<T: Send>(
    py: Python<'_>,
    call: &mut Call<'_>,
    work: impl FnOnce(&Signals) -> Result<T, antumbra_bake::Error> + Send,
) -> PyResult<T> {
    watch(py, &call.threads, &mut call.progress, work)?.map_err(failed)
}

/// Open parts of the sky, and mean open directions.
type Open<'py> = (
    Bound<'py, PyArrayDyn<f32>>,
    Option<Bound<'py, PyArrayDyn<f32>>>,
);

/// Open part of the sky above points, and the mean open directions if `bent`.
pub fn ambient_occlusion<'py>(
    py: Python<'py>,
    scene: &SceneData,
    places: &Places,
    options: &AmbientOcclusion,
    bent: bool,
    call: &mut Call<'_>,
) -> PyResult<Open<'py>> {
    let Places {
        points,
        normals,
        shape,
    } = places;
    let bvh = scene.bvh();
    if !bent {
        let open = done(py, call, |signals| {
            antumbra_bake::ambient_occlusion(bvh, points, normals, options, signals)
        })?;
        return Ok((shaped(py, open, shape)?, None));
    }
    let found = done(py, call, |signals| {
        antumbra_bake::bent_normals(bvh, points, normals, options, signals)
    })?;
    let open = memory::collected(found.iter().map(|point| point.open), found.len(), "values")?;
    let bent = found.iter().flat_map(|point| point.direction);
    let bent = memory::collected(bent, 3 * found.len(), "numbers of directions")?;
    let vectors = [&shape[..], &[3]].concat();
    Ok((shaped(py, open, shape)?, Some(shaped(py, bent, &vectors)?)))
}

pub fn sky_view<'py>(
    py: Python<'py>,
    scene: &SceneData,
    places: &Places,
    (patches, orientation): (&SkyPatches, &Orientation),
    weighting: Weighting,
    call: &mut Call<'_>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let Places {
        points,
        normals,
        shape,
    } = places;
    let sky = (patches, orientation);
    let parts = done(py, call, |signals| {
        antumbra_bake::sky_view(scene.bvh(), points, normals, sky, weighting, signals)
    })?;
    shaped(py, parts, shape)
}

/// Directions that points see, one row for each point.
pub fn sees_directions(
    py: Python<'_>,
    scene: &SceneData,
    places: &Places,
    towards: &[[f32; 3]],
    distance: f32,
    call: &mut Call<'_>,
) -> PyResult<BitMatrix> {
    let Places {
        points, normals, ..
    } = places;
    let seen = done(py, call, |signals| {
        antumbra_bake::sees_directions(scene.bvh(), points, normals, towards, distance, signals)
    })?;
    Ok(seen.into())
}

/// As [`sees_directions`], towards an argument of shape (k, 3).
pub fn sees(
    py: Python<'_>,
    scene: &SceneData,
    places: &Places,
    towards: &Bound<'_, PyAny>,
    distance: f32,
    call: &mut Call<'_>,
) -> PyResult<BitMatrix> {
    let towards = directions(towards, "directions")?;
    sees_directions(py, scene, places, &towards, distance, call)
}

/// Directions to the sun and lengths of steps: of positions, those by day, or of arrays.
pub fn suns(
    suns: &Bound<'_, PyAny>,
    weights: Option<&Bound<'_, PyAny>>,
    up: &str,
) -> PyResult<(Vec<[f32; 3]>, Vec<f64>)> {
    let py = suns.py();
    let up = orientation(up, 0.0)?.up;
    if !suns.hasattr("elevation")? {
        let suns = directions(suns, "suns")?;
        let Some(weights) = weights else {
            let wanted = "weights: wanted the length of each step in hours, which directions do not say; \
                          give what sun_positions returns, or weights=1 to count";
            return Err(PyValueError::new_err(wanted));
        };
        let height = |sun: &[f32; 3]| {
            (0..3)
                .map(|axis| f64::from(sun[axis]) * up[axis])
                .sum::<f64>()
        };
        let below = suns.iter().filter(|sun| height(sun) < 0.0).count();
        if below > 0 {
            let text = format!(
                "suns: {below} of {} directions are below the horizon, and count; \
                 give what sun_positions returns, or direction[sun.up]",
                suns.len()
            );
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(text)?, 1)?;
        }
        let weights = each_of(weights, "weights", suns.len())?;
        return Ok((suns, weights));
    }
    let day = suns.getattr("up")?;
    let all = directions(&suns.getattr("direction")?, "suns.direction")?;
    let is_day: Vec<bool> = day.extract()?;
    let weights = match weights {
        Some(weights) => each_of(weights, "weights", all.len())?,
        None => each_of(&suns.getattr("hours")?, "suns.hours", all.len())?,
    };
    let steps = all.into_iter().zip(weights).zip(is_day);
    let (directions, lengths): (Vec<_>, Vec<_>) = steps
        .filter(|(_, is_day)| *is_day)
        .map(|(step, _)| step)
        .unzip();
    if lengths.iter().any(|hours: &f64| hours.is_nan()) {
        let wanted =
            "weights: wanted the length of the step in hours, which a single time does not say";
        return Err(PyValueError::new_err(wanted));
    }
    Ok((directions, lengths))
}

pub fn sun_hours<'py>(
    py: Python<'py>,
    scene: &SceneData,
    places: &Places,
    (suns, weights): (Vec<[f32; 3]>, Vec<f64>),
    call: &mut Call<'_>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let Places {
        points,
        normals,
        shape,
    } = places;
    let hours = done(py, call, |signals| {
        antumbra_bake::sun_hours(scene.bvh(), points, normals, &suns, &weights, signals)
    })?;
    shaped(py, hours, shape)
}

/// Steps of time from arguments: Unix times of their middles, and lengths and irradiances of shape () or (k,).
pub fn time_steps(
    times: &[f64],
    hours: &Bound<'_, PyAny>,
    direct_normal: &Bound<'_, PyAny>,
    diffuse_horizontal: &Bound<'_, PyAny>,
) -> PyResult<Vec<TimeStep>> {
    let from_zero = |object: &Bound<'_, PyAny>, name| {
        let numbers = each_of(object, name, times.len())?;
        match numbers.iter().find(|x| !(**x >= 0.0 && x.is_finite())) {
            None => Ok(numbers),
            Some(found) => Err(PyValueError::new_err(format!(
                "{name}: found {found}, wanted finite numbers from 0"
            ))),
        }
    };
    // Also refuses times that no calendar has.
    antumbra_bake::sun_positions(&Place::default(), Refraction::None, times).map_err(failed)?;
    let hours = from_zero(hours, "hours")?;
    let direct_normal = from_zero(direct_normal, "direct_normal")?;
    let diffuse_horizontal = from_zero(diffuse_horizontal, "diffuse_horizontal")?;
    let step = |index: usize| TimeStep {
        middle: times[index],
        begin: Moment::at_unix(times[index] - 1800.0 * hours[index], 0.0),
        hours: hours[index],
        irradiance: Irradiance {
            direct_normal: direct_normal[index],
            diffuse_horizontal: diffuse_horizontal[index],
        },
    };
    Ok((0..times.len()).map(step).collect())
}

/// Irradiation by the sun and by the sky.
pub type Irradiation<'py> = (Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArrayDyn<f64>>);

pub fn irradiation<'py>(
    py: Python<'py>,
    scene: &SceneData,
    places: &Places,
    sunlight: &Sunlight,
    call: &mut Call<'_>,
) -> PyResult<Irradiation<'py>> {
    let found = done(py, call, |signals| {
        let job = SunJob::new(&places.points, &places.normals, sunlight)?;
        antumbra_bake::run(&job, scene.bvh(), signals)
    })?;
    let values = found.values;
    Ok((
        shaped(py, values.direct, &places.shape)?,
        shaped(py, values.diffuse, &places.shape)?,
    ))
}

/// Points, normals, and the number of the point in each cell of a picture, -1 for none.
pub type Cells<'py> = (
    Bound<'py, PyArrayDyn<f64>>,
    Bound<'py, PyArrayDyn<f32>>,
    Bound<'py, PyArrayDyn<i64>>,
);

/// Arrays of points in the world, their normals, and cells of a picture of this shape.
fn cells<'py>(
    py: Python<'py>,
    points: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    cells: Vec<i64>,
    shape: [usize; 2],
) -> PyResult<Cells<'py>> {
    let vectors = [points.len(), 3];
    Ok((
        shaped(py, points.into_flattened(), &vectors)?,
        shaped(py, normals.into_flattened(), &vectors)?,
        shaped(py, cells, &shape)?,
    ))
}

pub fn sensor_grid<'py>(
    py: Python<'py>,
    scene: &SceneData,
    spacing: f64,
    orientation: &Orientation,
) -> PyResult<Cells<'py>> {
    let found = py.detach(|| Sensors::on_grid((scene.bvh(), &|_| None), spacing, orientation));
    let sensors = found.map_err(failed)?;
    let local = scene.local();
    let points = sensors.points.iter().map(|&point| local.world(point));
    let points = memory::collected(points, sensors.points.len(), "sensors")?;
    let Layout::Grid(grid) = &sensors.layout else {
        return Err(PyValueError::new_err("the sensors have no grid"));
    };
    let mut numbers = memory::filled(-1, grid.width * grid.height, "cells")?;
    for (sensor, &cell) in (0..).zip(&grid.cells) {
        numbers[cell as usize] = sensor;
    }
    let shape = [grid.height, grid.width];
    cells(py, points, sensors.normals, numbers, shape)
}

/// Bytes that an atlas takes for each vertex while it is made: a copy of the mesh, and sums of normals.
const ATLAS: usize = 64;

/// Points in the middle of the texels of a square texture over a mesh.
///
/// Texture coordinates run from 0 to 1, v upwards from the last row. The first triangle that covers the middle of a texel has it.
///
/// Parameters
/// ----------
/// vertices : array (n, 3)
/// faces : array (m, 3) of integers
/// uvs : array (n, 2)
///     Texture coordinates of the vertices. Triangles with one that is not finite are left out.
/// size : int
///     Texels of a row, and number of rows: 1 to 16384.
/// normals : array (n, 3), optional
///     Normals of the vertices. Without them, the normals of the triangles around a vertex are mixed by their area.
///
/// Returns
/// -------
/// points : float64 of shape (k, 3)
///     Points on the mesh.
/// normals : float32 of shape (k, 3)
///     Normals there, of any length.
/// texels : int64 of shape (size, size)
///     Number of the point of each texel, -1 where no triangle is.
///
/// Raises
/// ------
/// IndexError
///     A face names a vertex that is not there.
/// ValueError
///     No texel is covered, or an argument has another shape.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> corners, uvs = [[0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 0], [1, 0], [0, 1]]
/// >>> points, normals, texels = am.texel_atlas(corners, [[0, 1, 2]], uvs, 2)
/// >>> texels
/// array([[ 0, -1],
///        [ 1,  2]])
#[pyfunction]
#[pyo3(signature = (vertices, faces, uvs, size, normals=None))]
pub fn texel_atlas<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
    uvs: &Bound<'py, PyAny>,
    size: u32,
    normals: Option<&Bound<'py, PyAny>>,
) -> PyResult<Cells<'py>> {
    if !(1..=16384).contains(&size) {
        let text = format!("size: found {size}, wanted 1 to 16384");
        return Err(PyValueError::new_err(text));
    }
    let vertices = Numbers::read(vertices, "vertices", 3)?;
    let count = vertices.rows()?;
    let faces = read_faces(faces, "faces", count)?;
    let uvs = Numbers::read(uvs, "uvs", 2)?;
    if uvs.lead(2) != [count] {
        return Err(wrong_shape("uvs", uvs.shape(), &format!("({count}, 2)")));
    }
    let normals = match normals {
        None => Vec::new(),
        Some(normals) => {
            let normals = Numbers::read(normals, "normals", 3)?;
            if normals.rows()? != count {
                let wanted = format!("({count}, 3)");
                return Err(wrong_shape("normals", normals.shape(), &wanted));
            }
            vectors(&normals, &[count])?
        }
    };
    let corners = Operand::new(&vertices, 3, &[count]);
    // Near the first vertex, single precision is good enough on maps, too.
    let first = if count > 0 {
        corners.vector(0)
    } else {
        [0.0; 3]
    };
    let near = |place| {
        let corner = corners.vector(place);
        [0, 1, 2].map(|axis| (corner[axis] - first[axis]) as f32)
    };
    let positions = memory::collected((0..count).map(near), count, "vertices")?;
    let coordinates = Operand::new(&uvs, 2, &[count]);
    let uv = |place| coordinates.pair(place).map(|x| x as f32);
    let uvs = memory::collected((0..count).map(uv), count, "texture coordinates")?;
    memory::check(count, ATLAS, "vertices of an atlas")?;
    let atlas = py.detach(|| {
        let mut mesh = Mesh::default();
        mesh.push((&positions, &faces), &normals, &uvs, false);
        Atlas::new(&mesh, size)
    });
    let atlas = atlas.map_err(failed)?;
    let texels = atlas
        .texels()
        .map(|point| point.map_or(-1, |point| point as i64));
    let texels = memory::collected(texels, size as usize * size as usize, "texels")?;
    let far = |point: &[f32; 3]| [0, 1, 2].map(|axis| first[axis] + f64::from(point[axis]));
    let points = atlas.points.iter().map(far);
    let points = memory::collected(points, atlas.points.len(), "points")?;
    cells(py, points, atlas.normals, texels, [size as usize; 2])
}

/// Which of (n, 3) points see which others, or which others of the same.
pub fn visibility(
    py: Python<'_>,
    scene: &SceneData,
    from: &Bound<'_, PyAny>,
    to: Option<&Bound<'_, PyAny>>,
    margin: Option<f32>,
    call: &mut Call<'_>,
) -> PyResult<BitMatrix> {
    let points = |object: &Bound<'_, PyAny>, name| {
        let numbers = Numbers::read(object, name, 3)?;
        numbers.rows()?;
        scene.local_points(&numbers)
    };
    let from = points(from, "a")?;
    let seen = match to {
        Some(to) => {
            let to = points(to, "b")?;
            done(py, call, |signals| {
                antumbra_bake::sees_points(scene.bvh(), &from, &to, margin, signals)
            })?
        }
        None => done(py, call, |signals| {
            let all = 0..from.len();
            antumbra_bake::sees_each_other(scene.bvh(), &from, all, margin, signals)
        })?,
    };
    Ok(seen.into())
}

/// Directions and what each counts.
type Weighted<'py> = (Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArray1<f64>>);

/// Azimuths, elevations and directions.
type Suns<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArrayDyn<f64>>,
);

/// Directions to the middles of the patches of the sky, and their solid angles.
///
/// Parameters
/// ----------
/// patches : int
///     145 (Tregenza), 577 or 2305 (Reinhart). With ``uniform``, any number of patches of one size.
/// uniform : bool
///     Whether all patches have one size.
/// up : "z" or "y"
///     Axis that points up. North is y where z is up, and -z where y is up.
/// north : float
///     Angle from the scene's north to true north in degrees, clockwise seen from above.
///
/// Returns
/// -------
/// directions : float64 of shape (patches, 3)
///     From the horizon up, in each row clockwise from north. The last one is the zenith.
/// solid_angles : float64 of shape (patches,)
///     Their sum is 2 pi.
///
/// Raises
/// ------
/// ValueError
///     An argument is outside its range, or has another shape.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> directions, solid_angles = am.sky_patches(145)
/// >>> directions.shape, round(float(solid_angles.sum()), 6)
/// ((145, 3), 6.283185)
#[pyfunction]
#[pyo3(signature = (patches=145, *, uniform=false, up="z", north=0.0))]
pub fn sky_patches<'py>(
    py: Python<'py>,
    patches: u32,
    uniform: bool,
    up: &str,
    north: f64,
) -> PyResult<Weighted<'py>> {
    let (sky, orientation) = (sky(patches, uniform)?, orientation(up, north)?);
    let centres: Vec<f64> = (sky.centres.iter())
        .flat_map(|&centre| orientation.scene(centre))
        .collect();
    let directions = shaped(py, centres, &[sky.len(), 3])?;
    Ok((directions, PyArray1::from_vec(py, sky.solid_angles)))
}

/// Azimuth and elevation in degrees, and directions, of Unix times.
#[pyfunction]
#[pyo3(name = "_sun_positions")]
#[allow(clippy::too_many_arguments)]
pub fn sun_positions<'py>(
    py: Python<'py>,
    latitude: f64,
    longitude: f64,
    height: f64,
    times: Vec<f64>,
    refraction: bool,
    up: &str,
    north: f64,
) -> PyResult<Suns<'py>> {
    let orientation = orientation(up, north)?;
    let place = Place {
        latitude,
        longitude,
        height,
    };
    let refraction = match refraction {
        true => Refraction::Standard,
        false => Refraction::None,
    };
    let found = py.detach(|| antumbra_bake::sun_positions(&place, refraction, &times));
    let found = found.map_err(failed)?;
    let directions =
        (found.iter()).flat_map(|sun| orientation.direction(sun.azimuth, sun.elevation));
    let directions = directions.collect();
    Ok((
        PyArray1::from_iter(py, found.iter().map(|sun| sun.azimuth)),
        PyArray1::from_iter(py, found.iter().map(|sun| sun.elevation)),
        shaped(py, directions, &[found.len(), 3])?,
    ))
}
