//! Hulls of lines at the borders of tiles, and their bytes.

use std::collections::BTreeMap;

use crate::{Error, Tile};

/// A line behind one of its cells: what its hull is, once the cell is passed.
#[derive(Clone, Debug)]
pub struct Line {
    /// Row and column of the cell in the whole raster: lines are sorted by them.
    pub place: [i64; 2],
    /// Height of the cell, and of the crossing or cell before it: NaN without a surface.
    pub held: f64,
    pub prior: f64,
    /// Distances from the cell, and heights, from far to near.
    pub points: Vec<[f64; 2]>,
}

/// What sweeps of tiles have to agree on, as words: columns and rows of the step and of the whole, whether it has holes, and what a
/// round earth takes.
pub type Key = [u64; 6];

/// Upper hulls of the lines that leave a tile along a step, for the tiles behind it.
///
/// A border has a line for each cell from which the step, backwards, leads to a cell of another tile. So it may be for several tiles:
/// each finds its own lines, and [`part`](Self::part) has no others. A line has mostly about ten points, so that the border of a tile
/// of 512 x 512 cells takes some 0.1 to 0.2 MB. See [`TileSweep`](crate::TileSweep).
#[derive(Clone, Debug)]
pub struct Border {
    key: Key,
    /// Row by row.
    lines: Vec<Line>,
}

/// First word of the bytes: changes with the meaning of the others.
const MAGIC: u64 = u64::from_le_bytes(*b"hulls  1");

/// Whole numbers up to here are exact.
pub const MOST: f64 = (1_u64 << 53) as f64;

const FINITE: &str = "heights that are finite";

impl Border {
    pub(super) fn new(key: Key, lines: Vec<Vec<Line>>) -> Self {
        let mut lines: Vec<_> = lines.into_iter().flatten().collect();
        lines.sort_unstable_by_key(|line: &Line| line.place);
        Self { key, lines }
    }

    /// The lines that enter a tile along a step, by their places.
    pub(super) fn entering<'b>(
        borders: &'b [Self],
        key: &Key,
        (tile, step): (&Tile, [i32; 2]),
    ) -> Result<BTreeMap<[i64; 2], &'b Line>, Error> {
        let is_same = borders.iter().all(|border| border.key == *key);
        check(is_same, "hulls of the same step, raster, holes and earth")?;
        let lines = borders.iter().flat_map(|border| &border.lines);
        let lines = lines.filter(|line| tile.follows(line.place, step));
        Ok(lines.map(|line| (line.place, line)).collect())
    }

    /// The lines that enter one of the tiles behind.
    pub fn part(&self, tile: &Tile) -> Self {
        let step = [self.key[0], self.key[1]].map(|word| word as i32);
        let is_ours = |line: &&Line| tile.follows(line.place, step);
        let lines = self.lines.iter().filter(is_ours).cloned().collect();
        Self { lines, ..*self }
    }

    /// Bytes to keep or to send: little endian, with a checksum, and the same on every machine for any number of threads.
    ///
    /// A line takes 40 bytes, and a point of its hull 16.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut words = words(self);
        words.push(checksum(&words));
        words.into_iter().flat_map(u64::to_le_bytes).collect()
    }

    /// A border from its bytes.
    ///
    /// # Errors
    /// [`Error::Border`] if bytes are missing or damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let (words, rest) = bytes.as_chunks();
        let words: Vec<_> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
        let (sum, mut words) = words.split_last().unwrap_or((&0, &[]));
        let is_sealed = rest.is_empty() && *sum == checksum(words);
        check(is_sealed, "bytes as they were written")?;
        let [magic, key @ ..] = take::<7>(&mut words)?;
        check(magic == MAGIC, "hulls, in the format of this version")?;
        let whole = Tile::whole([key[2], key[3]].map(|word| word as i64));
        let mut lines: Vec<Line> = Vec::new();
        while !words.is_empty() {
            let [row, column, held, prior, count] = take(&mut words)?;
            let [held, prior] = [held, prior].map(f64::from_bits);
            check(!held.is_infinite() && !prior.is_infinite(), FINITE)?;
            let (mut points, mut last) = (Vec::new(), MOST);
            for _ in 0..count {
                let [far, height] = take(&mut words)?.map(f64::from_bits);
                let is_nearer = far > 0.0 && far < last && far.fract() == 0.0;
                check(is_nearer && height.is_finite(), "points from far to near")?;
                points.push([far, height]);
                last = far;
            }
            let place = [row, column].map(|word| word as i64);
            check(whole.has(place), "a cell of the raster")?;
            let is_next = lines.last().is_none_or(|last| last.place < place);
            check(is_next, "lines row by row")?;
            lines.push(Line {
                place,
                held,
                prior,
                points,
            });
        }
        Ok(Self { key, lines })
    }
}

/// Words of a border without the checksum.
fn words(Border { key, lines }: &Border) -> Vec<u64> {
    let bits = |x: f64| match x.is_nan() {
        true => f64::NAN.to_bits(),
        false => x.to_bits(),
    };
    let mut words = vec![MAGIC];
    words.extend(key);
    for line in lines {
        words.extend(line.place.map(|x| x as u64));
        words.extend([line.held, line.prior].map(bits));
        words.push(line.points.len() as u64);
        words.extend(line.points.iter().flatten().map(|x| bits(*x)));
    }
    words
}

/// A number that differs if one word does.
fn checksum(words: &[u64]) -> u64 {
    // Each step has a reverse.
    let step = |sum: u64, x: &u64| (sum.rotate_left(29) ^ x).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    words.iter().fold(words.len() as u64, step)
}

/// The next words.
fn take<const N: usize>(words: &mut &[u64]) -> Result<[u64; N], Error> {
    let wanted = "all of the lines";
    let (next, rest) = words.split_first_chunk().ok_or(Error::Border { wanted })?;
    *words = rest;
    Ok(*next)
}

fn check(is_right: bool, wanted: &'static str) -> Result<(), Error> {
    is_right.then_some(()).ok_or(Error::Border { wanted })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{HeightField, Sweep, TileSweep, degrees};
    use antumbra_testkit::Rng;
    use std::collections::BTreeSet;

    /// Damage that the checksum does not show, as by a program that writes nonsense.
    #[test]
    fn sealed_nonsense_is_refused_or_harmless() {
        let heights: Vec<f64> = (0..24).map(|cell| f64::from(cell * 7 % 11)).collect();
        let transform = [0.0, 1.0, 0.0, 0.0, 0.0, -1.0];
        let field = HeightField::new([6, 4], &heights, transform).expect("a field");
        let sweep = |column: i64, entering: &[Border]| {
            let tile = Tile {
                at: [column, 0],
                size: [3, 4],
            };
            let (rise, drop) = (1.0, 1e-3);
            let part = TileSweep {
                sweep: Sweep {
                    field: &field,
                    rise,
                    drop,
                },
                at: [0; 2],
                tile,
                whole: [6, 4],
                has_holes: false,
            };
            part.horizons([1, 0], entering, degrees, &())
        };
        let (_, border) = sweep(3, &[]).expect("horizons");
        let right = words(&border);
        let odd = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            0.5,
            -3.0,
            4.0,
            1e15,
        ];
        let mut odd: Vec<u64> = odd.into_iter().map(f64::to_bits).collect();
        odd.extend([0, 1, 2, 3, u64::MAX, 1 << 63, i64::MAX as u64]);
        let mut rng = Rng::new(1);
        let (mut refused, mut swept) = (BTreeSet::new(), 0);
        for _ in 0..20_000 {
            let mut words = right.clone();
            for _ in 0..1 + rng.below(3) {
                let place = rng.below(words.len());
                words[place] = odd[rng.below(odd.len())];
            }
            words.truncate(words.len() - rng.below(2) * rng.below(4));
            words.push(checksum(&words));
            let bytes: Vec<u8> = words.into_iter().flat_map(u64::to_le_bytes).collect();
            match Border::from_bytes(&bytes) {
                Err(Error::Border { wanted }) => {
                    refused.insert(wanted);
                }
                Err(error) => panic!("{error}"),
                Ok(border) => {
                    assert_eq!(border.to_bytes().len(), bytes.len());
                    swept += usize::from(sweep(0, &[border]).is_ok());
                }
            }
        }
        let wanted = [
            "a cell of the raster",
            "all of the lines",
            "heights that are finite",
            "hulls, in the format of this version",
            "lines row by row",
            "points from far to near",
        ];
        assert!(refused.into_iter().eq(wanted) && swept > 100, "{swept}");
        for points in [[1.0, 2.0], [2.0, 0.0], [2.0, 0.5], [MOST, 1.0]] {
            let mut border = border.clone();
            border.lines[0].points = points.map(|at| [at, 0.0]).to_vec();
            assert!(Border::from_bytes(&border.to_bytes()).is_err());
        }
    }
}
