//! `render` and what it promises about its picture.

use crate::support::{Place, fields};

#[test]
fn the_picture_is_named_by_the_film_or_the_scene() {
    let place = Place::with_room();
    let run = place.run(&["render", "room.pbrt"]).expect(0);
    // The film asks for pictures/room.tga.
    assert!(run.stderr.contains("wrote room.exr"), "{}", run.stderr);
    assert_eq!(run.stdout, "");
    let image = place.image("room.exr");
    assert_eq!((image.width(), image.height()), (24, 16));
    assert_eq!(image.non_finite(), 0);
    assert!(image.mean().iter().all(|&mean| mean > 0.01));

    let args = ["render", "thing.ply", "--spp", "1", "--resolution", "20x10"];
    place.run(&args).expect(0);
    assert_eq!(place.image("thing.exr").width(), 20);
    place.run(&["render", "room.pbrt", "-o", "x.png"]).expect(0);
    let png = std::fs::read(place.path("x.png")).expect("a file");
    assert!(png.starts_with(b"\x89PNG"));
    assert_eq!(
        place.files(),
        ["room.exr", "room.pbrt", "thing.exr", "thing.ply", "x.png"]
    );
}

#[test]
fn no_colour_codes_where_there_is_no_terminal() {
    let place = Place::with_room();
    let run = place.run(&["render", "room.pbrt"]).expect(0);
    assert!(
        !run.stderr.contains('\u{1b}') && !run.stderr.contains('\r'),
        "{:?}",
        run.stderr
    );
}

#[test]
fn the_json_document_is_complete() {
    let place = Place::with_room();
    let args = [
        "render",
        "room.pbrt",
        "-o",
        "a.exr",
        "--seed",
        "7",
        "--threads",
        "2",
        "--stderr-image",
        "e.exr",
        "--json",
        "-",
    ];
    let document = place.run(&args).expect(0).json();
    let expected = [
        "schema",
        "version",
        "cpu",
        "level",
        "threads",
        "seed",
        "command_line",
        "scene",
        "output",
        "stderr_image",
        "shard",
        "resumed_tiles",
        "resolution",
        "pixel_bounds",
        "spp",
        "sampler",
        "integrator",
        "order",
        "builder",
        "collapse",
        "width",
        "prefetch",
        "triangles",
        "primitives",
        "dropped_primitives",
        "nodes",
        "leaves",
        "depth",
        "tree_bytes",
        "closest_rays",
        "shadow_rays",
        "occluded_rays",
        "logged_rays",
        "shadow_share",
        "node_tests_before",
        "prim_tests_before",
        "predicted_cost_before",
        "predicted_cost_after",
        "load_seconds",
        "lower_seconds",
        "build_seconds",
        "log_seconds",
        "sort_seconds",
        "render_seconds",
        "busy_seconds",
        "dropped_samples",
        "dropped_at",
        "noise",
        "image_hash",
    ];
    let (mut found, mut expected) = (fields(&document), expected.to_vec());
    found.sort_unstable();
    expected.sort_unstable();
    assert_eq!(found, expected);
    assert_eq!(document["schema"], "antumbra.render/1");
    assert_eq!(document["scene"], "room");
    assert_eq!(document["seed"], 7);
    assert_eq!(document["threads"], 2);
    assert_eq!(document["spp"], 4);
    assert_eq!(document["triangles"], 12);
    assert_eq!(document["primitives"], 13);
    assert_eq!(document["order"], "joint");
    assert_eq!(document["output"], "a.exr");
    assert!(document["shadow_rays"].as_u64() > Some(0));
    let busy = document["busy_seconds"].as_object().expect("an object");
    let seconds = |name: &str| busy[name].as_f64().expect("seconds");
    let parts = [
        "build", "log", "sort", "shadow", "closest", "shading", "film",
    ];
    assert_eq!(busy.len(), parts.len() + 1);
    let sum: f64 = parts.into_iter().map(seconds).sum();
    assert!(
        (sum - seconds("total")).abs() < 1e-9 && parts.into_iter().all(|name| seconds(name) >= 0.0)
    );

    // The same in a file, and no field depends on where it goes.
    let args = ["render", "room.pbrt", "--json", "figures.json"];
    let run = place.run(&args).expect(0);
    assert_eq!(run.stdout, "");
    assert_eq!(fields(&place.json("figures.json")), fields(&document));
    assert_eq!(place.image("e.exr").width(), 24);
}

/// The bytes of the picture and its hash are the same whatever way it was computed.
#[test]
fn nothing_but_the_seed_and_the_samples_changes_the_picture() {
    let place = Place::with_room();
    let render = |flags: &[&str]| {
        let args = [
            &["render", "room.pbrt", "-o", "a.exr", "--json", "-"],
            flags,
        ]
        .concat();
        let document = place.run(&args).expect(0).json();
        let bytes = std::fs::read(place.path("a.exr")).expect("a file");
        (document["image_hash"].clone(), bytes)
    };
    let reference = render(&[]);
    for flags in [
        ["--order", "simple"],
        ["--order", "ftob"],
        ["--order", "sort-"],
        ["--collapse", "area"],
        ["--collapse", "learned"],
        ["--integrator", "path"],
        ["--width", "4"],
        ["--width", "8"],
        ["--width", "16"],
        ["--threads", "1"],
        ["--threads", "3"],
        ["--level", "scalar"],
        ["--seed", "0"],
        ["--spp", "4"],
        ["--resolution", "24x16"],
    ] {
        assert!(render(&flags) == reference, "{flags:?}");
    }
    for flags in [["--seed", "1"], ["--spp", "3"], ["--resolution", "25x16"]] {
        assert!(render(&flags) != reference, "{flags:?}");
    }
}

/// Another integrator makes another picture; its samples are the shadow rays it asks for.
#[test]
fn integrators_and_their_samples_may_be_chosen() {
    let place = Place::with_room();
    let figures = |integrator: &str, samples: &[&str]| {
        let args = ["render", "room.pbrt", "--spp", "1", "--json", "-"];
        let args = [&args[..], &["--integrator", integrator], samples].concat();
        let document = place.run(&args).expect(0).json();
        assert_eq!(document["integrator"], integrator);
        document["shadow_rays"].as_u64().expect("a number")
    };
    let ambient = |samples: &[&str]| figures("ambientocclusion", samples);
    let few = ambient(&["--samples", "3"]);
    assert!(few > 0 && few.is_multiple_of(3));
    assert_eq!(ambient(&[]), few / 3 * 64);
    let direct = |samples: &[&str]| figures("directlighting", samples);
    let [once, often] = [direct(&[]), direct(&["--samples", "16"])];
    assert!(
        often > 10 * once && often <= 16 * 2 * once,
        "{often} {once}"
    );
}

#[test]
fn the_scene_may_choose_width_and_order() {
    let place = Place::with_room();
    let room = std::fs::read_to_string(place.path("room.pbrt")).expect("a file");
    place.write(
        "eight.pbrt",
        format!("Accelerator \"obvh\" \"string order\" [\"sato\"]\n{room}"),
    );
    let document = |flags: &[&str]| {
        let args = [&["render", "eight.pbrt", "--json", "-"], flags].concat();
        place.run(&args).expect(0).json()
    };
    let chosen = document(&[]);
    assert_eq!(
        (&chosen["width"], &chosen["order"]),
        (&8.into(), &"sato".into())
    );
    let overruled = document(&["--width", "4", "--order", "sort"]);
    assert_eq!(
        (&overruled["width"], &overruled["order"]),
        (&4.into(), &"sort".into())
    );
}

#[test]
fn outputs_that_cannot_be_written_are_found_before_rendering() {
    let place = Place::with_room();
    std::fs::create_dir(place.path("folder.exr")).expect("a folder");
    for args in [
        ["render", "room.pbrt", "-o", "no/such/folder/a.exr"],
        ["render", "room.pbrt", "-o", "folder.exr"],
        ["render", "room.pbrt", "--json", "no/such/folder/a.json"],
        [
            "render",
            "room.pbrt",
            "--stderr-image",
            "no/such/folder/a.exr",
        ],
        ["study", "room.pbrt", "--json", "no/such/folder/a.json"],
        ["study", "room.pbrt", "--out", "room.pbrt"],
    ] {
        let run = place.run(&args).expect(1);
        assert!(
            run.stderr.contains("cannot write"),
            "{args:?}: {}",
            run.stderr
        );
        assert!(!run.stderr.contains("rendered"), "{args:?}");
    }
    assert_eq!(place.files(), ["folder.exr", "room.pbrt", "thing.ply"]);
}

#[test]
fn meshes_are_lit_and_framed() {
    let place = Place::with_room();
    place.write(
        "square.obj",
        "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3 4\n",
    );
    let gltf = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": "points.bin", "byteLength": 36}]}"#;
    place.write("triangle.gltf", gltf);
    let points = [0.0f32, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0, 0.0].map(f32::to_le_bytes);
    place.write("points.bin", points.concat());
    for scene in ["thing.ply", "square.obj", "triangle.gltf"] {
        let args = [
            "render",
            scene,
            "-o",
            "m.exr",
            "--spp",
            "2",
            "--resolution",
            "32x18",
            "--up",
            "y",
        ];
        place.run(&args).expect(0);
        let image = place.image("m.exr");
        // Near the middle is the mesh, in the corner the sky.
        assert_ne!(image.get(15, 12), image.get(0, 0), "{scene}");
    }
}

#[test]
fn the_city_is_on_every_machine() {
    let place = Place::empty();
    let args = [
        "render",
        "builtin:city",
        "--spp",
        "1",
        "--resolution",
        "32x18",
        "--json",
        "-",
    ];
    let document = place.run(&args).expect(0).json();
    assert!(document["triangles"].as_u64() >= Some(500_000));
    assert_eq!(document["dropped_primitives"], 0);
    assert!(document["shadow_share"].as_f64() > Some(0.1));
    assert_eq!(place.files(), ["city.exr"]);
}

/// Ctrl-C ends an endless rendering in good order.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_rendering_leaves_nothing() {
    use std::time::Duration;

    let place = Place::with_room();
    let args = ["render", "room.pbrt", "--spp", "1048576"];
    let code = place.interrupt(&args, Duration::ZERO);
    assert_eq!(code, Some(130));
    assert_eq!(place.files(), ["room.pbrt", "thing.ply"]);
}
