//! Colours: conversion of RGB, XYZ, sampled spectra and black bodies to linear RGB.
//!
//! Spectra are converted through CIE XYZ, as by pbrt-v3 compiled for RGB. The colour matching functions are the
//! multi-lobe fit of Wyman, Sloan and Shirley (2013, "Simple Analytic Approximations to the CIE XYZ Color Matching
//! Functions"), within about 1 % of the 1931 tables of pbrt-v3.

use antumbra_scene::Rgb;
use glam::{DVec3, Vec3};

use crate::named_spectra::{self, Named};
use crate::number::parse_float;
use crate::params::{Param, ParamType, Values};
use crate::report::Report;
use crate::source::read_regular_file;

/// Shortest wavelength of pbrt-v3's integrals in nanometres. Steps are 1 nm.
const FIRST_NM: u32 = 360;
const LAST_NM: u32 = 830;

/// Kind of object that a spectrum belongs to.
#[derive(Clone, Copy)]
enum Of {
    /// A surface or an interface, in pbrt-v4 seen under daylight: an even spectrum is grey.
    Surface,
    /// A light. In pbrt-v4, spectra give colours of luminance 1.
    Light,
}

/// Reads a colour parameter as linear RGB. `None`: a mistake was reported.
pub(crate) fn read(param: &Param, report: &mut Report) -> Option<Rgb> {
    read_as(param, Of::Surface, report)
}

/// Reads the colour of a light as linear RGB. `None`: a mistake was reported.
pub(crate) fn read_emission(param: &Param, report: &mut Report) -> Option<Rgb> {
    read_as(param, Of::Light, report)
}

fn read_as(param: &Param, of: Of, report: &mut Report) -> Option<Rgb> {
    let name = &param.name;
    let color = match (&param.values, param.param_type) {
        (Values::Broken, _) => return None,
        (Values::Strings(files), _) => of_file(param, files, of, report)?,
        (Values::Floats(values), _) if values.iter().any(|v| !v.is_finite()) => {
            return report.fail(param.list, format!("{name:?} must be finite"));
        }
        (Values::Floats(values), ParamType::Spectrum) if !values.is_empty() => {
            let pairs = values.chunks_exact(2);
            let samples = pairs.map(|p| [f64::from(p[0]), f64::from(p[1])]);
            color_of(samples.collect(), of, report)
        }
        (Values::Floats(values), ParamType::Blackbody) => black_body(param, values, report)?,
        (Values::Floats(values), kind @ (ParamType::Rgb | ParamType::Xyz)) => match values[..] {
            [x, y, z] if kind == ParamType::Xyz => rgb_from_xyz(Vec3::new(x, y, z).as_dvec3()),
            [r, g, b] if r >= 0.0 && g >= 0.0 && b >= 0.0 => match report.color_space {
                None => return Some(Rgb::new(r, g, b)),
                Some(space) => space * Vec3::new(r, g, b).as_dvec3(),
            },
            [r, g, b] => {
                let message = format!("{name:?} must not be negative, found {r} {g} {b}");
                return report.fail(param.list, message);
            }
            _ => return wrong_count(param, "three values", report),
        },
        _ => return wrong_count(param, "values", report),
    };
    if color.min_element() < 0.0 {
        let message = format!("{name:?} lies outside of RGB, its negative components are set to 0");
        report.note(param.declaration, message);
    }
    let color = color.max(DVec3::ZERO).as_vec3();
    if !color.is_finite() {
        return report.fail(param.list, format!("{name:?} overflows"));
    }
    Some(color)
}

/// Colour of a spectrum on an object.
fn color_of(samples: Vec<[f64; 2]>, of: Of, report: &Report) -> DVec3 {
    match of {
        _ if !report.is_version4 => from_samples(samples),
        Of::Surface => of_surface(samples),
        Of::Light => at_luminance_1(from_samples(samples)),
    }
}

/// Colour of a named spectrum, or of one in a file. `None`: a mistake was reported.
fn of_file(param: &Param, files: &[String], of: Of, report: &mut Report) -> Option<DVec3> {
    let name = &param.name;
    let [file] = files else {
        let message = format!("{name:?} takes one file, found {}", files.len());
        return report.fail(param.list, message);
    };
    let named = match report.is_version4 {
        true => named_spectra::find(file),
        false => None,
    };
    let samples = match named {
        Some(Named::Light(light)) => return Some(light),
        Some(Named::Samples(samples)) => samples,
        // Glasses have one index for all wavelengths.
        Some(Named::Index(index)) => vec![[f64::from(FIRST_NM), index]],
        None => match read_spd(file, report) {
            Ok(samples) => samples,
            Err(message) => {
                let message = format!("cannot read spectrum {file:?}: {message}");
                let help = format!("without the file, write it as \"rgb {name}\"");
                return report.fail_help(param.value, message, help);
            }
        },
    };
    Some(color_of(samples, of, report))
}

/// Colour of a black body: of luminance 1 in pbrt-v4, times a scale in pbrt-v3. `None`: a mistake was reported.
fn black_body(param: &Param, values: &[f32], report: &mut Report) -> Option<DVec3> {
    let is_version4 = report.is_version4;
    match *values {
        [kelvin] if kelvin > 0.0 && is_version4 => {
            Some(at_luminance_1(from_black_body(kelvin.into())))
        }
        [kelvin, scale] if kelvin > 0.0 && !is_version4 => {
            Some(from_black_body(kelvin.into()) * f64::from(scale))
        }
        [kelvin] | [kelvin, _] if !(kelvin > 0.0) => {
            let message = format!("temperature {kelvin} of {:?} must be positive", param.name);
            report.fail(param.value, message)
        }
        _ if is_version4 => wrong_count(param, "one temperature", report),
        _ => wrong_count(param, "a temperature and a scale", report),
    }
}

fn wrong_count<T>(param: &Param, takes: &str, report: &mut Report) -> Option<T> {
    let message = format!(
        "{:?} takes {takes}, found {} values",
        param.name,
        param.values.len()
    );
    report.fail(param.list, message)
}

/// Converts XYZ to linear RGB with the primaries of sRGB and BT.709, by the matrix of pbrt-v3.
fn rgb_from_xyz(xyz: DVec3) -> DVec3 {
    DVec3::new(
        xyz.dot(DVec3::new(3.240479, -1.537150, -0.498535)),
        xyz.dot(DVec3::new(-0.969256, 1.875991, 0.041556)),
        xyz.dot(DVec3::new(0.055648, -0.204043, 1.057311)),
    )
}

/// Colour matching functions at a wavelength in nanometres.
fn matching(nm: f64) -> DVec3 {
    let lobe = |height: f64, center: f64, left: f64, right: f64| {
        let t = (nm - center) / if nm < center { left } else { right };
        height * (-0.5 * t * t).exp()
    };
    DVec3::new(
        lobe(1.056, 599.8, 37.9, 31.0)
            + lobe(0.362, 442.0, 16.0, 26.7)
            + lobe(-0.065, 501.1, 20.4, 26.2),
        lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
        lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
    )
}

/// Linear RGB of a spectrum, integrated against the colour matching functions.
fn rgb_from_spectrum(value_at: impl Fn(f64) -> f64) -> DVec3 {
    let mut xyz = DVec3::ZERO;
    let mut y_integral = 0.0;
    for nm in FIRST_NM..=LAST_NM {
        let nm = f64::from(nm);
        let weight = matching(nm);
        xyz += weight * value_at(nm);
        y_integral += weight.y;
    }
    // pbrt-v3 divides the length of the interval by the number of samples instead of the number of steps.
    let steps_over_samples = f64::from(LAST_NM - FIRST_NM) / f64::from(LAST_NM - FIRST_NM + 1);
    rgb_from_xyz(xyz * (steps_over_samples / y_integral))
}

/// Linear RGB of a spectrum given as `[wavelength, value]` pairs in any order.
///
/// Values are interpolated linearly between the wavelengths, and constant outside.
fn from_samples(samples: Vec<[f64; 2]>) -> DVec3 {
    rgb_from_spectrum(interpolated(samples))
}

/// Value by wavelength, see [`from_samples`].
pub(crate) fn interpolated(mut samples: Vec<[f64; 2]>) -> impl Fn(f64) -> f64 {
    samples.sort_by(|a, b| a[0].total_cmp(&b[0]));
    move |nm: f64| {
        let after = samples.partition_point(|[wavelength, _]| *wavelength <= nm);
        match (after.checked_sub(1).map(|i| samples[i]), samples.get(after)) {
            (Some([w0, v0]), Some([w1, v1])) => v0 + (v1 - v0) * (nm - w0) / (w1 - w0),
            (Some([_, value]), None) => value,
            (None, Some([_, value])) => *value,
            (None, None) => 0.0,
        }
    }
}

/// Linear RGB of a surface with this spectrum under daylight (CIE D65), where an even spectrum of value 1 is white.
pub(crate) fn of_surface(samples: Vec<[f64; 2]>) -> DVec3 {
    let value_at = interpolated(samples);
    let under = |value_at: &dyn Fn(f64) -> f64| {
        rgb_from_spectrum(|nm| value_at(nm) * named_spectra::daylight(nm))
    };
    under(&value_at) / under(&|_| 1.0)
}

/// Colour with luminance 1. Black stays black.
fn at_luminance_1(color: DVec3) -> DVec3 {
    let luminance = color.dot(DVec3::new(0.212671, 0.715160, 0.072169));
    if luminance > 0.0 {
        color / luminance
    } else {
        color
    }
}

/// Linear RGB of a chromaticity with luminance 1.
pub(crate) fn from_chromaticity([x, y]: [f64; 2]) -> DVec3 {
    rgb_from_xyz(DVec3::new(x / y, 1.0, (1.0 - x - y) / y))
}

/// Linear RGB of a black body: Planck's law divided by its maximum, as in pbrt-v3.
fn from_black_body(kelvin: f64) -> DVec3 {
    const WIEN: f64 = 2.897_772_1e-3;
    let peak = planck(WIEN / kelvin, kelvin);
    rgb_from_spectrum(|nm| planck(nm * 1e-9, kelvin) / peak)
}

/// Emitted radiance per wavelength in metres, up to a constant factor.
fn planck(wavelength: f64, kelvin: f64) -> f64 {
    const LIGHT_SPEED: f64 = 299_792_458.0;
    const PLANCK: f64 = 6.626_069_57e-34;
    const BOLTZMANN: f64 = 1.380_648_8e-23;
    let exponent = PLANCK * LIGHT_SPEED / (wavelength * BOLTZMANN * kelvin);
    wavelength.powi(-5) / exponent.exp_m1()
}

/// Reads an SPD file: pairs of numbers, comments from `#` to the end of the line.
fn read_spd(name: &str, report: &mut Report) -> Result<Vec<[f64; 2]>, String> {
    const LIMIT: u64 = 1 << 24;
    let path = report.sources.folder.join(name);
    let bytes = read_regular_file(&path, LIMIT).map_err(|error| error.to_string())?;
    report.sources.note(path);
    let mut values = Vec::new();
    for (index, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let line = line.split(|b| *b == b'#').next().unwrap_or_default();
        for word in line
            .split(u8::is_ascii_whitespace)
            .filter(|w| !w.is_empty())
        {
            match parse_float(word) {
                Ok(value) if value.is_finite() => values.push(value),
                _ => {
                    let shown = crate::params::shorten(&String::from_utf8_lossy(word));
                    return Err(format!("line {}: {shown} is not a number", index + 1));
                }
            }
        }
    }
    if values.is_empty() || !values.len().is_multiple_of(2) {
        return Err(format!(
            "the file has {} numbers; pairs of wavelength and value are needed",
            values.len()
        ));
    }
    Ok(values
        .chunks_exact(2)
        .map(|pair| [pair[0], pair[1]])
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_spectrum_is_white_with_the_luminance_of_its_value() {
        let rgb = from_samples(vec![[400.0, 2.0]]);
        let luminance = rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722));
        assert!((luminance - 2.0 * 470.0 / 471.0).abs() < 0.01, "{rgb}");
        // Illuminant E is a little pink in sRGB.
        let pink = DVec3::new(1.2048, 0.9483, 0.9087) * 2.0;
        assert!((rgb - pink).abs().max_element() < 0.02, "{rgb}");
    }

    #[test]
    fn samples_are_sorted_interpolated_and_held_at_the_ends() {
        let ramp = from_samples(vec![[800.0, 1.0], [400.0, 0.0]]);
        let same = from_samples(
            (40..=80)
                .map(|i| {
                    let nm = f64::from(i) * 10.0;
                    [nm, (nm - 400.0) / 400.0]
                })
                .collect(),
        );
        assert!((ramp - same).length() < 1e-9);
    }

    #[test]
    fn black_bodies_go_from_red_to_blue() {
        let warm = from_black_body(2700.0);
        let cold = from_black_body(12000.0);
        assert!(warm.x > warm.y && warm.y > warm.z);
        assert!(cold.z > cold.x);
        // Near 6500 K the colour is close to the white of sRGB.
        let white = from_black_body(6500.0);
        let white = white / white.y;
        assert!((white - DVec3::ONE).abs().max_element() < 0.12, "{white}");
    }

    #[test]
    fn white_of_xyz_is_white_of_rgb() {
        let white = rgb_from_xyz(DVec3::new(0.950456, 1.0, 1.089058));
        assert!((white - DVec3::ONE).abs().max_element() < 1e-3);
    }
}
