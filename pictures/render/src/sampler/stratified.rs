//! Jittered grids: one sample in each of x times y cells of the square. Every dimension has an order of its own.

use super::{below_one, mix, unit};

/// A grid of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Cells across and down, at least 1.
    pub cells: [u32; 2],
    /// Whether a sample lies at random in its cell, instead of in the middle.
    pub jitter: bool,
}

impl Grid {
    /// Number of cells.
    #[inline]
    fn count(self) -> u32 {
        self.cells[0].saturating_mul(self.cells[1]).max(1)
    }

    /// Point of sample `index`. Samples beyond the number of cells begin another grid.
    #[inline]
    pub fn pair(self, index: u32, key: u64) -> [f32; 2] {
        let count = self.count();
        let key = mix(key ^ u64::from(index / count));
        let cell = permute(index % count, count, key);
        let [x, y] = self.inside(key, index);
        let [across, down] = self.cells;
        [
            place(cell % across.max(1), x, across),
            place(cell / across.max(1), y, down),
        ]
    }

    /// Value of sample `index`, on a line of as many cells.
    #[inline]
    pub fn single(self, index: u32, key: u64) -> f32 {
        let count = self.count();
        let key = mix(key ^ u64::from(index / count));
        let cell = permute(index % count, count, key);
        place(cell, self.inside(key, index)[0], count)
    }

    /// Point `part` of `parts` of sample `index`.
    ///
    /// A grid has no room for parts. The parts of all samples form a Latin hypercube instead, stratified in each
    /// coordinate separately.
    #[inline]
    pub fn part(self, index: u32, part: u32, parts: u32, key: u64) -> [f32; 2] {
        let count = self.count();
        let all = count.saturating_mul(parts);
        let key = mix(key ^ u64::from(index / count));
        let number = (index % count).saturating_mul(parts).saturating_add(part) % all;
        let [x, y] = self.inside(key, number);
        [
            place(permute(number, all, key), x, all),
            place(permute(number, all, mix(key)), y, all),
        ]
    }

    #[inline]
    fn inside(self, key: u64, number: u32) -> [f32; 2] {
        if !self.jitter {
            return [0.5; 2];
        }
        let bits = mix(mix(key) ^ u64::from(number));
        [unit(bits as u32), unit((bits >> 32) as u32)]
    }
}

/// Place inside cell `cell` of `count`, as a fraction of the line.
#[inline]
fn place(cell: u32, inside: f32, count: u32) -> f32 {
    below_one((f64::from(cell) + f64::from(inside)) / f64::from(count.max(1)))
}

/// Image of `index` in a permutation of 0..`count` that `key` chooses.
///
/// Rounds permute all numbers of as many bits as `count - 1` has. They are repeated until the result is below
/// `count`. The cycle through `index` ends at the latest at `index` itself. A rotation at the end makes all places
/// equally likely even with few bits.
#[inline]
fn permute(index: u32, count: u32, key: u64) -> u32 {
    if count < 2 {
        return 0;
    }
    let bits = 32 - (count - 1).leading_zeros();
    let mask = u32::MAX >> (32 - bits);
    let half = bits.div_ceil(2);
    let mut x = index;
    loop {
        let mut keys = key;
        for _ in 0..4 {
            keys = keys.rotate_left(21).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            x = x.wrapping_add((keys >> 32) as u32) & mask;
            x ^= x >> half;
            x = x.wrapping_mul(keys as u32 | 1) & mask;
            x ^= x >> half;
        }
        if x < count {
            let turn = ((key & 0xffff_ffff) * u64::from(count)) >> 32;
            return ((u64::from(x) + turn) % u64::from(count)) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutations_are_permutations_and_fair() {
        for count in [1, 2, 3, 4, 5, 7, 16, 25, 100, 1000] {
            for key in 0..50 {
                let mut seen = vec![false; count as usize];
                for index in 0..count {
                    let place = permute(index, count, mix(key)) as usize;
                    assert!(!std::mem::replace(&mut seen[place], true));
                }
            }
        }
        // Where one goes, and where two go together.
        for count in [2, 3, 4, 7, 16] {
            let keys = 50_000;
            let mut single = vec![0; (count * count) as usize];
            let mut pairs = vec![0; (count * count) as usize];
            for key in 0..keys {
                let key = mix(key);
                for index in 0..count {
                    single[(index * count + permute(index, count, key)) as usize] += 1;
                }
                let [a, b] = [0, count - 1].map(|index| permute(index, count, key));
                pairs[(a * count + b) as usize] += 1;
            }
            let check = |found: i32, expected: f64, slack: f64, what: &str| {
                let off = (f64::from(found) - expected).abs();
                assert!(
                    off <= 6.0 * expected.sqrt() + slack * expected,
                    "{what} of {count}: {found} {expected}"
                );
            };
            for found in single {
                check(found, keys as f64 / f64::from(count), 0.0, "places");
            }
            for (cell, found) in pairs.into_iter().enumerate() {
                let cell = cell as u32;
                let ways = f64::from(count * (count - 1));
                let expected = if cell % count == cell / count {
                    0.0
                } else {
                    keys as f64 / ways
                };
                check(found, expected, 0.1, "pairs");
            }
        }
    }

    #[test]
    fn every_cell_holds_one_sample() {
        let jitter = true;
        for cells in [[4, 4], [1, 1], [5, 3], [1, 7]] {
            let [across, down] = cells;
            let count = across * down;
            let grid = Grid { cells, jitter };
            for first in [0, count, 9 * count] {
                let mut seen = vec![false; count as usize];
                let mut line = vec![false; count as usize];
                for index in first..first + count {
                    let [x, y] = grid.pair(index, 3);
                    let cell = (y * down as f32) as u32 * across + (x * across as f32) as u32;
                    assert!(!std::mem::replace(&mut seen[cell as usize], true));
                    let place = (grid.single(index, 3) * count as f32) as usize;
                    assert!(!std::mem::replace(&mut line[place], true));
                }
            }
            let parts = 5;
            let all = (parts * count) as usize;
            let mut seen = [vec![false; all], vec![false; all]];
            for index in 0..count {
                for part in 0..parts {
                    let point = grid.part(index, part, parts, 4);
                    for (value, seen) in point.into_iter().zip(&mut seen) {
                        let cell = (value * all as f32) as usize;
                        assert!(!std::mem::replace(&mut seen[cell], true));
                    }
                }
            }
        }
    }

    #[test]
    fn without_jitter_samples_are_in_the_middle() {
        let grid = Grid {
            cells: [2, 4],
            jitter: false,
        };
        for index in 0..30 {
            let [x, y] = grid.pair(index, 3);
            assert!([0.25, 0.75].contains(&x) && [0.125, 0.375, 0.625, 0.875].contains(&y));
        }
    }
}
