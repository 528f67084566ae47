//! The Halton sequence. Coordinate d is the index written in the d-th prime base and mirrored at the point, with
//! digits permuted for every pixel.
//!
//! # Permutations
//!
//! Permutations are nested as Owen's: the permutation of a digit depends on the digits before it. They are affine
//! maps modulo the base. Since the base is prime, any two digits become any two different digits with equal chance.
//! Variance depends on pairs only (Owen 2003, *Variance with alternative scramblings of digital nets*). Without
//! permutations, a large base makes stripes until there are as many samples as its square.

use super::owen::scramble;
use super::{below_one, mix, unit};

/// Number of pairs of dimensions with bases of their own.
pub const PAIRS: u32 = 32;

#[rustfmt::skip]
const PRIMES: [u32; 2 * PAIRS as usize] = [
    2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97, 101, 103,
    107, 109, 113, 127, 131, 137, 139, 149, 151, 157, 163, 167, 173, 179, 181, 191, 193, 197, 199, 211, 223,
    227, 229, 233, 239, 241, 251, 257, 263, 269, 271, 277, 281, 283, 293, 307, 311,
];

/// Number of points of a pixel that are stratified together, rounded up to a power of the base.
const STRATIFIED: u64 = 1 << 16;

/// Both coordinates of pair `pair`, below [`PAIRS`], of point `index`, with the permutations of `key`.
#[inline]
pub fn pair(index: u32, pair: u32, key: u64) -> [f32; 2] {
    let first = 2 * pair as usize;
    let key = mix(key ^ u64::from(pair));
    let x = match PRIMES[first] {
        2 => unit(scramble(index.reverse_bits(), key as u32)),
        base => radical_inverse(base, index, key),
    };
    [x, radical_inverse(PRIMES[first + 1], index, mix(key))]
}

/// Digits of `index` mirrored at the point, permuted by `key`.
#[inline]
fn radical_inverse(base: u32, index: u32, key: u64) -> f32 {
    let wide = u64::from(base);
    let (mut value, mut scale) = (0_u64, 1_u64);
    let (mut rest, mut node) = (index, key);
    while rest != 0 || scale < STRATIFIED {
        let digit = rest % base;
        rest /= base;
        // Factor (not 0) and summand from the two halves.
        let factor = 1 + (((node >> 32) * (wide - 1)) >> 32) as u32;
        let summand = (((node & 0xffff_ffff) * wide) >> 32) as u32;
        value = value * wide + u64::from((factor * digit + summand) % base);
        scale *= wide;
        node = mix(node ^ u64::from(digit));
    }
    // Further digits are zeros, permuted as in no other point: a random number.
    let further = f64::from(unit(node as u32));
    below_one((value as f64 + further) / scale as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bases_are_the_first_primes() {
        let primes = (2..).filter(|n| (2..*n).all(|d| n % d != 0));
        assert!(primes.take(PRIMES.len()).eq(PRIMES));
    }

    /// Of b^k points one lies in each interval of length b^-k. Of b^j c^k points one lies in each box.
    #[test]
    fn elementary_intervals_hold_one_point() {
        // Values are rounded down, perhaps below the edge of their interval.
        let cell = |value: f32, count: u32| {
            (((f64::from(value) + 3e-8) * f64::from(count)) as u32).min(count - 1)
        };
        for (base, digits) in [(3, 7), (5, 4), (7, 3), (11, 2), (311, 1)] {
            for digits in 0..=digits {
                let count = u32::pow(base, digits);
                for first in [0, count * 5] {
                    let mut seen = vec![false; count as usize];
                    for index in first..first + count {
                        let cell = cell(radical_inverse(base, index, 9), count);
                        assert!(!std::mem::replace(&mut seen[cell as usize], true));
                    }
                }
            }
        }
        for (columns, rows) in [(16, 9), (8, 27), (1, 81), (32, 1)] {
            let mut seen = vec![false; (columns * rows) as usize];
            for index in 0..columns * rows {
                let [x, y] = pair(index, 0, 77);
                let cell = cell(y, rows) * columns + cell(x, columns);
                assert!(!std::mem::replace(&mut seen[cell as usize], true));
            }
        }
    }

    /// Over many keys every digit becomes every digit, and every pair of digits every pair.
    #[test]
    fn permutations_are_uniform_on_pairs() {
        let base = 5;
        let mut pairs = [[0; 5]; 5];
        let count = 40_000;
        for key in 0..count {
            let [a, b] = [1, 4].map(|index| radical_inverse(base, index, mix(key)) * 5.0);
            pairs[a as usize][b as usize] += 1;
        }
        for (a, row) in pairs.iter().enumerate() {
            for (b, &found) in row.iter().enumerate() {
                let expected = if a == b { 0.0 } else { count as f64 / 20.0 };
                assert!((f64::from(found) - expected).abs() <= 5.0 * f64::sqrt(expected));
            }
        }
    }
}
