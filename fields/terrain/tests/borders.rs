//! Tiles of a raster that hand their hulls on, against the whole raster, bit for bit.

use antumbra_terrain::{Border, Error, HeightField, Lattice, Sweep, Tile, TileSweep, degrees};
use antumbra_testkit::Rng;

const PLAIN: [f64; 6] = [0.0, 1.0, 0.0, 0.0, 0.0, -1.0];

/// A raster, and who looks.
struct Whole {
    size: [i64; 2],
    transform: [f64; 6],
    heights: Vec<f64>,
    rise: f64,
    drop: f64,
    has_holes: bool,
}

impl Whole {
    /// Rough ground between -50 and 4000 with planes, in single or double precision.
    fn new(size: [i64; 2], transform: [f64; 6], holes: f64, rise: f64, drop: f64) -> Self {
        let mut rng = Rng::new(size[0] as u64);
        let is_single = size[0] % 2 == 1;
        let cells = (0..size[0] * size[1]).map(|cell| {
            let [x, y] = [cell % size[0], cell / size[0]];
            let is_plane = (x / 13 + y / 11) % 2 == 0;
            let [x, y] = [x, y].map(|at| at as f64);
            let wave = 1800.0 * (1.0 + (x / 9.0).sin() * (cell as f64 / 500.0).cos());
            let noise = f64::from(rng.unit()) + 1e-9 * f64::from(rng.unit());
            let height = match rng.below(4) {
                // Points on one line, but for digits that are rounded.
                _ if is_plane => x / 3.0 + y / 7.0,
                0 => 700.0,
                1 => wave,
                _ => 4050.0 * noise - 50.0,
            };
            match f64::from(rng.unit()) < holes {
                true => f64::NAN,
                false if is_single => f64::from(height as f32),
                false => height,
            }
        });
        let heights: Vec<f64> = cells.collect();
        let has_holes = heights.iter().any(|height| height.is_nan()) || size.contains(&1);
        Self {
            size,
            transform,
            heights,
            rise,
            drop,
            has_holes,
        }
    }

    /// Horizons of all cells.
    fn horizons(&self, step: [i32; 2]) -> Vec<u32> {
        let size = self.size.map(|size| size as usize);
        let field = HeightField::new(size, &self.heights, self.transform).expect("a field");
        assert_eq!(field.has_holes(), self.has_holes);
        let sweep = self.sweep(&field);
        let found = sweep.horizons(step, |slope| slope as f32, &());
        found
            .expect("horizons")
            .into_iter()
            .map(f32::to_bits)
            .collect()
    }

    fn sweep<'a>(&self, field: &'a HeightField<'a>) -> Sweep<'a> {
        let (rise, drop) = (self.rise, self.drop);
        Sweep { field, rise, drop }
    }

    /// Horizons of the cells of a tile, which sees so many cells around it.
    fn tile(
        &self,
        tile: Tile,
        margin: [i64; 2],
        step: [i32; 2],
        entering: &[Border],
    ) -> Result<(Vec<f32>, Border), Error> {
        let side = |axis: usize| {
            let first = (tile.at[axis] - margin[axis]).max(0);
            first..(tile.at[axis] + tile.size[axis] as i64 + margin[axis]).min(self.size[axis])
        };
        let [columns, rows] = [side(0), side(1)];
        let cells = rows.clone().flat_map(|row| {
            let first = row * self.size[0];
            &self.heights[(first + columns.start) as usize..(first + columns.end) as usize]
        });
        let heights: Vec<f64> = cells.copied().collect();
        // Far from the origin, as tiles of countries are.
        let mut transform = self.transform;
        transform[0] += 1e6 * tile.at[0] as f64;
        let size = [&columns, &rows].map(|side| (side.end - side.start) as usize);
        let field = HeightField::new(size, &heights, transform)?;
        let part = TileSweep {
            sweep: self.sweep(&field),
            at: [columns.start, rows.start],
            tile,
            whole: self.size,
            has_holes: self.has_holes,
        };
        part.horizons(step, entering, |slope| slope as f32, &())
    }

    /// Sweeps tiles in any order in which borders are there when they are needed.
    fn in_tiles(&self, tiles: &[Tile], step: [i32; 2], rng: &mut Rng) -> Vec<u32> {
        let mut found = vec![0; self.heights.len()];
        let mut bytes: Vec<Option<Vec<u8>>> = vec![None; tiles.len()];
        let mut left: Vec<usize> = (0..tiles.len()).collect();
        while !left.is_empty() {
            let is_ready = |&place: &usize| {
                let ahead = tiles[left[place]].ahead(step, tiles);
                ahead.iter().all(|&index| bytes[index].is_some())
            };
            let ready: Vec<usize> = (0..left.len()).filter(is_ready).collect();
            assert!(!ready.is_empty(), "{step:?}: no tile is first of {tiles:?}");
            let index = left.swap_remove(ready[rng.below(ready.len())]);
            let tile = tiles[index];
            let borders = tile.ahead(step, tiles).into_iter().map(|index| {
                let border = Border::from_bytes(bytes[index].as_ref().expect("it is ready"));
                // What is sent may be all, or what is needed.
                let (border, other) = (border.expect("a border"), rng.below(2) == 0);
                if other { border } else { border.part(&tile) }
            });
            let borders: Vec<Border> = borders.collect();
            let margin = step.map(|steps| i64::from(steps.abs()).max(1) + rng.below(2) as i64);
            let (own, border) = self.tile(tile, margin, step, &borders).expect("horizons");
            bytes[index] = Some(border.to_bytes());
            assert_eq!(own.len(), tile.size[0] * tile.size[1]);
            for (cell, own) in own.into_iter().enumerate() {
                let column = tile.at[0] + (cell % tile.size[0]) as i64;
                let row = tile.at[1] + (cell / tile.size[0]) as i64;
                found[(row * self.size[0] + column) as usize] = own.to_bits();
            }
        }
        found
    }
}

/// A hill of which each cell is a point of the hulls, so that they are deeper than usual. The part before a diagonal is level: there,
/// lines of the first rows of a tile are shallow, and lines that enter from the side are not.
fn dome(size: [i64; 2]) -> Whole {
    let heights = (0..size[0] * size[1]).map(|cell| {
        let [x, y] = [cell % size[0], cell / size[0]];
        match x + y < 86 {
            true => 0.0,
            false => 4000.0 - 0.09 * (x - y).pow(2) as f64,
        }
    });
    let heights = heights.collect();
    let whole = Whole::new(size, PLAIN, 0.0, 0.0, 0.0);
    Whole { heights, ..whole }
}

/// Rough ground with a lake at a corner, so that most tiles have no hole.
fn lake(size: [i64; 2]) -> Whole {
    let mut whole = Whole::new(size, PLAIN, 0.0, 1.5, 0.0);
    for cell in 0..size[0] * size[1] {
        let [x, y] = [cell % size[0], cell / size[0]];
        if x * x + 2 * y * y < 300 {
            whole.heights[cell as usize] = f64::NAN;
        }
    }
    let has_holes = true;
    Whole { has_holes, ..whole }
}

/// Tiles between cuts of both axes.
fn grid(cuts: [Vec<i64>; 2]) -> Vec<Tile> {
    let [columns, rows] = cuts;
    let mut tiles = Vec::new();
    for y in rows.windows(2) {
        for x in columns.windows(2) {
            let at = [x[0], y[0]];
            let size = [x[1] - x[0], y[1] - y[0]].map(|cells| cells as usize);
            tiles.push(Tile { at, size });
        }
    }
    tiles
}

/// Cuts a tile in two, again and again, so that tiles are beside several others.
fn divided(tile: Tile, rng: &mut Rng, tiles: &mut Vec<Tile>) {
    let axis = rng.below(2);
    let size = tile.size[axis];
    if size == 1 || tile.size[0] * tile.size[1] < 40 + rng.below(400) {
        tiles.push(tile);
        return;
    }
    let cut = 1 + rng.below(size - 1);
    let [mut first, mut second] = [tile; 2];
    first.size[axis] = cut;
    second.at[axis] += cut as i64;
    second.size[axis] -= cut;
    divided(first, rng, tiles);
    divided(second, rng, tiles);
}

/// A regular grid with smaller last tiles, cuts at random places, and tiles of all sizes.
fn partitions(size: [i64; 2], rng: &mut Rng) -> [Vec<Tile>; 3] {
    let regular = size.map(|size| {
        let cuts = (0..size).step_by(17);
        cuts.chain([size]).collect::<Vec<_>>()
    });
    let random = size.map(|size| {
        // Mostly some cells apart, so that steps jump over tiles.
        let mut cuts = vec![0];
        while let Some(last) = cuts.last().copied().filter(|last| *last < size) {
            let most = [3, 30][rng.below(2)];
            cuts.push((last + 1 + rng.below(most) as i64).min(size));
        }
        cuts
    });
    let mut tiles = Vec::new();
    let size = size.map(|cells| cells as usize);
    divided(Tile { at: [0; 2], size }, rng, &mut tiles);
    [grid(regular), grid(random), tiles]
}

#[test]
fn tiles_have_the_bits_of_the_whole() {
    let turned = [0.0, 0.6, 0.8, 0.0, 0.8, -0.6];
    let sheared = [9.0, 2.0, 0.5, 7.0, -0.25, -1.5];
    let wholes = [
        Whole::new([70, 41], PLAIN, 0.0, 0.0, 0.0),
        Whole::new([41, 60], sheared, 0.0, 1.7, 0.0),
        Whole::new([63, 52], PLAIN, 0.1, 0.0, 0.0),
        Whole::new([48, 50], turned, 0.5, 30.0, 1e-3),
        Whole::new([52, 47], [0.0, 25.0, 0.0, 0.0, 0.0, -3.0], 0.7, 0.0, 2e-3),
        Whole::new([60, 40], PLAIN, 0.0, 900.0, 1e-2),
        dome([110, 100]),
        lake([66, 58]),
        Whole::new([1, 33], PLAIN, 0.0, 1.0, 0.0),
    ];
    let mut rng = Rng::new(4);
    for (index, whole) in wholes.iter().enumerate() {
        let heights = [0.0; 4];
        let field = HeightField::new([2, 2], &heights, whole.transform).expect("a field");
        // These are the steps of smaller lattices, too.
        for step in Lattice::new(&field, 48).expect("a lattice").steps {
            let wanted = whole.horizons(step);
            for (kind, tiles) in partitions(whole.size, &mut rng).iter().enumerate() {
                let found = whole.in_tiles(tiles, step, &mut rng);
                let differ = found.iter().zip(&wanted).filter(|(a, b)| a != b).count();
                assert_eq!(differ, 0, "raster {index}, step {step:?}, tiles {kind}");
            }
        }
    }
}

/// Borders of the eastern half of a raster, and the western half.
fn halves() -> (Whole, Border, Tile) {
    let whole = Whole::new([40, 30], PLAIN, 0.1, 0.0, 0.0);
    let [west, east] = [0, 20].map(|column| Tile {
        at: [column, 0],
        size: [20, 30],
    });
    let (_, border) = whole.tile(east, [2, 1], [2, 1], &[]).expect("horizons");
    (whole, border, west)
}

#[test]
fn borders_do_not_depend_on_tiles() {
    for (holes, drop) in [(0.0, 0.0), (0.0, 1e-3), (0.3, 0.0)] {
        let whole = Whole::new([40, 30], PLAIN, holes, 0.0, drop);
        for step in [[1, 0], [2, 1], [3, -1], [1, -3], [4, 3]] {
            let margin = step.map(|steps: i32| i64::from(steps.abs()).max(1));
            let mut rest = Vec::new();
            let sweep = |first: i64, end: i64, entering: &[Border]| {
                let tile = Tile {
                    at: [first, 0],
                    size: [(end - first) as usize, 30],
                };
                let found = whole.tile(tile, margin, step, entering);
                found.expect("horizons").1
            };
            let mut end = 40;
            for first in [36, 28, 24, 17] {
                rest = vec![sweep(first, end, &rest)];
                end = first;
            }
            assert_eq!(
                rest[0].to_bytes(),
                sweep(17, 40, &[]).to_bytes(),
                "{step:?}"
            );
        }
    }
}

#[test]
fn bytes_of_borders_come_back_and_damage_is_found() {
    let (whole, border, west) = halves();
    let bytes = border.to_bytes();
    let again = Border::from_bytes(&bytes).expect("a border");
    assert_eq!(again.to_bytes(), bytes);
    assert_eq!(border.part(&west).to_bytes(), bytes);
    let found = whole.tile(west, [2, 1], [2, 1], &[again]);
    let wanted = whole.horizons([2, 1]);
    let (found, own) = found.expect("horizons");
    // What leaves a tile does not enter it.
    assert!(whole.tile(west, [2, 1], [2, 1], &[own, border]).is_ok());
    assert!((0..20).all(|cell| found[cell].to_bits() == wanted[cell]));
    let mut rng = Rng::new(2);
    let is_refused = |bytes: &[u8]| matches!(Border::from_bytes(bytes), Err(Error::Border { .. }));
    for place in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[place] ^= 1 + rng.below(255) as u8;
        assert!(is_refused(&damaged), "byte {place}");
        assert!(is_refused(&bytes[..place]), "{place} bytes");
    }
    let longer = [&bytes[..], &[0; 8]].concat();
    assert!(is_refused(&longer) && is_refused(&longer[..bytes.len() + 1]));
}

#[test]
fn what_does_not_go_together_is_refused() {
    let (whole, border, west) = halves();
    let borders = std::slice::from_ref(&border);
    let sweep = |whole: &Whole, margin: [i64; 2], step, borders: &[Border]| {
        whole.tile(west, margin, step, borders).map(|_| ())
    };
    assert_eq!(sweep(&whole, [2, 1], [2, 1], borders), Ok(()));
    // Rows are 30 of each column that a step crosses.
    let missing = Err(Error::Length {
        what: "hulls of lines that enter the tile",
        found: 0,
        wanted: 58,
    });
    assert_eq!(sweep(&whole, [2, 1], [2, 1], &[]), missing);
    let none = [border.part(&Tile {
        at: [50, 0],
        size: [9, 9],
    })];
    assert_eq!(sweep(&whole, [2, 1], [2, 1], &none), missing);
    // Columns for the crossings of a step, and rows beside it for triangles.
    let (at, size) = ([0, 5], [20, 10]);
    for (margin, step) in [([1, 1], [2, 1]), ([1, 0], [1, 0])] {
        let narrow = whole.tile(Tile { at, size }, margin, step, &[]);
        let what = "columns before the tile";
        assert!(matches!(narrow, Err(Error::Range { what: found, .. }) if found == what));
    }
    let is_other = |found| matches!(found, Err(Error::Border { .. }));
    assert!(is_other(sweep(&whole, [2, 2], [1, 1], borders)), "step");
    let curved = Whole {
        drop: 1e-3,
        ..halves().0
    };
    assert!(is_other(sweep(&curved, [2, 1], [2, 1], borders)), "earth");
    let mut hidden = halves().0;
    hidden.has_holes = false;
    let hidden = sweep(&hidden, [2, 1], [2, 1], borders);
    assert!(matches!(hidden, Err(Error::Range { what, .. }) if what.contains("holes")));
    let field = HeightField::new([2, 2], &[0.0; 4], PLAIN).expect("a field");
    let refused = |at: [i64; 2], tile: Tile, whole: [i64; 2], step: [i32; 2]| {
        let sweep = Sweep {
            field: &field,
            rise: 0.0,
            drop: 0.0,
        };
        let part = TileSweep {
            sweep,
            at,
            tile,
            whole,
            has_holes: false,
        };
        let found = part.horizons(step, &[], degrees, &());
        assert!(
            matches!(found, Err(Error::Range { .. })),
            "{part:?} {step:?}"
        );
    };
    let tile = |at: i64, size: i64| Tile {
        at: [at; 2],
        size: [size as usize; 2],
    };
    refused([0; 2], tile(0, 2), [2; 2], [2, 2]);
    refused([0; 2], tile(0, 2), [1; 2], [1, 0]);
    refused([-1; 2], tile(-1, 2), [2; 2], [1, 0]);
    refused([i64::MIN; 2], tile(i64::MAX, i64::MAX), [2; 2], [1, 0]);
    refused([0; 2], tile(i64::MIN, i64::MAX), [2; 2], [1, 0]);
    refused([0; 2], tile(1, 0), [2; 2], [1, 0]);
    refused([0; 2], tile(1, i64::MAX), [2; 2], [1, 0]);
    refused([0; 2], tile(0, 2), [i64::MAX; 2], [1, 0]);
    refused([1 << 54; 2], tile(1 << 54, 2), [(1 << 54) + 2; 2], [1, 0]);
    // Steps of so many parts that their distances are not exact.
    let heights = vec![f64::NAN; 200 * 200];
    let field = HeightField::new([200; 2], &heights, PLAIN).expect("a field");
    let whole = [(1 << 40) - 1; 2];
    let at = whole.map(|whole| whole - 200);
    let (rise, drop) = (0.0, 0.0);
    let part = TileSweep {
        sweep: Sweep {
            field: &field,
            rise,
            drop,
        },
        at,
        tile: Tile {
            at: at.map(|at| at + 190),
            size: [10; 2],
        },
        whole,
        has_holes: true,
    };
    let [near, far] = [[1, 1], [127, 128]].map(|step| part.horizons(step, &[], degrees, &()));
    assert!(matches!(near, Ok((found, _)) if found.iter().all(|x| x.is_nan())));
    assert!(matches!(
        far,
        Err(Error::Range {
            what: "parts of a line",
            ..
        })
    ));
}

#[test]
fn tiles_far_from_the_first_cell_have_the_same_bits() {
    let small = Whole::new([40, 30], PLAIN, 0.0, 0.0, 1e-3);
    let field = HeightField::new([40, 30], &small.heights, PLAIN).expect("a field");
    let moved = [1 << 38, (1 << 39) + 1];
    let part = TileSweep {
        sweep: small.sweep(&field),
        at: moved,
        tile: Tile {
            at: moved,
            size: [40, 30],
        },
        whole: [moved[0] + 40, moved[1] + 30],
        has_holes: false,
    };
    // Nothing is ahead in the south and east, where the whole ends; the margin in the north and west is missing.
    assert!(part.horizons([3, 2], &[], degrees, &()).is_err());
    let tile = Tile {
        at: moved.map(|at| at + 3),
        size: [37, 27],
    };
    let part = TileSweep { tile, ..part };
    let (found, border) = part
        .horizons([3, 2], &[], |slope| slope as f32, &())
        .expect("horizons");
    let wanted = small.horizons([3, 2]);
    for (cell, found) in found.iter().enumerate() {
        let [column, row] = [cell % 37 + 3, cell / 37 + 3];
        assert_eq!(found.to_bits(), wanted[row * 40 + column]);
    }
    assert!(Border::from_bytes(&border.to_bytes()).is_ok());
}
