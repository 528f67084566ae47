//! Sun and sky as other programs have them: pvlib's suns, shadows in double precision, and the sky of Radiance.
//!
//! `reference/sun.py` makes the figures of `reference/sun.csv`, and has the same city, sensors and light as here.

use std::fmt::Write;

use antumbra::{Bvh, Geometry, Recipe};
use antumbra_bake::{Orientation, SkyDivision, SunJob, SunValues, Sunlight, UpAxis, Weather, run};

const FIGURES: &str = include_str!("reference/sun.csv");

/// Middle, half widths and height of a building.
fn building(i: usize, j: usize) -> ([f32; 2], [f32; 2], f32) {
    let tall = if (5 * i + 7 * j).is_multiple_of(13) {
        40
    } else {
        0
    };
    let middle = [20 + 26 * i, 20 + 26 * j];
    let half = [4 + (7 * i + 5 * j) % 5, 4 + (3 * i + 11 * j) % 5];
    let height = 6 + 3 * ((i * i + 3 * j) % 8) + tall;
    (
        middle.map(|x| x as f32),
        half.map(|x| x as f32),
        height as f32,
    )
}

/// Point and normal: on a street, on a wall that faces south, on a roof.
fn sensor(k: usize) -> ([f32; 3], [f32; 3]) {
    let (i, j) = (5 * k % 11, 7 * k % 11);
    let ([x, y], [width, length], height) = building(i, j);
    match k % 3 {
        0 => ([x + 13.0, y + 13.0, 0.0], [0.0, 0.0, 1.0]),
        1 => ([x, y - length, 2.0], [0.0, -1.0, 0.0]),
        _ => ([x + width / 2.0, y, height], [0.0, 0.0, 1.0]),
    }
}

/// Direct normal and diffuse horizontal irradiance of a day and an hour from 0.
fn light(day: usize, hour: usize) -> [usize; 2] {
    match hour {
        9..=14 => [
            100 * ((7 * day + 3 * hour) % 9),
            40 + 20 * ((5 * day + hour) % 7),
        ],
        _ => [0, 0],
    }
}

fn city() -> Bvh {
    let mut positions = vec![
        [0.0, 0.0, 0.0],
        [320.0, 0.0, 0.0],
        [320.0, 320.0, 0.0],
        [0.0, 320.0, 0.0],
    ];
    let mut indices = vec![[0, 1, 2], [0, 2, 3]];
    for (i, j) in (0..144).map(|index| (index / 12, index % 12)) {
        let ([x, y], [w, d], h) = building(i, j);
        let first = positions.len() as u32;
        for z in [0.0, h] {
            for [a, b] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                positions.push([x + a * w, y + b * d, z]);
            }
        }
        for quad in [
            [4, 5, 6, 7],
            [0, 1, 5, 4],
            [1, 2, 6, 5],
            [2, 3, 7, 6],
            [3, 0, 4, 7],
        ] {
            let [a, b, c, e] = quad.map(|corner| first + corner);
            indices.extend([[a, b, c], [a, c, e]]);
        }
    }
    let geometry = [Geometry::triangles(&positions[..], &indices[..])];
    Bvh::build(&geometry, &Recipe::default()).expect("a tree")
}

/// A year of this light in Vienna.
fn weather() -> Weather {
    let mut text =
        "LOCATION,Wien,-,AUT,-,-,48.2,16.4,1.0,170.0\nDATA PERIODS,1,1,Data,Friday,1/1,12/31\n"
            .to_owned();
    let days = [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let days = (1..)
        .zip(days)
        .flat_map(|(month, days)| (1..=days).map(move |day| (month, day)));
    for (index, (month, day)) in days.enumerate() {
        for hour in 0..24 {
            let [direct, diffuse] = light(index, hour);
            let end = hour + 1;
            writeln!(
                text,
                "2021,{month},{day},{end},60,,,,,,,,,,{direct},{diffuse}"
            )
            .expect("a text");
        }
    }
    Weather::read(&text).expect("a weather file")
}

fn values(bvh: &Bvh, sensors: &[([f32; 3], [f32; 3])]) -> SunValues {
    let weather = weather();
    let (points, normals): (Vec<_>, Vec<_>) = sensors.iter().copied().unzip();
    let steps = weather.steps(weather.zone, None);
    let patches = SkyDivision::Tregenza.patches().expect("patches");
    let orientation = Orientation::new(UpAxis::Z, 0.0).expect("an orientation");
    let light = Sunlight::new(&weather.place, steps, true, patches, orientation).expect("light");
    let job = SunJob::new(&points, &normals, &light).expect("a job");
    run(&job, bvh, &()).expect("values").values
}

/// Numbers of the rows from the line that begins so on.
fn figures(head: &str) -> impl Iterator<Item = Vec<f64>> {
    let lines = FIGURES
        .lines()
        .skip_while(move |line| !line.starts_with(head));
    let numbers = |line: &str| line.split(',').skip(1).map(|x| x.parse().ok()).collect();
    lines.skip(1).map_while(numbers)
}

#[test]
fn hours_and_direct_light_are_those_of_pvlib_and_double_precision() {
    let sensors: Vec<_> = (0..12).map(sensor).collect();
    let found = values(&city(), &sensors);
    let (mut all, mut apart) = (0.0, 0.0);
    for (k, expected) in figures("sensor").enumerate() {
        all += expected[0];
        apart += (found.hours[k] - expected[0]).abs();
        let direct = found.direct[k];
        assert!(
            (direct / expected[1] - 1.0).abs() < 5e-4,
            "{k}: {direct}, not {}",
            expected[1]
        );
    }
    println!("{apart} of {all} hours differ");
    // A sun may graze a wall.
    assert!(
        all > 30_000.0 && apart <= 3.0,
        "{apart} of {all} hours differ"
    );
}

#[test]
fn diffuse_light_of_open_walls_is_that_of_radiance() {
    let empty = Bvh::build(&[], &Recipe::default()).expect("a tree");
    let normals = [
        [0.0, 0.0, 1.0],
        [0.0, -1.0, 0.0],
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
    ];
    let found = values(&empty, &normals.map(|normal| ([0.0; 3], normal))).diffuse;
    let expected: Vec<f64> = figures("surface").map(|row| row[0]).collect();
    assert_eq!(expected.len(), 5);
    for (found, expected) in found.iter().zip(&expected) {
        println!(
            "{found:.3} kWh/m2, Radiance has {expected:.3}: {:+.2} %",
            100.0 * (found / expected - 1.0)
        );
        assert!(
            (found / expected - 1.0).abs() < 6e-3,
            "{found}, not {expected}"
        );
    }
}
