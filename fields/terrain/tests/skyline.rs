//! Lights that the surface hides, against all triangles one by one and against the horizons of cells.

use antumbra_terrain::{HeightField, Lattice, March, Skyline};
use antumbra_testkit::Rng;

const TRANSFORMS: [[f64; 6]; 4] = [
    [0.0, 1.0, 0.0, 0.0, 0.0, -1.0],
    [0.0, 2.0, 0.0, 0.0, 0.0, -1.0],
    [0.0, 0.6, 0.8, 0.0, 0.8, -0.6],
    [7e6, 1.0, 0.3, 3e5, 0.1, -1.0],
];

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

/// Corners of all triangles: columns, rows and heights.
fn triangles(field: &HeightField<'_>) -> Vec<[[f64; 3]; 3]> {
    let [width, height] = field.size();
    let mut all = Vec::new();
    for row in 1..height {
        for column in 1..width {
            let corner = |left: usize, up: usize| {
                let [column, row] = [column - left, row - up];
                let height = field.heights()[row * width + column];
                [column as f64, row as f64, height]
            };
            let [a, b, c, d] = [corner(1, 1), corner(0, 1), corner(1, 0), corner(0, 0)];
            let known: Vec<_> = [a, b, c, d]
                .into_iter()
                .filter(|p| !p[2].is_nan())
                .collect();
            match known[..] {
                [_, _, _, _] => all.extend([[a, b, d], [a, c, d]]),
                [p, q, r] => all.push([p, q, r]),
                _ => {}
            }
        }
    }
    all
}

/// The largest slope from an eye to a place of a triangle in a direction, by clipping the ray at its three sides in plan; infinite
/// from below.
fn horizon(triangles: &[[[f64; 3]; 3]], [x, y, z]: [f64; 3], step: [f64; 2]) -> f64 {
    let slopes = triangles.iter().map(|corners| {
        let (mut near, mut far): (f64, f64) = (0.0, f64::INFINITY);
        let mut plane = [0.0; 2];
        let area = {
            let [a, b, c] = corners;
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        for side in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|corner| corners[(side + corner) % 3]);
            // The share of `c` at the eye, and its change on the way.
            let along = [(b[0] - a[0]) / area, (b[1] - a[1]) / area];
            let at = along[0] * (y - a[1]) - along[1] * (x - a[0]);
            let change = along[0] * step[1] - along[1] * step[0];
            plane = [plane[0] + at * c[2], plane[1] + change * c[2]];
            if change.abs() < 1e-12 {
                if at < -1e-9 {
                    return f64::NEG_INFINITY;
                }
            } else if change > 0.0 {
                near = near.max(-at / change);
            } else {
                far = far.min(-at / change);
            }
        }
        if far < near - 1e-9 || far < 1e-9 {
            return f64::NEG_INFINITY;
        }
        let slope = |way: f64| (plane[0] + way * plane[1] - z) / way;
        match (near > 1e-9, plane[0] > z + 1e-7) {
            (false, true) => f64::INFINITY,
            (false, false) => slope(far),
            (true, _) => slope(near).max(slope(far)),
        }
    });
    slopes.fold(f64::NEG_INFINITY, f64::max)
}

/// Columns and rows of a length of 1 in an azimuth.
fn step(field: &HeightField<'_>, azimuth: f64) -> [f64; 2] {
    let [_, a, b, _, d, e] = field.transform();
    let (x, y) = azimuth.to_radians().sin_cos();
    let area = a * e - b * d;
    [(e * x - b * y) / area, (a * y - d * x) / area]
}

#[test]
fn any_place_sees_what_no_triangle_hides() {
    let mut random = Rng::new(61);
    let mut counts = [0; 3];
    for round in 0..120 {
        let mut unit = || f64::from(random.unit());
        let long = round % 12 == 11;
        let size = match long {
            true => [1100, 3],
            false => [0, 1].map(|_| 1 + (unit() * 30.0) as usize),
        };
        let holes = if round % 3 == 0 { 0.0 } else { 0.15 * unit() };
        let heights = plain(&mut random, size[0] * size[1], holes);
        let field = HeightField::new(size, &heights, TRANSFORMS[round % 4]).expect("a field");
        let (skyline, triangles) = (Skyline::new(&field).expect("peaks"), triangles(&field));
        let lattice = Lattice::new(&field, 16).expect("a lattice");
        let mut unit = || f64::from(random.unit());
        for index in 0..if long { 20 } else { 60 } {
            // Anywhere, on lines and diagonals of cells, and beside the raster.
            let parts = [[1e6, 4.0, 1.0][index % 3]; 2];
            let beside = if index % 5 == 0 { 3.0 } else { 0.0 };
            let place = [0, 1].map(|axis| {
                let most = size[axis] as f64 - 1.0 + 2.0 * beside;
                ((unit() * most - beside) * parts[axis]).round() / parts[axis]
            });
            let place = place.map(|at: f64| (at * 1048576.0).round() / 1048576.0);
            let ground = field.surface(place);
            let rise = [0.0, 0.5, 5.0, -0.01][index / 3 % 4] * unit();
            let height = ground.unwrap_or(unit()) + rise;
            let azimuth = match index % 2 {
                0 => lattice.azimuths[(unit() * lattice.azimuths.len() as f64) as usize],
                _ => 360.0 * unit(),
            };
            let hides = |slope: f64| {
                let light = skyline.light(azimuth, slope).expect("a light");
                skyline.hides(place, height, &light)
            };
            let [x, y] = place;
            let own = horizon(&triangles, [x, y, height], step(&field, azimuth));
            let about = format!("{round} {size:?} {place:?} {height} {azimuth}: {own}");
            if ground.is_some_and(|ground| ground > height + 1e-6) {
                counts[2] += 1;
                assert!(hides(f64::INFINITY) && hides(1e9), "{about}");
                continue;
            }
            if own.is_finite() {
                let close = 1e-6 * (1.0 + own.abs());
                counts[0] += 1;
                assert!(hides(own - close) && !hides(own + close), "{about}");
            }
            for _ in 0..4 {
                let slope = (100.0 * unit() - 20.0).to_radians().tan();
                if (slope - own).abs() > 1e-6 * (1.0 + own.abs()) {
                    counts[1] += 1;
                    assert_eq!(hides(slope), slope < own, "{slope} {about}");
                }
            }
        }
    }
    assert!(
        counts[0] > 4000 && counts[1] > 15_000 && counts[2] > 1000,
        "{counts:?}"
    );
}

#[test]
fn centres_of_cells_have_the_horizons_of_a_march() {
    let mut random = Rng::new(62);
    let mut count = 0;
    for round in 0..60 {
        let mut unit = || f64::from(random.unit());
        let size = match round % 6 {
            5 => [600, 9],
            _ => [0, 1].map(|_| 1 + (unit() * 70.0) as usize),
        };
        let holes = if round % 3 == 0 { 0.0 } else { 0.1 * unit() };
        let rise = if round % 5 == 0 { unit() } else { 0.0 };
        let heights = plain(&mut random, size[0] * size[1], holes);
        let field = HeightField::new(size, &heights, TRANSFORMS[round % 4]).expect("a field");
        let lattice = Lattice::new(&field, [8, 16, 32, 80][round % 4]).expect("a lattice");
        let march = March::new(&field, rise, 0.0).expect("a march");
        let skyline = Skyline::new(&field).expect("peaks");
        for index in 0..6 {
            let place = f64::from(random.unit());
            let azimuth = match index % 2 {
                0 => lattice.azimuths[(place * lattice.azimuths.len() as f64) as usize],
                _ => 360.0 * place,
            };
            // The bits of each slope, in two halves.
            let bits =
                |shift: u32| move |slope: f64| f32::from_bits((slope.to_bits() >> shift) as u32);
            let [high, low] = [32, 0].map(|shift| march.horizons(azimuth, bits(shift), &()));
            let (high, low) = (high.expect("horizons"), low.expect("horizons"));
            for (cell, own) in heights.iter().enumerate().filter(|(_, own)| !own.is_nan()) {
                let [high, low] = [&high, &low].map(|half| u64::from(half[cell].to_bits()));
                let slope = f64::from_bits(high << 32 | low);
                let place = [cell % size[0], cell / size[0]].map(|at| at as f64);
                let hides = |slope: f64| {
                    let light = skyline.light(azimuth, slope).expect("a light");
                    skyline.hides(place, own + rise, &light)
                };
                count += 1;
                let about = format!("{round} {size:?} {azimuth} {place:?}: {slope}");
                if slope == f64::NEG_INFINITY {
                    assert!(!hides(-1e9), "{about}");
                } else {
                    assert!(hides(slope) && !hides(slope.next_up()), "{about}");
                }
            }
        }
    }
    assert!(count > 200_000, "{count}");
}

#[test]
fn places_that_are_nowhere_and_lights_at_the_ends() {
    let heights = [0.0, 1.0, f64::NAN, 5.0, 2.0, 0.0];
    let field =
        HeightField::new([3, 2], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]).expect("a field");
    let skyline = Skyline::new(&field).expect("peaks");
    let light = |azimuth, slope| skyline.light(azimuth, slope);
    assert!(light(f64::NAN, 1.0).is_err() && light(0.0, f64::NAN).is_err());
    let zenith = light(0.0, f64::INFINITY).expect("a light");
    let nadir = light(0.0, f64::NEG_INFINITY).expect("a light");
    for place in [[0.5, 0.5], [0.0, 1.0], [2.5, 0.0], [-9.0, 3.0]] {
        assert!(!skyline.hides(place, 9.0, &zenith) && skyline.hides(place, 9.0, &nadir));
        assert!(skyline.hides(place, f64::NAN, &zenith));
    }
    assert!(
        skyline.hides([f64::NAN, 0.0], 9.0, &zenith) && skyline.hides([0.5, 0.5], 0.1, &zenith)
    );
    // From the north of the raster, a tower of 5 m in its south is 10 cells away.
    let south = |slope| light(180.0, slope).expect("a light");
    let hides = |slope| skyline.hides([0.0, -9.0], 0.0, &south(slope));
    assert!(hides(0.5) && !hides(0.5 + 1e-9));
    // And nothing is north of it.
    assert!(!skyline.hides([0.0, -9.0], 0.0, &light(0.0, -5.0).expect("a light")));
    let empty = [f64::NAN; 4];
    let empty = HeightField::new([2, 2], &empty, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]).expect("a field");
    let skyline = Skyline::new(&empty).expect("peaks");
    assert!(!skyline.hides([0.5, 0.5], 0.0, &light(9.0, -0.1).expect("a light")));
}
