//! Shadows against horizons, which come from all crossings in double precision.

use antumbra_terrain::{HeightField, Lattice, March, Shadows, per_cell};
use antumbra_testkit::Rng;

/// Heights of a plain with towers, and with holes for this part of the cells.
fn plain(random: &mut Rng, cells: usize, holes: f64) -> Vec<f64> {
    let mut unit = || f64::from(random.unit());
    let mut height = || match (unit() < holes, unit() < 0.05) {
        (true, _) => f64::NAN,
        (false, true) => 20.0 * unit(),
        (false, false) => unit(),
    };
    (0..cells).map(|_| height()).collect()
}

/// Whether cells are lit, as their horizons say.
fn expected(field: &HeightField<'_>, rise: f64, [azimuth, slope]: [f64; 2]) -> Vec<bool> {
    let march = March::new(field, rise, 0.0).expect("a march");
    let lit = |horizon: f64| f32::from(u8::from(horizon < slope));
    let found = march.horizons(azimuth, lit, &()).expect("horizons");
    found.into_iter().map(|lit| lit == 1.0).collect()
}

#[test]
fn cells_are_lit_where_their_horizon_is_below_the_light() {
    let mut random = Rng::new(51);
    let transforms = [
        [0.0, 1.0, 0.0, 0.0, 0.0, -1.0],
        [0.0, 2.0, 0.0, 0.0, 0.0, -1.0],
        [0.0, 0.6, 0.8, 0.0, 0.8, -0.6],
        [7e6, 1.0, 0.3, 3e5, 0.1, -1.0],
    ];
    let mut counts = [0; 2];
    for round in 0..160 {
        let mut unit = || f64::from(random.unit());
        let mut size = [0, 1].map(|_| 1 + (unit() * 70.0) as usize);
        if round % 8 == 6 {
            size[round / 8 % 2] = 1;
        }
        // So many that cells are far from all others, in a third of the rounds.
        let holes = [0.0, 0.1, 0.7][round % 3] * unit();
        let rise = if round % 5 == 0 { unit() } else { 0.0 };
        let heights = plain(&mut random, size[0] * size[1], holes);
        let field = HeightField::new(size, &heights, transforms[round % 4]).expect("a field");
        // Half of them along lines of cells, where rays touch corners and run along borders, also in turned rasters.
        let lattice = Lattice::new(&field, [8, 16, 32, 80][round % 4]).expect("a lattice");
        let mut unit = || f64::from(random.unit());
        let direction = |index| {
            let place = unit();
            let azimuth = match index % 2 {
                0 => lattice.azimuths[(place * lattice.azimuths.len() as f64) as usize],
                _ => 360.0 * place,
            };
            [azimuth, (80.0 * unit() - 1.0).to_radians().tan()]
        };
        let directions: Vec<[f64; 2]> = (0..8).map(direction).collect();
        let shadows = Shadows::new(&field, rise).expect("shadows");
        let planes = shadows.all_lit(&directions, &()).expect("planes");
        let mut seen = vec![0; heights.len()];
        per_cell(&planes, size[0], &mut seen, |_, own, bits| own[0] = bits);
        for (index, &direction) in directions.iter().enumerate() {
            let wanted = expected(&field, rise, direction);
            for (cell, (&seen, wanted)) in seen.iter().zip(wanted).enumerate() {
                let is_lit = seen >> index & 1 == 1;
                counts[usize::from(is_lit)] += 1;
                assert_eq!(is_lit, wanted, "{round} {size:?} {direction:?} {cell}");
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 100_000), "{counts:?}");
}

#[test]
fn long_shadows_cross_many_blocks_of_rows() {
    // A ridge, a tower on a plain, and a sun that is so low that the shadow is longer than the raster.
    let size = [300, 400];
    let height = |cell: usize| match [cell % size[0], cell / size[0]] {
        [150, 200] => 30.0,
        [column, 40] => 3.0 + (column as f64 / 20.0).sin(),
        [column, row] => 0.01 * ((column * 31 + row * 17) % 7) as f64,
    };
    let heights: Vec<f64> = (0..size[0] * size[1]).map(height).collect();
    let field = HeightField::new(size, &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]).expect("a field");
    let shadows = Shadows::new(&field, 0.0).expect("shadows");
    for direction in [
        [3.0, 0.01],
        [357.3, 0.08],
        [12.0, 0.2],
        [91.7, 0.05],
        [183.0, 0.03],
    ] {
        let plane = shadows.all_lit(&[direction], &()).expect("a plane");
        let mut lit = vec![false; heights.len()];
        per_cell(&plane, size[0], &mut lit, |_, lit, seen| lit[0] = seen == 1);
        assert!(lit == expected(&field, 0.0, direction), "{direction:?}");
    }
}

#[test]
fn lights_that_are_nowhere_and_at_the_zenith() {
    let heights = [0.0, 1.0, f64::NAN, 5.0, 2.0, 0.0];
    let field =
        HeightField::new([3, 2], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]).expect("a field");
    let shadows = Shadows::new(&field, 0.0).expect("shadows");
    let lit = |azimuth, slope| shadows.lit(azimuth, slope);
    assert_eq!(lit(0.0, f64::INFINITY), Ok(vec![0b011, 0b111]));
    assert_eq!(lit(0.0, f64::NEG_INFINITY), Ok(vec![0, 0]));
    assert_eq!(lit(0.0, 1e16), Ok(vec![0b011, 0b111]));
    let marked = [0.0, -3.4e38, 1.0, 2.0];
    let marked =
        HeightField::new([2, 2], &marked, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]).expect("a field");
    assert!(
        Shadows::new(&marked, 0.0).is_err(),
        "a mark of missing data"
    );
    assert!(lit(f64::NAN, 1.0).is_err() && lit(0.0, f64::NAN).is_err());
    let buried = Shadows::new(&field, -1.0).expect("shadows");
    assert_eq!(buried.lit(0.0, 1.0), Ok(vec![0, 0]));
}
