//! Horizons against all triangles, and against the dip of the sea.

use antumbra_terrain::{Error, HeightField, Lattice, March, Monitor, Sweep, degrees};
use antumbra_testkit::Rng;

const PLAIN: [f64; 6] = [0.0, 1.0, 0.0, 0.0, 0.0, -1.0];

/// A rising eye over a field, and what a round earth takes.
struct Case {
    size: [usize; 2],
    transform: [f64; 6],
    holes: f64,
    rise: f64,
    drop: f64,
}

const CASES: [Case; 10] = [
    case([70, 60], PLAIN, 0.0, 0.0, 0.0),
    case([33, 90], [9.0, 2.0, 0.5, 7.0, -0.25, -1.5], 0.0, 1.7, 0.0),
    case([64, 40], PLAIN, 0.2, 0.0, 0.0),
    case([61, 55], PLAIN, 0.01, 0.0, 0.0),
    case([50, 51], PLAIN, 0.5, 2.0, 1e-3),
    case([41, 47], PLAIN, 0.0, 0.0, 2e-3),
    case([40, 40], PLAIN, 0.0, 30.0, 1e-2),
    case([2, 2], PLAIN, 0.0, 0.0, 0.0),
    case([1, 9], PLAIN, 0.0, 1.0, 0.0),
    case([300, 9], PLAIN, 0.0, 1.0, 0.0),
];

const fn case(size: [usize; 2], transform: [f64; 6], holes: f64, rise: f64, drop: f64) -> Case {
    Case {
        size,
        transform,
        holes,
        rise,
        drop,
    }
}

/// Hills with noise in single precision, and perhaps with holes. In the west there are walls on level ground, whose points are on
/// one line.
fn hills([width, height]: [usize; 2], holes: f64, seed: u64) -> Vec<f64> {
    let mut rng = Rng::new(seed);
    let cells = (0..width * height).map(|cell| {
        let [x, y] = [(cell % width) as f64, (cell / width) as f64];
        let wave = 9.0 * (x / 17.0).sin() * (y / 13.0).cos() + 4.0 * f64::from(rng.unit());
        let built = if rng.unit() < 0.1 { 12.0 } else { 0.0 };
        let height = if x < 20.0 { built } else { wave + built };
        match f64::from(rng.unit()) < holes {
            true => f64::NAN,
            false => f64::from(height as f32),
        }
    });
    cells.collect()
}

/// Edges of all triangles as columns and rows: squares with four corners have the diagonal from the first to the last one.
fn edges(size: [usize; 2], heights: &[f64]) -> Vec<[[i64; 2]; 2]> {
    let [width, height] = size.map(|size| size as i64);
    let has = |&[c, r]: &[i64; 2]| heights[(r * width + c) as usize].is_finite();
    let mut edges = Vec::new();
    for square in 0..(width - 1).max(0) * (height - 1).max(0) {
        let [c, r] = [square % (width - 1), square / (width - 1)];
        let all = [[c, r], [c + 1, r], [c, r + 1], [c + 1, r + 1]];
        let corners: Vec<_> = all.into_iter().filter(has).collect();
        let triangles = match corners[..] {
            [a, b, c, d] => vec![[a, b, d], [a, c, d]],
            [a, b, c] => vec![[a, b, c]],
            _ => Vec::new(),
        };
        for [a, b, c] in triangles {
            edges.extend([[a, b], [b, c], [c, a]]);
        }
    }
    edges
}

/// Largest slope to all edges ahead of a cell along columns and rows. `rounding` is how far beside a corner a line passes through it.
fn brute(
    (field, edges): (&HeightField<'_>, &[[[i64; 2]; 2]]),
    case: &Case,
    cell: usize,
    step: [f64; 2],
    rounding: f64,
) -> f64 {
    let [width, _] = field.size();
    let heights = field.heights();
    let [column, row] = [(cell % width) as i64, (cell / width) as i64];
    let eye = heights[cell] + case.rise;
    let [east, north] = field.along(step);
    let length = east.hypot(north);
    let mut most = f64::NEG_INFINITY;
    let mut take = |steps: f64, height: f64| {
        let way = steps * length;
        if steps > 1e-9 {
            most = most.max((height - eye) / way - case.drop * way);
        }
    };
    for edge in edges {
        let [a, b] = edge.map(|[c, r]| {
            let height = heights[(r * width as i64 + c) as usize];
            let [c, r] = [(c - column) as f64, (r - row) as f64];
            let ahead = (c * step[0] + r * step[1]) / (step[0] * step[0] + step[1] * step[1]);
            (c * step[1] - r * step[0], ahead, height)
        });
        for end in [a, b] {
            if end.0.abs() <= rounding {
                take(end.1, end.2);
            }
        }
        if a.0.abs() > rounding && b.0.abs() > rounding && a.0.signum() != b.0.signum() {
            let part = a.0 / (a.0 - b.0);
            take(a.1 + part * (b.1 - a.1), a.2 + part * (b.2 - a.2));
        }
    }
    most
}

/// Compares horizons of some cells with those of all triangles, and returns how many.
fn compare(case: &Case, cells: usize, of: impl Fn(&HeightField<'_>) -> Vec<([f64; 2], Vec<f32>)>) {
    let heights = hills(case.size, case.holes, case.size[0] as u64);
    let field = HeightField::new(case.size, &heights, case.transform).expect("a field");
    let edges = edges(case.size, &heights);
    let mut compared = 0;
    for (index, (step, found)) in of(&field).into_iter().enumerate() {
        let is_whole = step.iter().all(|x| x.fract() == 0.0);
        let rounding = if is_whole { 0.0 } else { 1e-11 };
        let cells = cells.min(heights.len() / 3);
        for cell in (index % cells..heights.len()).step_by(cells) {
            if heights[cell].is_nan() {
                assert!(found[cell].is_nan());
                continue;
            }
            let wanted = brute((&field, &edges), case, cell, step, rounding);
            let [found, size] = [f64::from(found[cell]), case.size[0] as f64];
            let is_close = (found - wanted).abs() <= 2e-7 * (1.0 + wanted.abs());
            assert!(
                is_close || found == wanted,
                "{size} {step:?} cell {cell}: {found} for {wanted}"
            );
            compared += 1;
        }
    }
    assert!(compared > 0);
}

#[test]
fn sweeps_find_the_horizons_of_all_triangles() {
    for case in &CASES {
        compare(case, 61, |field| {
            let sweep = Sweep {
                field,
                rise: case.rise,
                drop: case.drop,
            };
            let steps = Lattice::new(field, 48).expect("a lattice").steps;
            let plane = |step: [i32; 2]| {
                let found = sweep.horizons(step, |slope| slope as f32, &());
                (step.map(f64::from), found.expect("horizons"))
            };
            steps.into_iter().map(plane).collect()
        });
    }
}

#[test]
fn walks_find_the_horizons_of_all_triangles() {
    for case in &CASES {
        compare(case, 31, |field| {
            let march = March::new(field, case.rise, case.drop).expect("memory");
            let [_, a, b, _, d, e] = field.transform();
            let plane = |azimuth: f64| {
                let found = march.horizons(azimuth, |slope| slope as f32, &());
                // Columns and rows along the azimuth; exact where the map has right angles.
                let (x, y) = azimuth.to_radians().sin_cos();
                let area = a * e - b * d;
                let mut step = [(e * x - b * y) / area, (a * y - d * x) / area];
                if azimuth % 90.0 == 0.0 && b == 0.0 {
                    step = step.map(f64::round);
                }
                (step, found.expect("horizons"))
            };
            let azimuths = [0.0, 17.0, 90.0, 123.4, 180.0, 217.0, 270.0, 301.0, 359.0];
            azimuths.into_iter().map(plane).collect()
        });
    }
}

#[test]
fn both_ways_agree_where_azimuths_do() {
    let whole = hills([90, 80], 0.0, 3);
    // A tower that no triangle joins to its surroundings, so that nobody sees it.
    let mut lone = whole.clone();
    for cell in 0..9 {
        lone[(40 + cell / 3) * 90 + 50 + cell % 3] = if cell == 4 { 900.0 } else { f64::NAN };
    }
    // In the turned raster, azimuths of columns and rows are not whole degrees, and lines of sight run along its borders.
    let turned = [0.0, 0.6, 0.8, 0.0, 0.8, -0.6];
    for (heights, transform) in [(&whole, PLAIN), (&whole, turned), (&lone, PLAIN)] {
        let field = HeightField::new([90, 80], heights, transform).expect("a field");
        let sweep = Sweep {
            field: &field,
            rise: 0.0,
            drop: 0.0,
        };
        let march = March::new(&field, 0.0, 0.0).expect("memory");
        let Lattice { steps, azimuths } = Lattice::new(&field, 16).expect("a lattice");
        for (step, azimuth) in steps.into_iter().zip(azimuths) {
            let swept = sweep.horizons(step, degrees, &()).expect("horizons");
            let walked = march.horizons(azimuth, degrees, &()).expect("horizons");
            for (cell, (a, b)) in swept.iter().zip(&walked).enumerate() {
                let is_same = (a - b).abs() < 1e-5 || a.is_nan() && b.is_nan();
                assert!(is_same, "{azimuth} {cell}: {a} and {b}");
            }
        }
    }
}

#[test]
fn parts_of_a_raster_have_the_bits_of_the_whole() {
    let (size, part) = ([120, 100], [70, 100]);
    let heights = hills(size, 0.1, 5);
    let crop: Vec<f64> = heights
        .chunks(size[0])
        .flat_map(|row| &row[50..])
        .copied()
        .collect();
    let moved = [7e6, 1.0, 0.0, -3e6, 0.0, -1.0];
    let whole = HeightField::new(size, &heights, PLAIN).expect("a field");
    let east = HeightField::new(part, &crop, moved).expect("a field");
    let bits = |field: &HeightField<'_>, index: usize| {
        let sweep = Sweep {
            field,
            rise: 0.0,
            drop: 0.0,
        };
        let march = March::new(field, 0.0, 0.0).expect("memory");
        let found = match index {
            0 => sweep.horizons([2, -1], degrees, &()),
            1 => sweep.horizons([1, 0], degrees, &()),
            _ => march.horizons(77.7, degrees, &()),
        };
        let found = found.expect("horizons").into_iter();
        found.map(f32::to_bits).collect::<Vec<_>>()
    };
    // All that is ahead in the east is in the eastern part.
    for index in 0..3 {
        let whole = bits(&whole, index);
        let whole: Vec<u32> = whole
            .chunks(120)
            .flat_map(|row| &row[50..])
            .copied()
            .collect();
        assert_eq!(
            whole
                .iter()
                .zip(&bits(&east, index))
                .filter(|(a, b)| a != b)
                .count(),
            0
        );
    }
}

/// More lines than are walked side by side, by one thread: those that it walked before leave nothing behind.
#[test]
fn columns_of_a_wide_raster_do_not_meet() {
    let thread = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let thread = thread.expect("a thread");
    for holes in [0.0, 0.1] {
        let heights = hills([1300, 12], holes, 7);
        let found = |width: usize, heights: &[f64]| {
            let field = HeightField::new([width, 12], heights, PLAIN).expect("a field");
            let sweep = Sweep {
                field: &field,
                rise: 0.0,
                drop: 0.0,
            };
            let found = thread.install(|| sweep.horizons([0, -1], degrees, &()));
            found.expect("horizons")
        };
        let whole = found(1300, &heights);
        // Columns whose neighbours on both sides are in the part.
        for first in (0..1290).step_by(8) {
            let part = heights.chunks(1300).flat_map(|row| &row[first..first + 10]);
            let part = found(10, &part.copied().collect::<Vec<_>>());
            for (row, angles) in part.chunks(10).enumerate() {
                let own = &whole[1300 * row + first..][..10];
                let bits = |angles: &[f32]| [1, 2, 3, 4, 5, 6, 7, 8].map(|at| angles[at].to_bits());
                assert_eq!(bits(angles), bits(own), "row {row} from column {first}");
            }
        }
    }
}

#[test]
fn the_sea_dips_below_the_level() {
    let size = [1601, 401];
    let transform = [0.0, 25.0, 0.0, 0.0, 0.0, -25.0];
    let sea = vec![0.0; size[0] * size[1]];
    let field = HeightField::new(size, &sea, transform).expect("a field");
    let drop = 0.87 / (2.0 * 6_371_008.8);
    for rise in [2.0_f64, 10.0] {
        // Largest value of (-h - f t²) / t, at t = sqrt(h / f).
        let wanted = (-2.0 * (rise * drop).sqrt()).atan().to_degrees();
        let sweep = Sweep {
            field: &field,
            rise,
            drop,
        };
        let march = March::new(&field, rise, drop).expect("memory");
        let found = [
            sweep.horizons([1, 0], degrees, &()),
            sweep.horizons([-3, 1], degrees, &()),
            march.horizons(91.0, degrees, &()),
        ];
        for found in found {
            let found = f64::from(found.expect("horizons")[200 * size[0] + 800]);
            assert!((found - wanted).abs() < 2e-5, "{found} for {wanted}");
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let heights = [1.0, 2.0, 3.0, f64::NAN];
    let field = HeightField::new([2, 2], &heights, PLAIN).expect("a field");
    let sweep = Sweep {
        field: &field,
        rise: -1.0,
        drop: 0.0,
    };
    let below = sweep.horizons([1, 0], degrees, &()).expect("horizons");
    assert_eq!(below[..3], [90.0; 3], "eyes are below the surface");
    assert!(below[3].is_nan());
    let march = March::new(&field, -1.0, 0.0).expect("memory");
    assert_eq!(
        march.horizons(3.0, degrees, &()).expect("horizons")[..3],
        [90.0; 3]
    );
    for step in [[0, 0], [2, 4], [3, 0]] {
        assert!(matches!(
            sweep.horizons(step, degrees, &()),
            Err(Error::Range { .. })
        ));
    }
    assert!(matches!(
        march.horizons(f64::NAN, degrees, &()),
        Err(Error::Range { .. })
    ));
    assert!(matches!(
        Lattice::new(&field, 9),
        Err(Error::Range { found: 9.0, .. })
    ));
    struct Stop;
    impl Monitor for Stop {
        fn cancelled(&self) -> bool {
            true
        }
    }
    assert_eq!(
        sweep.horizons([1, 0], degrees, &Stop),
        Err(Error::Cancelled)
    );
    assert_eq!(march.horizons(0.0, degrees, &Stop), Err(Error::Cancelled));
}

#[test]
fn weights_of_azimuths_are_their_share_of_the_circle() {
    let heights = [0.0; 4];
    for (transform, count) in [(PLAIN, 16), ([0.0, 3.0, 0.4, 0.0, 0.2, -1.0], 32)] {
        let field = HeightField::new([2, 2], &heights, transform).expect("a field");
        let lattice = Lattice::new(&field, count).expect("a lattice");
        let weights = lattice.weights();
        assert_eq!([lattice.azimuths.len(), weights.len()], [count; 2]);
        assert!(lattice.azimuths.is_sorted() && weights.iter().all(|&weight| weight > 0.0));
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
