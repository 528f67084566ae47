//! `sun`: sensors on surfaces and along lines, names, hours of the day, time zones, steps of time.

use std::fs;

use antumbra_bake::{Moment, Place as Site, Refraction, SunPosition, sun_positions};

use crate::support::Place;

/// A house of 10 x 10 x 6 m on a ground of 50 x 50 m, z up.
const HOUSE: &str = "v -25 -25 0\nv 25 -25 0\nv 25 25 0\nv -25 25 0\nf 1 2 3 4\n\
    v -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\nv -5 -5 6\nv 5 -5 6\nv 5 5 6\nv -5 5 6\n\
    f 9 10 11 12\nf 5 6 10 9\nf 6 7 11 10\nf 7 8 12 11\nf 8 5 9 12\n";

const DAY: [&str; 10] = [
    "--lat",
    "48.2",
    "--lon",
    "16.4",
    "--from",
    "2025-06-21",
    "--to",
    "2025-06-21",
    "--up",
    "z",
];

fn place() -> Place {
    let place = Place::empty();
    place.write("house.obj", HOUSE);
    place
}

/// Columns of a table as texts.
fn column(place: &Place, file: &str, name: &str) -> Vec<String> {
    let text = fs::read_to_string(place.path(file)).expect("a table");
    let mut lines = text.lines().map(|line| line.split(','));
    let mut head = lines.next().expect("a head");
    let index = head.position(|other| other == name);
    let index = index.unwrap_or_else(|| panic!("no {name} in {text}"));
    lines
        .map(|mut line| line.nth(index).expect("a field").to_owned())
        .collect()
}

fn hours(place: &Place) -> Vec<f64> {
    let texts = column(place, "sun.csv", "hours");
    texts.iter().map(|x| x.parse().expect("a number")).collect()
}

impl Place {
    fn sun_on(&self, flags: &[&str]) {
        let args = ["sun", "house.obj", "-o", "sun.csv"];
        self.run(&[&args[..], flags, &DAY].concat()).expect(0);
    }
}

#[test]
fn facades_by_storey_and_roofs() {
    let place = place();
    place.sun_on(&[
        "--surfaces",
        "1",
        "--on",
        "facades,roof",
        "--storey-height",
        "3",
        "--offset",
        "0.1",
    ]);
    let kinds = column(&place, "sun.csv", "surface");
    let count = |name: &str| kinds.iter().filter(|kind| *kind == name).count();
    assert_eq!(
        [count("facade"), count("roof"), count("ground")],
        [240, 100, 0]
    );
    let storeys = column(&place, "sun.csv", "storey");
    let of = |name: &str| storeys.iter().filter(|storey| *storey == name).count();
    assert_eq!([of("0"), of("1"), of("")], [120, 120, 100]);
}

#[test]
fn names_come_back_and_lines_have_sensors() {
    let place = place();
    place.write("points.csv", "id,x,y\n\"roof, middle\",0,0\nstreet,20,20\n");
    place.sun_on(&["--sensors", "points.csv"]);
    let text = fs::read_to_string(place.path("sun.csv")).expect("a table");
    assert!(text.starts_with("name,x,y,z,hours,"), "{text}");
    assert!(text.contains("\n\"roof, middle\",0,0,6,") && text.contains("\nstreet,20,20,0,"));
    place.write("way.csv", "name,x,y\nway,-20,20\nway,20,20\n");
    place.sun_on(&["--along", "way.csv", "--spacing", "10", "--height", "1.5"]);
    assert_eq!(column(&place, "sun.csv", "x"), ["-15", "-5", "5", "15"]);
    assert_eq!(column(&place, "sun.csv", "z"), ["1.5"; 4]);
}

#[test]
fn hours_of_the_day_are_those_of_the_clocks() {
    let place = place();
    place.write("roof.csv", "x,y\n0,0\n");
    let roof = ["--sensors", "roof.csv"];
    place.sun_on(&[&roof[..], &["--hours", "9-17"]].concat());
    assert_eq!(hours(&place), [8.0]);
    // At six in summer the sun is up; at four it is not, which is five on clocks with summer time.
    place.sun_on(&[&roof[..], &["--timezone", "1", "--hours", "4-5"]].concat());
    let winter = hours(&place);
    place.sun_on(
        &[
            &roof[..],
            &["--timezone", "Europe/Vienna", "--hours", "5-6"],
        ]
        .concat(),
    );
    assert_eq!(hours(&place), winter);
    let args = [
        "sun",
        "house.obj",
        "-o",
        "sun.csv",
        "--sensors",
        "roof.csv",
        "--lat",
        "48.2",
        "--lon",
        "16.4",
    ];
    let moment = [
        "--up",
        "z",
        "--at",
        "2025-06-21T12:00",
        "--at",
        "2025-06-21T23:00",
        "--step",
        "30",
    ];
    place.run(&[&args[..], &moment].concat()).expect(0);
    assert_eq!(hours(&place), [0.5]);
    let summer = ["--up", "z", "--months", "summer", "--hours", "12-13"];
    place.run(&[&args[..], &summer].concat()).expect(0);
    assert_eq!(hours(&place), [92.0]);
    // December to February.
    let sydney = [&args[..6], &["--lat", "-33.87", "--lon", "151.2"]].concat();
    let run = place.run(&[&sydney[..], &summer].concat()).expect(0);
    assert_eq!(hours(&place), [90.0]);
    assert!(run.stderr.contains("UTC+10,"), "{}", run.stderr);
    for (dates, zone) in [
        (["2025-06-21", "2025-06-21"], "UTC+2,"),
        (["2025-01-21", "2025-01-21"], "UTC+1,"),
        (["2025-03-01", "2025-04-30"], "UTC+1 and +2,"),
    ] {
        let days = [
            "--from",
            dates[0],
            "--to",
            dates[1],
            "--timezone",
            "Europe/Vienna",
        ];
        let run = place
            .run(&[&args[..], &days, &["--up", "z"]].concat())
            .expect(0);
        assert!(run.stderr.contains(zone), "{}", run.stderr);
    }
    for (flags, word) in [
        (["--hours", "9"], "wanted two hours"),
        (["--months", "0-3"], "months from 1 to 12"),
        (["--timezone", "Europe/Nowhere"], "no name of a time zone"),
        (["--on", "roofs"], "--surfaces"),
    ] {
        let run = place.run(&[&args[..], &flags].concat());
        assert!(run.code == 2 && run.stderr.contains(word), "{}", run.stderr);
    }
}

#[test]
fn steps_of_time_add_up_to_the_sums() {
    let place = place();
    place.write("two.csv", "name,x,y\nroof,0,0\nyard,8,0\n");
    place.sun_on(&["--sensors", "two.csv", "--hourly", "steps.csv"]);
    let sums = hours(&place);
    for (name, sum) in ["roof", "yard"].into_iter().zip(sums) {
        let steps = column(&place, "steps.csv", name);
        assert_eq!(steps.len(), 24);
        let total: f64 = steps
            .iter()
            .map(|x| x.parse::<f64>().expect("a number"))
            .sum();
        assert!((total - sum).abs() < 1e-6, "{name}");
    }
    // Arrays have the values of the day as 32-bit floats, row by row, and the beginnings of the steps in Unix time.
    place.sun_on(&["--sensors", "two.csv", "--hourly", "steps.npz"]);
    let arrays = fs::read(place.path("steps.npz")).expect("arrays");
    let wanted: Vec<u8> = (0..24)
        .flat_map(|step| ["roof", "yard"].map(|name| (step, name)))
        .flat_map(|(step, name)| {
            let value = column(&place, "steps.csv", name)[step].parse::<f32>();
            value.expect("a number").to_le_bytes()
        })
        .collect();
    assert!(arrays.windows(wanted.len()).any(|bytes| bytes == wanted));
    // Local clocks at 16.4 degrees east are an hour ahead.
    let times = (0..24).flat_map(|hour| f64::from(1_750_460_400 + 3600 * hour).to_le_bytes());
    let times: Vec<u8> = times.collect();
    assert!(arrays.windows(times.len()).any(|bytes| bytes == times));
    let bad = ["sun", "house.obj", "-o", "a.csv", "--hourly", "a.txt"];
    let run = place.run(&[&bad[..], &["--grid", "1"], &DAY].concat());
    assert!(
        run.code == 2 && run.stderr.contains("csv or npz"),
        "{}",
        run.stderr
    );
    assert_eq!(
        column(&place, "steps.csv", "time")[12],
        "2025-06-21T12:00:00"
    );
}

#[test]
fn classes_of_en_17037_behind_a_long_wall() {
    let place = Place::empty();
    // A wall of 10 m that runs from west to east, and ten sensors north of it, without a ground.
    place.write(
        "wall.obj",
        "v -400 0 0\nv 400 0 0\nv 400 0 10\nv -400 0 10\nf 1 2 3 4\n",
    );
    let distances = [4.0, 8.0, 12.0, 14.0, 15.0, 16.0, 17.0, 20.0, 30.0, 60.0];
    let mut table = "name,x,y,z,nx,ny,nz\n".to_owned();
    for distance in distances {
        table += &format!("d{distance},0,{distance},1,0,0,1\n");
    }
    place.write("ten.csv", table);
    let day = [
        "--lat",
        "48.2",
        "--lon",
        "16.4",
        "--timezone",
        "1",
        "--from",
        "2025-02-15",
        "--to",
        "2025-02-15",
    ];
    let flags = [
        "--up",
        "z",
        "--en17037",
        "--min-elevation",
        "10",
        "--step",
        "10",
    ];
    let args = ["sun", "wall.obj", "--sensors", "ten.csv", "-o", "sun.csv"];
    place.run(&[&args[..], &day, &flags].concat()).expect(0);
    // By hand: the sun is over the wall if its height above the southern horizon in the plane from north to south is more than
    // that of the edge, 9 m above the sensors.
    let begin: Moment = "2025-02-15".parse().expect("a moment");
    let times: Vec<f64> = (0..144)
        .map(|i| begin.unix(1.0) + 600.0 * (f64::from(i) + 0.5))
        .collect();
    let site = Site {
        latitude: 48.2,
        longitude: 16.4,
        height: 0.0,
    };
    let suns = sun_positions(&site, Refraction::Standard, &times).expect("suns");
    let mut seen = std::collections::BTreeSet::new();
    let classes = column(&place, "sun.csv", "en17037");
    for (row, distance) in distances.into_iter().enumerate() {
        let is_over = |sun: &&SunPosition| {
            let [elevation, azimuth] = [sun.elevation, sun.azimuth].map(f64::to_radians);
            let south = -azimuth.cos();
            sun.elevation >= 10.0 && elevation.tan() > 9.0 / distance * south
        };
        let hours = suns.iter().filter(is_over).count() as f64 / 6.0;
        assert!((hours - hours_of(&place, row)).abs() < 1e-6, "{distance}");
        let class = match hours {
            ..1.499 => "none",
            ..2.999 => "minimum",
            ..3.999 => "medium",
            _ => "high",
        };
        assert_eq!(classes[row], class, "{distance}: {hours}");
        seen.insert(class);
    }
    assert!(seen.len() >= 3, "{seen:?}");
    let year = ["--lat", "48.2", "--lon", "16.4", "--en17037"];
    let run = place.run(&[&args[..], &year].concat());
    assert!(
        run.code == 2 && run.stderr.contains("one day"),
        "{}",
        run.stderr
    );
}

fn hours_of(place: &Place, row: usize) -> f64 {
    hours(place)[row]
}
