//! `study`, row by row.

use antumbra::recipe::Level;
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS};

use crate::support::{Place, fields, files};

const FIELDS: [&str; 51] = [
    "scene",
    "by",
    "part",
    "rays",
    "triangles",
    "width",
    "tree",
    "collapse",
    "order",
    "prim_cost",
    "level",
    "threads",
    "spp",
    "learned_from",
    "log_rays",
    "test_rays",
    "shadow_rays",
    "shadow_share",
    "occluded_share",
    "node_tests_before",
    "prim_tests_before",
    "node_tests_unsorted",
    "prim_tests_unsorted",
    "node_tests_after",
    "prim_tests_after",
    "top_node_tests_before",
    "top_node_tests_unsorted",
    "top_node_tests_after",
    "node_tests_occluded",
    "node_tests_unoccluded",
    "oracle_occluded",
    "oracle_unoccluded",
    "predicted_cost_before",
    "predicted_cost_after",
    "log_seconds",
    "sort_seconds",
    "remake_seconds",
    "build_seconds",
    "render_seconds",
    "render_time",
    "render_seconds_range",
    "timed_renderings",
    "measured_seconds",
    "measured_seconds_range",
    "measured_renderings",
    "busy_seconds",
    "mrays_per_s",
    "speed",
    "speed_range",
    "equal_answers",
    "image_hash",
];

#[test]
fn a_row_for_every_order_and_width() {
    let place = Place::with_room();
    let args = ["study", "room.pbrt", "--widths", "4,8,16", "--json", "-"];
    let run = place.run(&args).expect(0);
    let document = run.json();
    assert_eq!(document["schema"], "antumbra.study/2");
    for field in ["version", "cpu", "level", "threads", "seed", "command_line"] {
        assert!(document.get(field).is_some(), "{field}");
    }
    assert_eq!(document["complete"], true);
    let rows = document["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 3 * ORDERS.len());
    for row in rows {
        let (mut found, mut expected) = (fields(row), FIELDS.to_vec());
        found.sort_unstable();
        expected.sort_unstable();
        assert_eq!(found, expected);
        assert_eq!(row["by"], "render");
        assert_eq!(row["image_hash"], rows[0]["image_hash"]);
        assert_eq!(row["image_hash"].as_str().map(str::len), Some(16));
        assert_eq!(row["shadow_rays"], rows[0]["shadow_rays"]);
        // All trees meet the same rays, none of which was learned from.
        assert_eq!(row["test_rays"], rows[0]["test_rays"]);
        assert!(row["test_rays"].as_u64() < row["shadow_rays"].as_u64());
        assert_eq!(row["equal_answers"], true);
        assert_eq!(row["render_time"], "composed");
        assert!(row["measured_seconds"].is_null() && row["measured_renderings"] == 0);
        let name = row["order"].as_str().expect("a name");
        let order = antumbra_trees::order(name).expect("an order");
        let learns = order.learns();
        // The model knows nothing of orders that pick by ray, and nothing of use from a log of leaf hits alone.
        let boxes = order.log_kind().is_some_and(|kind| kind.boxes);
        let predicted = learns && boxes && !order.picks_by_ray();
        assert_eq!(row["predicted_cost_after"].is_f64(), predicted, "{order}");
        assert_eq!(row["node_tests_before"].is_f64(), learns, "{order}");
        // Before sorting, a tree that learns is that of the order which leaves it as it is.
        let simple = rows
            .iter()
            .find(|simple| simple["order"] == "simple" && simple["width"] == row["width"]);
        let simple = simple.expect("a row");
        if learns {
            for tests in ["node_tests", "prim_tests"] {
                let [unsorted, after] = ["unsorted", "after"].map(|end| format!("{tests}_{end}"));
                assert_eq!(row[unsorted], simple[after], "{order}");
            }
        }
        if !learns {
            assert_eq!(
                row["node_tests_unsorted"], row["node_tests_after"],
                "{order}"
            );
            assert_eq!(
                row["prim_tests_unsorted"], row["prim_tests_after"],
                "{order}"
            );
        }
        assert!(row["node_tests_after"].as_f64() >= Some(1.0), "{order}");
        assert!(row["render_seconds"].as_f64() > Some(0.0), "{order}");
    }
    // The table is there for people, too, but out of the way.
    assert!(run.stderr.contains("sort+") && run.stderr.contains("embree"));
    assert!(!run.stderr.contains('\u{1b}'));
    assert_eq!(place.files(), ["room.pbrt", "thing.ply"]);
}

/// The paper's Tables 2 and 3: six orders, two widths, three rounds, and whole pictures that took turns.
#[test]
fn a_preset_makes_the_tables_of_the_paper() {
    let place = Place::with_room();
    let args = ["study", "room.pbrt", "--preset", "paper", "--json", "-"];
    let document = place.run(&args).expect(0).json();
    let rows = document["rows"].as_array().expect("rows");
    // Orders that learn are there twice: the paper does not give the cost of a primitive test.
    let (free, learned) = (["simple", "ftob", "sato"], ["sort-", "sort", "sort+"]);
    let own = free.iter().chain(&learned).map(|order| (order, 0.15));
    let orders: Vec<_> = own
        .chain(learned.iter().map(|order| (order, 1.0)))
        .collect();
    assert_eq!(rows.len(), 2 * orders.len());
    for (row, (order, cost)) in rows.iter().zip(orders.iter().cycle()) {
        assert_eq!(row["order"], **order);
        let found = row["prim_cost"].as_f64().expect("a number");
        assert!((found - cost).abs() < 1e-6, "{row}");
        assert_eq!(
            (&row["tree"], &row["collapse"]),
            (&"pbrt".into(), &"area".into())
        );
        assert_eq!(
            (&row["spp"], &row["timed_renderings"]),
            (&1.into(), &3.into())
        );
        let [fastest, slowest] = [0, 1].map(|end| row["render_seconds_range"][end].as_f64());
        let median = row["render_seconds"].as_f64();
        assert!(fastest <= median && median <= slowest, "{row}");
        // Rendered apart: unsorted, and by the paper's best order.
        let apart = ["simple", "sort+"].contains(order) && *cost < 1.0;
        assert_eq!(
            row["measured_renderings"],
            if apart { 3 } else { 0 },
            "{row}"
        );
        assert_eq!(row["measured_seconds"].as_f64() > Some(0.0), apart, "{row}");
        let learns = order.starts_with("sort");
        for tests in [
            "node_tests_before",
            "node_tests_unsorted",
            "node_tests_after",
        ] {
            let known = learns || tests != "node_tests_before";
            assert_eq!(row[tests].is_f64(), known, "{row}");
        }
        // Sorting alone. Orders without it may measure the time of nothing.
        if order.starts_with("sort") || **order == "sato" {
            assert!(row["sort_seconds"].as_f64() > Some(0.0), "{row}");
        }
    }
}

#[test]
fn costs_are_numbers_that_are_not_negative() {
    let place = Place::with_room();
    for bad in ["-1", "nan", "inf", "x"] {
        let run = place.run(&["study", "room.pbrt", &format!("--prim-cost={bad}")]);
        run.expect(2);
    }
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
            "node_tests_unsorted",
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
    // So small a scene has no surface rays to learn a collapse from.
    assert_eq!(area, reference);
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
    let report = ["report.html", "report.md", "results.json", "results.csv"];
    let mut expected: Vec<String> = report.map(str::to_owned).to_vec();
    expected.push("journal.jsonl".to_owned());
    // One of the orders is the best; which one is not decided here.
    let (differences, found) = files(&out)
        .into_iter()
        .partition::<Vec<_>, _>(|name| name.contains("-difference."));
    assert_eq!(differences.len(), 4, "{differences:?}");
    for scene in ["room", "room-2"] {
        for name in ["", "-tests-simple", "-tests-sort-minus", "-tests-sort-plus"] {
            for extension in ["exr", "png"] {
                expected.push(format!("{scene}-w8{name}.{extension}"));
            }
        }
    }
    expected.sort();
    assert_eq!(found, expected);
    assert_eq!(place.json("deep/out/results.json"), place.json("rows.json"));
    let sheet = std::fs::read_to_string(out.join("results.csv")).expect("a sheet");
    assert_eq!(sheet.lines().count(), 1 + 2 * 3);
    let report = std::fs::read_to_string(out.join("report.md")).expect("a report");
    assert!(report.contains("room: ") && report.contains("sort-"));
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
    let endless = room.replace("[4]\nIntegrator", "[1048576]\nIntegrator");
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
        let code = place.interrupt(&args, wait);
        assert!(matches!(code, Some(75 | 130)), "{code:?}");
        if place.path("rows.json").exists() {
            assert_eq!(code, Some(75));
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
    assert_eq!(place.json("out/results.json"), document);
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

/// The laboratory: every combination answers the same, whoever rendered it or replayed its rays.
#[test]
fn every_combination_has_the_same_pictures_and_answers() {
    let place = Place::with_room();
    let args = [
        "study",
        "room.pbrt",
        "--trees",
        "all",
        "--collapses",
        "all",
        "--replay",
        "600",
        "--spp",
        "2",
        "--json",
        "-",
    ];
    let document = place.run(&args).expect(0).json();
    let rows = document["rows"].as_array().expect("rows");
    let of = |by: &str, part: &str| -> Vec<_> {
        rows.iter()
            .filter(|row| row["by"] == by && row["part"] == part)
            .collect()
    };
    let trees = BUILDERS.len() * COLLAPSES.len();
    let rendered = of("render", "techniques");
    // All orders on one tree, all trees by one order, and those of the paper unsorted.
    assert_eq!(rendered.len(), ORDERS.len() + trees);
    for row in &rendered {
        assert_eq!(row["image_hash"], rendered[0]["image_hash"]);
    }
    let replayed = of("replay", "techniques");
    assert_eq!(replayed.len(), 2 * trees * ORDERS.len());
    for kind in ["shadow", "ao"] {
        let own: Vec<_> = replayed.iter().filter(|row| row["rays"] == kind).collect();
        assert_eq!(own.len(), trees * ORDERS.len());
        for row in own {
            assert_eq!(row["equal_answers"], true, "{row}");
            assert_eq!(row["test_rays"], 600);
            assert!(row["mrays_per_s"].as_f64() > Some(0.0));
            assert!(row["image_hash"].is_null());
            // A mean of the rays that meet something and of the others.
            let [all, met, missed, share] = [
                "node_tests_after",
                "node_tests_occluded",
                "node_tests_unoccluded",
                "occluded_share",
            ]
            .map(|field| row[field].as_f64().expect("a number"));
            assert!(
                (share * met + (1.0 - share) * missed - all).abs() < 1e-9,
                "{row}"
            );
        }
    }
    assert!(!of("replay", "log-size").is_empty());
    let transfers = of("replay", "transfer");
    for trained in ["turned-camera", "surfaces", "other-kind"] {
        assert!(transfers.iter().any(|row| row["learned_from"] == trained));
    }
    assert!(rows.iter().all(|row| fields(row).len() == FIELDS.len()));
}

/// Learned from another camera, and from as many rays as were asked for.
#[test]
fn cameras_and_log_sizes_are_those_asked_for() {
    let place = Place::with_room();
    let rows = |flags: &[&str]| {
        let base = [
            "study",
            "room.pbrt",
            "--orders",
            "simple,sort+",
            "--widths",
            "4",
            "--replay",
            "500",
            "--json",
            "-",
        ];
        let document = place.run(&[&base, flags].concat()).expect(0).json();
        document["rows"].as_array().expect("rows").clone()
    };
    let main = |rows: &[serde_json::Value]| -> Vec<serde_json::Value> {
        let own = rows.iter().filter(|row| {
            row["by"] == "replay" && row["part"] == "techniques" && row["rays"] == "shadow"
        });
        own.cloned().collect()
    };
    let own = main(&rows(&["--log-size", "300"]));
    assert!(
        own.iter()
            .all(|row| row["log_rays"] == 300 && row["learned_from"] == "test-camera")
    );
    let camera = "1,1.5,-4 0,1,0 0,1,0";
    let other = rows(&["--log-size", "300", "--train-camera", camera]);
    assert!(
        other
            .iter()
            .any(|row| row["part"] == "transfer" && row["learned_from"] == "test-camera")
    );
    let other = main(&other);
    assert!(
        other
            .iter()
            .all(|row| row["learned_from"] == "train-camera")
    );
    assert_ne!(own[1]["node_tests_after"], other[1]["node_tests_after"]);
    // The rays that are measured are the same.
    assert_eq!(own[1]["occluded_share"], other[1]["occluded_share"]);
    let tested = main(&rows(&["--log-size", "300", "--test-camera", camera]));
    assert_ne!(own[1]["occluded_share"], tested[1]["occluded_share"]);
    // The camera of a file is that of the file.
    let file = main(&rows(&["--log-size", "300", "--test-camera", "room.pbrt"]));
    assert_eq!(own[1]["node_tests_after"], file[1]["node_tests_after"]);
    let surfaces = main(&rows(&["--log-size", "300", "--rays-from", "surfaces"]));
    assert!(surfaces.iter().all(|row| row["learned_from"] == "surfaces"));
    let bad = ["study", "room.pbrt", "--train-camera", "0,0,0 0,0,0 0,1,0"];
    assert!(place.run(&bad).expect(2).stderr.contains("cannot look at"));
}

#[test]
fn a_study_continues_where_it_stopped() {
    let place = Place::with_room();
    let study = |flags: &[&str]| {
        let base = [
            "study",
            "room.pbrt",
            "--orders",
            "simple,sort+",
            "--collapses",
            "all",
            "--replay",
            "300",
            "--out",
            "out",
        ];
        place.run(&[&base, flags].concat())
    };
    study(&[]).expect(0);
    let whole = place.json("out/results.json");
    let journal = std::fs::read_to_string(place.path("out/journal.jsonl")).expect("a journal");
    let lines: Vec<&str> = journal.lines().collect();
    assert!(lines.len() > 10);
    // As if it had been killed while it wrote a line.
    let kept = lines[..6].join("\n") + "\n" + &lines[6][..40];
    place.write("out/journal.jsonl", kept);
    let run = study(&[]).expect(0);
    assert!(
        run.stderr.contains("5 pieces of work were finished"),
        "{}",
        run.stderr
    );
    let again = place.json("out/results.json");
    let rows = |document: &serde_json::Value| document["rows"].as_array().expect("rows").clone();
    let (first, second) = (rows(&whole), rows(&again));
    assert_eq!(first.len(), second.len());
    for (a, b) in first.iter().zip(&second) {
        for fact in [
            "scene",
            "order",
            "by",
            "node_tests_after",
            "prim_tests_after",
            "image_hash",
        ] {
            assert_eq!(a[fact], b[fact]);
        }
    }
    // What was finished is taken as it is, times included.
    assert_eq!(first[0]["render_seconds"], second[0]["render_seconds"]);

    // Another plan, another scene, a damaged line: refused with the reason.
    let refused = |run: crate::support::Run, reason: &str| {
        let run = run.expect(2);
        assert!(
            run.stderr.contains(reason) && run.stderr.contains("--restart"),
            "{}",
            run.stderr
        );
    };
    refused(study(&["--seed", "1"]), "--seed 1");
    let room = std::fs::read_to_string(place.path("room.pbrt")).expect("a file");
    place.write("room.pbrt", room.replace("[0.6]", "[0.61]"));
    refused(study(&[]), "the scene room has changed");
    study(&["--restart"]).expect(0);
    let journal = std::fs::read_to_string(place.path("out/journal.jsonl")).expect("a journal");
    place.write(
        "out/journal.jsonl",
        journal.replacen("\"key\"", "\"kex\"", 1),
    );
    refused(study(&[]), "line 2 is damaged");
    place.write("out/journal.jsonl", "nonsense\n");
    refused(study(&[]), "no header");
}

/// The page needs nothing but itself, and a scene's name cannot break it.
#[test]
fn the_page_stands_alone() {
    let place = Place::with_room();
    let name = "a<b>&'c.pbrt";
    std::fs::rename(place.path("room.pbrt"), place.path(name)).expect("a file");
    let args = [
        "study",
        name,
        "--orders",
        "simple,sort-,sort,sort+",
        "--replay",
        "300",
        "--out",
        "out",
    ];
    place.run(&args).expect(0);
    let page = std::fs::read_to_string(place.path("out/report.html")).expect("a page");
    assert!(!page.contains("<b>") && page.contains("a&lt;b&gt;&amp;"));
    for foreign in [
        "src=\"http",
        "href=\"http",
        "url(",
        "@import",
        "<link rel=\"stylesheet",
    ] {
        assert!(!page.contains(foreign), "{foreign}");
    }
    // The picture, two maps, their difference and two scales.
    assert_eq!(page.matches("<img src=\"data:image/png;base64,").count(), 6);
    assert_eq!(page.matches("type=\"range\"").count(), 1);
    for word in [
        "Node tests by technique",
        "Share of shadow rays",
        "Correlation",
        "seed 0",
    ] {
        assert!(page.contains(word), "{word}");
    }
    assert!(!page.contains("#000000"));
}
