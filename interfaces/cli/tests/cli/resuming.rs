//! Interruptions, parts and learned orders: what is written, what is refused, and that pictures stay the same.

use std::fs;
#[cfg(target_os = "linux")]
use std::time::Duration;

use crate::support::{Place, Run};

/// Flags by which the room takes long enough to be interrupted.
const LONG: [&str; 4] = ["--resolution", "240x160", "--threads", "1"];

fn bytes(place: &Place, name: &str) -> Vec<u8> {
    fs::read(place.path(name)).expect("a file")
}

/// What is said when it is refused with this code; nothing may be written.
fn refused(place: &Place, args: &[&str], code: i32) -> String {
    let before = place.files();
    let Run { stderr, .. } = place.run(args).expect(code);
    assert_eq!(place.files(), before);
    stderr
}

/// Renders to a.exr with interruptions, at least one of them while samples are traced, until it is done. `check` is called
/// after each.
#[cfg(target_os = "linux")]
fn interrupted_until_done(place: &Place, args: &[&str], check: impl Fn()) {
    let mut wait = Duration::from_millis(40);
    let mut interruptions = 0;
    loop {
        match place.interrupt(args, wait) {
            Some(0) => break,
            Some(75) => {
                assert!(place.path("a.exr.checkpoint").exists());
                check();
                interruptions += 1;
            }
            Some(130) => assert!(!place.path("a.exr.checkpoint").exists()),
            code => panic!("{code:?}"),
        }
        // On a slow machine it may not get anywhere otherwise.
        wait += Duration::from_millis(20);
    }
    println!("{interruptions} interruptions");
    assert!(
        interruptions > 0,
        "it was never interrupted while it rendered"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_rendering_is_gone_on_with() {
    let place = Place::with_room();
    let plain = [
        &["render", "room.pbrt", "-o", "a.exr", "--spp", "32"][..],
        &LONG,
    ]
    .concat();
    place.run(&plain).expect(0);
    let whole = bytes(&place, "a.exr");
    place.write("a.exr", "the last good one");

    let often = [&plain[..], &["--resume", "--checkpoint-every", "5ms"]].concat();
    interrupted_until_done(&place, &often, || {
        assert_eq!(bytes(&place, "a.exr"), b"the last good one");
    });
    assert!(bytes(&place, "a.exr") == whole, "another picture");
    assert_eq!(place.files(), ["a.exr", "room.pbrt", "thing.ply"]);
}

/// Time and noise decide the number of samples, and an interruption does not change what comes of it, textures included.
#[cfg(target_os = "linux")]
#[test]
fn a_textured_rendering_in_steps_is_gone_on_with() {
    let place = Place::empty();
    place.write("model.glb", antumbra_testkit::model::all_textures());
    let plain = [
        &["render", "model.glb", "-o", "a.exr", "--time", "1h"][..],
        &["--spp", "64", "--resolution", "60x40", "--threads", "1"],
    ]
    .concat();
    place.run(&plain).expect(0);
    let whole = bytes(&place, "a.exr");
    assert!(!place.path("a.exr.checkpoint").exists());
    let often = [&plain[..], &["--checkpoint-every", "5ms"]].concat();
    // The picture of the last step is there, if one is finished.
    interrupted_until_done(&place, &often, || {
        assert!(place.image("a.exr").non_finite() == 0);
    });
    assert!(bytes(&place, "a.exr") == whole, "another picture");
    assert_eq!(place.files(), ["a.exr", "model.glb"]);
    // The checkpoint of a step is none of a picture with another number of samples, nor of another kind of run.
    let mut wait = Duration::from_millis(200);
    loop {
        match place.interrupt(&often, wait) {
            Some(75) => break,
            Some(0) => wait = wait * 2 / 3,
            _ => wait = wait * 5 / 4,
        }
    }
    let fewer = [&plain[..6], &["--spp", "8", "--resolution", "60x40"]].concat();
    let said = refused(&place, &fewer, 2);
    assert!(said.contains("more than --spp 8"), "{said}");
    let other = [&plain[..4], &["--spp", "64", "--resolution", "60x40"]].concat();
    let said = refused(&place, &other, 2);
    assert!(said.contains("textures for 64 samples"), "{said}");
}

#[test]
fn a_finished_picture_gets_more_samples() {
    let place = Place::with_room();
    let wide = fs::read_to_string(place.path("room.pbrt")).expect("a file");
    // A filter with which tiles overlap, and a picture whose tiles at the edges are small.
    let wide = wide.replace("Sampler", "PixelFilter \"gaussian\"\nSampler");
    place.write("wide.pbrt", wide);
    for scene in ["room.pbrt", "wide.pbrt"] {
        let render = |name: &str, spp: &str, flags: &[&str]| {
            let base = [
                "render",
                scene,
                "-o",
                name,
                "--resolution",
                "70x41",
                "--spp",
                spp,
            ];
            place.run(&[&base[..], flags].concat()).expect(0)
        };
        render("whole.exr", "64", &[]);
        render("a.exr", "16", &["--keep-samples"]);
        assert!(place.path("a.exr.checkpoint").is_file());
        // Fewer samples do not replace more.
        let fewer = [
            "render",
            scene,
            "-o",
            "a.exr",
            "--resolution",
            "70x41",
            "--spp",
            "8",
        ];
        refused(&place, &fewer, 2);
        let run = render(
            "a.exr",
            "32",
            &["--resume", "--keep-samples", "--threads", "1"],
        );
        assert!(run.stderr.contains("from 16 samples"), "{}", run.stderr);
        let run = render("a.exr", "64", &["--width", "4", "--order", "simple"]);
        assert!(run.stderr.contains("from 32 samples"), "{}", run.stderr);
        assert!(
            bytes(&place, "a.exr") == bytes(&place, "whole.exr"),
            "{scene}"
        );
        assert!(!place.path("a.exr.checkpoint").exists());
        // Without what was kept, the picture is the same.
        render("b.exr", "16", &[]);
        render("b.exr", "64", &["--resume"]);
        assert!(
            bytes(&place, "b.exr") == bytes(&place, "whole.exr"),
            "{scene}"
        );
    }
    // Parts keep their samples anyway.
    let part = |spp: &str| {
        let args = [
            "render",
            "room.pbrt",
            "--shard",
            "0/2",
            "-o",
            "p.part",
            "--spp",
            spp,
        ];
        place.run(&args).expect(0)
    };
    part("16");
    assert!(part("16").stderr.contains("complete already"));
    let run = part("32");
    assert!(run.stderr.contains("from 16 samples"), "{}", run.stderr);
    let other = ["--shard", "1/2", "-o", "q.part"];
    let whole = ["-o", "w.exr"];
    for flags in [&other[..], &whole] {
        let base = ["render", "room.pbrt", "--spp", "32"];
        place.run(&[&base[..], flags].concat()).expect(0);
    }
    let merge = ["merge", "p.part", "q.part", "-o", "m.exr"];
    place.run(&merge).expect(0);
    assert!(bytes(&place, "m.exr") == bytes(&place, "w.exr"));
}

#[cfg(target_os = "linux")]
#[test]
fn an_interruption_leaves_a_preview() {
    let place = Place::with_room();
    let args = [
        "render",
        "room.pbrt",
        "-o",
        "a.exr",
        "--spp",
        "400",
        "--preview",
    ];
    let args = [&args[..], &LONG].concat();
    let mut wait = Duration::from_millis(300);
    // Where the first batch was not finished, there is nothing to see.
    while !place.path("a.exr.preview.png").exists() {
        assert!(matches!(place.interrupt(&args, wait), Some(75 | 130)));
        wait *= 2;
    }
    let preview = bytes(&place, "a.exr.preview.png");
    assert!(preview.starts_with(b"\x89PNG"));
    place.run(&args).expect(0);
    assert!(!place.path("a.exr.preview.png").exists());
    // A file of the user under that name is no preview.
    place.write("a.exr.preview.png", "mine");
    refused(&place, &args, 2);
}

/// A checkpoint of the room, in `a.exr.checkpoint`.
#[cfg(target_os = "linux")]
fn with_checkpoint(place: &Place) {
    let args = ["render", "room.pbrt", "-o", "a.exr", "--spp", "2000"];
    let args = [&args[..], &["--checkpoint-every", "1ms"], &LONG].concat();
    let mut wait = Duration::from_millis(300);
    while !place.path("a.exr.checkpoint").exists() {
        assert!(matches!(place.interrupt(&args, wait), Some(75 | 130)));
        wait *= 2;
    }
}

#[cfg(target_os = "linux")]
#[test]
fn checkpoints_that_do_not_fit_are_refused_with_the_reason() {
    let place = Place::with_room();
    with_checkpoint(&place);
    let good = bytes(&place, "a.exr.checkpoint");
    let resume = |flags: &[&str], code: i32| {
        let args = ["render", "room.pbrt", "-o", "a.exr", "--resume"];
        let text = refused(&place, &[&args[..], &LONG, flags].concat(), code);
        assert!(text.contains("a.exr.checkpoint"), "{text}");
        text
    };
    let text = resume(&["--spp", "1000"], 2);
    assert!(text.contains("samples per pixel 2000, not 1000"), "{text}");
    let text = resume(&["--spp", "2000", "--seed", "3"], 2);
    assert!(text.contains("seed 0, not 3"), "{text}");
    let text = resume(&["--spp", "2000", "--integrator", "directlighting"], 2);
    assert!(text.contains("what is in scene room"), "{text}");
    assert_eq!(bytes(&place, "a.exr.checkpoint"), good);

    place.write("a.exr.checkpoint", &good[..good.len() / 2]);
    let text = resume(&["--spp", "2000"], 65);
    assert!(text.contains("truncated or damaged"), "{text}");
    place.write("a.exr.checkpoint", "P6 12 12 255");
    let text = resume(&["--spp", "2000"], 65);
    assert!(text.contains("no file of antumbra"), "{text}");

    // Without --resume it is not lost either, until --restart forgets it.
    place.write("a.exr.checkpoint", &good);
    let args = ["render", "room.pbrt", "-o", "a.exr"];
    let text = refused(&place, &args, 2);
    assert!(text.contains("--restart forgets it"), "{text}");
    assert_eq!(bytes(&place, "a.exr.checkpoint"), good);
    place.run(&[&args[..], &["--restart"]].concat()).expect(0);
    assert_eq!(place.files(), ["a.exr", "room.pbrt", "thing.ply"]);
}

#[test]
fn without_a_checkpoint_resuming_is_rendering() {
    let place = Place::with_room();
    place.run(&["render", "room.pbrt", "-o", "a.exr"]).expect(0);
    let args = ["render", "room.pbrt", "-o", "b.exr", "--resume"];
    place.run(&args).expect(0);
    assert_eq!(bytes(&place, "a.exr"), bytes(&place, "b.exr"));
}

#[test]
fn parts_are_merged_to_the_same_bytes() {
    let place = Place::with_room();
    let base = [
        "render",
        "room.pbrt",
        "--resolution",
        "100x70",
        "--seed",
        "2",
    ];
    let whole = ["-o", "whole.exr", "--stderr-image", "errors.exr"];
    place.run(&[&base[..], &whole].concat()).expect(0);
    for part in 0..3 {
        let shard = format!("{part}/3");
        let errors = format!("e{part}.exr");
        let flags = ["--shard", &shard, "--stderr-image", &errors];
        place.run(&[&base[..], &flags].concat()).expect(0);
    }
    let names = ["room.2-of-3.part", "room.0-of-3.part", "room.1-of-3.part"];
    let flags = ["-o", "joined.exr", "--stderr-image", "f.exr", "--json", "-"];
    let args = [&["merge"][..], &names, &flags].concat();
    let document = place.run(&args).expect(0).json();
    assert!(bytes(&place, "joined.exr") == bytes(&place, "whole.exr"));
    assert!(bytes(&place, "f.exr") == bytes(&place, "errors.exr"));
    assert_eq!(document["schema"], "antumbra.merge/1");
    assert_eq!(document["scene"], "room");
    assert_eq!(document["seed"], 2);
    assert_eq!(document["spp"], 4);

    let merge = |parts: &[&str], code: i32| {
        let args = [&["merge"][..], parts, &["-o", "x.exr"]].concat();
        refused(&place, &args, code)
    };
    assert!(merge(&names[..2], 2).contains("parts are missing: 1/3"));
    let twice = merge(&[names[0], names[1], names[2], names[0]], 2);
    assert!(twice.contains("both part 2/3"), "{twice}");
    let args = ["render", "room.pbrt", "--shard", "1/3", "-o", "other.part"];
    place.run(&args).expect(0);
    let foreign = merge(&[names[0], names[1], "other.part"], 2);
    assert!(
        foreign.contains("other.part does not go with room.2-of-3.part"),
        "{foreign}"
    );
    assert!(foreign.contains("seed 0, not 2"), "{foreign}");
    place.write("bad.part", &bytes(&place, names[2])[..2000]);
    let bad = merge(&[names[0], names[1], "bad.part"], 65);
    assert!(
        bad.contains("bad.part: it is truncated or damaged"),
        "{bad}"
    );
    assert!(merge(&[names[0], names[1], "whole.exr"], 65).contains("no file of antumbra"));
    assert!(merge(&["none.part"], 2).contains("there is no none.part"));

    // A part that is there already is not made again; one of something else is not taken for it.
    let again = [&base[..], &["--shard", "0/3", "--resume"]].concat();
    let run = place
        .run(&[&again[..], &["--stderr-image", "e0.exr"]].concat())
        .expect(0);
    assert!(run.stderr.contains("complete already"), "{}", run.stderr);
    let text = refused(&place, &again, 2);
    assert!(text.contains("standard errors"), "{text}");
}

#[test]
fn orders_are_saved_and_loaded() {
    let place = Place::with_room();
    let render = |flags: &[&str]| {
        let base = ["render", "room.pbrt", "-o", "a.exr", "--json", "-"];
        place.run(&[&base[..], flags].concat()).expect(0).json()
    };
    let saved = render(&["--save-order", "room.order"]);
    let picture = bytes(&place, "a.exr");
    let loaded = render(&["--load-order", "room.order"]);
    assert_eq!(bytes(&place, "a.exr"), picture);
    assert_eq!(saved["logged_rays"], loaded["logged_rays"]);
    assert_eq!(
        saved["predicted_cost_after"],
        loaded["predicted_cost_after"]
    );
    // Of whatever order and width.
    render(&[
        "--load-order",
        "room.order",
        "--order",
        "sort-",
        "--width",
        "4",
    ]);
    assert_eq!(bytes(&place, "a.exr"), picture);

    let load = |scene: &str, flags: &[&str], code: i32| {
        let args = [&["render", scene, "-o", "b.exr"][..], flags].concat();
        refused(&place, &args, code)
    };
    let other = load("thing.ply", &["--load-order", "room.order"], 2);
    assert!(other.contains("not that of thing"), "{other}");
    let none = load("room.pbrt", &["--load-order", "none"], 2);
    assert!(none.contains("there is no none"), "{none}");
    let text = load("room.pbrt", &["--load-order", "room.pbrt"], 65);
    assert!(text.contains("no file of antumbra"), "{text}");
    let useless = load("room.pbrt", &["--save-order", "x", "--order", "sato"], 2);
    assert!(useless.contains("learns nothing"), "{useless}");
}

#[test]
fn a_farm_is_told_what_to_do() {
    let place = Place::with_room();
    let slurm = [
        "farm",
        "slurm",
        "room.pbrt",
        "-o",
        "a b.exr",
        "--tasks",
        "3",
        "--dry-run",
    ];
    let flags = ["--sbatch=--partition=night", "--", "--spp", "9"];
    let before = place.files();
    let run = place.run(&[&slurm[..], &flags].concat()).expect(0);
    assert_eq!(place.files(), before);
    for part in [
        "#SBATCH --partition=night\n",
        "#SBATCH --requeue",
        "sbatch --parsable --array=0,1,2 ",
        "task.sh' 0 3 2\n",
        "--dependency=afterany",
    ] {
        assert!(run.stdout.contains(part), "{part} in\n{}", run.stdout);
    }
    for (flags, word) in [
        (["--", "--no-such-flag"], "--no-such-flag"),
        (["--", "--resume"], "set for every task"),
    ] {
        let text = refused(&place, &[&slurm[..], &flags].concat(), 2);
        assert!(text.contains(word), "{text}");
    }

    let openjd = ["farm", "openjd", "room.pbrt", "-o", "a.exr", "--tasks", "3"];
    let template = place.run(&openjd).expect(0).json();
    assert_eq!(template["specificationVersion"], "jobtemplate-2023-09");
    let render = &template["steps"][0];
    let shards = &render["parameterSpace"]["taskParameterDefinitions"][0];
    assert_eq!(shards["range"], "0-2");
    let args = &render["script"]["actions"]["onRun"]["args"];
    assert_eq!(args[4], "{{Task.Param.Shard}}/3");
}

#[test]
fn mistakes_about_parts_and_times_are_2() {
    let place = Place::with_room();
    let mistakes: &[(&[&str], &str)] = &[
        (&["render", "room.pbrt", "--shard", "3/3"], "0/4"),
        (
            &["render", "room.pbrt", "--shard", "0/2", "-o", "a.exr"],
            ".part",
        ),
        (&["render", "room.pbrt", "-o", "a.part"], "exr or png"),
        (
            &["render", "room.pbrt", "--checkpoint-every", "0s"],
            "longer",
        ),
        (
            &["render", "room.pbrt", "--checkpoint-every", "soon"],
            "10m",
        ),
        (&["merge", "-o", "a.exr"], "PART"),
        (&["merge", "x.part"], "--output"),
        (&["merge", "x.part", "-o", "a.bmp"], "exr or png"),
    ];
    for (args, word) in mistakes {
        let text = refused(&place, args, 2);
        assert!(text.contains(word), "{args:?}: {text}");
    }
}
