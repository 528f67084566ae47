//! Meshes with materials, flags of camera and film, layers, and pictures for displays.

use antumbra_image::Image;
use antumbra_testkit::model;

use crate::support::{Place, Run};

const SMALL: [&str; 4] = ["--spp", "4", "--resolution", "48x32"];

fn with_models() -> Place {
    let place = Place::with_room();
    place.write("model.glb", model::all_textures());
    for (name, bytes) in model::obj_with_materials() {
        place.write(name, bytes);
    }
    place
}

#[test]
fn models_come_with_their_looks() {
    let place = with_models();
    let args = ["render", "model.glb", "-o", "g.exr"];
    let run = place.run(&[&args[..], &SMALL].concat()).expect(0);
    for note in ["KHR_materials_sheen", "occlusion textures are left out"] {
        let all = run.stderr.matches(note).count();
        assert_eq!(all, 1, "{note}: {}", run.stderr);
    }
    let image = place.image("g.exr");
    assert_eq!(image.non_finite(), 0);
    // A golden ball and a blue and yellow one are no grey picture.
    let colourful = |[r, _, b]: &[f32; 3]| (r - b).abs() > 0.1 * (r + b);
    assert!(
        image
            .pixels()
            .iter()
            .filter(|pixel| colourful(pixel))
            .count()
            > 100
    );

    let args = ["render", "model.obj", "-o", "o.exr"];
    let run = place.run(&[&args[..], &SMALL].concat()).expect(0);
    assert!(!run.stderr.contains("note:"), "{}", run.stderr);
    assert_eq!(place.image("o.exr").non_finite(), 0);
    let document = place
        .run(&["info", "model.obj", "--json", "-"])
        .expect(0)
        .json();
    assert_eq!(document["materials"]["glass"], 1, "{document}");
}

#[test]
fn missing_files_are_warnings_and_errors_if_strict() {
    let place = with_models();
    let files = [
        (
            "leaf.png",
            "looks.mtl:20:8: ",
            "cannot read image `leaf.png`: ",
        ),
        ("looks.mtl", "model.obj:2:8: ", "cannot read `looks.mtl`: "),
    ];
    for (file, at, reason) in files {
        std::fs::remove_file(place.path(file)).expect("a file");
        let commands = [
            &["render", "model.obj", "-o", "o.exr", "--spp", "1"][..],
            &["info", "model.obj"],
        ];
        for command in commands {
            let run = place.run(command).expect(0);
            let warning = format!("{at}warning: {reason}");
            assert_eq!(run.stderr.matches(&warning).count(), 1, "{}", run.stderr);
            let run = place.run(&[command, &["-q"]].concat()).expect(0);
            assert_eq!(run.stderr, "");
            let before = place.files();
            let run = place.run(&[command, &["--strict"]].concat()).expect(65);
            let error = format!("{at}error: {reason}");
            assert!(run.stderr.contains(&error), "{}", run.stderr);
            assert!(!run.stderr.contains("warning"), "{}", run.stderr);
            assert_eq!(place.files(), before);
        }
        // Bakes use no materials.
        let bake = [
            "ao",
            "model.obj",
            "-o",
            "o.ply",
            "--samples",
            "1",
            "--strict",
        ];
        let run = place.run(&bake).expect(0);
        assert!(!run.stderr.contains("looks.mtl"), "{}", run.stderr);
    }
    // What is all there is no error.
    let place = with_models();
    place.run(&["info", "model.obj", "--strict"]).expect(0);
}

/// A square that faces the camera, with a material of these statements.
fn square(place: &Place, name: &str, statements: &str) {
    let obj =
        format!("mtllib {name}.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl m\nf 1 2 3 4\n");
    place.write(&format!("{name}.obj"), obj);
    place.write(&format!("{name}.mtl"), format!("newmtl m\n{statements}"));
}

/// Mean colour of a picture of a square, and what was said about it.
fn mean_color(place: &Place, name: &str) -> ([f32; 3], String) {
    let file = format!("{name}.obj");
    let args = [
        "render",
        &file,
        "-o",
        "square.exr",
        "--camera",
        "LookAt 0.5 0.5 1.2  0.5 0.5 0  0 1 0",
    ];
    let run = place.run(&[&args[..], &SMALL].concat()).expect(0);
    let image = place.image("square.exr");
    let pixels = image.pixels();
    let sum = |channel: usize| pixels.iter().map(|pixel| pixel[channel]).sum::<f32>();
    let mean = [0, 1, 2].map(|channel| sum(channel) / pixels.len() as f32);
    (mean, run.stderr)
}

#[test]
fn red_under_a_highlight_is_red() {
    let place = Place::empty();
    square(&place, "dull", "Kd .8 .05 .05\n");
    let ([red, ..], _) = mean_color(&place, "dull");
    for (name, highlight) in [
        ("none", "Ks 1 1 1\n"),
        ("zero", "Ks 1 1 1\nNs 0\nillum 2\n"),
        ("sharp", "Ks 1 1 1\nNs 500\nillum 2\n"),
    ] {
        square(&place, name, &format!("Kd .8 .05 .05\n{highlight}"));
        let (color, _) = mean_color(&place, name);
        assert!(color[0] > 0.85 * red, "{name}: {color:?}, {red}");
        assert!(color[0] > 3.0 * color[2], "{name}: {color:?}");
    }
}

#[test]
fn models_and_pictures_of_nothing_say_so() {
    let place = Place::empty();
    square(&place, "meshlab", "Kd 1 0 0\nTr 1.000000\n");
    let (color, said) = mean_color(&place, "meshlab");
    assert!(color[0] > 2.0 * color[2], "{color:?}");
    let note = "note: meshlab.obj: every material is wholly transparent (`Tr 1.000000` in meshlab.mtl:3:1)";
    assert_eq!(said.matches(note).count(), 1, "{said}");
    assert!(!said.contains("warning"), "{said}");

    // A file that means it: wholly transparent in glTF.
    let material =
        r#"{"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}}"#;
    let gltf = format!(
        r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}], "materials": [{material}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "material": 0}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
        "buffers": [{{"uri": "triangle.bin", "byteLength": 36}}]}}"#
    );
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let bytes: Vec<u8> = corners
        .as_flattened()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    place.write("triangle.bin", bytes);
    place.write("glass.gltf", gltf);
    let render = |args: &[&str]| {
        let args = [&["render"], args, &["-o", "x.exr"], &SMALL].concat();
        place.run(&args)
    };
    let said = render(&["glass.gltf"]).expect(0).stderr;
    let warning =
        "glass.gltf: warning: every material is wholly transparent, so nothing can be seen";
    assert_eq!(said.matches(warning).count(), 1, "{said}");
    assert!(!said.contains("sees no surface"), "{said}");
    render(&["glass.gltf", "--strict"]).expect(65);

    // A camera that looks away.
    let away = [
        "meshlab.obj",
        "--camera",
        "LookAt 0.5 0.5 1.2  0.5 0.5 9  0 1 0",
    ];
    let said = render(&away).expect(0).stderr;
    let warning = "warning: meshlab: the camera sees no surface, so the picture is all background";
    assert_eq!(said.matches(warning).count(), 1, "{said}");
}

#[test]
fn empty_meshes_are_errors() {
    let place = Place::empty();
    place.write("empty.obj", "v 0 0 0\n");
    place.write("empty.stl", "solid nothing\nendsolid\n");
    for name in ["empty.obj", "empty.stl"] {
        let run = place.run(&["render", name]).expect(65);
        assert!(
            run.stderr.contains("there is no triangle in it"),
            "{}",
            run.stderr
        );
    }
    let run = place.run(&["render", "."]).expect(65);
    assert!(run.stderr.contains("it is a folder"), "{}", run.stderr);
    assert!(!place.files().iter().any(|name| name.ends_with("exr")));
}

#[test]
fn vertex_colours_of_ply_and_triangles_of_stl_are_shown() {
    let place = Place::empty();
    place.write(
        "c.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
         property list uchar int vertex_indices\nend_header\n0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n",
    );
    place.write(
        "t.stl",
        "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n",
    );
    let dark = ["--up", "y", "--environment", "none", "--sun", "180,30"];
    for (file, output) in [("c.ply", "c.exr"), ("t.stl", "t.exr")] {
        let args = ["render", file, "-o", output];
        place.run(&[&args[..], &SMALL, &dark].concat()).expect(0);
    }
    let [r, g, b] = place.image("c.exr").mean();
    assert!(r > 0.05 && g == 0.0 && b == 0.0, "{r} {g} {b}");
    let [r, g, b] = place.image("t.exr").mean();
    assert!(r > 0.05 && g > 0.05 && b > 0.05, "{r} {g} {b}");
}

/// A camera given by numbers is the camera of the file, and crops are parts of the whole picture.
#[test]
fn cameras_crops_and_depths_are_chosen() {
    let place = Place::with_room();
    let base = ["render", "room.pbrt", "--spp", "4", "-o"];
    let run = |name: &str, more: &[&str]| {
        place.run(&[&base[..], &[name], more].concat()).expect(0);
        place.image(name)
    };
    let whole = run("whole.exr", &["--filter", "box"]);
    let part = run("part.exr", &["--filter", "box", "--crop", "5,3,7x6"]);
    assert_eq!(part.pixels().len(), 42);
    for y in 3..9 {
        for x in 5..12 {
            assert_eq!(part.get(x, y), whole.get(x, y), "{x} {y}");
        }
    }
    let wide = run("wide.exr", &["--filter", "box", "--fov", "100"]);
    assert_ne!(wide, whole);
    let shallow = run("shallow.exr", &["--filter", "box", "--max-depth", "1"]);
    assert!(shallow.mean()[0] < whole.mean()[0]);
    let moved = run(
        "moved.exr",
        &["--filter", "box", "--camera", "LookAt 1 2 4  0 1 0  0 1 0"],
    );
    assert_ne!(moved, whole);
    assert_ne!(
        run("other.exr", &["--filter", "box", "--sampler", "halton"]),
        whole
    );
    for (flags, word) in [
        (&["--crop", "20,0,10x10"][..], "reaches beyond"),
        (&["--camera", "LookAt 0 0 0 0 0 0 0 1 0"], "looks nowhere"),
        (&["--up", "z"], "for meshes"),
        (&["--sun", "none"], "for meshes"),
    ] {
        let run = place
            .run(&[&base[..], &["x.exr"], flags].concat())
            .expect(2);
        assert!(run.stderr.contains(word), "{}", run.stderr);
    }
    place
        .run(&[
            "render",
            "thing.ply",
            "--up",
            "z",
            "--spp",
            "1",
            "--resolution",
            "9x9",
        ])
        .expect(0);
}

#[test]
fn layers_and_notes_stand_beside_the_colours() {
    let place = with_models();
    let base = [
        "render",
        "model.glb",
        "--spp",
        "8",
        "--resolution",
        "48x32",
        "-o",
    ];
    place.run(&[&base[..], &["plain.exr"]].concat()).expect(0);
    place
        .run(&[&base[..], &["layers.exr", "--layers"]].concat())
        .expect(0);
    let plain = place.image("plain.exr");
    assert_eq!(plain, place.image("layers.exr"), "layers change no colour");
    let layer = |file: &str, names: [&str; 3]| {
        let found = Image::read_channels(place.path(file), names).expect("an image");
        found.unwrap_or_else(|| panic!("{file} has no {names:?}"))
    };
    let albedo = layer("layers.exr", ["Albedo.R", "Albedo.G", "Albedo.B"]);
    let inside = |pixel: &[f32; 3]| pixel.iter().all(|value| (0.0..=1.0).contains(value));
    assert!(albedo.pixels().iter().all(inside) && albedo.mean()[0] > 0.1);
    for names in [["N.X", "N.Y", "N.Z"], ["Ns.X", "Ns.Y", "Ns.Z"]] {
        let normal = layer("layers.exr", names);
        let length = |n: &[f32; 3]| n.iter().map(|x| x * x).sum::<f32>();
        assert!(normal.pixels().iter().all(|n| length(n) < 1.001));
    }
    let [depth, count, _] = layer("layers.exr", ["Z", "SampleCount", "Variance.R"]).mean();
    assert!(depth > 2.0 && depth < 12.0, "{depth}");
    assert_eq!(count, 8.0);
    let bytes = std::fs::read(place.path("layers.exr")).expect("a file");
    let text = String::from_utf8_lossy(&bytes[..4000]);
    for word in [
        "scene: model",
        "samples per pixel: 8",
        "sampler: 02sequence",
        "seed: 0",
        "order: joint",
        "camera: LookAt 0 0.4 9",
    ] {
        assert!(text.contains(word), "{word}");
    }
    let flags = ["cycles.exr", "--layers", "--aov-names", "cycles"];
    place.run(&[&base[..], &flags].concat()).expect(0);
    layer(
        "cycles.exr",
        [
            "Denoising Normal.X",
            "Denoising Albedo.R",
            "Denoising Depth.Z",
        ],
    );
    // Layers take memory, and are counted.
    let big = ["x.exr", "--resolution", "1000x1000", "--max-memory", "200M"];
    let run = place
        .run(&[&base[..4], &["-o"], &big[..], &["--layers"]].concat())
        .expect(65);
    assert!(run.stderr.contains("--max-memory"), "{}", run.stderr);
    let run = place
        .run(&[&base[..], &["x.png", "--layers"]].concat())
        .expect(2);
    assert!(
        run.stderr.contains("--layers needs an .exr"),
        "{}",
        run.stderr
    );
}

#[test]
fn pictures_for_displays_take_exposure_and_curves() {
    let place = Place::with_room();
    place.run(&["render", "room.pbrt", "-o", "a.exr"]).expect(0);
    let convert = |output: &str, flags: &[&str]| {
        place
            .run(&[&["image", "convert", "a.exr", output], flags].concat())
            .expect(0);
        place.image(output).mean()[1]
    };
    let usual = convert("a.png", &[]);
    assert!(convert("b.png", &["--exposure", "-1"]) < usual);
    assert!(convert("c.jpg", &[]) - usual < 0.01);
    assert!((convert("d.png", &["--bits", "16"]) - usual).abs() < 0.01);
    assert_eq!(convert("e.png", &["--tonemap", "agx"]), usual);
    assert_ne!(convert("f.png", &["--tonemap", "filmic"]), usual);
    let plain = convert("h.png", &["--tonemap", "none"]);
    assert_ne!(plain, usual);
    // Rendering straight to a picture for displays is the same as converting.
    place
        .run(&["render", "room.pbrt", "-o", "g.png", "--exposure", "-1"])
        .expect(0);
    let read = |name: &str| std::fs::read(place.path(name)).expect("a file");
    assert_eq!(read("g.png"), read("b.png"));
    // The curve is applied once.
    place.run(&["image", "convert", "h.png", "i.png"]).expect(0);
    assert_eq!(read("h.png"), read("i.png"));
    place
        .run(&["image", "convert", "c.jpg", "back.exr"])
        .expect(0);
    let run = place
        .run(&["image", "denoise", "a.exr", "x.exr", "--library", "none.so"])
        .expect(1);
    assert!(run.stderr.contains("pip install pyoidn"), "{}", run.stderr);
}

/// Shares of a hemisphere are values, not light: no curve bends them, and 1 is white.
#[test]
fn occlusion_and_layers_are_shown_as_they_are() {
    let place = Place::empty();
    square(&place, "wall", "Kd .8 .05 .05\n");
    let base = ["render", "wall.obj", "--spp", "2", "--resolution", "16x16"];
    let ambient = ["--integrator", "ambientocclusion", "--crop", "7,7,2x2"];
    let white = |name: &str| {
        let image = place.image(name);
        assert!(
            image.pixels().iter().flatten().all(|value| *value == 1.0),
            "{name}: {:?}",
            image.pixels()
        );
    };
    let render = |more: &[&str]| place.run(&[&base[..], &ambient, more].concat()).expect(0);
    render(&["-o", "a.png"]);
    white("a.png");
    for shard in ["0", "1"] {
        let (which, part) = (format!("{shard}/2"), format!("{shard}.part"));
        render(&["--shard", &which, "-o", &part]);
    }
    place
        .run(&["merge", "0.part", "1.part", "-o", "b.png"])
        .expect(0);
    white("b.png");
    let layers = ["-o", "c.exr", "--layers", "--crop", "7,7,2x2"];
    place.run(&[&base[..], &layers].concat()).expect(0);
    let convert = [
        "image",
        "convert",
        "c.exr",
        "c.png",
        "--layer",
        "SampleCount",
    ];
    place.run(&convert).expect(0);
    white("c.png");
    // Parts of light become the picture that one machine makes.
    place.run(&[&base[..], &["-o", "d.png"]].concat()).expect(0);
    let part = ["-o", "d.part", "--shard", "0/1"];
    place.run(&[&base[..], &part].concat()).expect(0);
    place.run(&["merge", "d.part", "-o", "e.png"]).expect(0);
    let read = |name| std::fs::read(place.path(name)).expect("a file");
    assert!(read("d.png") == read("e.png"));
}

#[test]
fn meshes_stand_on_a_ground_if_asked() {
    let place = with_models();
    let base = ["render", "thing.ply", "--spp", "4", "--resolution", "48x32"];
    let render = |more: &[&str]| place.run(&[&base[..], more].concat()).expect(0);
    let plain = render(&["-o", "a.exr"]);
    let ground = render(&["-o", "b.exr", "--ground"]);
    // What is said about the file does not count the ground.
    let said = |run: &Run| run.stderr.lines().next().map(str::to_owned);
    assert_eq!(said(&plain), said(&ground));
    let [a, b] = ["a.exr", "b.exr"].map(|name| place.image(name));
    // Above the horizon is the same sky, and below it a shadow where nothing of the mesh is.
    assert_eq!(a.get(1, 0), b.get(1, 0));
    let green = |image: &Image| -> Vec<f32> { image.pixels().iter().map(|p| p[1]).collect() };
    let (a, b) = (green(&a), green(&b));
    let lit = b[48 * 31];
    let mut pixels = a.iter().zip(&b);
    assert!(pixels.any(|(a, b)| *a > 0.8 * lit && *b < 0.7 * lit));
    let run = place.run(&["render", "room.pbrt", "--ground"]).expect(2);
    assert!(
        run.stderr.contains("--ground is for meshes"),
        "{}",
        run.stderr
    );
}

#[test]
fn samples_are_added_until_the_noise_is_gone() {
    let place = Place::with_room();
    let args = [
        "render",
        "room.pbrt",
        "-o",
        "a.exr",
        "--noise",
        "5%",
        "--json",
        "a.json",
    ];
    place.run(&args).expect(0);
    let document = place.json("a.json");
    let (noise, spp) = (
        document["noise"].as_f64().expect("noise"),
        document["spp"].as_u64(),
    );
    assert!(noise <= 0.05, "{document}");
    let spp = spp.expect("a number").to_string();
    // The picture is the one of that many samples.
    place
        .run(&["render", "room.pbrt", "-o", "b.exr", "--spp", &spp])
        .expect(0);
    assert_eq!(place.image("a.exr"), place.image("b.exr"));
    let args = [
        "render",
        "room.pbrt",
        "-o",
        "c.exr",
        "--time",
        "1h",
        "--spp",
        "32",
        "--json",
        "c.json",
    ];
    place.run(&args).expect(0);
    assert_eq!(place.json("c.json")["spp"], 32);
}
