//! Positions of the sun, and steps of time.

use std::ffi::CString;

use antumbra_bake::{Irradiance, Moment, Place, Refraction, TimeStep};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;

use super::sky::orientation;
use crate::arrays::{Numbers, memory, shaped, wrong_shape};
use crate::errors::failed;

/// Directions of an argument of shape (k, 3).
pub fn directions(object: &Bound<'_, PyAny>, name: &'static str) -> PyResult<Vec<[f32; 3]>> {
    let numbers = Numbers::read(object, name, 3)?;
    match numbers.lead(3) {
        [_] => numbers.vectors(numbers.lead(3)),
        _ => Err(wrong_shape(name, numbers.shape(), "(k, 3)")),
    }
}

/// One number for each of so many steps, or one for all.
fn each_of(object: &Bound<'_, PyAny>, name: &'static str, count: usize) -> PyResult<Vec<f64>> {
    let numbers = Numbers::read(object, name, 1)?;
    match numbers.shape() {
        [1] => memory::filled(numbers.each(1)?[0], count, name),
        _ => numbers.each(count),
    }
}

/// Directions to the sun and lengths of steps: of positions, those by day, or of arrays.
#[pyfunction]
#[pyo3(name = "_suns")]
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

/// Azimuths, elevations and directions.
type Suns<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArrayDyn<f64>>,
);

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
