//! The command line and its mistakes.

use crate::support::Place;

#[test]
fn mistakes_on_the_command_line_are_2_and_write_nothing() {
    let place = Place::with_room();
    place.write(
        "cropped.pbrt",
        "Film \"image\" \"float cropwindow\" [0.4 0.5 0 1]\nWorldBegin WorldEnd",
    );
    let before = place.files();
    let mistakes: &[(&[&str], &str)] = &[
        (&["fly"], "fly"),
        (&["render"], "SCENE"),
        (&["render", "room.pbrt", "--no-such-flag"], "--no-such-flag"),
        (&["render", "room.pbrt", "--spp", "0"], "0"),
        (&["render", "room.pbrt", "--order", "best"], "sort+"),
        (&["render", "room.pbrt", "--width", "5"], "4, 8, 16"),
        (&["render", "room.pbrt", "--level", "mmx"], "avx2"),
        (&["render", "room.pbrt", "--threads", "0"], "0"),
        (&["render", "room.pbrt", "--resolution", "12"], "640x360"),
        (&["render", "room.pbrt", "-o", "room.bmp"], "exr or png"),
        (&["render", "room.pbrt", "--stderr-image", "e.png"], "exr"),
        (
            &[
                "render",
                "room.pbrt",
                "-o",
                "a.exr",
                "--stderr-image",
                "a.exr",
            ],
            "two outputs",
        ),
        (
            &["render", "room.pbrt", "-o", "a.exr", "--json", "./a.exr"],
            "two outputs",
        ),
        // The picture's own name, which is known only after the scene is read.
        (
            &["render", "room.pbrt", "--stderr-image", "./room.exr"],
            "two outputs",
        ),
        (
            &["render", "room.pbrt", "--json", "room.exr"],
            "two outputs",
        ),
        (
            &["render", "cropped.pbrt", "--resolution", "1x1"],
            "1x1 pixels",
        ),
        (
            &["study", "cropped.pbrt", "--resolution", "1x1"],
            "crop window",
        ),
        (&["render", "builtin:moon"], "builtin:city"),
        (&["render", "room.blend"], ".pbrt"),
        (&["study"], "SCENE"),
        (&["render", "room.pbrt", "--collapse", "best"], "learned"),
        (&["bench", "room.pbrt", "--collapses", "area,area"], "twice"),
        (
            &["study", "room.pbrt", "--integrator", "bdpt"],
            "ambientocclusion",
        ),
        (&["render", "room.pbrt", "--samples", "0"], "0"),
        (&["render", "room.pbrt", "--samples", "4"], "--samples"),
        (&["study", "room.pbrt", "--orders", "sort,sort"], "twice"),
        (&["study", "room.pbrt", "--widths", ""], "width"),
        (&["bench", "room.pbrt", "--threads", "1,0"], "1 to 1024"),
        (&["bench", "room.pbrt", "--levels", "auto,mmx"], "avx2"),
        (&["bench", "room.pbrt", "--builder", "lego"], "binned-sah"),
        (&["bench", "room.pbrt", "--builds", "ploc,ploc"], "twice"),
        (&["bench", "room.pbrt", "--rays", "0"], "0"),
        (
            &["bench", "room.pbrt", "--embree", "none.so"],
            "no such file",
        ),
        (
            &["bench", "room.pbrt", "--embree", "thing.ply"],
            "thing.ply as Embree",
        ),
        (&["image", "convert", "a.exr"], "OUTPUT"),
        (&["image", "convert", "a.xyz", "b.png"], "exr"),
    ];
    for (args, hint) in mistakes {
        let run = place.run(args).expect(2);
        assert!(run.stderr.contains(hint), "{args:?}: {}", run.stderr);
        assert_eq!(run.stdout, "", "{args:?}");
    }
    assert_eq!(place.files(), before);
}

#[test]
fn levels_that_the_cpu_lacks_are_2() {
    let place = Place::with_room();
    for level in antumbra::recipe::Level::ALL {
        let args = ["render", "room.pbrt", "--spp", "1", "--level", level.name()];
        if level.is_available() {
            place.run(&args).expect(0);
        } else {
            let run = place.run(&args).expect(2);
            assert!(run.stderr.contains(level.name()), "{}", run.stderr);
        }
    }
}

#[test]
fn help_and_version_go_to_stdout() {
    let place = Place::empty();
    for args in [&["--help"][..], &["render", "--help"], &["study", "-h"]] {
        let run = place.run(args).expect(0);
        assert!(run.stdout.contains("Usage:"));
        assert!(!run.stdout.contains('\u{1b}'));
    }
    let help = place.run(&["render", "--help"]).stdout;
    for flag in [
        "--output",
        "--spp",
        "--order",
        "--width",
        "--level",
        "--threads",
        "--seed",
        "--json",
        "--stderr-image",
        "--resolution",
    ] {
        assert!(help.contains(flag), "{flag}");
    }
    let version = place.run(&["--version"]).expect(0).stdout;
    assert!(version.starts_with("antumbra "));
}
