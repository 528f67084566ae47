//! Tiles against the whole raster, bit for bit.

use antumbra_terrain::{
    Error, Eyes, HeightField, Lattice, March, Monitor, Peaks, Pull, Shadows, Tile, Tiles,
};
use antumbra_testkit::Rng;

const TRANSFORMS: [[f64; 6]; 4] = [
    [0.0, 1.0, 0.0, 0.0, 0.0, -1.0],
    [0.0, 2.0, 0.0, 0.0, 0.0, -10.0],
    [0.0, 0.6, 0.8, 0.0, 0.8, -0.6],
    [7e6, 10.0, 3.0, 3e5, 1.0, -10.0],
];

/// A raster whose first cell is anywhere, and its tiles.
struct Raster {
    size: [usize; 2],
    heights: Vec<f64>,
    transform: [f64; 6],
    at: [i64; 2],
    tiles: Vec<Tile>,
    /// Cells on a side of the squares whose peaks are known.
    side: Option<usize>,
}

impl Raster {
    /// Hills, cliffs and towers, with holes for this part of the cells.
    fn new(random: &mut Rng, size: [usize; 2], holes: f64, transform: [f64; 6]) -> Self {
        let mut unit = || f64::from(random.unit());
        let is_single = unit() < 0.5;
        let [long, wide] = [0, 1].map(|_| 3.0 + 20.0 * unit());
        let scale = [3.0, 300.0, 4000.0][(3.0 * unit()) as usize];
        let height = |cell: usize| {
            let [x, y] = [(cell % size[0]) as f64, (cell / size[0]) as f64];
            let hill = 0.5 + 0.5 * (x / long).sin() * (y / wide).cos();
            let tower = if unit() < 0.03 { 0.2 * unit() } else { 0.0 };
            let height = (-50.0 + scale * (0.9 * hill + tower + 0.02 * unit())).min(4000.0);
            match (unit() < holes, is_single) {
                (true, _) => f64::NAN,
                (_, true) => f64::from(height as f32),
                (_, false) => height,
            }
        };
        let heights = (0..size[0] * size[1]).map(height).collect();
        let at = [0, 1].map(|_| (2e12 * unit() - 1e12) as i64);
        let whole = Tile { at, size };
        let mut tiles = vec![];
        cut(random, whole, &mut tiles);
        shuffle(random, &mut tiles);
        let side = [None, Some(1), Some(4), Some(8), Some(64)][(5.0 * random.unit()) as usize];
        Self {
            size,
            heights,
            transform,
            at,
            tiles,
            side,
        }
    }

    fn field(&self) -> HeightField<'_> {
        HeightField::new(self.size, &self.heights, self.transform).expect("a field")
    }

    /// Values of the cells of a tile.
    fn part<T: Copy>(&self, values: &[T], tile: Tile) -> Vec<T> {
        let [column, row] = [0, 1].map(|axis| (tile.at[axis] - self.at[axis]) as usize);
        let rows = values.chunks(self.size[0]).skip(row).take(tile.size[1]);
        rows.flat_map(|row| row[column..][..tile.size[0]].iter().copied())
            .collect()
    }

    /// A tile with a margin of one cell, as far as there are any.
    fn window(&self, tile: Tile) -> Tile {
        let ends = |axis: usize| {
            let size = self.size[axis] as i64;
            let first = (tile.at[axis] - 1).max(self.at[axis]);
            let end = tile.at[axis] + tile.size[axis] as i64 + 1;
            (first, end.min(self.at[axis] + size) - first)
        };
        let [(column, columns), (row, rows)] = [0, 1].map(ends);
        Tile {
            at: [column, row],
            size: [columns as usize, rows as usize],
        }
    }
}

impl Tiles for Raster {
    type Error = Error;

    fn transform(&self) -> [f64; 6] {
        self.transform
    }

    fn tiles(&self) -> &[Tile] {
        &self.tiles
    }

    fn peak(&self, tile: usize) -> f64 {
        let heights = self.part(&self.heights, self.tiles[tile]);
        heights.into_iter().fold(f64::NEG_INFINITY, f64::max)
    }

    fn peaks(&self, tile: usize) -> Result<Option<Peaks>, Error> {
        let Some(side) = self.side else {
            return Ok(None);
        };
        let tile = self.tiles[tile];
        let heights = self.part(&self.heights, tile);
        let field = HeightField::new(tile.size, &heights, self.transform)?;
        let values = Peaks::new(&field, side)?.values();
        Peaks::from_values(tile.size, side, &values).map(Some)
    }

    fn read(&self, part: Tile) -> Result<Vec<f64>, Error> {
        Ok(self.part(&self.heights, part))
    }
}

/// Divides a tile at random places.
fn cut(random: &mut Rng, tile: Tile, tiles: &mut Vec<Tile>) {
    let axis = usize::from(random.unit() < 0.5);
    let size = tile.size[axis];
    if size < 2 || tile.size[0] * tile.size[1] < 900 && random.unit() < 0.4 {
        return tiles.push(tile);
    }
    let first = 1 + (f64::from(random.unit()) * (size - 1) as f64) as usize;
    let (mut a, mut b) = (tile, tile);
    a.size[axis] = first;
    b.size[axis] = size - first;
    b.at[axis] += first as i64;
    cut(random, a, tiles);
    cut(random, b, tiles);
}

fn shuffle<T>(random: &mut Rng, items: &mut [T]) {
    for index in (1..items.len()).rev() {
        let other = (f64::from(random.unit()) * (index + 1) as f64) as usize;
        items.swap(index, other.min(index));
    }
}

/// Bits of the slopes of the horizons of a whole field.
fn bits(march: &March<'_>, azimuth: f64) -> Vec<u64> {
    let half = |shift: u32| {
        let of = move |slope: f64| f32::from_bits((slope.to_bits() >> shift) as u32);
        march.horizons(azimuth, of, &()).expect("horizons")
    };
    let both = half(32).into_iter().zip(half(0));
    both.map(|(high, low)| u64::from(high.to_bits()) << 32 | u64::from(low.to_bits()))
        .collect()
}

/// An azimuth of steps between cells, or any other one.
fn azimuth(random: &mut Rng, field: &HeightField<'_>, index: usize) -> f64 {
    let lattice = Lattice::new(field, [8, 16, 32, 80][index / 2 % 4]).expect("a lattice");
    let place = f64::from(random.unit());
    match index % 2 {
        0 => lattice.azimuths[(place * lattice.azimuths.len() as f64) as usize],
        _ => 360.0 * place,
    }
}

/// A raster of a round: some have no holes, many or only few; some are narrow.
fn raster(random: &mut Rng, round: usize) -> Raster {
    let size = match round % 7 {
        6 => [150, 1 + round % 3],
        _ => [0, 1].map(|_| 1 + (f64::from(random.unit()) * 80.0) as usize),
    };
    let holes = [0.0, 0.003, 0.1, 0.5][round % 4];
    Raster::new(random, size, holes, TRANSFORMS[round / 4 % 4])
}

#[test]
fn windows_in_any_order_raise_horizons_to_those_of_the_whole() {
    let mut random = Rng::new(52);
    let mut counts = [0; 2];
    for round in 0..112 {
        let raster = raster(&mut random, round);
        let field = raster.field();
        let rise = if round % 3 == 0 { 2.0 } else { 0.0 };
        let drop = if round % 5 == 0 { 1e-3 } else { 0.0 };
        let march = March::new(&field, rise, drop).expect("a march");
        for index in 0..4 {
            let azimuth = azimuth(&mut random, &field, index + round);
            let whole = bits(&march, azimuth);
            let own = raster.tiles[index % raster.tiles.len()];
            let heights = raster.part(&raster.heights, own);
            let mut slopes = vec![f64::NEG_INFINITY; heights.len()];
            let mut order = raster.tiles.clone();
            shuffle(&mut random, &mut order);
            for tile in order {
                let window = raster.window(tile);
                let around = raster.part(&raster.heights, window);
                let field =
                    HeightField::new(window.size, &around, raster.transform).expect("a field");
                let eyes = Eyes {
                    heights: &heights,
                    width: own.size[0],
                    at: [0, 1].map(|axis| own.at[axis] - window.at[axis]),
                };
                let before = slopes.clone();
                let march = March::new(&field, rise, drop).expect("a march");
                march
                    .raise(&eyes, azimuth, &mut slopes, &())
                    .expect("slopes");
                counts[usize::from(before != slopes && tile != own)] += 1;
            }
            for ((slope, whole), height) in
                slopes.iter().zip(raster.part(&whole, own)).zip(&heights)
            {
                let about = format!("{round} {:?} {own:?} {azimuth}", raster.size);
                let whole = f64::from_bits(whole);
                assert!(
                    height.is_nan() || slope.to_bits() == whole.to_bits(),
                    "{about}: {slope} {whole}"
                );
            }
        }
    }
    assert!(counts[1] > 500, "{counts:?}");
}

#[test]
fn tiles_have_the_horizons_and_the_light_of_the_whole() {
    let mut random = Rng::new(53);
    let (mut read, mut left) = (0, 0);
    for round in 0..112 {
        let raster = raster(&mut random, round);
        let field = raster.field();
        let rise = if round % 3 == 0 { 2.0 } else { 0.0 };
        let drop = if round % 5 == 0 { 1e-3 } else { 0.0 };
        let pull = Pull {
            tiles: &raster,
            rise,
        };
        let march = March::new(&field, rise, drop).expect("a march");
        let shadows = Shadows::new(&field, rise).expect("shadows");
        let azimuths: Vec<f64> = (0..4)
            .map(|index| azimuth(&mut random, &field, index + round))
            .collect();
        let mut slope = |_: &f64| (70.0 * f64::from(random.unit()) - 1.0).to_radians().tan();
        let mut suns: Vec<[f64; 2]> = azimuths
            .iter()
            .map(|azimuth| [*azimuth, slope(azimuth)])
            .collect();
        // From below, and where nothing is.
        suns.extend([[9.0, -0.3], [9.0, f64::INFINITY], [9.0, f64::NEG_INFINITY]]);
        let wholes: Vec<Vec<u64>> = azimuths
            .iter()
            .map(|&azimuth| bits(&march, azimuth))
            .collect();
        let lit = shadows.all_lit(&suns, &()).expect("light");
        // Two tiles of the raster, and a rectangle that is none of them.
        let mut own: Vec<Tile> = raster.tiles.iter().copied().take(2).collect();
        let [columns, rows] = raster.size.map(|size| size / 2 + 1);
        own.push(Tile {
            at: [raster.at[0] + (columns / 2) as i64, raster.at[1]],
            size: [raster.size[0] - columns / 2, rows],
        });
        for tile in own {
            let about = format!("{round} {:?} {tile:?} {azimuths:?}", raster.size);
            let found = pull
                .horizons(&tile, &azimuths, drop, &())
                .expect("horizons");
            read += found.read.len();
            left += raster.tiles.len() - found.read.len();
            for (found, whole) in found.values.iter().zip(&wholes) {
                let whole = raster.part(whole, tile);
                let is_equal = |(slope, whole): (&f64, &u64)| {
                    // Cells without data have halves of the bits of NaN in single precision.
                    slope.is_nan() || slope.to_bits() == *whole
                };
                assert!(found.iter().zip(&whole).all(is_equal), "{about}");
                let holes = raster.part(&raster.heights, tile);
                assert!(
                    found
                        .iter()
                        .zip(holes)
                        .all(|(slope, height)| slope.is_nan() == height.is_nan())
                );
            }
            let found = pull.lit(&tile, &suns, &()).expect("light");
            for (index, found) in found.values.iter().enumerate() {
                let words = raster.size[0].div_ceil(64);
                let is_lit = |cell: usize| {
                    let [column, row] = [cell % raster.size[0], cell / raster.size[0]];
                    lit[index][row * words + column / 64] >> (column % 64) & 1 == 1
                };
                let all: Vec<bool> = (0..raster.heights.len()).map(is_lit).collect();
                let words = tile.size[0].div_ceil(64);
                for (cell, wanted) in raster.part(&all, tile).into_iter().enumerate() {
                    let [column, row] = [cell % tile.size[0], cell / tile.size[0]];
                    let is_lit = found[row * words + column / 64] >> (column % 64) & 1 == 1;
                    assert_eq!(is_lit, wanted, "{about} {cell} {:?}", suns[index]);
                }
            }
        }
    }
    assert!(read > 500 && left > 500, "{read} {left}");
}

#[test]
fn a_plain_needs_no_other_tiles() {
    let mut plain = Raster::new(&mut Rng::new(1), [60, 50], 0.0, TRANSFORMS[0]);
    plain.heights.fill(4000.1);
    assert!(plain.tiles.len() > 3);
    let pull = Pull {
        tiles: &plain,
        rise: 0.0,
    };
    for tile in &plain.tiles {
        let suns = pull
            .lit(tile, &[[33.0, 1.0], [200.0, 0.01]], &())
            .expect("light");
        assert_eq!((suns.read, suns.cells), (vec![], 0));
        let horizons = pull
            .horizons(tile, &[0.0, 77.0, 123.4, 180.0], 0.0, &())
            .expect("horizons");
        assert_eq!(horizons.read, []);
    }
    // A tower hides a low sun, and the tile that it is in is the only one that is read.
    plain.heights[25 * 60 + 55] = 4010.0;
    let own = Tile {
        at: plain.at,
        size: [20, 50],
    };
    let lit = Pull {
        tiles: &plain,
        rise: 0.0,
    };
    let lit = lit.lit(&own, &[[90.0, 0.2]], &()).expect("light");
    let [tower] = lit.read[..] else {
        panic!("{lit:?}")
    };
    let place = [0, 1].map(|axis| plain.at[axis] + [55, 25][axis] - plain.tiles[tower].at[axis]);
    assert!((0..2).all(|axis| (0..plain.tiles[tower].size[axis] as i64).contains(&place[axis])));
    let window = plain.window(plain.tiles[tower]).size;
    assert_eq!(lit.cells, (window[0] * window[1]) as u64);
    let dark: u32 = lit.values[0].iter().map(|row| 20 - row.count_ones()).sum();
    assert_eq!(dark, 14, "the shadow is 49.5 cells long");
}

/// A raster with these peaks for each tile.
struct Wrong<'a>(&'a Raster, Peaks);

impl Tiles for Wrong<'_> {
    type Error = Error;

    fn transform(&self) -> [f64; 6] {
        self.0.transform()
    }

    fn tiles(&self) -> &[Tile] {
        self.0.tiles()
    }

    fn peak(&self, _: usize) -> f64 {
        9e3
    }

    fn peaks(&self, _: usize) -> Result<Option<Peaks>, Error> {
        Ok(Some(self.1.clone()))
    }

    fn read(&self, part: Tile) -> Result<Vec<f64>, Error> {
        self.0.read(part)
    }
}

#[test]
fn what_is_wrong_is_refused() {
    let mut random = Rng::new(2);
    let raster = Raster::new(&mut random, [40, 40], 0.0, TRANSFORMS[0]);
    let pull = Pull {
        tiles: &raster,
        rise: 0.0,
    };
    let own = raster.tiles[0];
    let is_range = |result: Result<_, Error>| matches!(result, Err(Error::Range { .. }));
    assert!(is_range(
        pull.horizons(&own, &[f64::NAN], 0.0, &()).map(drop)
    ));
    assert!(is_range(pull.lit(&own, &[[0.0, f64::NAN]], &()).map(drop)));
    for (column, columns) in [(-1, 4), (38, 4), (0, 0), (1 << 50, 4), (0, usize::MAX)] {
        let beside = Tile {
            at: [raster.at[0] + column, raster.at[1]],
            size: [columns, 4],
        };
        assert!(is_range(pull.lit(&beside, &[], &()).map(drop)), "{column}");
    }
    struct Never;
    impl Monitor for Never {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let cancelled = pull.horizons(&own, &[3.0], 0.0, &Never);
    assert_eq!(cancelled, Err(Error::Cancelled));
    let other = Wrong(
        &raster,
        Peaks::from_values([1, 1], 1, &[9e3]).expect("peaks"),
    );
    let wrong = Pull {
        tiles: &other,
        rise: 0.0,
    };
    let found = wrong.lit(&own, &[[0.0, 0.1], [180.0, 0.1]], &());
    assert!(matches!(found, Err(Error::Length { .. })), "{found:?}");
    let field = raster.field();
    assert!(is_range(Peaks::new(&field, 3).map(drop)));
    assert!(Peaks::from_values([9, 9], 8, &[0.0; 3]).is_err());
    let march = March::new(&field, 0.0, 0.0).expect("a march");
    let eyes = |width, at| Eyes {
        heights: &[0.0; 6],
        width,
        at,
    };
    let raise = |eyes: Eyes<'_>, count| march.raise(&eyes, 0.0, &mut vec![0.0; count], &());
    assert_eq!(raise(eyes(3, [0, -1 << 28]), 6), Ok(()));
    assert!(is_range(raise(eyes(3, [0, 1 << 29]), 6)) && is_range(raise(eyes(0, [0; 2]), 6)));
    assert!(raise(eyes(4, [0; 2]), 6).is_err() && raise(eyes(3, [0; 2]), 5).is_err());
}

#[test]
fn light_and_horizons_come_from_tiles_far_away() {
    let mut random = Rng::new(54);
    let mut far = 0;
    for round in 0..12 {
        let size = [0, 1].map(|_| 250 + (f64::from(random.unit()) * 100.0) as usize);
        let holes = [0.0, 0.0, 0.002][round % 3];
        let mut raster = Raster::new(&mut random, size, holes, TRANSFORMS[round % 4]);
        let unit = [64, 80, 128][round / 4];
        let [columns, rows] = size.map(|size| (0..size).step_by(unit));
        let tiles = rows.flat_map(|row| columns.clone().map(move |column| [column, row]));
        let tiles = tiles.map(|at| Tile {
            at: [0, 1].map(|axis| raster.at[axis] + at[axis] as i64),
            size: [0, 1].map(|axis| unit.min(size[axis] - at[axis])),
        });
        raster.tiles = tiles.collect();
        raster.side = [None, Some(8), Some(1), Some(32)][round % 4];
        // A plain with some ranges of hills, of which a cell may see what is far away.
        let lowest = raster.heights.iter().copied().fold(f64::NAN, f64::min);
        for (cell, height) in raster.heights.iter_mut().enumerate() {
            let [column, row] = [cell % size[0], cell / size[0]];
            if (column + 2 * row) % 211 > 9 && (3 * column + row) % 173 > 4 {
                *height = lowest + 0.05 * (*height - lowest);
            }
        }
        let field = raster.field();
        let rise = if round % 2 == 0 { 2.0 } else { 0.0 };
        let pull = Pull {
            tiles: &raster,
            rise,
        };
        let azimuths: Vec<f64> = (0..3)
            .map(|index| azimuth(&mut random, &field, index + round))
            .collect();
        let relief = raster.heights.iter().copied().fold(lowest, f64::max) - lowest;
        let long = field.unit() * size[0] as f64;
        let suns = [0.05, 0.3, 1.0, 3.0].map(|part| {
            let azimuth = azimuth(&mut random, &field, round);
            [azimuth, part * relief / long]
        });
        let march = March::new(&field, rise, 0.0).expect("a march");
        let wholes: Vec<Vec<u64>> = azimuths
            .iter()
            .map(|&azimuth| bits(&march, azimuth))
            .collect();
        let shadows = Shadows::new(&field, rise).expect("shadows");
        let lit = shadows.all_lit(&suns, &()).expect("light");
        for index in 0..2 {
            let count = raster.tiles.len() as f64;
            let own = raster.tiles[(f64::from(random.unit()) * count) as usize];
            let about = format!("{round} {index} {size:?} {own:?} {azimuths:?} {suns:?}");
            let found = pull.lit(&own, &suns, &()).expect("light");
            for (found, lit) in found.values.iter().zip(&lit) {
                let bit = |plane: &[u64], width: usize, [column, row]: [usize; 2]| {
                    plane[row * width.div_ceil(64) + column / 64] >> (column % 64) & 1
                };
                for cell in 0..own.size[0] * own.size[1] {
                    let at = [cell % own.size[0], cell / own.size[0]];
                    let place =
                        [0, 1].map(|axis| at[axis] + (own.at[axis] - raster.at[axis]) as usize);
                    let wanted = bit(lit, size[0], place);
                    assert_eq!(bit(found, own.size[0], at), wanted, "{about} {at:?}");
                }
            }
            let beside = |tile: &usize| {
                let tile = raster.tiles[*tile];
                (0..2).all(|axis| (tile.at[axis] - own.at[axis]).abs() <= unit as i64)
            };
            far += found.read.iter().filter(|tile| !beside(tile)).count();
            let found = pull.horizons(&own, &azimuths, 0.0, &()).expect("horizons");
            far += found.read.iter().filter(|tile| !beside(tile)).count();
            for (found, whole) in found.values.iter().zip(&wholes) {
                let wanted = raster.part(whole, own);
                let mut cells = found.iter().zip(&wanted);
                assert!(
                    cells.all(|(slope, whole)| slope.is_nan() || slope.to_bits() == *whole),
                    "{about}"
                );
            }
        }
    }
    assert!(far > 50, "{far}");
}
