//! `bench`: what it writes, with and without Embree. Nothing is said about speed here.

use antumbra::recipe::Level;
use antumbra_trees::{BUILDERS, COLLAPSES};
use serde_json::Value;

use crate::support::{Place, fields, files};

const FIELDS: [&str; 23] = [
    "scene",
    "triangles",
    "unique_triangles",
    "cutouts",
    "instances",
    "rays",
    "ray_count",
    "query",
    "engine",
    "api",
    "level",
    "width",
    "order",
    "builder",
    "collapse",
    "prefetch",
    "threads",
    "mrays_per_s",
    "ratio_to_embree",
    "disagreements",
    "occluded",
    "node_tests",
    "prim_tests",
];
const BUILD_FIELDS: [&str; 16] = [
    "scene",
    "triangles",
    "unique_triangles",
    "cutouts",
    "instances",
    "engine",
    "builder",
    "collapse",
    "level",
    "width",
    "threads",
    "seconds",
    "best_seconds",
    "step_seconds",
    "bytes",
    "buffer_bytes",
];
/// The room's triangles: walls, light, tetrahedron, and its sphere as a mesh.
const TRIANGLES: usize = 6 + 2 + 4 + 2 * 48 * 23;
const QUICK: [&str; 6] = ["--rays", "300", "--log-rays", "200", "--repeat", "2"];

fn rows(document: &Value) -> &[Value] {
    document["rows"].as_array().expect("rows")
}

fn check_fields(rows: &[Value], expected: &[&str]) {
    let mut expected = expected.to_vec();
    expected.sort_unstable();
    for row in rows {
        let mut found = fields(row);
        found.sort_unstable();
        assert_eq!(found, expected);
    }
}

#[test]
fn a_row_for_every_query_kind_tree_api_and_number_of_threads() {
    let place = Place::with_room();
    let args = [
        "bench",
        "room.pbrt",
        "--orders",
        "simple,ftob,sort+",
        "--collapses",
        "all",
        "--widths",
        "4,16",
        "--threads",
        "1,2",
        "--json",
        "-",
        "--out",
        "deep/out",
    ];
    let run = place.run(&[&args[..], &QUICK].concat()).expect(0);
    assert_eq!(run.stderr.matches("bench/get-embree").count(), 1);
    let document = run.json();
    assert_eq!(document["schema"], "antumbra.bench/1");
    for field in [
        "version",
        "cpu",
        "level",
        "threads",
        "command_line",
        "commit",
    ] {
        assert!(document.get(field).is_some(), "{field}");
    }
    assert_eq!(document["complete"], true);
    assert_eq!(document["embree"], Value::Null);
    assert_eq!(
        (&document["seed"], &document["repeat"]),
        (&0.into(), &2.into())
    );
    let compiler = document["compiler"].as_str().expect("known to cargo");
    assert!(compiler.starts_with("rustc 1."), "{compiler}");

    let rows = rows(&document);
    check_fields(rows, &FIELDS);
    // Kinds, queries, numbers of threads, APIs, orders, widths, and all collapses.
    assert_eq!(rows.len(), 3 * 2 * 2 * 2 * 3 * 2 * COLLAPSES.len());
    for row in rows {
        assert_eq!(row["triangles"], TRIANGLES);
        assert_eq!(row["ray_count"], 300);
        assert_eq!(row["engine"], "antumbra");
        assert_eq!(row["disagreements"], 0, "{row}");
        assert_eq!(row["ratio_to_embree"], Value::Null);
        assert!(row["mrays_per_s"].as_f64() > Some(0.0), "{row}");
        let share = row["occluded"].as_f64().expect("a share");
        assert!(share > 0.05 && share <= 1.0, "{row}");
        let counts = row["query"] == "occluded";
        assert_eq!(row["node_tests"].as_f64() >= Some(1.0), counts, "{row}");
        assert_eq!(row["prim_tests"].as_f64() > Some(0.0), counts, "{row}");
    }
    let keys: Vec<_> = rows
        .iter()
        .map(|row| {
            let keys = ["rays", "query", "api", "width", "collapse", "order"];
            let threads = row["threads"].to_string();
            (keys.map(|key| row[key].to_string()), threads)
        })
        .collect();
    for (index, key) in keys.iter().enumerate() {
        assert!(!keys[..index].contains(key), "{key:?} twice");
    }

    let builds = document["builds"].as_array().expect("builds");
    check_fields(builds, &BUILD_FIELDS);
    assert_eq!(builds.len(), 2 * BUILDERS.len());
    for build in builds {
        assert!(build["seconds"].as_f64() >= build["best_seconds"].as_f64());
        assert!(build["bytes"].as_u64() > Some(1000), "{build}");
        let steps = ["primitives", "tree", "log", "collapse"];
        for step in steps.map(|step| build["step_seconds"][step].as_f64()) {
            assert!(
                step > Some(0.0) && step < build["seconds"].as_f64(),
                "{build}"
            );
        }
    }
    let checks = document["checks"].as_array().expect("checks");
    assert_eq!(checks.len(), 3);
    for check in checks {
        assert_eq!(
            (&check["ray_count"], &check["disagreements"]),
            (&128.into(), &0.into())
        );
    }

    let out = place.path("deep/out");
    assert_eq!(files(&out), ["bench.json", "bench.md", "bench.svg"]);
    assert_eq!(place.json("deep/out/bench.json"), document);
    let text = |name| std::fs::read_to_string(out.join(name)).expect("a readable file");
    let report = text("bench.md");
    assert!(
        report.contains("bench.svg")
            && report.contains("16 learned sort+ |")
            && report.contains("16 area sort+ |"),
        "{report}"
    );
    let picture = text("bench.svg");
    assert!(picture.starts_with("<svg") && picture.trim_end().ends_with("</svg>"));
    assert!(picture.contains("room") && picture.contains("shadow batch"));
    // Two panels with three kinds of two bars, the white ground, and the legend's squares.
    assert_eq!(picture.matches("<rect").count(), 2 * 3 * 2 + 1 + 6);
}

#[test]
fn the_same_rays_and_answers_on_every_level() {
    let place = Place::with_room();
    let levels: Vec<_> = Level::available().map(Level::name).collect();
    let levels = levels.join(",");
    let args = [
        "bench",
        "room.pbrt",
        "--levels",
        &levels,
        "--threads",
        "3",
        "--builds",
        "ploc,binned-sah",
        "--json",
        "-",
    ];
    let document = place.run(&[&args[..], &QUICK].concat()).expect(0).json();
    let builds = document["builds"].as_array().expect("builds");
    let builders = builds.iter().map(|build| &build["builder"]);
    let chosen = ["ploc", "binned-sah"].repeat(Level::available().count());
    assert!(builders.eq(&chosen));
    let rows = rows(&document);
    assert_eq!(rows.len(), 3 * 2 * 2 * Level::available().count());
    for row in rows {
        assert_eq!(row["disagreements"], 0, "{row}");
        let alike = |other: &&Value| ["rays", "query"].iter().all(|&key| other[key] == row[key]);
        let first = rows.iter().find(alike).expect("itself");
        assert_eq!(row["occluded"], first["occluded"]);
    }
}

#[test]
fn several_scenes_have_a_mean_and_kinds_without_rays_no_row() {
    let place = Place::with_room();
    place.write("dark.pbrt", "WorldBegin Shape \"sphere\" WorldEnd");
    let args = [
        "bench",
        "room.pbrt",
        "dark.pbrt",
        "--threads",
        "1",
        "--json",
        "rows.json",
    ];
    let run = place.run(&[&args[..], &QUICK].concat()).expect(0);
    assert!(
        run.stdout.contains("geometric mean of 2 scenes"),
        "{}",
        run.stdout
    );
    assert!(
        run.stderr.contains("dark: its paths have no shadow rays"),
        "{}",
        run.stderr
    );
    let document = place.json("rows.json");
    let count = |scene: &str, kind: &str| {
        let alike = |row: &&Value| row["scene"] == scene && row["rays"] == kind;
        rows(&document).iter().filter(alike).count()
    };
    assert_eq!(
        ["primary", "shadow", "diffuse"].map(|kind| count("room", kind)),
        [4, 4, 4]
    );
    assert_eq!(
        ["primary", "shadow", "diffuse"].map(|kind| count("dark", kind)),
        [4, 0, 4]
    );
}

/// Grates with square holes, one in the world and five placed ones, each of these with a ball, over a floor.
const GRATES: &str = r#"
LookAt 0 2.5 6  0 0.8 0  0 1 0
Camera "perspective" "float fov" [50]
Film "image" "integer xresolution" [24] "integer yresolution" [16]
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.5 0.5]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [12 11 10]
  Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-0.5 4 -0.5  0.5 4 -0.5  0.5 4 0.5  -0.5 4 0.5]
AttributeEnd
Texture "holes" "float" "checkerboard" "float uscale" [4] "float vscale" [4] "float tex1" [1] "float tex2" [0]
ObjectBegin "grate"
  Shape "trianglemesh" "texture alpha" ["holes"] "integer indices" [0 1 2 0 2 3]
    "point P" [-1 1 -1  1 1 -1  1 1 1  -1 1 1] "float uv" [0 0 1 0 1 1 0 1]
  Shape "sphere" "float radius" [0.4]
ObjectEnd
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-4 0 -4  4 0 -4  4 0 4  -4 0 4]
Shape "trianglemesh" "texture alpha" ["holes"] "integer indices" [0 1 2 0 2 3]
  "point P" [-3 0 -2  3 0 -2  3 3 -2  -3 3 -2] "float uv" [0 0 1 0 1 1 0 1]
ObjectInstance "grate"
AttributeBegin Translate 1.5 0.5 0.5 Rotate 40 0 0 1 ObjectInstance "grate" AttributeEnd
AttributeBegin Translate -1.5 0.3 1 Rotate 70 1 2 0 Scale 0.7 0.7 0.7 ObjectInstance "grate" AttributeEnd
AttributeBegin Translate 0.5 0.8 1.5 Scale -0.5 0.5 0.5 ObjectInstance "grate" AttributeEnd
AttributeBegin Translate -2 1 -1 Scale 0.4 0.4 0.4 ObjectInstance "grate" AttributeEnd
WorldEnd
"#;

/// Ours must agree with brute force, Embree nearly so; without Embree only ours is there.
#[test]
fn instances_and_holes_are_traced_as_such() {
    let place = Place::empty();
    place.write("grates.pbrt", GRATES);
    let library = std::env::var("ANTUMBRA_EMBREE").unwrap_or_default();
    let mut args = vec![
        "bench",
        "grates.pbrt",
        "--collapses",
        "all",
        "--widths",
        "4,16",
    ];
    args.extend(["--threads", "1", "--json", "-"]);
    if library.is_empty() {
        println!("skipped in part: no Embree");
    } else {
        args.extend(["--embree", &library]);
    }
    let run = place.run(&[&args[..], &QUICK].concat()).expect(0);
    let heading = "11 056 triangles, 5 instances, 2 216 unique, 4 with holes";
    assert!(run.stderr.contains(heading), "{}", run.stderr);
    let document = run.json();
    for check in document["checks"].as_array().expect("checks") {
        assert_eq!(check["disagreements"], 0, "{check}");
    }
    let ball = 2 * 48 * 23;
    let sizes = [
        ("triangles", 6 + 5 * (2 + ball)),
        ("unique_triangles", 6 + 2 + ball),
        ("cutouts", 4),
        ("instances", 5),
    ];
    let builds = document["builds"].as_array().expect("builds");
    for row in rows(&document).iter().chain(builds) {
        for (field, size) in sizes {
            assert_eq!(row[field], size, "{field} of {row}");
        }
    }
    let engines = if library.is_empty() { 1 } else { 2 };
    for row in rows(&document) {
        if row["engine"] == "antumbra" {
            assert_eq!(row["disagreements"], 0, "{row}");
        } else {
            // Rays through the edges of holes, too.
            assert!(row["disagreements"].as_u64() <= Some(6), "{row}");
        }
    }
    assert_eq!(builds.len(), BUILDERS.len() + engines - 1);
    for build in builds {
        // Two levels, not the written-out triangles. The leaves of pbrt are small, so that blocks are half empty.
        assert!(build["bytes"].as_u64() < Some(500 * 2216), "{build}");
    }
}

/// Runs only where `ANTUMBRA_EMBREE` names the library.
#[test]
fn embree_stands_beside_us() {
    let Some(library) = std::env::var("ANTUMBRA_EMBREE")
        .ok()
        .filter(|path| !path.is_empty())
    else {
        println!("skipped: no Embree");
        return;
    };
    let place = Place::with_room();
    let args = [
        "bench",
        "room.pbrt",
        "--embree",
        &library,
        "--threads",
        "1,2",
        "--json",
        "-",
    ];
    let levels = ["avx512", "avx2"].map(|name| name.parse().expect("a level"));
    let levels = levels
        .into_iter()
        .filter(|level: &Level| level.is_available());
    for level in levels {
        let flags = ["--level", level.name()];
        let run = place.run(&[&args[..], &QUICK, &flags].concat()).expect(0);
        let document = run.json();
        assert!(
            document["embree"]
                .as_str()
                .is_some_and(|version| version.starts_with("4."))
        );
        // Both queries on three kinds and two numbers of threads by four single engines, one of them ours
        // in batches, and packets for occlusion alone.
        assert_eq!(rows(&document).len(), 3 * 2 * (4 + 5));
        for row in rows(&document) {
            let is = |engine: &str, api: &str| row["engine"] == engine && row["api"] == api;
            assert!(row["ratio_to_embree"].as_f64() > Some(0.0), "{row}");
            if is("embree", "single") {
                assert_eq!(row["ratio_to_embree"], 1.0);
            }
            if row["engine"] == "antumbra" {
                assert_eq!(row["disagreements"], 0, "{row}");
            } else {
                // Rays through edges may leak, and distances differ by rounding where rays graze.
                assert!(row["disagreements"].as_u64() <= Some(6), "{row}");
                assert_eq!(row["width"], Value::Null);
            }
        }
        let builds = document["builds"].as_array().expect("builds");
        let theirs: Vec<_> = builds
            .iter()
            .filter(|row| row["engine"] == "embree")
            .collect();
        assert_eq!(theirs.len(), 2);
        for build in theirs {
            assert!(build["bytes"].as_u64() > Some(10_000), "{build}");
            let buffers = build["buffer_bytes"].as_u64().expect("a number") as usize;
            assert!(
                (TRIANGLES * 12..TRIANGLES * 30).contains(&buffers),
                "{build}"
            );
        }
    }
}

/// What there is beside plain triangles answers as brute force does, and Embree nearly so.
#[test]
fn kinds_beside_plain_triangles() {
    let place = Place::empty();
    place.write("grates.pbrt", GRATES);
    let library = std::env::var("ANTUMBRA_EMBREE").unwrap_or_default();
    let mut args = vec![
        "bench",
        "builtin:city:3000",
        "grates.pbrt",
        "--kinds",
        "--json",
        "-",
    ];
    args.extend(["--threads", "1", "--builds", "binned-sah"]);
    if library.is_empty() {
        println!("skipped in part: no Embree");
    } else {
        args.extend(["--embree", &library]);
    }
    let run = place.run(&[&args[..], &QUICK].concat()).expect(0);
    let passed_over = "grates: kinds are measured in scenes of one level only";
    assert!(run.stderr.contains(passed_over), "{}", run.stderr);
    let document = run.json();
    for check in document["checks"].as_array().expect("checks") {
        assert_eq!(check["disagreements"], 0, "{check}");
        assert!(check["ray_count"].as_u64() >= Some(16), "{check}");
    }
    let rows = document["kinds"].as_array().expect("kinds");
    let of = |kind: &str, query: &str, engine: &str| {
        let alike =
            |row: &&Value| row["kind"] == kind && row["query"] == query && row["engine"] == engine;
        rows.iter().filter(alike).count()
    };
    let queries = ["occluded", "intersect"];
    for kind in [
        "triangles",
        "quads",
        "user",
        "closed",
        "mask",
        "except",
        "filter",
        "refitted",
    ] {
        assert_eq!(
            queries.map(|query| of(kind, query, "antumbra")),
            [2, 2],
            "{kind}"
        );
    }
    assert_eq!(queries.map(|query| of("visit", query, "antumbra")), [0, 1]);
    assert_eq!(of("refit", "update", "antumbra"), 1);
    assert_eq!(of("points", "closest", "antumbra"), 2);
    let rivals = usize::from(!library.is_empty());
    for kind in ["triangles", "quads", "user", "filter", "refitted"] {
        assert_eq!(
            queries.map(|query| of(kind, query, "embree")),
            [rivals; 2],
            "{kind}"
        );
    }
    assert_eq!(of("refit", "update", "embree"), rivals);
    assert_eq!(of("points", "closest", "embree"), rivals);
    for row in rows {
        assert!(row["millions_per_s"].as_f64() > Some(0.0), "{row}");
        // Rays through edges may leak, and user geometry has edges that meet in single precision.
        let most = if row["engine"] == "antumbra" { 0 } else { 6 };
        assert!(row["disagreements"].as_u64() <= Some(most), "{row}");
    }
}

/// Ctrl-C keeps the rows that were finished.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_bench_keeps_what_was_finished() {
    use std::time::Duration;

    let place = Place::with_room();
    let args = [
        "bench",
        "room.pbrt",
        "--rays",
        "300",
        "--repeat",
        "10000",
        "--json",
        "rows.json",
    ];
    let mut wait = Duration::from_millis(100);
    let document = loop {
        let code = place.interrupt(&args, wait);
        assert_eq!(code, Some(130), "after {wait:?}");
        if place.path("rows.json").exists() {
            break place.json("rows.json");
        }
        wait *= 2;
    };
    assert_eq!(document["complete"], false);
    check_fields(rows(&document), &FIELDS);
    assert!(!rows(&document).is_empty());
}
