//! `sun`: hours, sky view and irradiation, shares of work, and refusals.

use std::fs;

use antumbra_bake::{Moment, Place as Site, Refraction, sun_positions};

use crate::support::Place;

/// A level square of 40 m around the origin, z up, and a wall of 10 m along its southern edge if there is one.
fn square(wall: bool, up: char) -> String {
    let mut corners = vec![
        [-20.0, -20.0, 0.0],
        [20.0, -20.0, 0.0],
        [20.0, 20.0, 0.0],
        [-20.0, 20.0, 0.0],
    ];
    let mut faces = "f 1 2 3 4\n".to_owned();
    if wall {
        corners.extend([[-20.0, -20.0, 10.0], [20.0, -20.0, 10.0]]);
        faces += "f 1 2 6 5\n";
    }
    let mut text = String::new();
    for [x, y, z] in corners {
        text += &match up {
            'z' => format!("v {x} {y} {z}\n"),
            _ => format!("v {x} {z} {}\n", -y),
        };
    }
    text + &faces
}

pub const VIENNA: [&str; 4] = ["--lat", "48.2", "--lon", "16.4"];

/// Columns of a table by name.
pub struct Table(Vec<String>, Vec<Vec<f64>>);

impl Table {
    pub fn column(&self, name: &str) -> Vec<f64> {
        let place = self.0.iter().position(|other| other == name);
        let place = place.unwrap_or_else(|| panic!("no column {name} in {:?}", self.0));
        self.1.iter().map(|row| row[place]).collect()
    }
}

impl Place {
    pub fn table(&self, name: &str) -> Table {
        let text = fs::read_to_string(self.path(name)).expect("a table");
        let mut lines = text.lines();
        let head = lines
            .next()
            .expect("a head")
            .split(',')
            .map(str::to_owned)
            .collect();
        let numbers = |line: &str| {
            line.split(',')
                .map(|x| x.parse().expect("a number"))
                .collect()
        };
        Table(head, lines.map(numbers).collect())
    }

    fn sun(&self, mesh: &str, flags: &[&str]) -> Table {
        self.run(&[&["sun", mesh, "-o", "sun.csv"], flags].concat())
            .expect(0);
        self.table("sun.csv")
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).expect("a file")
    }
}

/// Hours from June to August with the sun above the horizon in the middle of the hour, of those that `counts`.
fn summer(counts: impl Fn(f64, f64) -> bool) -> f64 {
    hours(("2025-06-01", 92), counts)
}

/// The same of so many days from a date on.
pub fn hours((from, days): (&str, u32), counts: impl Fn(f64, f64) -> bool) -> f64 {
    let begin: Moment = from.parse().expect("a moment");
    let times: Vec<f64> = (0..days * 24)
        .map(|hour| begin.unix(1.0) + 3600.0 * (f64::from(hour) + 0.5))
        .collect();
    let site = Site {
        latitude: 48.2,
        longitude: 16.4,
        height: 0.0,
    };
    let suns = sun_positions(&site, Refraction::Standard, &times).expect("suns");
    let up = suns
        .iter()
        .filter(|sun| sun.elevation > 0.0 && counts(sun.azimuth, sun.elevation));
    up.count() as f64
}

const SUMMER: [&str; 4] = ["--from", "2025-06-01", "--to", "2025-08-31"];

#[test]
fn an_open_square_sees_every_sun_and_all_of_the_sky() {
    let place = Place::empty();
    place.write("open.obj", square(false, 'z'));
    let flags = [&VIENNA[..], &SUMMER, &["--grid", "10"]].concat();
    let table = place.sun("open.obj", &flags);
    assert_eq!(table.1.len(), 16);
    let expected = summer(|_, _| true);
    assert!(expected > 1300.0);
    assert_eq!(table.column("hours"), vec![expected; 16]);
    assert_eq!(table.column("sky_view"), vec![1.0; 16]);
    let months = ["hours_06", "hours_07", "hours_08"].map(|name| table.column(name)[0]);
    assert_eq!(months.iter().sum::<f64>(), expected);
    assert!(!table.0.contains(&"hours_05".to_owned()));
    assert_eq!(table.column("x")[..2], [-15.0, -5.0]);
    assert_eq!(table.column("y")[0], 15.0, "rows run from north to south");
}

#[test]
fn a_wall_in_the_south_takes_the_suns_behind_it() {
    let place = Place::empty();
    place.write("z.obj", square(true, 'z'));
    place.write("y.obj", square(true, 'y'));
    place.write("points.csv", "x,y,z,nx,ny,nz\n0,-15,0,0,0,1\n");
    let flags = [&VIENNA[..], &SUMMER].concat();
    let with = |mesh: &str, more: &[&str]| {
        let table = place.sun(mesh, &[&flags[..], more].concat());
        table.column("hours")[0]
    };
    // The wall is 5 m away, 40 m wide and 10 m high.
    let hidden = |azimuth: f64, elevation: f64| {
        let (sin, cos) = azimuth.to_radians().sin_cos();
        let toward = -cos;
        let reach = 5.0 / toward;
        toward > 0.0 && (reach * sin).abs() < 20.0 && reach * elevation.to_radians().tan() < 10.0
    };
    let expected = summer(|azimuth, elevation| !hidden(azimuth, elevation));
    assert!(expected < summer(|_, _| true) - 50.0);
    assert_eq!(with("z.obj", &["--sensors", "points.csv"]), expected);
    place.write("points_y.csv", "0 0 15 0 1 0\n");
    assert_eq!(
        with("y.obj", &["--sensors", "points_y.csv", "--up", "y"]),
        expected
    );
    // North turned half around: the wall stands in the north.
    let behind = |azimuth: f64, elevation: f64| hidden(azimuth + 180.0, elevation);
    let turned = with("z.obj", &["--sensors", "points.csv", "--north", "180"]);
    assert_eq!(
        turned,
        summer(|azimuth, elevation| !behind(azimuth, elevation))
    );
    // Clocks do not move the sun, only the hours that are asked about.
    let later = with("z.obj", &["--sensors", "points.csv", "--timezone", "2"]);
    assert!((later - expected).abs() < 40.0);
}

#[test]
fn level_ground_receives_what_the_weather_file_says() {
    let place = Place::empty();
    place.write("open.obj", square(false, 'z'));
    let mut weather = "LOCATION,Wien,-,AUT,Test,110350,48.2,16.4,1.0,200.0\n".to_owned();
    for name in [
        "DESIGN CONDITIONS",
        "TYPICAL/EXTREME PERIODS",
        "GROUND TEMPERATURES",
    ] {
        weather += &format!("{name},0\n");
    }
    weather += "HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0\nCOMMENTS 1,a\nCOMMENTS 2,b\nDATA PERIODS,1,1,Data,Sunday,6/30,7/1\n";
    let site = Site {
        latitude: 48.2,
        longitude: 16.4,
        height: 200.0,
    };
    // Of June and of July.
    let (mut direct, mut diffuse) = ([0.0; 2], [0.0; 2]);
    for (index, (month, day)) in [(6, 30), (7, 1)].into_iter().enumerate() {
        for hour in 1..=24 {
            let (beam, sky) = if (6..=19).contains(&hour) {
                (700.0, 90.0 + f64::from(hour * month))
            } else {
                (0.0, 0.0)
            };
            weather += &format!(
                "2019,{month},{day},{hour},60,flags,20,10,50,101000,0,0,300,0,{beam},{sky},0,0,0\n"
            );
            let middle = Moment::midnight(2019, month, day).expect("a day").unix(1.0)
                + 3600.0 * (f64::from(hour) - 0.5);
            let sun = sun_positions(&site, Refraction::Standard, &[middle]).expect("a sun")[0];
            direct[index] += beam * sun.elevation.to_radians().sin().max(0.0) / 1000.0;
            diffuse[index] += sky / 1000.0;
        }
    }
    place.write("wien.epw", weather);
    let args = [
        "--vertices",
        "--epw",
        "wien.epw",
        "--sky",
        "577",
        "--show",
        "total",
        "-o",
        "sun.npz",
        "-o",
        "sun.ply",
    ];
    let table = place.sun("open.obj", &args);
    for (name, [june, july]) in [("direct_kwh_m2", direct), ("diffuse_kwh_m2", diffuse)] {
        for (name, expected) in [
            (name.to_owned(), june + july),
            (format!("{name}_06"), june),
            (format!("{name}_07"), july),
        ] {
            for found in table.column(&name) {
                assert!(
                    (found - expected).abs() < 1e-6,
                    "{name}: {found}, not {expected}"
                );
            }
        }
    }
    assert!(table.0.contains(&"hours_06".to_owned()));
    assert!(place.read("sun.npz").starts_with(b"PK"));
    let ply = place.read("sun.ply");
    assert!(String::from_utf8_lossy(&ply[..400]).contains("total_kwh_m2"));
}

#[test]
fn threads_shares_and_resumed_work_change_no_byte() {
    let place = Place::empty();
    let outputs = ["-o", "a.npz", "-o", "a.csv", "-o", "a.png"];
    // Two chunks and more.
    let job = [
        &["sun", "builtin:city:2000", "--grid", "12", "--step", "20"][..],
        &VIENNA,
    ]
    .concat();
    place.run(&[&job[..], &outputs].concat()).expect(0);
    let whole = ["a.npz", "a.csv", "a.png"].map(|name| place.read(name));
    place
        .run(&[&job[..], &outputs, &["--threads", "1"]].concat())
        .expect(0);
    assert_eq!(
        ["a.npz", "a.csv", "a.png"].map(|name| place.read(name)),
        whole
    );
    for (shard, part) in [("0/2", "0.part"), ("1/2", "1.part")] {
        place
            .run(&[&job[..], &["--shard", shard, "-o", part]].concat())
            .expect(0);
    }
    // A part that was cut short is completed by the same command.
    let full = place.read("0.part");
    place.write("0.part", &full[..full.len() - 100]);
    let merge = [
        "merge", "1.part", "0.part", "-o", "b.npz", "-o", "b.csv", "-o", "b.png",
    ];
    let run = place.run(&merge).expect(65);
    assert!(run.stderr.contains("cut short"), "{}", run.stderr);
    place
        .run(&[&job[..], &["--shard", "0/2", "-o", "0.part"]].concat())
        .expect(0);
    place.run(&merge).expect(0);
    assert_eq!(
        ["b.npz", "b.csv", "b.png"].map(|name| place.read(name)),
        whole
    );

    let run = place.run(&["merge", "0.part", "-o", "c.csv"]).expect(2);
    assert!(run.stderr.contains("1/2"), "{}", run.stderr);
    let run = place
        .run(&["merge", "0.part", "0.part", "-o", "c.csv"])
        .expect(2);
    assert!(run.stderr.contains("both"), "{}", run.stderr);
    let other = [
        &job[..],
        &["--shard", "0/2", "-o", "0.part", "--north", "5"],
    ]
    .concat();
    let run = place.run(&other).expect(2);
    assert!(run.stderr.contains("--restart"), "{}", run.stderr);
}

#[test]
fn what_cannot_be_meant_is_refused_before_anything_is_written() {
    let place = Place::empty();
    place.write("open.obj", square(false, 'z'));
    place.write("points.csv", "1,2,3\n1,2\n");
    place.write("bad.epw", "LOCATION,nowhere\n");
    let files = place.files();
    let refused: &[(&[&str], i32, &str)] = &[
        (&["-o", "a.csv", "--vertices"], 2, "--lat"),
        (&["-o", "a.csv", "--lat", "1", "--lon", "2"], 2, "--grid"),
        (
            &["-o", "a.png", "--vertices", "--lat", "1", "--lon", "2"],
            2,
            "--grid",
        ),
        (
            &["-o", "a.xyz", "--vertices", "--lat", "1", "--lon", "2"],
            2,
            "csv",
        ),
        (
            &["-o", "a.csv", "--vertices", "--lat", "91", "--lon", "2"],
            2,
            "latitude",
        ),
        (
            &[
                "-o",
                "a.csv",
                "--vertices",
                "--lat",
                "1",
                "--lon",
                "2",
                "--show",
                "total",
            ],
            2,
            "--epw",
        ),
        (
            &[
                "-o",
                "a.csv",
                "--vertices",
                "--lat",
                "1",
                "--lon",
                "2",
                "--from",
                "2023-02-29",
                "--to",
                "2023-03-01",
            ],
            2,
            "2023-02-29",
        ),
        (
            &[
                "-o",
                "a.csv",
                "--vertices",
                "--lat",
                "1",
                "--lon",
                "2",
                "--from",
                "2023-03-02",
                "--to",
                "2023-03-01",
            ],
            2,
            "behind",
        ),
        (
            &[
                "-o",
                "a.csv",
                "--sensors",
                "points.csv",
                "--lat",
                "1",
                "--lon",
                "2",
            ],
            65,
            "points.csv:2",
        ),
        (
            &["-o", "a.csv", "--vertices", "--epw", "bad.epw"],
            65,
            "LOCATION",
        ),
        (
            &[
                "-o",
                "points.csv",
                "--sensors",
                "points.csv",
                "--lat",
                "1",
                "--lon",
                "2",
            ],
            2,
            "destroy",
        ),
        (
            &["-o", "open.obj", "--vertices", "--lat", "1", "--lon", "2"],
            2,
            "csv",
        ),
        (
            &[
                "-o",
                "a.csv",
                "-o",
                "./a.csv",
                "--vertices",
                "--lat",
                "1",
                "--lon",
                "2",
            ],
            2,
            "two outputs",
        ),
        (
            &["-o", "a.csv", "--grid", "1e-5", "--lat", "1", "--lon", "2"],
            2,
            "cells",
        ),
        (
            &[
                "-o",
                "a.csv",
                "--shard",
                "0/2",
                "--vertices",
                "--lat",
                "1",
                "--lon",
                "2",
            ],
            2,
            ".part",
        ),
    ];
    for (args, code, hint) in refused {
        let run = place
            .run(&[&["sun", "open.obj"], *args].concat())
            .expect(*code);
        assert!(run.stderr.contains(hint), "{args:?}: {}", run.stderr);
    }
    assert_eq!(place.files(), files);
}

/// A square with a tower of 6 m, as it is near the origin and in map coordinates, where single precision has steps of half a
/// metre: the same hours, sky, occlusion and pairs, and positions of the world in what is written.
#[test]
fn cities_in_map_coordinates_are_those_at_the_origin() {
    let place = Place::empty();
    let day = ["--from", "2025-06-21", "--to", "2025-06-21"];
    let mut all = Vec::new();
    for [x0, y0] in [[0.0, 0.0], [10_000.0, 10_000.0], [600_000.0, 5_340_000.0]] {
        let corner = |[x, y, z]: [f64; 3]| format!("v {} {} {z}\n", x + x0, y + y0);
        let ground = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
        let mut text: String = ground.map(|[x, y]| corner([x, y, 0.0])).concat();
        // The tower reaches into the ground: rays from a foot on the ground would begin in its plane.
        for z in [-1.0, 6.0] {
            text += &[[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0]]
                .map(|[x, y]| corner([x, y, z]))
                .concat();
        }
        text += "f 1 2 3 4\nf 9 10 11 12\nf 5 6 10 9\nf 6 7 11 10\nf 7 8 12 11\nf 8 5 9 12\n";
        place.write("city.obj", text);
        let rows = || {
            (0..100).map(|i| {
                let [x, y] = [i % 10, i / 10].map(|i| f64::from(i) + 0.5);
                [x + x0, y + y0]
            })
        };
        let sensors = rows().map(|[x, y]| format!("{x},{y},0.01,0,0,1\n"));
        place.write(
            "sensors.csv",
            format!("x,y,z,nx,ny,nz\n{}", sensors.collect::<String>()),
        );
        let eyes = rows().map(|[x, y]| format!("{x},{y},0.5\n"));
        place.write("eyes.csv", format!("x,y,z\n{}", eyes.collect::<String>()));
        let flags = [&["--sensors", "sensors.csv"][..], &VIENNA, &day].concat();
        let sun = place.sun("city.obj", &flags);
        let first = [0.5 + x0, 0.5 + y0];
        for (axis, expected) in ["x", "y"].into_iter().zip(first) {
            assert!((sun.column(axis)[0] - expected).abs() < 1e-6);
        }
        place
            .run(&["ao", "city.obj", "-o", "ao.ply", "--json", "ao.json"])
            .expect(0);
        let sight = [
            "visible", "city.obj", "eyes.csv", "-o", "v.csv", "--json", "v.json",
        ];
        place.run(&sight).expect(0);
        let number = |file: &str, field: &str| {
            let text = String::from_utf8(place.read(file)).expect("text");
            let document: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            document[field].as_f64().expect("a number")
        };
        let values = [number("ao.json", "mean"), number("v.json", "visible_pairs")];
        all.push((sun.column("hours"), sun.column("sky_view"), values));
    }
    let (hours, sky, values) = &all[0];
    assert!(hours.iter().any(|h| *h < 10.0) && hours.iter().any(|h| *h > 14.0));
    for (other_hours, other_sky, other_values) in &all[1..] {
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
        assert!(near(hours, other_hours) && near(sky, other_sky));
        let [openness, pairs] = [0, 1].map(|i| [values[i], other_values[i]]);
        // Directions depend on the bits of coordinates: some rays of some thousand.
        assert!((openness[0] - openness[1]).abs() < 6e-3, "{openness:?}");
        assert!(pairs[0] > 1000.0 && pairs[0] == pairs[1], "{pairs:?}");
    }
}

#[test]
fn maps_are_png_svg_and_pdf_with_their_words() {
    let place = Place::empty();
    // 7 km to the east and 5 km to the north, as in map coordinates.
    let text: String = square(true, 'z')
        .lines()
        .map(|line| match line.strip_prefix("v ") {
            Some(numbers) => {
                let mut numbers: Vec<f64> = numbers
                    .split(' ')
                    .map(|x| x.parse().expect("a number"))
                    .collect();
                numbers[0] += 607_000.0;
                numbers[1] += 5_305_000.0;
                format!("v {} {} {}\n", numbers[0], numbers[1], numbers[2])
            }
            None => format!("{line}\n"),
        })
        .collect();
    place.write("court.obj", text);
    let outputs = ["-o", "m.png", "-o", "m.svg", "-o", "m.pdf"];
    let job = [
        &[
            "sun",
            "court.obj",
            "--grid",
            "2",
            "--title",
            "A court & a wall",
            "--range",
            "0",
            "8",
        ][..],
        &[
            "--from",
            "2025-03-20",
            "--to",
            "2025-03-20",
            "--resolution",
            "700x600",
        ],
        &VIENNA,
        &outputs,
    ]
    .concat();
    place.run(&job).expect(0);
    let picture = place.image("m.png");
    assert_eq!((picture.width(), picture.height()), (700, 600));
    let svg = String::from_utf8(place.read("m.svg")).expect("text");
    for words in [
        "A court &amp; a wall",
        "20 March 2025",
        "48.2",
        "Direct sun in h",
        "court.obj",
        "grid of 2 m",
    ] {
        assert!(svg.contains(words), "{words}: {svg}");
    }
    // The equinox has twelve hours of sun in the north, which lie beyond 8.
    assert!(svg.contains("fill=\"#fde725\"") && !svg.contains("fill=\"#440154\""));
    assert!(place.read("m.pdf").starts_with(b"%PDF-"));
    let lines = String::from_utf8(place.read("m.pgw")).expect("text");
    let numbers: Vec<f64> = lines
        .lines()
        .map(|x| x.parse().expect("a number"))
        .collect();
    // The corner of the sheet is less than a map's width beyond the corner of the court.
    // Pixels are squares but for the rounding of the frame to whole pixels.
    assert!(numbers[0] > 0.0 && numbers[1] == 0.0);
    assert!((numbers[3] / numbers[0] + 1.0).abs() < 0.01, "{numbers:?}");
    assert!((606_940.0..606_980.0).contains(&numbers[4]), "{numbers:?}");
    assert!(
        (5_305_020.0..5_305_060.0).contains(&numbers[5]),
        "{numbers:?}"
    );

    for (flags, words) in [
        (&["--range", "8", "0"][..], "smaller"),
        (&["--resolution", "200x100"], "320"),
        (&["--title", "日"], "日"),
    ] {
        let job = ["sun", "court.obj", "--grid", "2", "-o", "x.svg"];
        let run = place.run(&[&job[..], &VIENNA, flags].concat()).expect(2);
        assert!(run.stderr.contains(words), "{}", run.stderr);
        assert!(!place.path("x.svg").exists());
    }
}
