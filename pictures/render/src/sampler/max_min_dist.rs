//! Points on the film with maximized minimum distance.
//!
//! For 2^m points, (i / 2^m, C i) with a generator matrix C of m x m bits is a (0, m, 2)-net if all leading minors of
//! C (rows from the highest digit, columns from the lowest bit) are odd. The matrices of the table keep any two
//! points far apart on the torus. They come from hill climbing over products of triangular matrices, after
//! Grünschloß, Hanika, Schwede and Keller 2008, *(t, m, s)-nets and maximized minimum distance*. Every pixel shifts
//! its points at random on the torus, which keeps the distances.

use super::owen::scramble;
use super::{below_one, mix};

/// Columns of C for 2^1, 2^2, ... points. Column k is added to the m digits of the second coordinate for bit k of the
/// index.
const MATRICES: [&[u32]; 10] = [
    &[0x1],
    &[0x3, 0x2],
    &[0x5, 0x2, 0x4],
    &[0xc, 0x5, 0xe, 0xf],
    &[0x11, 0xb, 0x4, 0x8, 0x10],
    &[0x20, 0x18, 0x8, 0x1c, 0x1e, 0x3],
    &[0x41, 0x22, 0x57, 0x8, 0x10, 0x60, 0x1],
    &[0xc0, 0x42, 0x72, 0x14, 0x3a, 0x7e, 0x41, 0x40],
    &[0x180, 0x100, 0x42, 0x1b0, 0x13, 0x9, 0x184, 0x1bf, 0xf3],
    &[
        0x3e4, 0x161, 0x263, 0x67, 0x4f, 0x3f4, 0x39b, 0x203, 0x260, 0x62,
    ],
];

/// Binary logarithm of the number of points that `samples` are taken from: the next power of two with a matrix.
pub fn log2_points(samples: u32) -> u32 {
    let enough = u32::BITS - samples.max(1).saturating_sub(1).leading_zeros();
    enough.min(MATRICES.len() as u32)
}

/// Point `index` of 2^`log2_points`, shuffled and shifted by `key`. After the last point the set begins again, with
/// another shuffle and shift.
#[inline]
pub fn point(index: u32, log2_points: u32, key: u64) -> [f32; 2] {
    let count = (1_u64 << log2_points) as f64;
    let key = mix(key ^ u64::from(index >> log2_points));
    // Mirrored, so that any number of points spreads over all i.
    let number = u64::from(scramble(index.reverse_bits(), key as u32)) >> (32 - log2_points);
    let shifts = mix(key);
    let [x, y] = net_point(number as u32, log2_points);
    let shifted = |digits: u32, shift: u32| {
        let shift = f64::from(shift) / 4_294_967_296.0;
        below_one((f64::from(digits) / count + shift).fract())
    };
    [shifted(x, shifts as u32), shifted(y, (shifts >> 32) as u32)]
}

/// Digits of point `number` of the net, before the shift.
#[inline]
fn net_point(number: u32, log2_points: u32) -> [u32; 2] {
    let Some(matrix) = (log2_points as usize)
        .checked_sub(1)
        .and_then(|m| MATRICES.get(m))
    else {
        return [0; 2];
    };
    let columns = matrix.iter().enumerate();
    let y = columns.fold(0, |sum, (bit, column)| sum ^ (column * (number >> bit & 1)));
    [number, y]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nets_are_nets() {
        for m in 0..=MATRICES.len() as u32 {
            for columns in 0..=m {
                let mut seen = vec![false; 1 << m];
                for number in 0..1 << m {
                    let [x, y] = net_point(number, m);
                    assert!(x >> m == 0 && y >> m == 0);
                    let cell = (x >> (m - columns)) << (m - columns) | y >> columns;
                    assert!(!std::mem::replace(&mut seen[cell as usize], true));
                }
            }
        }
    }

    /// Least squared distance on the torus, in pixels. The best arrangement of all, hexagons, has 1.15 / count.
    fn distance2(points: &[[f32; 2]]) -> f32 {
        let mut least = f32::INFINITY;
        for (i, a) in points.iter().enumerate() {
            for b in &points[..i] {
                let [dx, dy] = [0, 1].map(|axis| {
                    let d = (a[axis] - b[axis]).abs();
                    d.min(1.0 - d)
                });
                least = least.min(dx * dx + dy * dy);
            }
        }
        least
    }

    #[test]
    fn points_keep_their_distance_wherever_they_are_shifted() {
        for m in 1..=MATRICES.len() as u32 {
            let count = 1 << m;
            for (key, first) in [(1, 0), (2, 0), (3, count)] {
                let points: Vec<_> = (first..first + count).map(|i| point(i, m, key)).collect();
                let relative = distance2(&points) * count as f32;
                assert!(relative > 0.49, "2^{m} points: {relative}");
            }
        }
    }

    /// Half or a quarter of the points are spread evenly along x, wherever the shift begins.
    #[test]
    fn some_of_the_points_are_spread_too() {
        for some in [8, 16, 32] {
            let mut along: Vec<f32> = (0..some).map(|i| point(i, 6, 5)[0]).collect();
            along.sort_by(f32::total_cmp);
            for pair in along.windows(2) {
                assert!((pair[1] - pair[0]) < 2.0 / some as f32);
            }
        }
    }

    #[test]
    fn any_number_of_samples_has_a_set() {
        let found = [0, 1, 2, 3, 4, 5, 16, 17, 1024, 1025, u32::MAX].map(log2_points);
        assert_eq!(found, [0, 0, 1, 2, 2, 3, 4, 5, 10, 10, 10]);
    }
}
