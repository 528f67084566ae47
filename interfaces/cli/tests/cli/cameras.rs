//! Cameras from the command line in `info` and `ao`, and light from images around a mesh.

use std::f64::consts::PI;

use antumbra_image::{Image, Window};
use antumbra_testkit::model;

use crate::support::{Place, TETRAHEDRON};

/// A mesh with a material of one colour.
fn write_mesh(place: &Place, name: &str, color: &str, faces: &str) {
    place.write("m.mtl", format!("newmtl m\nKd {color}\nillum 1\n"));
    place.write(name, format!("mtllib m.mtl\nusemtl m\n{faces}"));
}

#[test]
fn info_tells_of_the_camera_that_is_asked_for() {
    let place = Place::with_room();
    place.write("model.glb", model::all_textures());
    let info = |args: &[&str]| {
        let args = [&["info"], args, &["--json", "-"]].concat();
        place.run(&args).expect(0).json()
    };
    let flags = ["--camera", "LookAt 1 2 3  1 2 9  0 1 0", "--fov", "33"];
    for scene in ["room.pbrt", "thing.ply", "model.glb"] {
        let document = info(&[&[scene], &flags[..], &["--crop", "5,3,7x6"]].concat());
        let camera = &document["camera"];
        assert_eq!(camera["position"], serde_json::json!([1.0, 2.0, 3.0]));
        assert_eq!(camera["direction"], serde_json::json!([0.0, 0.0, 1.0]));
        assert_eq!(camera["fov_degrees"], 33.0);
        assert_eq!(
            document["film"]["pixel_bounds"],
            serde_json::json!([5, 12, 3, 9])
        );
    }
    // A narrow view is framed from farther away, and another axis up from another side.
    let far = |document: &serde_json::Value| {
        let eye = document["camera"]["position"].as_array().expect("a point");
        let square = |x: &serde_json::Value| x.as_f64().expect("a number").powi(2);
        eye.iter().map(square).sum::<f64>().sqrt()
    };
    let [usual, narrow, turned] = [
        info(&["thing.ply"]),
        info(&["thing.ply", "--fov", "5"]),
        info(&["thing.ply", "--up", "z"]),
    ];
    assert!(far(&narrow) > 3.0 * far(&usual), "{narrow} {usual}");
    let down = |document: &serde_json::Value| document["camera"]["direction"][2].as_f64();
    assert!(down(&usual) < Some(-0.5) && down(&turned) > Some(-0.5));
    let run = place.run(&["info", "room.pbrt", "--up", "z"]).expect(2);
    assert!(run.stderr.contains("--up is for meshes"), "{}", run.stderr);
}

/// A flag that would have no effect is refused.
#[test]
fn only_perspective_cameras_have_an_angle_of_view() {
    let place = Place::empty();
    place.write(
        "flat.pbrt",
        "Camera \"orthographic\" WorldBegin Shape \"sphere\" WorldEnd",
    );
    let info = place.run(&["info", "flat.pbrt", "--json", "-"]).expect(0);
    let camera = &info.json()["camera"];
    assert_eq!(camera["projection"], "orthographic");
    assert!(camera["fov_degrees"].is_null());
    let refused = place.run(&["info", "flat.pbrt", "--fov", "20"]).expect(2);
    assert!(
        refused.stderr.contains("--fov is for perspective"),
        "{}",
        refused.stderr
    );
}

#[test]
fn pictures_of_occlusion_take_a_camera() {
    let place = Place::with_room();
    let base = [
        "ao",
        "thing.ply",
        "--samples",
        "64",
        "--resolution",
        "40x30",
    ];
    let from = [
        "--camera",
        "LookAt 0.4 1.8 2.4  -0.6 0.5 0  0 1 0",
        "--fov",
        "60",
    ];
    let ao = |name: &str, flags: &[&str]| {
        place
            .run(&[&base[..], &["-o", name], flags].concat())
            .expect(0);
        place.image(name)
    };
    let usual = ao("usual.exr", &[]);
    let moved = ao("moved.exr", &from);
    assert_ne!(usual, moved);
    // The same pixels as `render` sees a surface in, but for those at the silhouette.
    let flags = [
        &[
            "render",
            "thing.ply",
            "-o",
            "r.exr",
            "--resolution",
            "40x30",
        ][..],
        &["--integrator", "ambientocclusion", "--spp", "16"],
        &from,
    ];
    place.run(&flags.concat()).expect(0);
    let pairs = place.image("r.exr");
    let pairs = pairs.pixels().iter().zip(moved.pixels());
    let seen = |pixel: &[f32; 3]| pixel[0] > 0.0;
    let differing = pairs.filter(|(a, b)| seen(a) != seen(b)).count();
    let shown = moved.pixels().iter().filter(|pixel| seen(pixel)).count();
    assert!(
        shown > 60 && differing < shown / 8,
        "{differing} of {shown}"
    );
    // A crop is a part, but for the directions of rays, which count points.
    let part = ao("part.exr", &[&from[..], &["--crop", "10,5,20x18"]].concat());
    assert_eq!(
        part.window(),
        Window {
            x0: 10,
            x1: 30,
            y0: 5,
            y1: 23
        }
    );
    for y in 5..23 {
        for x in 10..30 {
            let [a, b] = [&part, &moved].map(|image| image.get(x, y).expect("a pixel")[0]);
            assert!((a - b).abs() < 0.1, "{x} {y}: {a} {b}");
        }
    }
    for (output, flags, word) in [
        ("x.ply", &["--fov", "40"][..], "--fov makes a png or exr"),
        (
            "x.png",
            &["--atlas", "16", "--crop", "0,0,2x2"],
            "--crop does not go with --atlas",
        ),
        (
            "x.exr",
            &["--camera", "LookAt 0 9 0 0 99 0 0 0 1"],
            "sees no surface",
        ),
    ] {
        let run = place.run(&[&["ao", "thing.ply", "-o", output], flags].concat());
        assert!(
            run.code != 0 && run.stderr.contains(word),
            "{word}: {}",
            run.stderr
        );
    }
}

/// A furnace: what reflects all light cannot be told from an even sky.
#[test]
fn a_white_body_vanishes_in_an_even_environment() {
    let place = Place::empty();
    let sky = Image::from_fn(16, 8, Window::full(16, 8), |_, _| [2.0, 1.0, 0.5]);
    sky.expect("an image")
        .write(place.path("even.exr"))
        .expect("a file");
    // Convex, so that light is reflected once.
    let lines = TETRAHEDRON.lines().skip(9);
    let faces: String = lines
        .map(|line| match line.strip_prefix("3 ") {
            Some(corners) => {
                let corner = |text: &str| text.parse::<u32>().expect("an index") + 1;
                let corners = corners.split(' ').map(|text| corner(text).to_string());
                format!("f {}\n", corners.collect::<Vec<_>>().join(" "))
            }
            None => format!("v {line}\n"),
        })
        .collect();
    write_mesh(&place, "body.obj", "1 1 1", &faces);
    let args = [
        &["render", "body.obj", "-o", "a.exr", "--resolution", "32x24"][..],
        &[
            "--environment",
            "even.exr",
            "--spp",
            "64",
            "--filter",
            "box",
        ],
    ];
    place.run(&args.concat()).expect(0);
    let image = place.image("a.exr");
    for (channel, sky) in [2.0, 1.0, 0.5].into_iter().enumerate() {
        let mean = image.mean()[channel] / sky;
        assert!((mean - 1.0).abs() < 2e-3, "{mean}");
    }
    for [red, ..] in image.pixels() {
        assert!((red / 2.0 - 1.0).abs() < 0.1, "{red}");
    }
}

/// Lossy images have texels below zero around what is bright.
#[test]
fn texels_that_are_no_light_count_as_black() {
    let place = Place::empty();
    place.write("thing.ply", TETRAHEDRON);
    for (name, bad) in [
        ("good.exr", 0.0),
        ("bad.exr", -0.5),
        ("nan.exr", f32::NAN),
        ("inf.exr", f32::INFINITY),
    ] {
        let sky = Image::from_fn(16, 8, Window::full(16, 8), |x, y| match (x, y) {
            (3..6, 2) => [bad, 1.0, 0.5],
            _ => [1.0; 3],
        });
        sky.expect("an image")
            .write(place.path(name))
            .expect("a file");
        let args = ["render", "thing.ply", "--spp", "4", "--resolution", "9x9"];
        let picture = format!("of-{name}");
        let flags = ["--environment", name, "-o", &picture];
        let said = place.run(&[&args[..], &flags].concat()).expect(0).stderr;
        assert_eq!(said.contains("3 texels"), name != "good.exr", "{said}");
        assert!(!said.contains("left out"), "{said}");
        assert!(place.image(&picture) == place.image("of-good.exr"));
    }
}

/// Radiance of a sky with a small bright sun, by the column and row of a texel.
fn sky(column: u32, row: u32) -> [f64; 3] {
    let sun = (20..24).contains(&column) && (6..9).contains(&row);
    let (x, y) = (f64::from(column) / 64.0, f64::from(row) / 32.0);
    match sun {
        true => [400.0, 350.0, 300.0],
        false => [0.5 + 0.4 * (2.0 * PI * x).cos(), 1.0 - 0.5 * y, 0.25 + y],
    }
}

/// The sky as a Radiance picture of 64 x 32 pixels without compression, and the values that its bytes stand for.
fn radiance_picture() -> (Vec<u8>, Vec<[f64; 3]>) {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32 +X 64\n".to_vec();
    let mut values = Vec::new();
    for row in 0..32 {
        for column in 0..64 {
            let color = sky(column, row);
            let exponent = color.iter().copied().fold(0.0, f64::max).log2().floor() as i32 + 1;
            let scale = f64::from(exponent - 8).exp2();
            let mantissas = color.map(|x| (x / scale).floor());
            bytes.extend(mantissas.map(|x| x as u8));
            bytes.push((exponent + 128) as u8);
            // Readers differ by half a step.
            values.push(mantissas.map(|x| x * scale));
        }
    }
    (bytes, values)
}

/// Irradiance of a surface with this normal, with y up and the middle column at -z, summed over finer cells.
fn irradiance(values: &[[f64; 3]], normal: [f64; 3]) -> [f64; 3] {
    const FINE: usize = 8;
    let (columns, rows) = (64 * FINE, 32 * FINE);
    let mut sum = [0.0; 3];
    for row in 0..rows {
        let (sin, cos) = (PI * (row as f64 + 0.5) / rows as f64).sin_cos();
        let area = PI / rows as f64 * (2.0 * PI / columns as f64) * sin;
        for column in 0..columns {
            // To the right of -z is x.
            let azimuth = 2.0 * PI * ((column as f64 + 0.5) / columns as f64 - 0.5);
            let direction = [sin * azimuth.sin(), cos, -sin * azimuth.cos()];
            let along: f64 = normal.iter().zip(direction).map(|(a, b)| a * b).sum();
            let value = values[row / FINE * 64 + column / FINE];
            for channel in 0..3 {
                sum[channel] += value[channel] * along.max(0.0) * area;
            }
        }
    }
    sum
}

/// Floor and walls under a sky with a sun reflect what an integral over its texels says: directions, areas and values
/// of the image are right.
#[test]
fn surfaces_reflect_the_light_of_a_radiance_picture() {
    let place = Place::empty();
    let (bytes, values) = radiance_picture();
    place.write("sky.hdr", bytes);
    for (normal, corners, camera) in [
        (
            [0.0, 1.0, 0.0],
            "v -9 0 -9\nv -9 0 9\nv 9 0 9\nv 9 0 -9\n",
            "LookAt 0 5 0  0 0 0  0 0 1",
        ),
        (
            [0.0, 0.0, -1.0],
            "v -9 -9 0\nv -9 9 0\nv 9 9 0\nv 9 -9 0\n",
            "LookAt 0 0 -5  0 0 0  0 1 0",
        ),
        (
            [-1.0, 0.0, 0.0],
            "v 0 -9 -9\nv 0 -9 9\nv 0 9 9\nv 0 9 -9\n",
            "LookAt -5 0 0  0 0 0  0 1 0",
        ),
    ] {
        write_mesh(
            &place,
            "quad.obj",
            "0.5 0.5 0.5",
            &format!("{corners}f 1 2 3 4\n"),
        );
        let args = [
            &["render", "quad.obj", "-o", "a.exr", "--resolution", "16x16"][..],
            &[
                "--environment",
                "sky.hdr",
                "--spp",
                "256",
                "--filter",
                "box",
            ],
            &["--up", "y", "--camera", camera, "--fov", "20"],
        ];
        place.run(&args.concat()).expect(0);
        let found = place.image("a.exr").mean();
        let expected = irradiance(&values, normal).map(|e| 0.5 * e / PI);
        for channel in 0..3 {
            let ratio = found[channel] / expected[channel];
            assert!(
                (ratio - 1.0).abs() < 0.01,
                "{normal:?}: {found:?}, not {expected:?}"
            );
        }
    }
}
