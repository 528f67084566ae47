//! The sky above cells of height fields against closed forms and against sums over elevations.

use antumbra_bake::{
    Direction, FieldHorizonJob, FieldSky, HeightField, Lattice, SkyMeasure, SkyValues,
};
use antumbra_testkit::Rng;

const ALL: [SkyMeasure; 3] = [SkyMeasure::View, SkyMeasure::Open, SkyMeasure::Openness];

fn directions(field: &HeightField<'_>, azimuths: usize) -> Vec<Direction> {
    let lattice = Lattice::new(field, azimuths).expect("a lattice");
    lattice.steps.into_iter().map(Direction::Step).collect()
}

fn sky(field: &HeightField<'_>, directions: &[Direction], measure: SkyMeasure) -> SkyValues {
    let job = FieldHorizonJob::new(field, directions, 0.0, 0.0).expect("a job");
    let mut sky = FieldSky::new(field, directions, measure).expect("sums");
    for index in 0..directions.len() {
        sky.add(index, &job.plane(index, &()).expect("horizons"));
    }
    sky.finish()
}

#[test]
fn planes_see_what_their_slope_leaves() {
    for degrees in [0.0_f64, 20.0, 45.0, 70.0] {
        let slope = degrees.to_radians();
        let heights: Vec<f64> = (0..81)
            .map(|cell| slope.tan() * 2.0 * f64::from(cell % 9))
            .collect();
        let field =
            HeightField::new([9, 9], &heights, [0.0, 2.0, 0.0, 0.0, 0.0, -2.0]).expect("a field");
        let lattice = directions(&field, 80);
        let wanted = [
            0.5 * (1.0 + slope.cos()),
            1.0 - slope / std::f64::consts::PI,
        ];
        for (measure, wanted) in ALL.into_iter().zip(wanted) {
            let found = sky(&field, &lattice, measure);
            for (cell, value) in found.values.iter().enumerate() {
                let apart = (f64::from(*value) - wanted).abs();
                assert!(
                    apart < 2e-3,
                    "{degrees} {measure:?} {cell}: {value}, not {wanted}"
                );
            }
            let [mean, most] = found.quadrature_error.expect("half of the azimuths");
            assert!(
                mean <= most + 1e-12 && most < 0.01,
                "{degrees}: {mean} {most}"
            );
        }
    }
}

#[test]
fn streets_see_what_their_walls_leave() {
    // The middle of a long street, 3 m beside walls that are 2.25 m high.
    let [width, length] = [9, 1201];
    let heights: Vec<f64> = (0..width * length)
        .map(|cell| match cell % width {
            0 | 1 | 7 | 8 => 2.25,
            _ => 0.0,
        })
        .collect();
    let field = HeightField::new([width, length], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])
        .expect("a field");
    let wall = 0.75_f64.atan();
    let wanted = [wall.cos(), 1.0 - 2.0 * wall / std::f64::consts::PI];
    for (measure, wanted) in ALL.into_iter().zip(wanted) {
        let errors = [8, 16, 48].map(|azimuths| {
            let found = sky(&field, &directions(&field, azimuths), measure);
            let middle = width * (length / 2) + 4;
            (f64::from(found.values[middle]) - wanted).abs()
        });
        assert!(
            errors[2] < 1e-3 && errors.iter().all(|error| *error < 0.03),
            "{measure:?}: {errors:?}"
        );
    }
}

/// Sum over many elevations above a horizon and in front of a surface that rises so.
fn by_elevations(measure: SkyMeasure, horizon: f64, [rise, size]: [f64; 2]) -> f64 {
    const STEPS: usize = 20_000;
    let step = std::f64::consts::FRAC_PI_2 / STEPS as f64;
    let lowest = horizon.to_radians();
    let steps = (0..STEPS).map(|index| (index as f64 + 0.5) * step);
    let seen = steps.filter(|&angle| angle > lowest && angle.tan() > rise);
    match measure {
        SkyMeasure::View => {
            let facing = |angle: f64| (angle.sin() - rise * angle.cos()) / size;
            seen.map(|angle| 2.0 * step * angle.cos() * facing(angle))
                .sum()
        }
        SkyMeasure::Open => seen.map(|angle| step * angle.cos()).sum(),
        SkyMeasure::Openness => 90.0 - if horizon == -90.0 { 0.0 } else { horizon },
    }
}

#[test]
fn values_are_sums_over_azimuths_and_elevations() {
    let mut random = Rng::new(5);
    for round in 0..6 {
        let size = [5 + round, 11 - round];
        let mut heights: Vec<f64> = (0..size[0] * size[1])
            .map(|_| 8.0 * f64::from(random.unit()))
            .collect();
        if round > 2 {
            heights[7 + round] = f64::NAN;
            heights[0] = f64::NAN;
            // The last cell is in no triangle.
            let last = heights.len() - 1;
            for cell in [last - 1, last - size[0], last - size[0] - 1] {
                heights[cell] = f64::NAN;
            }
        }
        // Turned and oblong cells.
        let turn = f64::from(round as u32) * 0.4;
        let (sin, cos) = turn.sin_cos();
        let transform = [0.0, 3.0 * cos, 2.0 * sin, 0.0, 3.0 * sin, -2.0 * cos];
        let field = HeightField::new(size, &heights, transform).expect("a field");
        let even = |count: u32| -> Vec<Direction> {
            let azimuth = |index: u32| 7.0 + 360.0 * f64::from(index) / f64::from(count);
            (0..count)
                .map(|index| Direction::new(&field, azimuth(index)))
                .collect()
        };
        for all in [directions(&field, 16), even(12), even(1), even(2), even(7)] {
            let job = FieldHorizonJob::new(&field, &all, 0.0, 0.0).expect("a job");
            let planes: Vec<Vec<f32>> = (0..all.len())
                .map(|index| job.plane(index, &()).expect("horizons"))
                .collect();
            let azimuths: Vec<f64> = all
                .iter()
                .map(|direction| match direction {
                    Direction::Azimuth(azimuth) => *azimuth,
                    Direction::Step(step) => {
                        let [east, north] = field.along(step.map(f64::from));
                        east.atan2(north).to_degrees()
                    }
                })
                .collect();
            let weights = match all.len() {
                16 => Lattice::new(&field, 16).expect("a lattice").weights(),
                count => vec![1.0 / count as f64; count],
            };
            for measure in ALL {
                let found = sky(&field, &all, measure).values;
                for cell in 0..heights.len() {
                    let normal = field.normal([cell % size[0], cell / size[0]]);
                    let is_known = !heights[cell].is_nan()
                        && (normal.is_some() || measure == SkyMeasure::Openness);
                    assert_eq!(found[cell].is_nan(), !is_known, "{cell}");
                    if !is_known {
                        continue;
                    }
                    let [x, y, z] = normal.unwrap_or([0.0, 0.0, 1.0]);
                    let wanted: f64 = (0..all.len())
                        .map(|index| {
                            let (east, north) = azimuths[index].to_radians().sin_cos();
                            let rise = -(x * east + y * north) / z;
                            weights[index]
                                * by_elevations(
                                    measure,
                                    planes[index][cell].into(),
                                    [rise, 1.0 / z],
                                )
                        })
                        .sum();
                    let apart = (f64::from(found[cell]) - wanted).abs();
                    assert!(
                        apart < 2e-4,
                        "{measure:?} {cell}: {} for {wanted}",
                        found[cell]
                    );
                }
            }
        }
    }
}

#[test]
fn few_azimuths_have_no_error_and_none_are_refused() {
    let heights = [0.0; 9];
    let field =
        HeightField::new([3, 3], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]).expect("a field");
    let one = sky(&field, &[Direction::Azimuth(30.0)], SkyMeasure::View);
    assert_eq!((one.values, one.quadrature_error), (vec![1.0; 9], None));
    let none = FieldSky::new(&field, &[], SkyMeasure::Open).map(|_| ());
    assert!(none.is_err_and(|error| error.to_string().contains("directions")));
}
