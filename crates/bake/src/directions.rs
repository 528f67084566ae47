//! Directions over a hemisphere, spread evenly and different at every point.
//!
//! Sample `i` is point `i` of the (0, 2)-sequence of Sobol', scrambled by exclusive or with two numbers of the point in
//! question (Kollig and Keller 2002, "Efficient multidimensional sampling"). Of each power of two of samples, every
//! interval of that many equal parts of either coordinate holds one. The numbers are a hash of the point, its normal and
//! the seed. So a point has the same directions in whatever list it stands, and vertices that are stored twice agree.

use crate::normals::cross;

/// How much each part of the sky counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Weighting {
    /// By the cosine of the angle to the normal, as a matt surface is lit by an even sky. Low parts count little.
    #[default]
    Cosine,
    /// By solid angle alone: all parts alike.
    Uniform,
}

/// Directions around one normal.
pub(crate) struct Directions {
    /// Two tangents and the normal.
    frame: [[f64; 3]; 3],
    scramble: [u32; 2],
}

impl Directions {
    /// Directions around a normal of length 1; `key` decides which of all sequences.
    pub fn new(normal: [f64; 3], key: u64) -> Self {
        // Crossed with the axis that is farthest from the normal, so that the length is not near 0.
        let axis = (0..3).fold(0, |least, axis| {
            if normal[axis].abs() < normal[least].abs() {
                axis
            } else {
                least
            }
        });
        let mut other = [0.0; 3];
        other[axis] = 1.0;
        let tangent = cross(normal, other);
        let length = tangent.iter().map(|x| x * x).sum::<f64>().sqrt();
        let tangent = tangent.map(|x| x / length);
        Self {
            frame: [tangent, cross(normal, tangent), normal],
            scramble: [key as u32, (key >> 32) as u32],
        }
    }

    /// Direction of sample `index`, of length 1 up to rounding, above the plane of the normal.
    pub fn get(&self, index: u32, weighting: Weighting) -> [f32; 3] {
        // Within [0, 1), because 32 bits fit a double.
        let [u, v] = [
            index.reverse_bits() ^ self.scramble[0],
            second_dimension(index) ^ self.scramble[1],
        ]
        .map(|bits| f64::from(bits) / 4_294_967_296.0);
        let z = match weighting {
            Weighting::Cosine => (1.0 - u).sqrt(),
            Weighting::Uniform => 1.0 - u,
        };
        let r = (1.0 - z * z).max(0.0).sqrt();
        // The system's own functions differ in their last bits.
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * v);
        let local = [r * cos, r * sin, z];
        std::array::from_fn(|axis| {
            let [s, t, n] = self.frame.map(|vector| vector[axis]);
            (local[0] * s + local[1] * t + local[2] * n) as f32
        })
    }
}

/// Second coordinate of the Sobol' sequence as a fraction of 2³²; the first is the index with its bits reversed.
fn second_dimension(index: u32) -> u32 {
    let (mut left, mut direction, mut sum) = (index, 1_u32 << 31, 0);
    while left != 0 {
        if left & 1 == 1 {
            sum ^= direction;
        }
        left >>= 1;
        direction ^= direction >> 1;
    }
    sum
}

/// Hash of a point with its normal. Zeros of either sign are the same.
pub(crate) fn key(seed: u64, point: &[f32; 3], normal: &[f32; 3]) -> u64 {
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    let mut state = mixed(seed.wrapping_add(STEP));
    for x in point.iter().chain(normal) {
        let bits = (x + 0.0).to_bits();
        state = mixed((state ^ u64::from(bits)).wrapping_add(STEP));
    }
    state
}

/// Output function of SplitMix64 (Steele, Lea and Flood 2014).
fn mixed(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normals::unit;

    #[test]
    fn every_elementary_interval_holds_one_sample() {
        for scramble in [0, 0x1234_5678_9abc_def0, u64::MAX] {
            for log in 0..10 {
                let count = 1_u32 << log;
                for first in 0..=log {
                    let mut seen = vec![0; count as usize];
                    for index in 0..count {
                        let u = index.reverse_bits() ^ scramble as u32;
                        let v = second_dimension(index) ^ (scramble >> 32) as u32;
                        let [u, v] = [u, v].map(u64::from);
                        let cell =
                            ((u << first) >> 32) << (log - first) | (v << (log - first)) >> 32;
                        seen[cell as usize] += 1;
                    }
                    assert!(seen.iter().all(|&count| count == 1), "{log} {first}");
                }
            }
        }
    }

    #[test]
    fn directions_are_units_above_the_plane_with_the_right_mean_height() {
        let normals = [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 2.0, -3.0]];
        for (normal, weighting, mean) in normals.iter().flat_map(|normal| {
            [
                (normal, Weighting::Cosine, 2.0 / 3.0),
                (normal, Weighting::Uniform, 0.5),
            ]
        }) {
            let normal = unit(*normal).expect("a normal");
            let directions = Directions::new(normal, 77);
            let mut sum = 0.0;
            for index in 0..1024 {
                let dir = directions.get(index, weighting).map(f64::from);
                let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                assert!((dot(dir, dir) - 1.0).abs() < 1e-6);
                assert!(dot(dir, normal) > -1e-6);
                sum += dot(dir, normal);
            }
            assert!((sum / 1024.0 - mean).abs() < 1e-3, "{weighting:?} {sum}");
        }
    }

    #[test]
    fn keys_differ_by_point_normal_and_seed_but_not_by_the_sign_of_zero() {
        let one = key(1, &[0.0, 1.0, 2.0], &[0.0, 0.0, 1.0]);
        assert_eq!(one, key(1, &[-0.0, 1.0, 2.0], &[0.0, -0.0, 1.0]));
        assert_ne!(one, key(2, &[0.0, 1.0, 2.0], &[0.0, 0.0, 1.0]));
        assert_ne!(one, key(1, &[0.0, 1.0, 2.5], &[0.0, 0.0, 1.0]));
        assert_ne!(one, key(1, &[0.0, 1.0, 2.0], &[0.0, 0.0, -1.0]));
    }
}
