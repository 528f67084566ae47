//! Scattering by hair: a rough dielectric cylinder with tilted scales that absorbs inside (Chiang, Bitterli, Tappan and
//! Burley 2016, *A Practical and Controllable Hair and Fur Model for Production Path Tracing*, as in pbrt-v3).
//!
//! The x axis of the frame points along the hair. Light is reflected (path 0), passes through (1), is reflected inside once
//! (2), or more often (the last). The offset across the hair is the texture coordinate v, as in pbrt-v3. The normal does
//! not matter: angles around the hair are measured from the viewer.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use super::fresnel::dielectric;
use super::{Evaluation, Scatter};
use crate::color::luminance;

/// Number of kinds of paths through the hair. The last stands for all that are longer.
const PATHS: usize = 4;

/// Least roughness.
const SMOOTHEST: f32 = 0.01;

/// Attenuation of hair per cross-section by eumelanin and pheomelanin of concentration 1.
const EUMELANIN: Vec3 = Vec3::new(0.419, 0.697, 1.37);
const PHEOMELANIN: Vec3 = Vec3::new(0.187, 0.4, 1.05);

/// A hair, as one point of it scatters.
#[derive(Clone, Copy, Debug)]
pub struct Hair {
    scale: Vec3,
    eta: f32,
    /// Offset of the point from the axis as the viewer sees it, -1..=1 from side to side.
    offset: f32,
    /// Absorption coefficient, per radius of the hair.
    absorption: Vec3,
    /// Variance along the hair of every path.
    variances: [f32; PATHS],
    /// Scale of the logistic distribution around the hair.
    spread: f32,
    /// Sine and cosine of the tilt of every path.
    tilts: [[f32; 2]; PATHS],
}

/// Terms that depend on the viewer only.
struct Viewed {
    sin: f32,
    cos: f32,
    /// Angle around the hair.
    phi: f32,
    /// Angle between normal and viewer across the hair, outside and inside.
    gamma: [f32; 2],
    attenuation: [Vec3; PATHS],
}

impl Hair {
    /// Hair by its index of refraction, the absorption coefficient per radius, the roughness along and around, both
    /// 0..=1, and the tilt of the scales in degrees; at an offset from the axis, -1..=1.
    pub fn new(
        eta: f32,
        absorption: Vec3,
        [along, around]: [f32; 2],
        tilt: f32,
        offset: f32,
    ) -> Self {
        let [m, n] = [along, around].map(|beta| beta.clamp(SMOOTHEST, 1.0));
        let deviation = 0.726 * m + 0.812 * m * m + 3.7 * m.powi(20);
        let v = deviation * deviation;
        let tilt = f64::from(tilt).to_radians();
        let tilts = [-2.0, 1.0, 4.0, 0.0].map(|factor: f64| {
            let angle = factor * tilt;
            [libm::sin(angle) as f32, libm::cos(angle) as f32]
        });
        Self {
            scale: Vec3::ONE,
            eta,
            offset: offset.clamp(-1.0, 1.0),
            absorption: absorption.max(Vec3::ZERO),
            variances: [v, 0.25 * v, 4.0 * v, 4.0 * v],
            spread: (PI / 8.0).sqrt() * (0.265 * n + 1.194 * n * n + 5.372 * n.powi(22)),
            tilts,
        }
    }

    fn viewed(&self, wo: Vec3) -> Viewed {
        let sin = wo.x.clamp(-1.0, 1.0);
        let cos = safe_root(1.0 - sin * sin).max(1e-6);
        let h = self.offset;
        let sin_inside = sin / self.eta;
        let cos_inside = safe_root(1.0 - sin_inside * sin_inside).max(1e-6);
        // Index of refraction across the hair (Marschner and others 2003).
        let eta_across = safe_root(self.eta * self.eta - sin * sin) / cos;
        let sin_gamma = (h / eta_across).clamp(-1.0, 1.0);
        let cos_gamma = safe_root(1.0 - sin_gamma * sin_gamma);
        let length = 2.0 * cos_gamma / cos_inside;
        let passed = Vec3::from((-self.absorption * length).to_array().map(libm::expf));
        let reflected = dielectric(cos * safe_root(1.0 - h * h), self.eta);
        let entering = (1.0 - reflected) * (1.0 - reflected);
        let second = passed * passed * (entering * reflected);
        let rest =
            second * passed * reflected / (Vec3::ONE - passed * reflected).max(Vec3::splat(1e-6));
        let attenuation = [Vec3::splat(reflected), passed * entering, second, rest];
        Viewed {
            sin,
            cos,
            phi: libm::atan2f(wo.z, wo.y),
            gamma: [libm::asinf(h), libm::asinf(sin_gamma)],
            attenuation,
        }
    }

    /// Sine and cosine of the viewer's angle along the hair, tilted for a path.
    fn tilted(&self, path: usize, viewed: &Viewed) -> [f32; 2] {
        let [sin, cos] = self.tilts[path];
        let tilted = viewed.cos * cos - viewed.sin * sin;
        [viewed.sin * cos + viewed.cos * sin, tilted.abs()]
    }
}

impl Scatter for Hair {
    fn is_black(&self) -> bool {
        self.scale == Vec3::ZERO
    }

    fn scale(&mut self, by: Vec3) {
        self.scale *= by;
    }

    fn is_of(&self, _: bool) -> bool {
        true
    }

    fn is_anisotropic(&self) -> bool {
        true
    }

    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.evaluate(wo, wi).value
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.evaluate(wo, wi).pdf
    }

    /// Value without the cosine, and density of [`Self::sample`].
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        let viewed = self.viewed(wo);
        let sin = wi.x.clamp(-1.0, 1.0);
        let cos = safe_root(1.0 - sin * sin);
        let turn = libm::atan2f(wi.z, wi.y) - viewed.phi;
        let chances = viewed.chances();
        let mut found = Evaluation::default();
        for path in 0..PATHS {
            let tilted = self.tilted(path, &viewed);
            let along = longitudinal([sin, cos], tilted, self.variances[path]);
            let around = match path + 1 < PATHS {
                true => logistic(wrapped(turn - viewed.turn(path)), self.spread),
                false => 1.0 / TAU,
            };
            found.value += viewed.attenuation[path] * (along * around);
            found.pdf += chances[path] * along * around;
        }
        found.value *= self.scale / wi.z.abs().max(1e-6);
        found
    }

    /// Direction drawn with the density of [`Self::evaluate`], by a choice of the path in `[0, 1)` and a place.
    fn sample(&self, wo: Vec3, choice: f32, [u, v]: [f32; 2]) -> Option<Vec3> {
        let viewed = self.viewed(wo);
        let (mut path, mut rest) = (0, choice);
        let chances = viewed.chances();
        while path + 1 < PATHS && rest >= chances[path] {
            rest -= chances[path];
            path += 1;
        }
        let rest = (rest / chances[path]).clamp(0.0, 1.0 - f32::EPSILON);
        let [sin_tilted, cos_tilted] = self.tilted(path, &viewed);
        let variance = self.variances[path];
        let u = u.max(1e-5);
        let cos = 1.0 + variance * libm::logf(u + (1.0 - u) * libm::expf(-2.0 / variance));
        let cos = cos.clamp(-1.0, 1.0);
        let sin_along =
            -cos * sin_tilted + safe_root(1.0 - cos * cos) * libm::cosf(TAU * v) * cos_tilted;
        let sin_along = sin_along.clamp(-1.0, 1.0);
        let turn = match path + 1 < PATHS {
            true => viewed.turn(path) + sample_logistic(rest, self.spread),
            false => TAU * rest,
        };
        let phi = viewed.phi + turn;
        let cos_along = safe_root(1.0 - sin_along * sin_along);
        let wi = Vec3::new(
            sin_along,
            cos_along * libm::cosf(phi),
            cos_along * libm::sinf(phi),
        );
        wi.is_finite().then_some(wi)
    }
}

impl Viewed {
    /// Probability with which a path is drawn.
    fn chances(&self) -> [f32; PATHS] {
        let shares = self.attenuation.map(luminance);
        let sum: f32 = shares.iter().sum();
        shares.map(|share| share / sum)
    }

    /// Angle by which smooth hair turns light of a path.
    fn turn(&self, path: usize) -> f32 {
        let [outside, inside] = self.gamma;
        2.0 * path as f32 * inside - 2.0 * outside + path as f32 * PI
    }
}

/// Absorption of hair by its concentrations of eumelanin and pheomelanin.
pub fn absorption_of_melanin([eumelanin, pheomelanin]: [f32; 2]) -> Vec3 {
    EUMELANIN * eumelanin.max(0.0) + PHEOMELANIN * pheomelanin.max(0.0)
}

/// Absorption of hair of which many together have this colour (Chiang and others 2016, equation 9).
pub fn absorption_of_color(color: Vec3, around: f32) -> Vec3 {
    let b = around;
    let fit = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
    let color = color.clamp(Vec3::splat(1e-4), Vec3::ONE);
    let root = Vec3::from(color.to_array().map(libm::logf)) / fit;
    root * root
}

/// Density along the hair (d'Eon and others 2011), for sine and cosine of both directions.
fn longitudinal([sin_i, cos_i]: [f32; 2], [sin_o, cos_o]: [f32; 2], variance: f32) -> f32 {
    let a = cos_i * cos_o / variance;
    let b = sin_i * sin_o / variance;
    if variance <= 0.1 {
        // The hyperbolic sine of a large number is half of its exponential.
        libm::expf(log_bessel(a) - b - 1.0 / variance) / variance
    } else {
        libm::expf(log_bessel(a) - b) / (libm::sinhf(1.0 / variance) * 2.0 * variance)
    }
}

/// Logarithm of the modified Bessel function of the first kind and order 0, for `x` of at least 0.
fn log_bessel(x: f32) -> f32 {
    if x > 12.0 {
        return x - 0.5 * libm::logf(TAU * x) + 1.0 / (8.0 * x);
    }
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..=24 {
        term *= quarter / (k * k) as f32;
        sum += term;
    }
    libm::logf(sum)
}

/// Logistic density on -π..=π.
fn logistic(x: f32, scale: f32) -> f32 {
    let tail = libm::expf(-x.abs() / scale);
    tail / (scale * (1.0 + tail) * (1.0 + tail)) / (1.0 - 2.0 * below(-PI, scale))
}

/// Share of the logistic distribution below `x`.
fn below(x: f32, scale: f32) -> f32 {
    1.0 / (1.0 + libm::expf(-x / scale))
}

/// Angle in -π..=π, drawn by the density [`logistic`].
fn sample_logistic(u: f32, scale: f32) -> f32 {
    let least = below(-PI, scale);
    let share = (u * (1.0 - 2.0 * least) + least).clamp(1e-7, 1.0 - 1e-7);
    (-scale * libm::logf(1.0 / share - 1.0)).clamp(-PI, PI)
}

/// Angle in -π..=π.
fn wrapped(angle: f32) -> f32 {
    angle - TAU * (angle / TAU).round()
}

fn safe_root(value: f32) -> f32 {
    value.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::Random;
    use crate::sampler::warp::uniform_sphere;

    /// Viewers of a cylinder whose normal is z, and the offset from the axis at which they see it.
    fn viewers() -> impl Iterator<Item = (Vec3, f32)> {
        [(0.1, 0.2), (0.5, -0.7), (-0.8, 0.95), (0.0, -0.3)]
            .into_iter()
            .map(|(x, h): (f32, f32)| {
                let across = (1.0 - x * x).sqrt();
                let wo = Vec3::new(x, -h * across, (1.0 - h * h).sqrt() * across);
                (wo, h)
            })
    }

    const SIDE: u32 = 400;
    const COUNT: u32 = SIDE * SIDE;

    /// Directions in all parts of the sphere.
    fn around() -> impl Iterator<Item = Vec3> {
        (0..COUNT).map(|index| {
            let place = [index % SIDE, index / SIDE];
            uniform_sphere(place.map(|place| (place as f32 + 0.5) / SIDE as f32))
        })
    }

    const ROUGHNESSES: [[f32; 2]; 4] = [[0.3, 0.3], [0.2, 0.9], [1.0, 0.4], [0.6, 1.0]];

    /// Hair that absorbs nothing scatters all light, and densities integrate to 1.
    #[test]
    fn white_hair_loses_nothing() {
        for roughness in ROUGHNESSES {
            for (wo, h) in viewers() {
                let hair = Hair::new(1.55, Vec3::ZERO, roughness, 0.0, h);
                let mut sums = [0.0_f64; 2];
                for wi in around() {
                    let found = hair.evaluate(wo, wi);
                    sums[0] += f64::from(found.value.x * wi.z.abs());
                    sums[1] += f64::from(found.pdf);
                }
                for sum in sums {
                    let whole = sum * 4.0 * std::f64::consts::PI / COUNT as f64;
                    assert!((whole - 1.0).abs() < 0.01, "{roughness:?} {wo}: {whole}");
                }
            }
        }
    }

    /// Means of a smooth function by drawn directions equal means by uniform ones.
    #[test]
    fn directions_are_drawn_with_their_density() {
        let weigh = |wi: Vec3| 1.0 + 0.5 * wi.x + 0.3 * wi.y * wi.z - 0.4 * wi.z;
        for roughness in ROUGHNESSES {
            let absorption = Vec3::new(0.2, 0.6, 1.5);
            for (wo, h) in viewers() {
                let hair = Hair::new(1.55, absorption, roughness, 2.0, h);
                let mut uniform = Vec3::ZERO;
                for wi in around() {
                    uniform += hair.evaluate(wo, wi).value * (wi.z.abs() * weigh(wi));
                }
                uniform *= 4.0 * PI / COUNT as f32;
                let count = 50_000;
                let mut drawn = Vec3::ZERO;
                for seed in 0..count {
                    let mut random = Random::new(seed);
                    let wi = hair.sample(wo, random.next(), random.pair()).unwrap();
                    let found = hair.evaluate(wo, wi);
                    assert!(
                        (wi.length() - 1.0).abs() < 1e-4 && found.pdf > 0.0,
                        "{wi} {found:?}"
                    );
                    drawn += found.value * (wi.z.abs() * weigh(wi) / found.pdf);
                }
                drawn /= count as f32;
                let difference = (drawn - uniform).abs().max_element();
                assert!(difference < 0.02, "{roughness:?} {wo}: {drawn} {uniform}");
            }
        }
    }

    /// Smooth hair reflects as a mirror does: the peak is where light is reflected at the normal.
    #[test]
    fn reflection_is_about_the_normal() {
        for (wo, h) in viewers().filter(|(wo, _)| wo.z > 0.4) {
            let hair = Hair::new(1.55, Vec3::splat(100.0), [0.1, 0.1], 0.0, h);
            let mirrored = Vec3::new(-wo.x, -wo.y, wo.z);
            let peak = hair.evaluate(wo, mirrored).value.x * mirrored.z;
            for turn in [Vec3::Y, -Vec3::Y, Vec3::X, -Vec3::X] {
                let near = (mirrored + turn * 0.1).normalize();
                assert!(
                    hair.evaluate(wo, near).value.x * near.z < peak,
                    "{wo} {turn}"
                );
            }
        }
    }

    /// A turn of the frame about the hair changes nothing: only the offset says where the hair is hit.
    #[test]
    fn normals_do_not_matter() {
        let hair = Hair::new(1.55, Vec3::splat(0.4), [0.3, 0.3], 2.0, -0.6);
        let turn = glam::Quat::from_rotation_x(2.1);
        for (wo, _) in viewers() {
            for wi in around().step_by(997) {
                let [found, turned] = [
                    hair.evaluate(wo, wi).value * wi.z.abs(),
                    hair.evaluate(turn * wo, turn * wi).value * (turn * wi).z.abs(),
                ];
                let difference = (found - turned).abs().max_element();
                assert!(difference < 1e-3 * (1.0 + found.max_element()), "{wo} {wi}");
            }
        }
    }

    #[test]
    fn colors_and_pigments_absorb() {
        assert_eq!(absorption_of_melanin([0.0, 0.0]), Vec3::ZERO);
        let brown = absorption_of_melanin([1.3, 0.0]);
        assert!(brown.x < brown.y && brown.y < brown.z);
        assert_eq!(absorption_of_color(Vec3::ONE, 0.3), Vec3::ZERO);
        let dark = absorption_of_color(Vec3::new(0.5, 0.1, 0.01), 0.3);
        assert!(dark.x < dark.y && dark.y < dark.z);
    }
}
