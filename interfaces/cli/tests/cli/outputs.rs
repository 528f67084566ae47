//! What outputs may replace: never an input, another output, or a file that the user did not name.

use std::fs;

use crate::support::Place;

const TEXTURED: &str = r#"
Film "image" "integer xresolution" [8] "integer yresolution" [8] "string filename" ["tex.png"]
Sampler "random" "integer pixelsamples" [1]
WorldBegin
Include "lights.pbrt"
Texture "t" "spectrum" "imagemap" "string filename" ["tex.png"]
Material "matte" "texture Kd" ["t"]
Shape "plymesh" "string filename" ["thing.ply"]
WorldEnd
"#;

/// A scene that reads an include, a texture and a mesh.
fn textured() -> Place {
    let place = Place::with_room();
    place
        .run(&["render", "room.pbrt", "-o", "tex.png"])
        .expect(0);
    place.write("lights.pbrt", "LightSource \"infinite\"\n");
    place.write("s.pbrt", TEXTURED);
    place
}

/// Checks that a command is refused with 2 and the names of both files, and that no file changes.
fn spared(place: &Place, args: &[&str], names: [&str; 2]) {
    let contents = || {
        let names = place.files().into_iter();
        let files = names.filter(|name| place.path(name).is_file());
        files
            .map(|name| (fs::read(place.path(&name)).expect("a file"), name))
            .collect::<Vec<_>>()
    };
    let before = contents();
    let run = place.run(args).expect(2);
    for name in names {
        assert!(run.stderr.contains(name), "{args:?}: {}", run.stderr);
    }
    assert!(contents() == before, "{args:?} changed a file");
}

#[test]
fn no_output_destroys_an_input() {
    let place = textured();
    let render = ["render", "s.pbrt"];
    for (flags, names) in [
        (&["-o", "tex.png"][..], ["--output tex.png", "tex.png"]),
        (&["-o", "./sub/../tex.png"], ["--output", "tex.png"]),
        (
            &["-o", "o.exr", "--json", "s.pbrt"],
            ["--json s.pbrt", "scene s.pbrt"],
        ),
        (
            &["-o", "o.exr", "--json", "lights.pbrt"],
            ["--json", "lights.pbrt"],
        ),
        (
            &["-o", "o.exr", "--json", "thing.ply"],
            ["--json", "thing.ply"],
        ),
        (
            &["-o", "o.exr", "--save-order", "s.pbrt"],
            ["--save-order", "s.pbrt"],
        ),
        (
            &["-o", "o.exr", "--stderr-image", "o.exr"],
            ["--output", "--stderr-image"],
        ),
        (
            &["-o", "o.exr", "--json", "o.exr.checkpoint"],
            ["--json", "checkpoint"],
        ),
        (
            &["--shard", "0/2", "--json", "tex.0-of-2.part"],
            ["--json", "part"],
        ),
    ] {
        fs::create_dir_all(place.path("sub")).expect("a folder");
        spared(&place, &[&render[..], flags].concat(), names);
    }
    // The name in the scene, which is that of its own texture.
    spared(&place, &["render", "s.pbrt"], ["tex.png", "an input"]);
    spared(
        &place,
        &["render", "s.pbrt", "--overwrite"],
        ["tex.png", "an input"],
    );
    spared(
        &place,
        &["info", "s.pbrt", "--json", "s.pbrt"],
        ["--json", "scene s.pbrt"],
    );
    spared(
        &place,
        &["info", "s.pbrt", "--json", "tex.png"],
        ["--json", "tex.png"],
    );
    spared(
        &place,
        &[
            "farm",
            "openjd",
            "s.pbrt",
            "-o",
            "o.exr",
            "--template",
            "s.pbrt",
        ],
        ["--template", "s.pbrt"],
    );
    place.run(&["render", "room.pbrt", "-o", "a.exr"]).expect(0);
    spared(
        &place,
        &["image", "convert", "a.exr", "./a.exr"],
        ["output", "image"],
    );
    let compare = ["image", "compare", "a.exr", "a.exr", "--json", "a.exr"];
    spared(&place, &compare, ["--json", "image"]);

    let learn = ["render", "room.pbrt", "-o", "b.exr", "--save-order", "ord"];
    place.run(&learn).expect(0);
    let load = ["render", "room.pbrt", "-o", "b.exr", "--load-order", "ord"];
    spared(
        &place,
        &[&load[..], &["--json", "ord"]].concat(),
        ["--json", "order"],
    );
    for part in ["0/2", "1/2"] {
        place
            .run(&["render", "room.pbrt", "--shard", part])
            .expect(0);
    }
    let parts = ["room.0-of-2.part", "room.1-of-2.part"];
    let merge = ["merge", parts[0], parts[1], "-o", "m.exr"];
    spared(
        &place,
        &[&merge[..], &["--json", parts[0]]].concat(),
        ["--json", "part"],
    );
    place.write(
        "results.json",
        fs::read(place.path("thing.ply")).expect("a file"),
    );
    let text = TEXTURED
        .replace("thing.ply", "results.json")
        .replace("tex.png\"]\nS", "x\"]\nS");
    place.write("r.pbrt", text);
    spared(
        &place,
        &["study", "r.pbrt", "--out", "."],
        ["--out", "results.json"],
    );
}

#[cfg(unix)]
#[test]
fn links_do_not_hide_what_they_lead_to() {
    use std::os::unix::fs::symlink;

    let place = textured();
    symlink("o.exr", place.path("link.exr")).expect("a link");
    let render = [
        "render",
        "room.pbrt",
        "-o",
        "o.exr",
        "--stderr-image",
        "link.exr",
    ];
    spared(&place, &render, ["o.exr", "link.exr"]);
    symlink("s.pbrt", place.path("soft.json")).expect("a link");
    fs::hard_link(place.path("s.pbrt"), place.path("hard.json")).expect("a link");
    for link in ["soft.json", "hard.json"] {
        spared(
            &place,
            &["info", "s.pbrt", "--json", link],
            [link, "s.pbrt"],
        );
    }
    // A link that leads nowhere makes its target, for all kinds of outputs.
    for (link, flags) in [
        ("p.exr", &["-o", "p.exr"][..]),
        ("j", &["-o", "a.exr", "--json", "j"]),
        ("ord", &["-o", "a.exr", "--save-order", "ord"]),
        ("e.exr", &["-o", "a.exr", "--stderr-image", "e.exr"]),
    ] {
        let target = format!("new-{link}");
        symlink(&target, place.path(link)).expect("a link");
        place
            .run(&[&["render", "room.pbrt"][..], flags].concat())
            .expect(0);
        assert!(place.path(link).is_symlink(), "{link}");
        assert!(place.path(&target).is_file(), "{target}");
    }
    symlink("missing/a.exr", place.path("lost.exr")).expect("a link");
    let run = place
        .run(&["render", "room.pbrt", "-o", "lost.exr"])
        .expect(1);
    assert!(run.stderr.contains("no directory"), "{}", run.stderr);
}

#[test]
fn a_name_from_the_scene_replaces_only_our_own_pictures() {
    let place = Place::with_room();
    let scene = fs::read_to_string(place.path("room.pbrt")).expect("a file");
    place.write("room.pbrt", scene.replace("pictures/room.tga", "../me.png"));
    place.write("me.png", "a face");
    spared(&place, &["render", "room.pbrt"], ["me.png", "--overwrite"]);
    place.run(&["render", "room.pbrt", "--overwrite"]).expect(0);
    // From now on it is ours.
    place.run(&["render", "room.pbrt"]).expect(0);
    place.write("me.png", "a face");
    place
        .run(&["render", "room.pbrt", "-o", "me.png"])
        .expect(0);
    place.write("me.0-of-2.part", "a face");
    spared(
        &place,
        &["render", "room.pbrt", "--shard", "0/2"],
        ["me.0-of-2.part", "-o"],
    );
}

#[test]
fn a_strangers_checkpoint_is_refused() {
    let place = Place::with_room();
    let render = ["render", "room.pbrt", "-o", "o.exr"];
    place.write("o.exr.checkpoint", "my list of checkpoints");
    for flags in [&[][..], &["--resume"], &["--restart"]] {
        let run = place.run(&[&render[..], flags].concat()).expect(65);
        assert!(run.stderr.contains("o.exr.checkpoint"), "{}", run.stderr);
    }
    assert_eq!(
        place.files(),
        ["o.exr.checkpoint", "room.pbrt", "thing.ply"]
    );
    fs::remove_file(place.path("o.exr.checkpoint")).expect("a file");
    fs::create_dir(place.path("o.exr.checkpoint")).expect("a folder");
    place.run(&render).expect(65);
    assert_eq!(
        place.files(),
        ["o.exr.checkpoint", "room.pbrt", "thing.ply"]
    );
}

#[cfg(unix)]
#[test]
fn write_protected_files_stay() {
    use std::os::unix::fs::PermissionsExt;

    let place = Place::with_room();
    for name in ["a.exr", "j", "ord", "e.exr"] {
        place.write(name, "precious");
        let protected = fs::Permissions::from_mode(0o444);
        fs::set_permissions(place.path(name), protected).expect("permissions");
    }
    for flags in [
        &["-o", "a.exr"][..],
        &["-o", "b.exr", "--json", "j"],
        &["-o", "b.exr", "--save-order", "ord"],
        &["-o", "b.exr", "--stderr-image", "e.exr"],
    ] {
        let run = place
            .run(&[&["render", "room.pbrt"][..], flags].concat())
            .expect(1);
        assert!(run.stderr.contains("write-protected"), "{}", run.stderr);
        assert!(!place.path("b.exr").exists(), "{flags:?}");
    }
}

#[cfg(unix)]
#[test]
fn devices_and_streams_are_written_to() {
    use std::os::unix::fs::symlink;

    let place = Place::with_room();
    let before = place.files();
    for flags in [
        &["-o", "/dev/null"][..],
        &[
            "-o",
            "/dev/null",
            "--json",
            "/dev/null",
            "--stderr-image",
            "/dev/null",
        ],
        &["-o", "/dev/null", "--save-order", "/dev/null"],
    ] {
        let run = place
            .run(&[&["render", "room.pbrt"][..], flags].concat())
            .expect(0);
        assert_eq!(run.stdout, "");
        assert_eq!(place.files(), before);
    }
    for stream in ["-", "/dev/stdout"] {
        let args = ["render", "room.pbrt", "-o", "/dev/null", "--json", stream];
        assert_eq!(place.run(&args).expect(0).json()["scene"], "room");
        let both = ["render", "room.pbrt", "-o", stream, "--json", "-"];
        place.run(&both).expect(2);
    }
    symlink("/dev/null", place.path("null.exr")).expect("a link");
    place
        .run(&["render", "room.pbrt", "-o", "null.exr"])
        .expect(0);
    assert!(place.path("null.exr").is_symlink());
    // A picture through a pipe is the picture in a file.
    place.run(&["render", "room.pbrt", "-o", "a.exr"]).expect(0);
    let program = env!("CARGO_BIN_EXE_antumbra");
    let line = format!("'{program}' render room.pbrt -o - 2>/dev/null | cat >b.exr");
    let shell = std::process::Command::new("sh")
        .args(["-c", &line])
        .current_dir(place.path("."))
        .status();
    assert!(shell.expect("a shell").success());
    let bytes = |name: &str| fs::read(place.path(name)).expect("a file");
    assert!(bytes("a.exr") == bytes("b.exr"));
}

#[test]
fn files_with_names_like_ours_stay() {
    let place = Place::with_room();
    let names = [
        ".antumbra-1.tmp",
        ".antumbra-27938.tmp",
        ".o.exr.backup.tmp",
    ];
    for name in names {
        place.write(name, "mine");
    }
    // What a killed process left behind: see `pictures/image/src/atomic.rs`.
    let dead = ".antumbra-0000000000000007-1e2dc709cf02a3cf.tmp";
    place.write(dead, "half a pict");
    place.run(&["render", "room.pbrt", "-o", "o.exr"]).expect(0);
    let files = place.files();
    for name in names {
        assert!(files.contains(&name.to_owned()), "{files:?}");
    }
    assert!(!files.contains(&dead.to_owned()), "{files:?}");
}
