//! Warps of the unit square: points of a disk, a hemisphere, a sphere or a triangle for a pair of random values.

use std::f32::consts::{FRAC_PI_4, PI};

use glam::Vec3;

/// Uniform point of the unit disk (Shirley and Chiu 1997, the concentric map).
#[inline]
pub fn disk([u, v]: [f32; 2]) -> [f32; 2] {
    let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if x == 0.0 && y == 0.0 {
        return [0.0, 0.0];
    }
    let across = x.abs() > y.abs();
    let (radius, other) = if across { (x, y) } else { (y, x) };
    let (sin, cos) = sin_cos_of_eighth(FRAC_PI_4 * (other / radius));
    // On the other half the angle is a quarter turn minus this one.
    if across {
        [radius * cos, radius * sin]
    } else {
        [radius * sin, radius * cos]
    }
}

/// Sine and cosine of an angle of at most an eighth of a turn either way, to 10⁻⁷, with equal bits on every machine.
///
/// Series suffice, since larger angles do not occur.
#[inline]
fn sin_cos_of_eighth(angle: f32) -> (f32, f32) {
    let square = angle * angle;
    let sin = [1.0 / 362_880.0, -1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0, 1.0];
    let cos = [1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0, -0.5, 1.0];
    let series = |terms: [f32; 5]| terms.into_iter().fold(0.0, |sum, term| sum * square + term);
    (angle * series(sin), series(cos))
}

/// Direction of the upper hemisphere with density `cos / π`.
#[inline]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let [x, y] = disk(u);
    Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// Direction of the upper hemisphere with density `1 / 2π`.
#[inline]
pub fn uniform_hemisphere([u, v]: [f32; 2]) -> Vec3 {
    around_z(u, (1.0 - u * u).max(0.0).sqrt(), v)
}

/// Direction of the whole sphere with density `1 / 4π`.
pub fn uniform_sphere([u, v]: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u;
    around_z(z, (1.0 - z * z).max(0.0).sqrt(), v)
}

/// Direction of height `cos` (with matching `sin`), turned by the fraction `turn` of a circle.
#[inline]
pub fn around_z(cos: f32, sin: f32, turn: f32) -> Vec3 {
    let (sin_phi, cos_phi) = libm::sincosf(2.0 * PI * turn);
    Vec3::new(sin * cos_phi, sin * sin_phi, cos)
}

/// Barycentric weights of the first two vertices of a triangle for a uniformly chosen point.
#[inline]
pub fn triangle([u, v]: [f32; 2]) -> [f32; 2] {
    let root = u.sqrt();
    [1.0 - root, v * root]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Method, Sampler};

    fn points(count: u32) -> impl Iterator<Item = [f32; 2]> {
        let sampler = Sampler::new(Method::OwenSobol, 11);
        (0..count).map(move |i| sampler.stream(0, 0, i).pair(0))
    }

    /// Against double precision: a point some share of the way around a square goes to that share of the circle.
    #[test]
    fn the_disk_is_the_square_bent_round() {
        for step in -1000..=1000 {
            let angle = FRAC_PI_4 * step as f32 / 1000.0;
            let (sin, cos) = sin_cos_of_eighth(angle);
            assert!(
                (f64::from(sin) - f64::from(angle).sin()).abs() < 1e-7,
                "{angle}"
            );
            assert!(
                (f64::from(cos) - f64::from(angle).cos()).abs() < 1e-7,
                "{angle}"
            );
        }
        for u in points(4000) {
            let [x, y] = u.map(|u| 2.0 * f64::from(u) - 1.0);
            let turn = std::f64::consts::FRAC_PI_4;
            let (radius, angle) = if x.abs() > y.abs() {
                (x, turn * (y / x))
            } else {
                (y, 2.0 * turn - turn * (x / y))
            };
            let wanted = [radius * angle.cos(), radius * angle.sin()];
            let found = disk(u).map(f64::from);
            for axis in 0..2 {
                assert!((found[axis] - wanted[axis]).abs() < 3e-7, "{u:?}");
            }
        }
        assert_eq!(disk([0.5, 0.5]), [0.0, 0.0]);
    }

    /// The means of z and z² distinguish each density from the others.
    #[test]
    fn warps_have_their_densities() {
        let count = 4096;
        let moments = |warp: &dyn Fn([f32; 2]) -> Vec3| {
            let sum = points(count).map(warp).fold([0.0; 3], |[m, s, l], d| {
                [m + d.z, s + d.z * d.z, l + (d.length() - 1.0).abs()]
            });
            sum.map(|v| v / count as f32)
        };
        let near = |[m, s, l]: [f32; 3], mean: f32, square: f32| {
            assert!(l < 1e-5);
            assert!((m - mean).abs() < 2e-3, "{m} {mean}");
            assert!((s - square).abs() < 2e-3, "{s} {square}");
        };
        near(moments(&cosine_hemisphere), 2.0 / 3.0, 0.5);
        near(moments(&uniform_hemisphere), 0.5, 1.0 / 3.0);
        near(moments(&uniform_sphere), 0.0, 1.0 / 3.0);
        let centre = points(count)
            .map(triangle)
            .fold([0.0; 2], |[a, b], [x, y]| {
                assert!(x >= 0.0 && y >= 0.0 && x + y <= 1.0 + 1e-6);
                [a + x, b + y]
            });
        for c in centre {
            assert!((c / count as f32 - 1.0 / 3.0).abs() < 2e-3);
        }
    }
}
