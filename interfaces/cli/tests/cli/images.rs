//! `image compare`, `convert` and `heatmap`.

use antumbra_image::{Image, Window};

use crate::support::Place;

fn write(place: &Place, name: &str, pixel: impl FnMut(i32, i32) -> [f32; 3]) {
    let image = Image::from_fn(16, 8, Window::full(16, 8), pixel).expect("an image");
    image.write(place.path(name)).expect("a written image");
}

#[test]
fn comparing_tells_chance_from_error() {
    let place = Place::empty();
    write(&place, "a.exr", |x, _| [0.5, x as f32, 1.0]);
    write(&place, "near.exr", |x, _| [0.5, x as f32 + 0.1, 1.0]);
    write(&place, "far.exr", |x, _| [0.5, x as f32 + 0.9, 1.0]);
    write(&place, "error.exr", |_, _| [0.1; 3]);
    let run = |args: &[&str]| place.run(&[&["image", "compare"], args].concat());

    run(&["a.exr", "a.exr"]).expect(0);
    // Without standard errors both are exact.
    run(&["a.exr", "near.exr"]).expect(1);
    run(&["a.exr", "near.exr", "--rounding", "0.2"]).expect(1);
    run(&["a.exr", "near.exr", "--stderr-a", "error.exr"]).expect(0);
    run(&["a.exr", "near.exr", "--stderr-b", "error.exr"]).expect(0);
    run(&[
        "a.exr",
        "near.exr",
        "--stderr-b",
        "error.exr",
        "--limit",
        "0.5",
    ])
    .expect(1);
    run(&[
        "a.exr",
        "near.exr",
        "--stderr-b",
        "error.exr",
        "--limit",
        "0.5",
        "--share",
        "1",
    ])
    .expect(0);
    run(&[
        "a.exr",
        "far.exr",
        "--stderr-a",
        "error.exr",
        "--stderr-b",
        "error.exr",
    ])
    .expect(1);
    run(&["a.exr", "missing.exr"]).expect(65);
    run(&["a.exr", "a.exr", "--share", "2"]).expect(2);

    let text = run(&["a.exr", "near.exr"]).stdout;
    for word in ["MSE", "relMSE", "PSNR", "means", "FAIL"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    // 128 pixels, each with an error of 0.1: the mean has 0.1 / sqrt(128), relative to the means 0.5, 7.6 and 1.
    let one = ["a.exr", "near.exr", "--stderr-a", "error.exr"];
    let text = run(&one).stdout;
    let line = "its error    1.768 % 0.116 % 0.884 %, so z +0.0 -11.3 +0.0";
    assert!(text.contains(line), "{text}");
    let both = [&one[..], &["--stderr-b", "error.exr"]].concat();
    let text = run(&both).stdout;
    let line = "its error    2.500 % 0.164 % 1.250 %, so z +0.0 -8.0 +0.0";
    assert!(text.contains(line), "{text}");
    let document = run(&[&both[..], &["--json", "-"]].concat()).json();
    let error = document["mean_difference_error"][0].as_f64();
    assert!((error.expect("a number") - 0.025).abs() < 1e-6);
    assert!(!run(&["a.exr", "near.exr"]).stdout.contains("its error"));
    let document = run(&["a.exr", "a.exr", "--json", "-"]).expect(0).json();
    assert!(document["mean_difference_error"].is_null());
    assert_eq!(document["schema"], "antumbra.compare/1");
    assert_eq!(document["mse"], 0.0);
    // Infinite for equal images.
    assert!(document["psnr"].is_null());
    assert_eq!(document["pass"], true);
}

#[test]
fn converting_and_drawing() {
    let place = Place::empty();
    write(&place, "a.exr", |x, y| [x as f32, y as f32, 0.5]);
    place.run(&["image", "convert", "a.exr", "b.exr"]).expect(0);
    assert_eq!(place.image("a.exr"), place.image("b.exr"));
    let burnt = "note: 96.9 % of the pixels are brighter than white; --tonemap agx or a smaller --exposure keeps them\n";
    let plain = ["image", "convert", "a.exr", "b.png", "--tonemap", "none"];
    for (args, note) in [
        (&["image", "convert", "a.exr", "a.png"][..], ""),
        (&plain, burnt),
        (&["image", "heatmap", "a.exr", "h.png"], ""),
    ] {
        assert_eq!(
            place.run(args).expect(0).stderr,
            format!("{note}wrote {}\n", args[3])
        );
        assert_eq!(place.run(&[&["-q"], args].concat()).expect(0).stderr, "");
    }
    let ranged = ["image", "heatmap", "a.exr", "r.png", "--range", "-1", "2.5"];
    place.run(&ranged).expect(0);
    let backwards = ["image", "heatmap", "a.exr", "x.png", "--range", "3", "1"];
    place.run(&backwards).expect(2);
    place.run(&["image", "heatmap", "a.exr", "h.exr"]).expect(2);
    assert_eq!(
        place.files(),
        ["a.exr", "a.png", "b.exr", "b.png", "h.png", "r.png"]
    );
    let read = |name| std::fs::read(place.path(name)).expect("a file");
    assert_ne!(read("h.png"), read("r.png"));
}

#[test]
fn hdr_files_are_written_and_read() {
    let place = Place::with_room();
    for output in ["a.exr", "a.hdr"] {
        place.run(&["render", "room.pbrt", "-o", output]).expect(0);
    }
    let convert = |from: &str, to: &str| {
        place.run(&["image", "convert", from, to]).expect(0);
    };
    convert("a.exr", "b.hdr");
    let read = |name| std::fs::read(place.path(name)).expect("a file");
    assert!(read("a.hdr") == read("b.hdr"));
    // The values are linear: a picture for displays is the one of the EXR file, but for rounding.
    convert("a.exr", "a.png");
    convert("a.hdr", "b.png");
    let [exact, rounded] = ["a.png", "b.png"].map(|name| place.image(name).mean());
    for (exact, rounded) in exact.into_iter().zip(rounded) {
        assert!((exact / rounded - 1.0).abs() < 1e-3, "{exact} {rounded}");
    }
    let compare = ["image", "compare", "a.hdr", "b.hdr"];
    place.run(&compare).expect(0);
}

#[test]
fn layers_are_converted_and_drawn() {
    let place = Place::with_room();
    let args = [
        "render",
        "room.pbrt",
        "-o",
        "a.exr",
        "--layers",
        "--spp",
        "1",
    ];
    place.run(&args).expect(0);
    for layer in ["Albedo", "Ns", "Z", "SampleCount"] {
        let output = format!("{layer}.exr");
        let args = ["image", "convert", "a.exr", &output, "--layer", layer];
        place.run(&args).expect(0);
        let [image, whole] = [&output[..], "a.exr"].map(|name| place.image(name));
        assert_eq!(image.window(), whole.window());
        assert!(image != whole);
        let output = format!("{layer}.png");
        let args = ["image", "heatmap", "a.exr", &output, "--layer", layer];
        place.run(&args).expect(0);
    }
    let depths = place.image("Z.exr");
    assert!(depths.pixels().iter().all(|[r, g, b]| r == g && g == b));
    assert!(depths.mean()[0] > 0.0);
    let run = place.run(&["image", "convert", "a.exr", "x.exr", "--layer", "Depth"]);
    let text = run.expect(2).stderr;
    for word in ["no layer Depth", "Albedo", "Ns", "Z"] {
        assert!(text.contains(word), "{text}");
    }
    let run = place.run(&["image", "convert", "Z.png", "x.exr", "--layer", "Z"]);
    assert!(run.expect(2).stderr.contains("has no layers"));
}

#[test]
fn crops_are_compared_with_their_part_of_the_whole() {
    let place = Place::empty();
    let pixel = |x: i32, y: i32| [x as f32, y as f32, 0.5];
    write(&place, "whole.exr", pixel);
    let window = Window {
        x0: 3,
        y0: 2,
        x1: 9,
        y1: 7,
    };
    let crop = Image::from_fn(16, 8, window, pixel).expect("an image");
    crop.write(place.path("crop.exr")).expect("a written image");
    for pair in [["crop.exr", "whole.exr"], ["whole.exr", "crop.exr"]] {
        let args = [&["image", "compare"], &pair[..], &["--json", "-"]].concat();
        let run = place.run(&args).expect(0);
        assert!(run.stderr.contains("[3, 9) x [2, 7)"), "{}", run.stderr);
        assert_eq!(run.json()["pixels"], 30);
    }
    // What differs is outside of the crop.
    write(&place, "other.exr", |x, y| {
        if x < 3 { [9.0; 3] } else { pixel(x, y) }
    });
    place
        .run(&["image", "compare", "crop.exr", "other.exr"])
        .expect(0);
    let args = [
        "image",
        "compare",
        "whole.exr",
        "other.exr",
        "--map",
        "map.png",
    ];
    place.run(&args).expect(1);
    assert!(place.path("map.png").exists());
    let small = Image::from_fn(8, 8, Window::full(8, 8), pixel).expect("an image");
    small
        .write(place.path("small.exr"))
        .expect("a written image");
    place
        .run(&["image", "compare", "small.exr", "whole.exr"])
        .expect(65);
}

/// A damaged or missing image is bad data for every command that reads one.
#[test]
fn damaged_images_are_65_everywhere() {
    let place = Place::empty();
    write(&place, "a.exr", |x, y| [x as f32, y as f32, 0.5]);
    let whole = std::fs::read(place.path("a.exr")).expect("a file");
    place.write("cut.exr", &whole[..whole.len() / 2]);
    for bad in ["cut.exr", "none.exr"] {
        for args in [
            &["image", "convert", bad, "b.png"][..],
            &["image", "heatmap", bad, "b.png"],
            &["image", "compare", bad, "a.exr"],
            &["render", "t.obj", "-o", "o.exr", "--environment", bad],
        ] {
            place.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
            let run = place.run(args).expect(65);
            assert!(run.stderr.contains(bad), "{args:?}: {}", run.stderr);
        }
    }
    assert!(!place.path("b.png").exists());
}

#[test]
fn two_renderings_of_one_scene_agree_within_their_errors() {
    let place = Place::with_room();
    for (seed, image, error) in [("1", "a.exr", "ae.exr"), ("2", "b.exr", "be.exr")] {
        let args = [
            "render",
            "room.pbrt",
            "--spp",
            "64",
            "--seed",
            seed,
            "-o",
            image,
            "--stderr-image",
            error,
        ];
        place.run(&args).expect(0);
    }
    let compare = ["image", "compare", "a.exr", "b.exr"];
    let with_errors = [
        &compare[..],
        &["--stderr-a", "ae.exr", "--stderr-b", "be.exr"],
    ]
    .concat();
    let document = place
        .run(&[&with_errors[..], &["--json", "-"]].concat())
        .expect(0)
        .json();
    // The means differ by chance, and the errors tell how much.
    for channel in 0..3 {
        let value = |name: &str| document[name][channel].as_f64().expect("a number");
        let (difference, error) = (value("mean_difference"), value("mean_difference_error"));
        assert!(
            error > 0.0 && difference.abs() < 4.0 * error,
            "{difference} {error}"
        );
    }
    place.run(&compare).expect(1);
}
