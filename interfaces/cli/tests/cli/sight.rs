//! `visible`: visibility between points, lines of sight and viewsheds.

use std::fs;

use crate::support::Place;

/// A level square of 8 m, and a wall of 1 m along x = 0 in the middle of it.
const WALL: &str = "v -4 -4 0\nv 4 -4 0\nv 4 4 0\nv -4 4 0\nf 1 2 3 4\n\
    v 0 -4 0\nv 0 4 0\nv 0 4 1\nv 0 -4 1\nf 5 6 7 8\n";

fn place() -> Place {
    let place = Place::empty();
    place.write("wall.obj", WALL);
    // Two points west of the wall, two east of it, one above.
    place.write(
        "a.csv",
        "x,y,z\n-2,0,0.5\n-2,1,0.5\n2,0,0.5\n2,1,0.5\n0,0,3\n",
    );
    place.write("b.csv", "3,3,0.5\n-3,-3,0.5\n");
    place
}

fn text(place: &Place, name: &str) -> String {
    fs::read_to_string(place.path(name)).expect("a text")
}

/// Last column of a table.
fn counts(place: &Place, name: &str) -> Vec<u64> {
    let text = text(place, name);
    let last = |line: &str| {
        line.rsplit(',')
            .next()
            .expect("a column")
            .parse()
            .expect("a number")
    };
    text.lines().skip(1).map(last).collect()
}

#[test]
fn the_wall_parts_those_who_see_each_other() {
    let place = place();
    let run = place.run(&[
        "visible",
        "wall.obj",
        "a.csv",
        "-o",
        "sees.csv",
        "-o",
        "sees.npz",
        "-o",
        "sees.ply",
        "--lines",
        "lines.csv",
        "--json",
        "-",
    ]);
    let document = run.expect(0).json();
    assert_eq!(document["schema"], "antumbra.visible/1");
    assert_eq!(
        (&document["pairs"], &document["visible_pairs"]),
        (&20.into(), &12.into()),
        "no point is paired with itself"
    );
    // Each sees its neighbour and the one above.
    assert_eq!(counts(&place, "sees.csv"), [2, 2, 2, 2, 4]);
    assert_eq!(
        text(&place, "lines.csv"),
        "from,to\n0,1\n0,4\n1,4\n2,3\n2,4\n3,4\n"
    );
    let args = [
        "visible",
        "wall.obj",
        "a.csv",
        "b.csv",
        "-o",
        "b_sees.csv",
        "--lines",
        "lines.ply",
    ];
    place.run(&args).expect(0);
    assert_eq!(counts(&place, "b_sees.csv"), [1, 1, 1, 1, 2]);
    let lines = fs::read(place.path("lines.ply")).expect("lines");
    assert!(String::from_utf8_lossy(&lines[..200]).contains("element edge 6"));
}

#[test]
fn a_viewshed_is_one_side_of_the_wall() {
    let place = place();
    place.write("eye.csv", "-2 0 0\n");
    let args = [
        "visible",
        "wall.obj",
        "eye.csv",
        "--viewshed",
        "--grid",
        "1",
        "--eye",
        "0.5",
        "-o",
        "shed.csv",
        "-o",
        "shed.png",
        "-o",
        "shed.npz",
    ];
    place.run(&args).expect(0);
    let table = text(&place, "shed.csv");
    for line in table.lines().skip(1) {
        let numbers: Vec<f64> = line
            .split(',')
            .map(|x| x.parse().expect("a number"))
            .collect();
        let expected = if numbers[0] < 0.0 { 1.0 } else { 0.0 };
        assert_eq!(numbers[3], expected, "{line}");
    }
    assert_eq!(table.lines().count(), 65);
    // From above the wall, the observer sees over it, except right behind it.
    let run = [
        "visible",
        "wall.obj",
        "eye.csv",
        "--viewshed",
        "--grid",
        "1",
        "--eye",
        "2",
        "-o",
        "high.csv",
    ];
    place.run(&run).expect(0);
    let seen: u64 = counts(&place, "high.csv").iter().sum();
    assert!(seen > 32 && seen < 64, "{seen}");
    place
        .run(&[
            "visible",
            "wall.obj",
            "eye.csv",
            "--viewshed",
            "--eye",
            "1",
            "-o",
            "shed.ply",
        ])
        .expect(0);
    let ply = fs::read(place.path("shed.ply")).expect("a mesh");
    assert!(String::from_utf8_lossy(&ply[..400]).contains("seen_by"));
}

#[test]
fn points_on_surfaces_see_what_is_above_them() {
    let place = Place::empty();
    // A level and a tilted square, with points on them that are not exact in single precision.
    place.write(
        "ground.obj",
        "v 0 0 0.1\nv 9 0 0.1\nv 9 9 2.8\nv 0 9 2.8\nf 1 2 3 4\n",
    );
    let mut points = String::new();
    for index in 0..200 {
        let [x, y] = [17, 23].map(|step| f64::from(step * index % 89) / 10.0);
        points += &format!("{x},{y},{}\n", 0.1 + 0.3 * y);
    }
    place.write("ground.csv", points);
    place.write("sky.csv", "4.5,4.5,9\n");
    let sees = |margin: &[&str]| {
        let args = [
            "visible",
            "ground.obj",
            "ground.csv",
            "sky.csv",
            "-o",
            "o.csv",
        ];
        let run = place.run(&[&args[..], margin].concat()).expect(0);
        assert!(!run.stderr.contains("warning"), "{}", run.stderr);
        counts(&place, "o.csv").iter().sum::<u64>()
    };
    assert_eq!(sees(&[]), 200);
    assert!(sees(&["--margin", "0"]) < 200, "the surface is in the way");
}

#[test]
fn points_far_from_the_mesh_are_counted_in_a_warning() {
    let place = place();
    // The wall is 8 long and ends at 4: the first two are farther away than that.
    place.write("far.csv", "500,0,1\n0,-12.5,0\n0,-11.5,0\n1,1,1\n");
    let args = ["visible", "wall.obj", "b.csv", "far.csv", "-o", "o.csv"];
    let run = place.run(&args).expect(0);
    let warning =
        "warning: far.csv: 2 of 4 points are farther outside the mesh than its extent of 8";
    assert!(run.stderr.contains(warning), "{}", run.stderr);
    assert!(!run.stderr.contains("warning: b.csv"), "{}", run.stderr);
    let args = [
        "visible",
        "wall.obj",
        "far.csv",
        "--viewshed",
        "-o",
        "o.csv",
    ];
    let run = place.run(&args).expect(0);
    assert!(run.stderr.contains(warning), "{}", run.stderr);
}

#[test]
fn shares_make_the_same_bytes() {
    let place = Place::empty();
    let mut points = String::new();
    for index in 0..4000 {
        let angle = f64::from(index) * 2.4;
        let reach = 0.2 * f64::from(index).sqrt();
        points += &format!("{} {} {}\n", reach * angle.cos(), 3.0, reach * angle.sin());
    }
    place.write("points.csv", points);
    let job = ["visible", "builtin:city:2000", "points.csv"];
    place
        .run(&[&job[..], &["-o", "whole.npz"]].concat())
        .expect(0);
    for shard in ["0/2", "1/2"] {
        let part = format!("{}.part", &shard[..1]);
        place
            .run(&[&job[..], &["--shard", shard, "-o", &part]].concat())
            .expect(0);
    }
    place
        .run(&["merge", "0.part", "1.part", "-o", "joined.npz"])
        .expect(0);
    let read = |name: &str| fs::read(place.path(name)).expect("a file");
    assert_eq!(read("joined.npz"), read("whole.npz"));
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let place = place();
    let files = place.files();
    let refused: &[(&[&str], i32, &str)] = &[
        (&["a.csv", "-o", "a.csv"], 2, "destroy"),
        (&["a.csv", "-o", "x.png"], 2, "--grid"),
        (&["a.csv", "-o", "x.xyz"], 2, "npz"),
        (
            &["a.csv", "b.csv", "--viewshed", "-o", "x.csv"],
            2,
            "cannot be used",
        ),
        (&["none.csv", "-o", "x.csv"], 1, "none.csv"),
        (&["a.csv", "-o", "x.csv", "--margin=-1"], 2, "from 0"),
        (
            &["a.csv", "-o", "x.csv", "--lines", "x.csv"],
            2,
            "two outputs",
        ),
        (&["a.csv", "-o", "x.csv", "--grid", "1"], 2, "--viewshed"),
    ];
    for (args, code, hint) in refused {
        let run = place
            .run(&[&["visible", "wall.obj"], *args].concat())
            .expect(*code);
        assert!(run.stderr.contains(hint), "{args:?}: {}", run.stderr);
    }
    assert_eq!(place.files(), files);
}

#[test]
fn answers_that_have_no_room_are_refused_before_the_first_ray() {
    let place = place();
    let points: String = (0..30_000)
        .map(|i| format!("{},0,1\n", i as f32 * 1e-4))
        .collect();
    place.write("many.csv", format!("x,y,z\n{points}"));
    let flags = [
        "visible",
        "wall.obj",
        "many.csv",
        "-o",
        "seen.npz",
        "--max-memory",
        "128M",
    ];
    let begin = std::time::Instant::now();
    let run = place.run(&flags).expect(65);
    assert!(
        run.stderr.contains("the answers take about 2"),
        "{}",
        run.stderr
    );
    // All lines of sight take minutes.
    assert!(begin.elapsed().as_secs() < 30);
    assert!(
        !place.files().iter().any(|name| name.contains("seen")),
        "nothing is left"
    );
}
