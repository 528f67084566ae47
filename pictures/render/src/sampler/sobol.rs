//! The Sobol' sequence in as many dimensions as a path of some vertices has, Owen-scrambled for every pixel.
//!
//! All dimensions share the sample's number. Points are thus stratified in more than two dimensions, too. Two distant
//! dimensions may be less even together than a (0, 2)-sequence.

use super::owen::scramble;
use super::{mix, unit};

/// Number of pairs of dimensions in the table.
pub const PAIRS: u32 = 32;

/// Inner coefficients of a primitive polynomial, and as many initial direction numbers as its degree, for dimensions
/// 2, 3, ... (Joe and Kuo 2008, *Constructing Sobol' sequences with better two-dimensional projections*, the table
/// for property D up to dimension 6, first 64 dimensions).
#[rustfmt::skip]
const INITIAL: [(u32, &[u32]); 63] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
    (11, &[1, 1, 5, 1, 1]),
    (13, &[1, 1, 1, 3, 11]),
    (14, &[1, 3, 5, 5, 31]),
    (1, &[1, 3, 3, 9, 7, 49]),
    (13, &[1, 1, 1, 15, 21, 21]),
    (16, &[1, 3, 1, 13, 27, 49]),
    (19, &[1, 1, 1, 15, 7, 5]),
    (22, &[1, 3, 1, 15, 13, 25]),
    (25, &[1, 1, 5, 5, 19, 61]),
    (1, &[1, 3, 7, 11, 23, 15, 103]),
    (4, &[1, 3, 7, 13, 13, 15, 69]),
    (7, &[1, 1, 3, 13, 7, 35, 63]),
    (8, &[1, 3, 5, 9, 1, 25, 53]),
    (14, &[1, 3, 1, 13, 9, 35, 107]),
    (19, &[1, 3, 1, 5, 27, 61, 31]),
    (21, &[1, 1, 5, 11, 19, 41, 61]),
    (28, &[1, 3, 5, 3, 3, 13, 69]),
    (31, &[1, 1, 7, 13, 1, 19, 1]),
    (32, &[1, 3, 7, 5, 13, 19, 59]),
    (37, &[1, 1, 3, 9, 25, 29, 41]),
    (41, &[1, 3, 5, 13, 23, 1, 55]),
    (42, &[1, 3, 7, 3, 13, 59, 17]),
    (50, &[1, 3, 1, 3, 5, 53, 69]),
    (55, &[1, 1, 5, 5, 23, 33, 13]),
    (56, &[1, 1, 7, 7, 1, 61, 123]),
    (59, &[1, 1, 7, 9, 13, 61, 49]),
    (62, &[1, 3, 3, 5, 3, 55, 33]),
    (14, &[1, 3, 1, 15, 31, 13, 49, 245]),
    (21, &[1, 3, 5, 15, 31, 59, 63, 97]),
    (22, &[1, 3, 1, 11, 11, 11, 77, 249]),
    (38, &[1, 3, 1, 11, 27, 43, 71, 9]),
    (47, &[1, 1, 7, 15, 21, 11, 81, 45]),
    (49, &[1, 3, 7, 3, 25, 31, 65, 79]),
    (50, &[1, 3, 1, 1, 19, 11, 3, 205]),
    (52, &[1, 1, 5, 9, 19, 21, 29, 157]),
    (56, &[1, 3, 7, 11, 1, 33, 89, 185]),
    (67, &[1, 3, 3, 3, 15, 9, 79, 71]),
    (70, &[1, 3, 7, 11, 15, 39, 119, 27]),
    (84, &[1, 1, 3, 1, 11, 31, 97, 225]),
    (97, &[1, 1, 1, 3, 23, 43, 57, 177]),
    (103, &[1, 3, 7, 7, 17, 17, 37, 71]),
    (115, &[1, 3, 1, 5, 27, 63, 123, 213]),
    (122, &[1, 1, 3, 5, 11, 43, 53, 133]),
    (8, &[1, 3, 5, 5, 29, 17, 47, 173, 479]),
    (13, &[1, 3, 3, 11, 3, 1, 109, 9, 69]),
    (16, &[1, 1, 1, 5, 17, 39, 23, 5, 343]),
    (22, &[1, 3, 1, 5, 25, 15, 31, 103, 499]),
    (25, &[1, 1, 1, 11, 11, 17, 63, 105, 183]),
    (44, &[1, 1, 5, 11, 9, 29, 97, 231, 363]),
    (47, &[1, 1, 5, 15, 19, 45, 41, 7, 383]),
    (52, &[1, 3, 7, 7, 31, 19, 83, 137, 221]),
    (55, &[1, 1, 1, 3, 23, 15, 111, 223, 83]),
    (59, &[1, 1, 5, 13, 31, 15, 55, 25, 161]),
    (62, &[1, 1, 3, 13, 25, 47, 39, 87, 257]),
];

/// Generator matrices of all dimensions. Bit k of the index adds column k.
static DIRECTIONS: [[u32; 32]; 2 * PAIRS as usize] = directions();

/// Direction numbers by the recurrence of Bratley and Fox (1988, algorithm 659).
const fn directions() -> [[u32; 32]; 2 * PAIRS as usize] {
    let mut all = [[0; 32]; 2 * PAIRS as usize];
    let mut bit = 0;
    while bit < 32 {
        all[0][bit] = 1 << (31 - bit);
        bit += 1;
    }
    let mut dimension = 1;
    while dimension < all.len() {
        let (polynomial, initial) = INITIAL[dimension - 1];
        let degree = initial.len();
        let mut column = [0; 32];
        let mut bit = 0;
        while bit < 32 {
            column[bit] = if bit < degree {
                initial[bit] << (31 - bit)
            } else {
                let mut sum = column[bit - degree] ^ (column[bit - degree] >> degree);
                let mut term = 1;
                while term < degree {
                    if (polynomial >> (degree - 1 - term)) & 1 == 1 {
                        sum ^= column[bit - term];
                    }
                    term += 1;
                }
                sum
            };
            bit += 1;
        }
        all[dimension] = column;
        dimension += 1;
    }
    all
}

/// Both coordinates of pair `pair`, below [`PAIRS`], of point `index`, scrambled by `key`.
#[inline]
pub fn pair(index: u32, pair: u32, key: u64) -> [f32; 2] {
    let scrambles = mix(key ^ u64::from(pair));
    let first = 2 * pair as usize;
    [
        unit(scramble(coordinate(index, first), scrambles as u32)),
        unit(scramble(
            coordinate(index, first + 1),
            (scrambles >> 32) as u32,
        )),
    ]
}

/// Coordinate of the unscrambled sequence, as a 32-bit fraction.
#[inline]
fn coordinate(index: u32, dimension: usize) -> u32 {
    if dimension == 0 {
        return index.reverse_bits();
    }
    let columns = &DIRECTIONS[dimension];
    let (mut sum, mut rest) = (0, index);
    while rest != 0 {
        sum ^= columns[rest.trailing_zeros() as usize];
        rest &= rest - 1;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first points of a (0, 1)-sequence: every interval of length 2^-k holds one of any aligned 2^k points.
    #[test]
    fn every_dimension_is_stratified() {
        for dimension in 0..2 * PAIRS as usize {
            for first in [0_u32, 1 << 12, 3 << 20] {
                for k in 0..=12 {
                    let mut seen = vec![false; 1 << k];
                    for index in first..first + (1 << k) {
                        let cell = (u64::from(coordinate(index, dimension)) << k >> 32) as usize;
                        assert!(!std::mem::replace(&mut seen[cell], true));
                    }
                }
            }
        }
    }

    #[test]
    fn the_second_dimension_is_that_of_the_zero_two_sequence() {
        for index in (0..5000).chain([u32::MAX, 1 << 31]) {
            let expected = super::super::owen::second_sobol_dimension(index);
            assert_eq!(coordinate(index, 1), expected);
        }
    }

    /// A few points as published implementations have them.
    #[test]
    fn the_sequence_is_the_known_one() {
        let point =
            |index| [0, 1, 2, 3, 4].map(|d| f64::from(coordinate(index, d)) / f64::from(u32::MAX));
        for (index, expected) in [
            (1, [0.5; 5]),
            (2, [0.25, 0.75, 0.75, 0.75, 0.25]),
            (3, [0.75, 0.25, 0.25, 0.25, 0.75]),
            (6, [0.375, 0.375, 0.625, 0.875, 0.375]),
        ] {
            let found = point(index);
            let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-9, "{index}: {found:?}");
        }
    }
}
