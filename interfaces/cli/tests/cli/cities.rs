//! Cities in many files, against one file of everything.

use std::fmt::Write as _;
use std::fs;

use antumbra_testkit::Rng;

use crate::support::Place;

/// Tiles on a side, their length in metres, and where they begin.
const TILES: usize = 4;
const SIDE: f64 = 150.0;
const CORNER: [f64; 2] = [691_000.0, 5_335_000.0];

/// Adds a body to the text of an .obj file, and to the number of its vertices.
fn push(file: &mut (String, usize), name: &str, [low, high]: [[f64; 3]; 2]) {
    let (text, first) = file;
    writeln!(text, "o {name}").expect("text");
    for corner in 0..8_usize {
        let [x, y, z] = [0, 1, 2].map(|axis| [low, high][corner >> axis & 1][axis]);
        writeln!(text, "v {x:.3} {y:.3} {z:.3}").expect("text");
    }
    let sides = [
        [2, 3, 1, 0],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [1, 3, 7, 5],
        [3, 2, 6, 7],
        [2, 0, 4, 6],
    ];
    for side in sides {
        let [a, b, c, d] = side.map(|corner| corner + *first + 1);
        writeln!(text, "f {a} {b} {c} {d}").expect("text");
    }
    *first += 8;
}

/// A town with some towers as `whole.obj`, and as files by squares, of which houses at borders touch.
fn town(place: &Place, random: &mut Rng) {
    let mut whole = Default::default();
    for tile in 0..TILES * TILES {
        let mut own = Default::default();
        for house in 0..12 {
            let mut at = |most: f64| f64::from(random.unit()) * most;
            let size = [8.0 + at(20.0), 8.0 + at(20.0), 5.0 + at(12.0)];
            let mut low = [0, 1].map(|axis| {
                let tile = [tile % TILES, tile / TILES][axis];
                CORNER[axis] + SIDE * tile as f64 + at(SIDE - size[axis])
            });
            if house == 0 {
                // At the border, as the last house of the tile before.
                low[0] = CORNER[0] + SIDE * (tile % TILES) as f64;
            } else if house == 11 {
                low[0] = CORNER[0] + SIDE * (tile % TILES + 1) as f64 - size[0];
            }
            let roof = 510.0
                + if house == 5 && tile % 5 == 0 {
                    80.0
                } else {
                    size[2]
                };
            let body = [
                [low[0], low[1], 510.0],
                [low[0] + size[0], low[1] + size[1], roof],
            ];
            let name = format!("h{tile}-{house}");
            push(&mut whole, &name, body);
            push(&mut own, &name, body);
        }
        place.write(&format!("tile{tile:02}.obj"), own.0);
    }
    place.write("whole.obj", whole.0);
}

const INDEX: [&str; 3] = ["index", "-o", "city.index"];
const TIME: [&str; 8] = [
    "--crs",
    "EPSG:25832",
    "--from",
    "2025-03-01",
    "--to",
    "2025-03-01",
    "--step",
    "30",
];

/// A town and its index.
fn indexed(random: &mut Rng) -> Place {
    let place = Place::empty();
    town(&place, random);
    let names: Vec<String> = (0..TILES * TILES)
        .map(|tile| format!("tile{tile:02}.obj"))
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let run = place.run(&[&INDEX[..], &names].concat()).expect(0);
    assert!(
        run.stderr
            .contains("16 files are one scene of 2 304 triangles"),
        "{}",
        run.stderr
    );
    place
}

#[test]
fn a_plan_of_files_has_the_bits_of_one_file() {
    let mut random = Rng::new(11);
    let place = indexed(&mut random);
    for sensors in [&["--vertices"][..], &["--surfaces", "3"]] {
        let flags = [&["sun"][..], sensors, &TIME].concat();
        place
            .run(&[&["plan", "city.index", "-o", "plan.jsonl"][..], &flags].concat())
            .expect(0);
        // In any order, some twice, and some by a process of their own.
        let mut tasks: Vec<usize> = (0..TILES * TILES).chain([3, 7]).collect();
        for place in (1..tasks.len()).rev() {
            tasks.swap(place, random.below(place + 1));
        }
        let tasks: Vec<String> = tasks.iter().map(usize::to_string).collect();
        for some in tasks.chunks(5) {
            let some: Vec<&str> = some.iter().map(String::as_str).collect();
            place
                .run(&[&["run", "plan.jsonl", "--task"][..], &some].concat())
                .expect(0);
        }
        place
            .run(&["merge", "plan.jsonl", "-o", "all.csv"])
            .expect(0);
        place
            .run(&[&["sun", "whole.obj", "-o", "whole.csv"][..], &flags[1..]].concat())
            .expect(0);
        let [all, whole] =
            ["all.csv", "whole.csv"].map(|name| fs::read(place.path(name)).expect("a table"));
        assert!(all.len() > 10_000 && all == whole, "{sensors:?}");
        fs::remove_dir_all(place.path("plan.jsonl.results")).expect("results");
    }
}

#[test]
fn a_scene_in_a_city_sees_what_one_file_shows() {
    let place = indexed(&mut Rng::new(12));
    // A house that is in no file, and sensors on it and on the ground.
    let mut house = Default::default();
    let low = [CORNER[0] + 2.2 * SIDE, CORNER[1] + 1.7 * SIDE, 510.0];
    push(
        &mut house,
        "new",
        [low, [low[0] + 9.0, low[1] + 9.0, 530.0]],
    );
    place.write("new.obj", &house.0);
    let mut whole = (
        fs::read_to_string(place.path("whole.obj")).expect("a mesh"),
        8 * 12 * TILES * TILES,
    );
    push(
        &mut whole,
        "new",
        [low, [low[0] + 9.0, low[1] + 9.0, 530.0]],
    );
    place.write("with.obj", whole.0);
    let points: String = (0..40)
        .map(|i| {
            format!(
                "{},{},{},0,0,1\n",
                low[0] - 5.0 + f64::from(i),
                low[1] - 3.0,
                510 + i / 4
            )
        })
        .collect();
    place.write("points.csv", format!("x,y,z,nx,ny,nz\n{points}"));
    let flags = [&["--sensors", "points.csv"][..], &TIME].concat();
    let alone = place.run(&[&["sun", "new.obj", "-o", "alone.csv"][..], &flags].concat());
    alone.expect(0);
    let run = place.run(
        &[
            &["sun", "new.obj", "--city", "city.index", "-o", "in.csv"][..],
            &flags,
        ]
        .concat(),
    );
    let run = run.expect(0);
    assert!(
        run.stderr.contains(" other files of a city of 16"),
        "{}",
        run.stderr
    );
    place
        .run(&[&["sun", "with.obj", "-o", "with.csv"][..], &flags].concat())
        .expect(0);
    let table = |name: &str| fs::read(place.path(name)).expect("a table");
    assert!(table("in.csv") == table("with.csv"));
    assert!(
        table("in.csv") != table("alone.csv"),
        "the city casts no shadows"
    );
    // A grid covers the scene, and not the city.
    let grid = [
        &[
            "sun",
            "new.obj",
            "--city",
            "city.index",
            "--grid",
            "1",
            "-o",
            "grid.csv",
        ][..],
        &TIME,
    ]
    .concat();
    place.run(&grid).expect(0);
    assert_eq!(place.rows("grid.csv").len(), 1 + 81);
}

#[test]
fn what_cannot_be_in_a_city_is_refused() {
    let place = indexed(&mut Rng::new(13));
    let plan = ["plan", "city.index", "-o", "plan.jsonl"];
    let sun = [&["sun", "--vertices"][..], &TIME].concat();
    for (command, word) in [
        (&["horizon", "--vertices"][..], "for sun"),
        (&["render"], "for sun"),
        (
            &[&["sun", "--grid", "2"][..], &TIME].concat(),
            "--vertices or --surfaces",
        ),
        (
            &[&sun[..], &["--city", "city.index"]].concat(),
            "scene of the plan",
        ),
        (&[&sun[..], &["--hourly", "a.csv"]].concat(), "--hourly"),
    ] {
        let run = place.run(&[&plan[..], command].concat()).expect(2);
        assert!(run.stderr.contains(word), "{}", run.stderr);
    }
    place.run(&[&plan[..], &sun].concat()).expect(0);
    place.run(&["run", "plan.jsonl", "--task", "6"]).expect(0);
    // A file changes: its own task is refused, and those that read it.
    let text = fs::read_to_string(place.path("tile06.obj")).expect("a mesh");
    place.write("tile06.obj", text.replace("v 6913", "v 6912"));
    for task in ["6", "5"] {
        fs::remove_file(place.path(&format!("plan.jsonl.results/f0000{task}.csv"))).ok();
        let run = place.run(&["run", "plan.jsonl", "--task", task]).expect(65);
        assert!(run.stderr.contains("tile06.obj"), "{}", run.stderr);
    }
    place.write("tile06.obj", text);
    place.run(&["run", "plan.jsonl"]).expect(0);
    let run = place
        .run(&["merge", "plan.jsonl", "-o", "all.tif"])
        .expect(2);
    assert!(
        run.stderr.contains("all.tif") && run.stderr.contains(".csv"),
        "{}",
        run.stderr
    );
    let index = fs::read_to_string(place.path("city.index")).expect("an index");
    place.write("cut.index", index.rsplit_once("\n{").expect("lines").0);
    let run = place.run(
        &[
            &["sun", "tile00.obj", "--city", "cut.index", "-o", "a.csv"][..],
            &sun[1..],
        ]
        .concat(),
    );
    assert!(
        run.code != 0 && run.stderr.contains("cut short"),
        "{}",
        run.stderr
    );
    let run = place.run(&[&["sun", "city.index", "-o", "a.csv"][..], &sun[1..]].concat());
    assert!(
        run.code != 0 && run.stderr.contains("antumbra.index/1"),
        "{}",
        run.stderr
    );
    place.write("ball.pbrt", "WorldBegin\nShape \"sphere\"\nWorldEnd\n");
    let run = place.run(&["index", "tile00.obj", "ball.pbrt", "-o", "b.index"]);
    assert!(
        run.code != 0 && run.stderr.contains("triangles"),
        "{}",
        run.stderr
    );
}

#[test]
fn files_that_differ_in_which_way_is_up_need_a_word() {
    let place = Place::empty();
    let ground = "v 0 0 0\nv 40 0 0\nv 40 40 0\nv 0 40 0\nf 1 2 3 4\n";
    let sail = "v 50 10 5\nv 60 10 5\nv 50 20 25\nf 1 2 3\n";
    place.write("ground.obj", ground);
    place.write("sail.obj", sail);
    let moved = "v 50 10 5\nv 60 10 5\nv 50 20 25\nf 5 6 7\n";
    place.write("both.obj", format!("{ground}{moved}"));
    let index = ["index", "ground.obj", "sail.obj", "-o", "city.index"];
    place.run(&index).expect(0);
    let day = [
        "--lat",
        "48",
        "--lon",
        "11",
        "--from",
        "2025-03-01",
        "--to",
        "2025-03-01",
    ];
    let sun = [&["--vertices"][..], &day].concat();
    let city = ["sun", "ground.obj", "--city", "city.index", "-o", "a.csv"];
    let run = place.run(&[&city[..], &sun].concat()).expect(2);
    assert!(
        run.stderr.contains("choose y or z with --up"),
        "{}",
        run.stderr
    );
    let sun = [&sun[..], &["--up", "z"]].concat();
    place
        .run(&[&["plan", "city.index", "-o", "plan.jsonl", "sun"][..], &sun].concat())
        .expect(0);
    place.run(&["run", "plan.jsonl"]).expect(0);
    place
        .run(&["merge", "plan.jsonl", "-o", "all.csv"])
        .expect(0);
    place
        .run(&[&["sun", "both.obj", "-o", "both.csv"][..], &sun].concat())
        .expect(0);
    assert_eq!(place.rows("all.csv"), place.rows("both.csv"));
    // With a city around it, a file is taken as the city is, whatever it looks like.
    place
        .run(&["index", "ground.obj", "-o", "one.index"])
        .expect(0);
    let run = place.run(
        &[
            &[
                "sun",
                "sail.obj",
                "--city",
                "one.index",
                "-o",
                "a.csv",
                "--vertices",
            ][..],
            &day,
        ]
        .concat(),
    );
    assert!(
        run.expect(0)
            .stderr
            .contains("z is up, as in all files of the city")
    );
    let run = place
        .run(&["index", "ground.obj", "./ground.obj", "-o", "two.index"])
        .expect(2);
    assert!(run.stderr.contains("given twice"), "{}", run.stderr);
    let run = place.run(&[&["plan", "none.index", "-o", "plan.jsonl", "sun"][..], &sun].concat());
    assert!(run.expect(2).stderr.contains("there is no file none.index"));
}
