//! The light of the sky by the all-weather model of Perez.
//!
//! Perez, Seals and Michalsky 1993, "All-weather model for sky luminance distribution" (Solar Energy 50, and the erratum in 51).
//! The relative luminance at the zenith angle ζ and the angle γ from the sun is
//! `(1 + a exp(b / cos ζ)) (1 + c exp(d γ) + e cos² γ)`. Five parameters depend on the zenith angle Z of the sun, the clearness ε
//! and the brightness Δ of the sky, through the coefficients of one of eight classes of ε.

use crate::orientation::Orientation;
use crate::sun::sky::SkyPatches;
use crate::vector::dot;
use crate::{Error, SunPosition};

/// What the sun and the sky shine at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Irradiance {
    /// Irradiance of a surface that faces the sun, from the sun only, in W/m².
    pub direct_normal: f64,
    /// Irradiance of level ground, from the sky only, in W/m².
    pub diffuse_horizontal: f64,
}

/// Upper ends of the classes of clearness; the last has none.
const CLASSES: [f64; 7] = [1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2];

/// Coefficients of each class: four of `a`, of `b`, `c`, `d` and `e` (table 1 of the paper).
const COEFFICIENTS: [[[f64; 4]; 5]; 8] = [
    [
        [1.3525, -0.2576, -0.2690, -1.4366],
        [-0.7670, 0.0007, 1.2734, -0.1233],
        [2.8000, 0.6004, 1.2375, 1.0000],
        [1.8734, 0.6297, 0.9738, 0.2809],
        [0.0356, -0.1246, -0.5718, 0.9938],
    ],
    [
        [-1.2219, -0.7730, 1.4148, 1.1016],
        [-0.2054, 0.0367, -3.9128, 0.9156],
        [6.9750, 0.1774, 6.4477, -0.1239],
        [-1.5798, -0.5081, -1.7812, 0.1080],
        [0.2624, 0.0672, -0.2190, -0.4285],
    ],
    [
        [-1.1000, -0.2515, 0.8952, 0.0156],
        [0.2782, -0.1812, -4.5000, 1.1766],
        [24.7219, -13.0812, -37.7000, 34.8438],
        [-5.0000, 1.5218, 3.9229, -2.6204],
        [-0.0156, 0.1597, 0.4199, -0.5562],
    ],
    [
        [-0.5484, -0.6654, -0.2672, 0.7117],
        [0.7234, -0.6219, -5.6812, 2.6297],
        [33.3389, -18.3000, -62.2500, 52.0781],
        [-3.5000, 0.0016, 1.1477, 0.1062],
        [0.4659, -0.3296, -0.0876, -0.0329],
    ],
    [
        [-0.6000, -0.3566, -2.5000, 2.3250],
        [0.2937, 0.0496, -5.6812, 1.8415],
        [21.0000, -4.7656, -21.5906, 7.2492],
        [-3.5000, -0.1554, 1.4062, 0.3988],
        [0.0032, 0.0766, -0.0656, -0.1294],
    ],
    [
        [-1.0156, -0.3670, 1.0078, 1.4051],
        [0.2875, -0.5328, -3.8500, 3.3750],
        [14.0000, -0.9999, -7.1406, 7.5469],
        [-3.4000, -0.1078, -1.0750, 1.5702],
        [-0.0672, 0.4016, 0.3017, -0.4844],
    ],
    [
        [-1.0000, 0.0211, 0.5025, -0.5119],
        [-0.3000, 0.1922, 0.7023, -1.6317],
        [19.0000, -5.0000, 1.2438, -1.9094],
        [-4.0000, 0.0250, 0.3844, 0.2656],
        [1.0468, -0.3788, -2.4517, 1.4656],
    ],
    [
        [-1.0500, 0.0289, 0.4260, 0.3590],
        [-0.3250, 0.1156, 0.7781, 0.0025],
        [31.0625, -14.5000, -46.1148, 55.3750],
        [-7.2312, 0.4050, 13.3500, 0.6234],
        [1.5000, -0.6426, 1.8564, 0.5636],
    ],
];

/// Irradiance of a surface that faces the sun above the air at the mean distance of the earth, in W/m², as Perez has it.
const SOLAR_CONSTANT: f64 = 1367.0;

/// Weight of the zenith angle in the clearness.
const KAPPA: f64 = 1.041;

/// Radiance of every patch of the sky in W/(m² sr), `[patches]`.
///
/// `day` is the day of the year, from 1. Radiances are scaled so that an open level surface receives `diffuse_horizontal`. While
/// the sun is at or below the horizon, the sky is even. The sun itself is not part of the sky.
///
/// # Errors
/// [`Error::Range`] if an irradiance is negative or not finite, or if an angle is not finite.
pub fn perez_sky(
    patches: &SkyPatches,
    sun: &SunPosition,
    day: u32,
    irradiance: &Irradiance,
) -> Result<Vec<f64>, Error> {
    let Irradiance {
        direct_normal,
        diffuse_horizontal,
    } = *irradiance;
    for (what, found) in [
        ("direct normal irradiance", direct_normal),
        ("diffuse horizontal irradiance", diffuse_horizontal),
        ("elevation of the sun", sun.elevation + 90.0),
        ("azimuth of the sun", sun.azimuth.abs()),
    ] {
        let is_in = found >= 0.0 && found.is_finite();
        let wanted = "a finite number, and no irradiance below 0";
        Error::check_range(what, found, is_in, wanted)?;
    }
    if diffuse_horizontal == 0.0 || patches.is_empty() {
        return Ok(vec![0.0; patches.len()]);
    }
    let relative = match Parameters::new(sun.elevation, day, irradiance) {
        None => vec![1.0; patches.len()],
        Some(parameters) => {
            let sun = Orientation::default().direction(sun.azimuth, sun.elevation);
            let luminance = |&centre: &[f64; 3]| parameters.luminance(centre, sun);
            patches.centres.iter().map(luminance).collect()
        }
    };
    let level = patches.cosine_weights([0.0, 0.0, 1.0]);
    let sum: f64 = relative.iter().zip(&level).map(|(l, w)| l * w).sum();
    let scale = diffuse_horizontal / sum;
    if !(scale > 0.0 && scale.is_finite()) {
        let even = diffuse_horizontal / level.iter().sum::<f64>();
        return Ok(vec![even; patches.len()]);
    }
    Ok(relative.iter().map(|l| l * scale).collect())
}

/// The five parameters of the luminance.
struct Parameters([f64; 5]);

impl Parameters {
    /// `None` if the sun is not above the horizon.
    fn new(elevation: f64, day: u32, irradiance: &Irradiance) -> Option<Self> {
        if !(elevation > 0.0) {
            return None;
        }
        let degrees = 90.0 - elevation;
        let zenith = degrees.to_radians();
        let diffuse = irradiance.diffuse_horizontal;
        let low = KAPPA * zenith.powi(3);
        let clearness = (1.0 + irradiance.direct_normal / diffuse + low) / (1.0 + low);
        // Relative air mass (Kasten and Young 1989).
        let depth = 0.50572 * libm::pow(96.07995 - degrees, -1.6364);
        let air_mass = 1.0 / (libm::cos(zenith) + depth);
        let brightness = diffuse * air_mass / (SOLAR_CONSTANT * distance_factor(day));
        // The erratum: the polynomials of these classes go astray below 0.2.
        let brightness = match clearness > 1.065 && clearness < 2.8 {
            true => brightness.max(0.2),
            false => brightness,
        };
        let class = CLASSES.iter().take_while(|&&end| clearness >= end).count();
        let coefficients = &COEFFICIENTS[class];
        let mut parameters = coefficients.map(|[one, two, three, four]| {
            one + two * zenith + brightness * (three + four * zenith)
        });
        if class == 0 {
            let [_, _, c, d, _] = coefficients;
            let power = libm::pow(brightness * (c[0] + c[1] * zenith), c[2]);
            parameters[2] = libm::exp(power) - c[3];
            parameters[3] =
                -libm::exp(brightness * (d[0] + d[1] * zenith)) + d[2] + brightness * d[3];
        }
        Some(Self(parameters))
    }

    /// Relative luminance in a direction, not below 0.
    fn luminance(&self, direction: [f64; 3], sun: [f64; 3]) -> f64 {
        let [a, b, c, d, e] = self.0;
        let cosine = dot(direction, sun).clamp(-1.0, 1.0);
        let gradation = 1.0 + a * libm::exp(b / direction[2].max(0.01));
        let scattering = 1.0 + c * libm::exp(d * libm::acos(cosine)) + e * cosine * cosine;
        (gradation * scattering).max(0.0)
    }
}

/// Square of the mean distance of the earth over that on a day (Spencer 1971).
fn distance_factor(day: u32) -> f64 {
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * (f64::from(day) - 1.0) / 365.0);
    // Of the double angle.
    let (sin2, cos2) = (2.0 * sin * cos, cos * cos - sin * sin);
    1.00011 + 0.034221 * cos + 0.00128 * sin + 0.000719 * cos2 + 0.000077 * sin2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SkyDivision;

    fn sky(elevation: f64, direct_normal: f64, diffuse_horizontal: f64) -> (SkyPatches, Vec<f64>) {
        let patches = SkyDivision::Reinhart(2).patches().expect("patches");
        let sun = SunPosition {
            azimuth: 180.0,
            elevation,
        };
        let irradiance = Irradiance {
            direct_normal,
            diffuse_horizontal,
        };
        let sky = perez_sky(&patches, &sun, 172, &irradiance).expect("a sky");
        (patches, sky)
    }

    /// Radiance of the patch nearest to a place.
    fn at((patches, sky): &(SkyPatches, Vec<f64>), azimuth: f64, elevation: f64) -> f64 {
        let to = Orientation::default().direction(azimuth, elevation);
        let near = |i: &usize, j: &usize| {
            dot(patches.centres[*i], to).total_cmp(&dot(patches.centres[*j], to))
        };
        sky[(0..patches.len()).max_by(near).expect("a patch")]
    }

    #[test]
    fn level_ground_receives_what_was_measured() {
        for elevation in [-5.0, 0.0, 0.5, 10.0, 45.0, 89.0, 90.0] {
            for (direct, diffuse) in [(0.0, 100.0), (5.0, 150.0), (300.0, 200.0), (900.0, 60.0)] {
                let (patches, sky) = sky(elevation, direct, diffuse);
                let weights = patches.cosine_weights([0.0, 0.0, 1.0]);
                let sum: f64 = sky.iter().zip(weights).map(|(l, w)| l * w).sum();
                assert!(
                    (sum / diffuse - 1.0).abs() < 1e-12,
                    "{elevation} {direct} {sum}"
                );
                assert!(sky.iter().all(|l| l.is_finite() && *l >= 0.0));
            }
        }
        let (_, dark) = sky(45.0, 0.0, 0.0);
        assert!(dark.iter().all(|&l| l == 0.0));
    }

    #[test]
    fn clear_skies_are_bright_at_the_sun_and_dull_ones_overhead() {
        let clear = sky(40.0, 850.0, 80.0);
        let aureole = at(&clear, 180.0, 40.0);
        assert!(
            aureole > 8.0 * at(&clear, 0.0, 50.0),
            "the other side is dark"
        );
        assert!(
            at(&clear, 0.0, 5.0) > 1.5 * at(&clear, 0.0, 50.0),
            "and its horizon bright"
        );
        let dull = sky(60.0, 0.0, 300.0);
        let ratio = at(&dull, 0.0, 90.0) / at(&dull, 0.0, 3.0);
        assert!(
            ratio > 2.0 && ratio < 3.5,
            "towards 3, as of the sky of the CIE: {ratio}"
        );
    }

    #[test]
    fn measurements_that_cannot_be_are_refused() {
        let patches = SkyDivision::Tregenza.patches().expect("patches");
        for (direct_normal, diffuse_horizontal) in [(-1.0, 5.0), (5.0, -1.0), (f64::NAN, 5.0)] {
            let irradiance = Irradiance {
                direct_normal,
                diffuse_horizontal,
            };
            assert!(perez_sky(&patches, &SunPosition::default(), 1, &irradiance).is_err());
        }
    }
}
