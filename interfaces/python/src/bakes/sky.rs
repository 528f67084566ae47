//! The sky in patches, and which way is up.

use antumbra_bake::{Orientation, SkyDivision, SkyPatches, UpAxis, Weighting};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::shaped;
use crate::errors::failed;

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

/// Directions and what each counts.
type Weighted<'py> = (Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArray1<f64>>);

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
