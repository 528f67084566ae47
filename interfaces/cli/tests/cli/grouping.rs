//! Results by object, material and facade; elevations, moving shadows and view factors.

use std::fs;

use crate::support::Place;

/// Two houses of 10 x 10 x 6 m beside each other on a ground of 60 x 60 m, z up.
fn village() -> Place {
    let mut text = String::from("o ground\nusemtl grass\n");
    text += "v -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n";
    for (index, (name, x)) in [("mill", -20), ("school hall", 5)].iter().enumerate() {
        let first = 5 + 8 * index;
        for z in [0, 6] {
            for [dx, y] in [[0, -5], [10, -5], [10, 5], [0, 5]] {
                text += &format!("v {} {y} {z}\n", x + dx);
            }
        }
        let at = |corner: usize| first + corner;
        text += &format!("o {name}\nusemtl tiles\n");
        text += &format!("f {} {} {} {}\nusemtl brick\n", at(4), at(5), at(6), at(7));
        for [a, b] in [[0, 1], [1, 2], [2, 3], [3, 0]] {
            text += &format!("f {} {} {} {}\n", at(a), at(b), at(b + 4), at(a + 4));
        }
    }
    let place = Place::empty();
    place.write("village.obj", text);
    place
}

const DAY: [&str; 12] = [
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
    "--step",
    "30",
];

#[test]
fn facades_and_materials_have_areas_and_means() {
    let place = village();
    let flags = [
        "sun",
        "village.obj",
        "-o",
        "sun.csv",
        "--surfaces",
        "1",
        "--offset",
        "0.1",
    ];
    let facades = [
        "--groups",
        "facades.csv",
        "--by",
        "facade",
        "--json",
        "sun.json",
    ];
    place.run(&[&flags[..], &facades, &DAY].concat()).expect(0);
    let rows = place.rows("facades.csv");
    let head = "object,facade,area_m2,sensors,hours_mean,hours_min,hours_max,sky_view_mean,sky_view_min,sky_view_max";
    assert_eq!(rows[0].join(","), head);
    // The ground below the houses is covered.
    let names: Vec<String> = rows[1..].iter().map(|row| row[..4].join(" ")).collect();
    let wanted = [
        "ground ground 3400.0 3400",
        "mill roof 100.0 100",
        "school hall roof 100.0 100",
        "mill S 60.0 60",
        "mill E 60.0 60",
        "mill N 60.0 60",
        "mill W 60.0 60",
        "school hall S 60.0 60",
        "school hall E 60.0 60",
        "school hall N 60.0 60",
        "school hall W 60.0 60",
        "ground covered 200.0 200",
    ];
    assert_eq!(names, wanted);
    let hours = |index: usize| rows[index][4].parse::<f64>().expect("a number");
    let (south, north) = (hours(4), hours(6));
    assert!(south > north && north > 0.5, "{south} {north}");
    assert!(hours(2) > 14.0, "roofs are open");
    // The same lines as JSON, and means that the sensors give.
    let document = place.json("sun.json");
    assert_eq!(document["groups"][3]["facade"], "S");
    let sensors = place.rows("sun.csv");
    let at = |name: &str| {
        sensors[0]
            .iter()
            .position(|other| other == name)
            .expect("a column")
    };
    let number = |row: &[String], column: usize| row[column].parse::<f64>().expect("a number");
    let own = sensors[1..]
        .iter()
        .filter(|row| number(row, at("ny")) < -0.9 && number(row, at("x")) < 0.0);
    let own: Vec<f64> = own.map(|row| number(row, at("hours"))).collect();
    assert_eq!(own.len(), 60);
    let mean = own.iter().sum::<f64>() / 60.0;
    assert!((mean - south).abs() < 1e-5, "{mean} {south}");

    let materials = ["--groups", "materials.json", "--by", "material"];
    place
        .run(&[&flags[..], &materials, &DAY].concat())
        .expect(0);
    let found = place.json("materials.json");
    let areas: Vec<f64> = (0..3)
        .map(|i| found[i]["area_m2"].as_f64().expect("an area"))
        .collect();
    assert_eq!(areas, [3400.0, 200.0, 480.0]);
    assert_eq!(found[1]["material"], "tiles");
}

/// Two houses of 10 and 20 m, wall against wall, as a file of boxes; the second one wound the other way or not.
fn semi_detached(is_turned: bool) -> String {
    let mut text = String::new();
    for (index, (name, x, z)) in [("low", 0, 10), ("high", 10, 20)].iter().enumerate() {
        let at = |corner: usize| 8 * index + corner + 1;
        text += &format!("o {name}\n");
        for height in [0, *z] {
            for [dx, y] in [[0, 0], [10, 0], [10, 10], [0, 10]] {
                text += &format!("v {} {y} {height}\n", x + dx);
            }
        }
        let sides = [
            [4, 5, 6, 7],
            [3, 2, 1, 0],
            [0, 1, 5, 4],
            [1, 2, 6, 5],
            [2, 3, 7, 6],
            [3, 0, 4, 7],
        ];
        for mut side in sides {
            if is_turned && index == 1 {
                side.reverse();
            }
            let [a, b, c, d] = side.map(at);
            text += &format!("f {a} {b} {c} {d}\n");
        }
    }
    text
}

#[test]
fn walls_that_touch_count_for_their_own_house_and_only_where_they_are_free() {
    let mut tables = Vec::new();
    for is_turned in [false, true] {
        let place = Place::empty();
        place.write("houses.obj", semi_detached(is_turned));
        let flags = [
            "sun",
            "houses.obj",
            "--surfaces",
            "1",
            "--on",
            "facade",
            "-o",
            "all.csv",
            "--groups",
            "facades.csv",
            "--by",
            "facade",
        ];
        let run = place.run(&[&flags[..], &DAY].concat()).expect(0);
        assert_eq!(
            run.stderr.contains("turned 1 body that faced inwards"),
            is_turned,
            "{}",
            run.stderr
        );
        assert!(
            run.stderr.contains("200 places more are covered"),
            "{}",
            run.stderr
        );
        assert!(!run.stderr.contains("warning"), "{}", run.stderr);
        let rows = place.rows("facades.csv");
        let named = |name: &str| {
            rows.iter()
                .find(|row| row[..2].join(" ") == name)
                .expect(name)
        };
        for (name, area) in [
            ("low W", "100.0"),
            ("low E", "0.0"),
            ("high W", "100.0"),
            ("high E", "200.0"),
            ("low covered", "100.0"),
            ("high covered", "100.0"),
        ] {
            assert_eq!(named(name)[2], area, "{name}");
        }
        // Means of the sensors above the roof of the lower house.
        let sensors = place.rows("all.csv");
        let number = |row: &[String], column: usize| row[column].parse::<f64>().expect("a number");
        let is_west = |row: &&Vec<String>| number(row, 1) == 10.0 && number(row, 4) == -1.0;
        let own: Vec<f64> = sensors[1..]
            .iter()
            .filter(is_west)
            .map(|row| number(row, 7))
            .collect();
        assert_eq!(own.len(), 100);
        assert!((number(named("high W"), 4) - own.iter().sum::<f64>() / 100.0).abs() < 1e-5);
        tables.push(rows);
    }
    assert_eq!(tables[0], tables[1]);
}

#[test]
fn points_inside_of_houses_or_between_two_are_told() {
    let place = Place::empty();
    place.write("houses.obj", semi_detached(false));
    place.write(
        "points.csv",
        "x,y,z,nx,ny,nz\n5,5,5,0,0,1\n-0.1,5,5,-1,0,0\n10,5,15,-1,0,0\n",
    );
    let flags = [
        "sun",
        "houses.obj",
        "--sensors",
        "points.csv",
        "-o",
        "all.csv",
        "--groups",
        "facades.csv",
        "--by",
        "facade",
    ];
    let run = place.run(&[&flags[..], &DAY].concat()).expect(0);
    assert!(
        run.stderr
            .contains("warning: 1 of 3 points lie inside of bodies"),
        "{}",
        run.stderr
    );
    assert!(
        !run.stderr.contains("two groups"),
        "normals decide: {}",
        run.stderr
    );
    let rows = place.rows("facades.csv");
    let counts: Vec<&str> = rows[1..]
        .iter()
        .filter(|row| row[3] != "0")
        .map(|row| &*row[1])
        .collect();
    assert_eq!(counts, ["W", "W"], "{rows:?}");

    // Without normals, an edge between two roofs of the same height belongs to nobody.
    let even = semi_detached(false).replace(" 20\n", " 10\n");
    place.write("houses.obj", even);
    place.write("points.csv", "x,y,z\n10,5,10.5\n5,5,10.5\n");
    let run = place.run(&[&flags[..], &DAY].concat()).expect(0);
    assert!(
        run.stderr
            .contains("warning: 1 of 2 points lie on surfaces of two groups"),
        "{}",
        run.stderr
    );
}

#[test]
fn energies_are_means_times_areas() {
    let place = village();
    let mut weather = String::new();
    weather += "LOCATION,Here,-,-,-,-,48.2,16.4,1.0,170\n";
    for line in 1..7 {
        weather += &format!("LINE {line}\n");
    }
    weather += "DATA PERIODS,1,1,Data,Sunday,6/21,6/21\n";
    for hour in 1..=24 {
        let mut fields = vec!["0".to_owned(); 35];
        for (index, value) in [2025, 6, 21, hour, 60].iter().enumerate() {
            fields[index] = value.to_string();
        }
        let is_day = (6..=19).contains(&hour);
        (fields[14], fields[15]) = match is_day {
            true => ("500".into(), "100".into()),
            false => ("0".into(), "0".into()),
        };
        weather += &(fields.join(",") + "\n");
    }
    place.write("day.epw", weather);
    let flags = [
        "sun",
        "village.obj",
        "-o",
        "sun.csv",
        "--grid",
        "2",
        "--epw",
        "day.epw",
        "--up",
        "z",
    ];
    place
        .run(&[&flags[..], &["--groups", "objects.csv"]].concat())
        .expect(0);
    let rows = place.rows("objects.csv");
    let at = |name: &str| {
        rows[0]
            .iter()
            .position(|other| other == name)
            .expect("a column")
    };
    for row in &rows[1..] {
        let number = |name: &str| row[at(name)].parse::<f64>().expect("a number");
        let energy = number("area_m2") * number("diffuse_kwh_m2_mean");
        assert!((energy - number("diffuse_kwh")).abs() < 1e-2 && energy > 0.0);
    }
}

/// Strips of 0.6 m, whose middles lie on the lattice of 1 m: the sensors stand for 800 of 480 m².
#[test]
fn sensors_that_stand_for_another_area_are_told() {
    let mut text = String::from("o fence\n");
    for strip in 0..40 {
        let [left, right] = [0.2, 0.8].map(|x| f64::from(strip) + x);
        text += &format!("v {left} 0 0\nv {right} 0 0\nv {right} 20 0\nv {left} 20 0\n");
        text += "f -4 -3 -2 -1\n";
    }
    let place = Place::empty();
    place.write("fence.obj", text);
    let flags = ["sun", "fence.obj", "-o", "sun.csv", "--surfaces", "1"];
    let groups = ["--groups", "objects.csv", "--by", "object"];
    let ran = place.run(&[&flags[..], &groups, &DAY].concat()).expect(0);
    let wanted = "more than a tenth off (fence: 800 m² of 480)";
    assert!(ran.stderr.contains(wanted), "{}", ran.stderr);
}

/// Names of a stranger's file do nothing in a spreadsheet or a terminal.
#[test]
fn names_are_only_read() {
    let place = village();
    let text = fs::read_to_string(place.path("village.obj")).expect("a model");
    place.write("a\u{1b}[31m.obj", text.replace("o mill", "o =1+1"));
    let flags = ["sun", "a\u{1b}[31m.obj", "-o", "sun.csv", "--surfaces", "2"];
    let groups = ["--groups", "objects.csv", "--by", "object"];
    let ran = place.run(&[&flags[..], &groups, &DAY].concat()).expect(0);
    let names: Vec<String> = place
        .rows("objects.csv")
        .into_iter()
        .map(|mut row| row.swap_remove(0))
        .collect();
    assert!(names.contains(&"'=1+1".to_owned()), "{names:?}");
    assert!(!ran.stderr.contains('\u{1b}') && ran.stderr.contains("a\u{fffd}[31m"));
}

#[test]
fn objects_that_are_not_there_are_named() {
    let place = village();
    let flags = ["sun", "village.obj", "-o", "sun.csv", "--grid", "2"];
    let run = place
        .run(&[&flags[..], &["--only", "barn"], &DAY].concat())
        .expect(2);
    assert!(
        run.stderr.contains("some are ground, mill, school hall"),
        "{}",
        run.stderr
    );
    place
        .run(&[&flags[..], &["--by", "facade"], &DAY].concat())
        .expect(2);
    place
        .run(&[&flags[..], &["--groups", "a.txt"], &DAY].concat())
        .expect(2);
    place.write("plain.obj", "v 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n");
    let flags = [
        "sun",
        "plain.obj",
        "-o",
        "sun.csv",
        "--grid",
        "2",
        "--groups",
        "a.csv",
    ];
    let run = place
        .run(&[&flags[..], &["--by", "material"], &DAY].concat())
        .expect(65);
    assert!(
        run.stderr.contains("no material of the scene has a name"),
        "{}",
        run.stderr
    );
    let run = place.run(&[&flags[..], &["--only", "body 2"], &DAY].concat());
    assert!(run.stderr.contains("some are body 1"), "{}", run.stderr);
}

#[test]
fn elevations_show_one_side_of_one_object() {
    let place = village();
    let flags = ["sun", "village.obj", "--grid", "1", "--seen-from", "south"];
    let outputs = [
        "-o",
        "south.png",
        "-o",
        "south.csv",
        "--only",
        "mill",
        "--resolution",
        "640x480",
    ];
    place.run(&[&flags[..], &outputs, &DAY].concat()).expect(0);
    let rows = place.rows("south.csv");
    let column = |name: &str| {
        rows[0]
            .iter()
            .position(|other| other == name)
            .expect("a column")
    };
    assert_eq!(rows.len(), 1 + 60, "10 x 6 squares");
    for row in &rows[1..] {
        let number = |name: &str| row[column(name)].parse::<f64>().expect("a number");
        assert_eq!([number("y"), number("ny")], [-5.0, -1.0]);
        assert!(number("x") < -9.0);
    }
    assert!(
        !place.path("south.pgw").exists(),
        "an elevation is on no map"
    );
    let run = place
        .run(&[&flags[..], &["-o", "a.tif"], &DAY].concat())
        .expect(2);
    assert!(
        run.stderr.contains("a raster needs --grid from above"),
        "{}",
        run.stderr
    );
    // From above, the same object has the sensors of its roof.
    let above = [
        "sun",
        "village.obj",
        "--grid",
        "1",
        "--only",
        "mill",
        "-o",
        "roof.csv",
    ];
    place.run(&[&above[..], &DAY].concat()).expect(0);
    assert_eq!(place.rows("roof.csv").len(), 1 + 100);
}

#[test]
fn shadows_move_in_one_file_or_in_many() {
    let place = village();
    let flags = [
        "sun",
        "village.obj",
        "--grid",
        "2",
        "-o",
        "sun.csv",
        "--resolution",
        "400x360",
    ];
    let times = ["--hours", "9-12", "--step", "60"];
    let day = &DAY[..10];
    place
        .run(&[&flags[..], &["--frames", "day.gif"], &times, day].concat())
        .expect(0);
    let gif = fs::read(place.path("day.gif")).expect("a picture");
    assert_eq!(&gif[..6], b"GIF89a");
    // Graphic control extensions, one for each picture.
    let controls = gif
        .windows(3)
        .filter(|bytes| *bytes == [0x21, 0xf9, 4])
        .count();
    assert_eq!(controls, 3);
    place
        .run(&[&flags[..], &["--frames", "day.png"], &times, day].concat())
        .expect(0);
    let pictures = place
        .files()
        .into_iter()
        .filter(|name| name.starts_with("day-"));
    let pictures: Vec<String> = pictures.collect();
    assert_eq!(pictures, ["day-0001.png", "day-0002.png", "day-0003.png"]);
    let [first, last] = [0, 2].map(|i| fs::read(place.path(&pictures[i])).expect("a picture"));
    assert_ne!(first, last);
    // Numbered maps replace no other output and no input.
    let clash = ["--frames", "day.png", "-o", "day-0003.png"];
    let run = place.run(&[&flags[..], &clash, &times, day].concat());
    assert!(run.stderr.contains("two outputs"), "{}", run.stderr);
    // Nor do they, or a world file, replace what somebody else wrote; again the same is no stranger.
    place
        .run(&[&flags[..], &["--frames", "day.png"], &times, day].concat())
        .expect(0);
    for (stranger, output) in [
        ("own-0002.png", ["--frames", "own.png"]),
        ("map.pgw", ["-o", "map.png"]),
    ] {
        place.write(stranger, "mine");
        let run = place.run(&[&flags[..], &output, &times, day].concat());
        assert!(run.expect(2).stderr.contains(stranger), "{stranger}");
        let text = fs::read(place.path(stranger)).expect("a file");
        assert_eq!(text, b"mine");
    }
    place
        .run(&[&flags[..], &["--frames", "day.mp4"], &times, day].concat())
        .expect(2);
    let night = ["--hours", "0-2", "--step", "60"];
    let run = place.run(&[&flags[..], &["--frames", "day.gif"], &night, day].concat());
    assert!(
        run.stderr.contains("0 steps of time have a sun"),
        "{}",
        run.stderr
    );
}

#[test]
fn view_factors_of_a_box_are_those_of_the_catalogue() {
    let place = Place::empty();
    let mut text = String::new();
    for z in [0, 1] {
        for [x, y] in [[0, 0], [2, 0], [2, 3], [0, 3]] {
            text += &format!("v {x} {y} {z}\n");
        }
    }
    // All sides face inwards.
    for (name, face) in [
        ("floor", "1 2 3 4"),
        ("ceiling", "5 8 7 6"),
        ("south", "1 5 6 2"),
        ("east", "2 6 7 3"),
        ("north", "3 7 8 4"),
        ("west", "4 8 5 1"),
    ] {
        text += &format!("o {name}\nf {face}\n");
    }
    place.write("box.obj", text);
    let flags = ["factors", "box.obj", "--up", "z"];
    place
        .run(&[&flags[..], &["-o", "factors.csv", "-o", "factors.npz"]].concat())
        .expect(0);
    let rows = place.rows("factors.csv");
    let names = "object,area,to floor,to ceiling,to south,to east,to north,to west,to nowhere";
    assert_eq!(rows[0].join(","), names);
    let number = |row: usize, column: usize| rows[row][column].parse::<f64>().expect("a number");
    assert_eq!([number(1, 1), number(3, 1), number(4, 1)], [6.0, 2.0, 3.0]);
    // C-11 of Howell's catalogue for two rectangles of 2 x 3 in the distance 1.
    let (x, y) = (2.0_f64, 3.0_f64);
    let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    let sum = (p * q / (1.0 + x * x + y * y).sqrt()).ln()
        + x * q * (x / q).atan()
        + y * p * (y / p).atan()
        - x * x.atan()
        - y * y.atan();
    let wanted = 2.0 / (std::f64::consts::PI * x * y) * sum;
    assert!(
        (number(1, 3) - wanted).abs() < 1e-3,
        "{} for {wanted}",
        number(1, 3)
    );
    for row in 1..7 {
        let sum: f64 = (2..9).map(|column| number(row, column)).sum();
        assert!((sum - 1.0).abs() < 1e-5, "the sum rule: {sum}");
        assert_eq!(number(row, 8), 0.0, "the box is closed");
    }
    for share in ["0/2", "1/2"] {
        let part = format!("{}.part", &share[..1]);
        place
            .run(&[&flags[..], &["--shard", share, "-o", &part]].concat())
            .expect(0);
    }
    place
        .run(&["merge", "1.part", "0.part", "-o", "merged.npz"])
        .expect(0);
    let read = |name: &str| fs::read(place.path(name)).expect("a file");
    assert!(read("merged.npz") == read("factors.npz"));
}

#[test]
fn mirrored_surfaces_face_as_their_normals() {
    let place = Place::empty();
    let shape =
        "Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point3 P\" [0 0 0 9 0 0 0 9 0]";
    for (turn, facade) in [
        ("", "ground"),
        ("Scale -1 1 1", "ground"),
        ("ReverseOrientation", "underside"),
    ] {
        let scene = format!("Camera \"perspective\" WorldBegin {turn} {shape} WorldEnd");
        place.write("one.pbrt", scene);
        let flags = ["factors", "one.pbrt", "--up", "z", "--by", "facade"];
        let output = ["--samples", "16", "-o", "one.csv"];
        place.run(&[&flags[..], &output].concat()).expect(0);
        assert_eq!(place.rows("one.csv")[1][1], facade, "{turn}");
    }
}
