//! `study`, row by row.

use antumbra::{Level, Order};

use crate::support::{Place, fields, files};

const FIELDS: [&str; 23] = [
    "scene",
    "triangles",
    "width",
    "order",
    "collapse",
    "level",
    "threads",
    "spp",
    "shadow_rays",
    "shadow_share",
    "node_tests_before",
    "prim_tests_before",
    "node_tests_after",
    "prim_tests_after",
    "top_node_tests_before",
    "top_node_tests_after",
    "predicted_cost_before",
    "predicted_cost_after",
    "log_seconds",
    "sort_seconds",
    "build_seconds",
    "render_seconds",
    "image_hash",
];

#[test]
fn a_row_for_every_order_and_width() {
    let place = Place::with_room();
    let args = ["study", "room.pbrt", "--widths", "4,8,16", "--json", "-"];
    let run = place.run(&args).expect(0);
    let document = run.json();
    assert_eq!(document["schema"], "antumbra.study/1");
    for field in ["version", "cpu", "level", "threads", "seed", "command_line"] {
        assert!(document.get(field).is_some(), "{field}");
    }
    assert_eq!(document["complete"], true);
    let rows = document["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 3 * Order::ALL.len());
    for row in rows {
        let (mut found, mut expected) = (fields(row), FIELDS.to_vec());
        found.sort_unstable();
        expected.sort_unstable();
        assert_eq!(found, expected);
        assert_eq!(row["image_hash"], rows[0]["image_hash"]);
        assert_eq!(row["image_hash"].as_str().map(str::len), Some(16));
        assert_eq!(row["shadow_rays"], rows[0]["shadow_rays"]);
        let order: Order = row["order"]
            .as_str()
            .expect("a name")
            .parse()
            .expect("an order");
        let learns = order.log_kind().is_some();
        assert_eq!(row["predicted_cost_after"].is_f64(), learns, "{order}");
        if !learns {
            assert_eq!(row["node_tests_before"], row["node_tests_after"], "{order}");
            assert_eq!(row["prim_tests_before"], row["prim_tests_after"], "{order}");
        }
        assert!(row["node_tests_after"].as_f64() >= Some(1.0), "{order}");
        assert!(row["render_seconds"].as_f64() > Some(0.0), "{order}");
    }
    // The table is there for people, too, but out of the way.
    assert!(run.stderr.contains("sort+") && run.stderr.contains("embree"));
    assert!(!run.stderr.contains('\u{1b}'));
    assert_eq!(place.files(), ["room.pbrt", "thing.ply"]);
}

#[test]
fn the_same_images_and_tests_on_every_level_and_number_of_threads() {
    let place = Place::with_room();
    let rows = |flags: &[&str]| {
        let base = [
            "study",
            "room.pbrt",
            "--orders",
            "simple,sort+",
            "--widths",
            "8",
            "--json",
            "-",
        ];
        let document = place.run(&[&base, flags].concat()).expect(0).json();
        let rows = document["rows"].as_array().expect("rows").clone();
        let facts = [
            "image_hash",
            "node_tests_before",
            "node_tests_after",
            "prim_tests_after",
        ];
        let facts = rows.iter().map(|row| facts.map(|fact| row[fact].clone()));
        facts.collect::<Vec<_>>()
    };
    let reference = rows(&[]);
    assert_eq!(reference.len(), 2);
    let area = rows(&["--collapse", "area"]);
    assert_eq!(area[0][0], reference[0][0]);
    assert_ne!(area, reference);
    for threads in ["1", "2", "3"] {
        assert_eq!(
            rows(&["--threads", threads]),
            reference,
            "{threads} threads"
        );
    }
    for level in Level::ALL {
        if level.is_available() {
            // Box tests of different levels may differ in what they let pass, images may not.
            let found = rows(&["--level", level.name()]);
            assert_eq!(found[0][0], reference[0][0], "{level}");
            assert_eq!(found[1][0], reference[0][0], "{level}");
        } else {
            println!("not run: {level}");
        }
    }
}

#[test]
fn a_folder_with_pictures_tables_and_heat_maps() {
    let place = Place::with_room();
    std::fs::create_dir(place.path("other")).expect("a folder");
    std::fs::copy(place.path("room.pbrt"), place.path("other/room.pbrt")).expect("a copy");
    std::fs::copy(place.path("thing.ply"), place.path("other/thing.ply")).expect("a copy");
    let args = [
        "study",
        "room.pbrt",
        "other/room.pbrt",
        "--orders",
        "simple,sort-,sort+",
        "--widths",
        "8",
        "--spp",
        "2",
        "--repeat",
        "2",
        "--out",
        "deep/out",
        "--json",
        "rows.json",
    ];
    let run = place.run(&args).expect(0);
    assert!(run.stdout.contains("simple") && run.stdout.contains("sort+"));
    let out = place.path("deep/out");
    let mut expected = vec!["report.md".to_owned(), "study.json".to_owned()];
    for scene in ["room", "room-2"] {
        for name in ["", "-tests-simple", "-tests-sort-minus", "-tests-sort-plus"] {
            for extension in ["exr", "png"] {
                expected.push(format!("{scene}-w8{name}.{extension}"));
            }
        }
    }
    expected.sort();
    assert_eq!(files(&out), expected);
    assert_eq!(place.json("deep/out/study.json"), place.json("rows.json"));
    let report = std::fs::read_to_string(out.join("report.md")).expect("a report");
    for name in &expected {
        if name.ends_with(".png") {
            assert!(report.contains(name), "{name}");
        }
    }
    let field = place.image("deep/out/room-w8-tests-simple.exr");
    let picture = place.image("deep/out/room-w8.exr");
    assert_eq!(field.window(), picture.window());
    assert!(field.mean()[0] > 0.5);
}

/// Ctrl-C during an endless rendering keeps those before it.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_study_keeps_what_was_finished() {
    use std::time::Duration;

    let place = Place::with_room();
    let room = std::fs::read_to_string(place.path("room.pbrt")).expect("a file");
    let endless = room.replace("[4]\nIntegrator", "[1000000000]\nIntegrator");
    assert_ne!(endless, room);
    place.write("endless.pbrt", endless);
    let args = [
        "study",
        "room.pbrt",
        "endless.pbrt",
        "--orders",
        "simple,sort+",
        "--out",
        "out",
        "--json",
        "rows.json",
    ];
    // However slow the machine is, some wait is long enough for the two renderings of the first scene.
    let mut wait = Duration::from_millis(100);
    let document = loop {
        assert_eq!(place.interrupt(&args, wait), Some(130));
        if place.path("rows.json").exists() {
            let document = place.json("rows.json");
            assert_eq!(document["complete"], false);
            let rows = document["rows"].as_array().expect("rows");
            assert!((1..=2).contains(&rows.len()), "{rows:?}");
            assert!(rows.iter().all(|row| row["scene"] == "room"));
            if rows.len() == 2 {
                break document;
            }
        }
        wait *= 2;
    };
    assert_eq!(place.json("out/study.json"), document);
    let report = std::fs::read_to_string(place.path("out/report.md")).expect("a report");
    assert!(report.contains("interrupted") && report.contains("sort+"));
    assert!(
        files(&place.path("out"))
            .iter()
            .all(|name| !name.contains("endless"))
    );
}

/// All scenes of a folder can be given, even if some have parts in files of their own.
#[test]
fn a_part_of_another_scene_is_left_out() {
    let place = Place::empty();
    let sphere = "Shape \"sphere\"";
    place.write("part.pbrt", sphere);
    place.write("whole.pbrt", "WorldBegin Include \"part.pbrt\" WorldEnd");
    let study = [
        "study",
        "--orders",
        "simple",
        "--spp",
        "1",
        "--json",
        "-",
        "part.pbrt",
    ];
    place.run(&study).expect(65);
    let run = place.run(&[&study[..], &["whole.pbrt"]].concat()).expect(0);
    let document = run.json();
    let rows = document["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 1);
    assert_eq!(rows[0]["scene"], "whole");
    assert!(rows[0]["top_node_tests_after"].is_null());
    assert!(
        run.stderr.contains("part.pbrt is a part of whole"),
        "{}",
        run.stderr
    );
}
