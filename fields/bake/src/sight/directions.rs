//! Directions over a hemisphere, spread evenly and different at every point.
//!
//! Sample `i` is point `i` of the (0, 2)-sequence of Sobol'. The first coordinate is the height, scrambled by exclusive or with
//! a number of the point in question (Kollig and Keller 2002, "Efficient multidimensional sampling"). The second is the angle
//! around the normal, which starts at another number of the point (Cranley and Patterson 1976). So sines and cosines are those
//! of one table, and each power of two of samples has one in every interval of that many equal parts of either coordinate.
//! The numbers are a hash of the point, its normal and the seed. So a point has the same directions in every list,
//! and vertices that are stored twice agree.

use std::f64::consts::TAU;

use crate::vector::cross;

/// How much each part of the sky counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Weighting {
    /// By the cosine of the angle to the normal, as a matt surface is lit by an even sky. Low parts count little.
    #[default]
    Cosine,
    /// By solid angle only: all parts alike.
    Uniform,
}

/// Most samples of the table.
const MOST: u32 = 1 << 12;

/// Samples of a hemisphere, for all points.
pub(crate) struct Samples {
    weighting: Weighting,
    table: Vec<Sample>,
}

/// A sample before the numbers of a point change it.
#[derive(Clone, Copy)]
struct Sample {
    /// First coordinate, as a fraction of 2³².
    height: u32,
    /// Cosine and sine of the angle around the normal.
    turn: [f64; 2],
}

impl Sample {
    fn new(index: u32) -> Self {
        Self {
            height: index.reverse_bits(),
            turn: turn(second_dimension(index)),
        }
    }
}

/// Cosine and sine of a part of a turn, given as a fraction of 2³².
fn turn(part: u32) -> [f64; 2] {
    // The system's own functions differ in their last bits.
    let (sin, cos) = libm::sincos(TAU * fraction(part));
    [cos, sin]
}

/// A number within [0, 1): 32 bits fit a double.
fn fraction(bits: u32) -> f64 {
    f64::from(bits) / 4_294_967_296.0
}

impl Samples {
    /// Table for up to `count` samples per point. Further samples are computed each time.
    pub fn new(count: u32, weighting: Weighting) -> Self {
        Self {
            weighting,
            table: (0..count.min(MOST)).map(Sample::new).collect(),
        }
    }

    /// Directions around a normal of length 1; `key` decides which of all sequences.
    pub fn around(&self, normal: [f64; 3], key: u64) -> Directions<'_> {
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
        let side = cross(normal, tangent);
        let [cos, sin] = turn((key >> 32) as u32);
        let turned = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|axis| cos * a[axis] + sin * b[axis]);
        Directions {
            samples: self,
            frame: [
                turned(tangent, side),
                turned(side, tangent.map(|x| -x)),
                normal,
            ],
            scramble: key as u32,
        }
    }
}

/// Directions around one normal.
pub(crate) struct Directions<'a> {
    samples: &'a Samples,
    /// Two tangents and the normal.
    frame: [[f64; 3]; 3],
    scramble: u32,
}

impl Directions<'_> {
    /// Direction of sample `index`, of length 1 up to rounding, above the plane of the normal.
    #[inline]
    pub fn get(&self, index: u32) -> [f32; 3] {
        let sample = match self.samples.table.get(index as usize) {
            Some(sample) => *sample,
            None => Sample::new(index),
        };
        let u = fraction(sample.height ^ self.scramble);
        let (r, z) = match self.samples.weighting {
            Weighting::Cosine => (u.sqrt(), (1.0 - u).sqrt()),
            Weighting::Uniform => ((u * (2.0 - u)).sqrt(), 1.0 - u),
        };
        let [x, y] = sample.turn.map(|part| r * part);
        std::array::from_fn(|axis| {
            let [s, t, n] = self.frame.map(|vector| vector[axis]);
            (x * s + y * t + z * n) as f32
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
    use crate::vector::unit;

    /// Heights and angles of the directions themselves. Heights are scrambled to lie away from the ends of intervals.
    #[test]
    fn every_interval_of_heights_and_of_angles_holds_one_sample() {
        for (key, weighting) in [
            (0x5555_5555, Weighting::Uniform),
            (0x1234_5678_9abc_def0, Weighting::Cosine),
            (0xffff_ffff_0f3c_3c3c, Weighting::Uniform),
        ] {
            for log in 0..10 {
                let count = 1_u32 << log;
                let samples = Samples::new(count / 2, weighting);
                let directions = samples.around([0.0, 0.0, 1.0], key);
                // Angles begin anywhere: the first sample marks the start, from the middle of its interval.
                let [x, y, _] = directions.get(0).map(f64::from);
                let start = y.atan2(x) / TAU - 0.5 / f64::from(count);
                for first in [0, log] {
                    let mut seen = vec![0; count as usize];
                    for index in 0..count {
                        let [x, y, z] = directions.get(index).map(f64::from);
                        let height = match weighting {
                            Weighting::Cosine => 1.0 - z * z,
                            Weighting::Uniform => 1.0 - z,
                        };
                        let angle = (y.atan2(x) / TAU - start).rem_euclid(1.0);
                        let part = if first == 0 { angle } else { height };
                        seen[(part * f64::from(count)) as usize % count as usize] += 1;
                    }
                    assert!(
                        seen.iter().all(|&count| count == 1),
                        "{log} {first} {seen:?}"
                    );
                }
            }
        }
    }

    /// Elementary intervals of both coordinates, before the numbers of a point.
    #[test]
    fn every_elementary_interval_holds_one_sample() {
        for scramble in [0, 0x9abc_def0, u32::MAX] {
            for log in 0..10 {
                let count = 1_u32 << log;
                for first in 0..=log {
                    let mut seen = vec![0; count as usize];
                    for index in 0..count {
                        let u = index.reverse_bits() ^ scramble;
                        let v = second_dimension(index);
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
            let samples = Samples::new(512, weighting);
            let directions = samples.around(normal, 77);
            let mut sum = 0.0;
            for index in 0..1024 {
                let dir = directions.get(index).map(f64::from);
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
