//! `ao`: values, bytes and refusals.

use std::fs;

use crate::support::{Place, TETRAHEDRON};

/// Bytes of a vertex: position, normal, value, colour.
const VERTEX: usize = 31;

/// Values and grey levels of the vertices in a file of `ao`.
fn values(bytes: &[u8]) -> Vec<(f32, u8)> {
    let end = b"end_header\n";
    let first = bytes.windows(end.len()).position(|window| window == end);
    let first = first.expect("a header") + end.len();
    let header = std::str::from_utf8(&bytes[..first]).expect("text");
    let count = header.split("element vertex ").nth(1).expect("vertices");
    let count: usize = count.lines().next().unwrap().parse().expect("a number");
    let vertices = bytes[first..].chunks(VERTEX).take(count);
    vertices
        .map(|vertex| {
            assert_eq!(vertex[28..31], [vertex[28]; 3], "grey");
            let value = vertex[24..28].try_into().expect("four bytes");
            (f32::from_le_bytes(value), vertex[28])
        })
        .collect()
}

impl Place {
    /// Bakes a mesh, and returns the values of its vertices.
    fn bake(&self, mesh: &str, flags: &[&str]) -> Vec<f32> {
        self.run(&[&["ao", mesh, "-o", "baked.ply"], flags].concat())
            .expect(0);
        let found = values(&self.bytes("baked.ply"));
        for (value, grey) in &found {
            assert_eq!(*grey, (value * 255.0).round() as u8);
        }
        found.into_iter().map(|(value, _)| value).collect()
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).expect("a file")
    }
}

/// A cube whose faces look outwards, or inwards.
fn cube(inwards: bool) -> String {
    let mut text = String::new();
    for i in 0..8 {
        text += &format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2 & 1);
    }
    let quads = [
        [1, 3, 4, 2],
        [5, 6, 8, 7],
        [1, 2, 6, 5],
        [3, 7, 8, 4],
        [1, 5, 7, 3],
        [2, 4, 8, 6],
    ];
    for mut quad in quads {
        if inwards {
            quad.reverse();
        }
        text += &format!("f {} {} {} {}\n", quad[0], quad[1], quad[2], quad[3]);
    }
    text
}

/// A small triangle at the origin that looks up, under a large square at height 1 or behind one at x = 0.
fn under(square: &str) -> String {
    format!("v 0.1 0 0\nv 0.2 0 0\nv 0.2 0.1 0\nf 1 2 3\n{square}f 4 5 6 7\n")
}

const CEILING: &str = "v -900 -900 1\nv -900 900 1\nv 900 900 1\nv 900 -900 1\n";
const WALL: &str = "v 0 -900 0\nv 0 900 0\nv 0 900 900\nv 0 -900 900\n";

#[test]
fn values_are_those_known_on_paper() {
    let place = Place::empty();
    place.write("out.obj", cube(false));
    place.write("in.obj", cube(true));
    place.write("ceiling.obj", under(CEILING));
    place.write("wall.obj", under(WALL));
    // Every corner has a vertex for each of its three sides.
    assert_eq!(place.bake("out.obj", &[]), [1.0; 24]);
    assert_eq!(place.bake("in.obj", &[]), [0.0; 24]);
    assert_eq!(place.bake("in.obj", &["--two-sided"]), [1.0; 24]);

    let near = |mesh: &str, flags: &[&str], expected: f32| {
        let flags = [flags, &["--samples", "4096"]].concat();
        let values = place.bake(mesh, &flags);
        for value in &values[..3] {
            assert!(
                (value - expected).abs() < 0.005,
                "{mesh} {flags:?}: {value}"
            );
        }
    };
    near("wall.obj", &[], 0.5);
    near("wall.obj", &["--uniform"], 0.5);
    // Rays are stopped where 1 / cos < 2.
    near("ceiling.obj", &["--distance", "2"], 0.25);
    near("ceiling.obj", &["--distance", "2", "--uniform"], 0.5);
    near("ceiling.obj", &["--distance", "0.9"], 1.0);
}

/// Positions, normals and values of the vertices in a file of `ao`.
fn vertices(bytes: &[u8]) -> Vec<([f32; 3], [f32; 3], f32)> {
    let count = values(bytes).len();
    let end = b"end_header\n";
    let first = bytes.windows(end.len()).position(|window| window == end);
    let first = first.expect("a header") + end.len();
    let vertices = bytes[first..].chunks(VERTEX).take(count);
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
    let three = |bytes: &[u8]| [0, 4, 8].map(|at| number(&bytes[at..at + 4]));
    vertices
        .map(|vertex| (three(vertex), three(&vertex[12..]), number(&vertex[24..28])))
        .collect()
}

#[test]
fn corners_of_roofs_see_the_whole_sky() {
    let place = Place::empty();
    // A cube on a large square, z up.
    let square = "v -900 -900 0\nv 900 -900 0\nv 900 900 0\nv -900 900 0\nf 9 10 11 12\n";
    let house = cube(false) + square;
    place.write("house.obj", &house);
    let run = place.run(&["ao", "house.obj", "-o", "house.ply", "--json", "-"]);
    let run = run.expect(0);
    let said = "house: 16 vertices more, since vertices without normals are split at creases of more than 40 degrees";
    assert!(run.stderr.contains(said), "{}", run.stderr);
    assert_eq!(run.json()["vertices"], 28);
    let found = vertices(&place.bytes("house.ply"));
    let roof = found
        .iter()
        .filter(|(point, normal, _)| point[2] == 1.0 && normal[2] == 1.0);
    assert_eq!(roof.clone().count(), 4);
    assert!(roof.clone().all(|(_, _, open)| *open == 1.0), "{found:?}");
    let walls = found
        .iter()
        .filter(|(point, normal, _)| point[2] == 1.0 && normal[2] == 0.0);
    assert_eq!(walls.clone().count(), 8);
    // Walls look at the ground with one half.
    assert!(
        walls.clone().all(|(_, _, open)| (open - 0.5).abs() < 0.02),
        "{found:?}"
    );

    // Normals of the file count, and split nothing.
    let smooth = house.replace("f 1 3 4 2\n", "vn 0 0 1\nf 1 3 4 2\n");
    let with_normals = |line: &str| match line.strip_prefix("f ") {
        Some(corners) => {
            let corners = corners.split(' ').map(|corner| format!(" {corner}//1"));
            format!("f{}\n", corners.collect::<String>())
        }
        None => format!("{line}\n"),
    };
    let smooth: String = smooth.lines().map(with_normals).collect();
    place.write("smooth.obj", smooth);
    assert_eq!(place.bake("smooth.obj", &[]).len(), 12);
}

#[test]
fn threads_and_instruction_sets_change_no_byte_and_seeds_do() {
    let place = Place::with_room();
    let bake = |name: &str, flags: &[&str]| {
        place
            .run(&[&["ao", "room.pbrt", "-o", name], flags].concat())
            .expect(0);
        place.bytes(name)
    };
    let one = bake("one.ply", &["--threads", "1"]);
    assert_eq!(one, bake("two.ply", &["--threads", "2"]));
    let bent = bake("bent.ply", &["--bent-normals"]);
    let names = 3 * "property float bent_x\n".len();
    assert_eq!(bent.len(), one.len() + 28 * 12 + names);
    assert_eq!(one, bake("scalar.ply", &["--level", "scalar"]));
    assert_ne!(one, bake("seed.ply", &["--seed", "1"]));
    let city = |threads| {
        let args = [
            "ao",
            "builtin:city:20000",
            "-o",
            "city.ply",
            "--samples",
            "8",
            "--threads",
        ];
        place.run(&[&args[..], &[threads]].concat()).expect(0);
        place.bytes("city.ply")
    };
    assert_eq!(city("1"), city("2"));
}

#[test]
fn figures_and_what_is_read_again() {
    let place = Place::with_room();
    let args = [
        "ao",
        "room.pbrt",
        "-o",
        "a.ply",
        "--json",
        "-",
        "--distance",
        "inf",
    ];
    let run = place.run(&args).expect(0);
    let document = run.json();
    assert_eq!(document["schema"], "antumbra.ao/1");
    assert_eq!(document["vertices"], 28);
    assert_eq!(document["triangles"], 12);
    assert_eq!(document["without_value"], 0);
    assert_eq!(document["rays"], 28 * 256);
    assert_eq!(document["weighting"], "cosine");
    assert!(document["distance"].is_null());
    let mean = document["mean"].as_f64().expect("a mean");
    assert!(mean > 0.05 && mean < 0.95, "{mean}");
    assert!(run.stderr.contains("1 spheres"), "{}", run.stderr);
    let again = ["ao", "a.ply", "-o", "b.ply", "--json", "b.json"];
    place.run(&again).expect(0);
    let document = place.json("b.json");
    assert_eq!(document["vertices"], 28);
    assert_eq!(document["triangles"], 12);
}

#[test]
fn vertices_without_a_normal_are_told() {
    let place = Place::empty();
    place.write(
        "loose.ply",
        TETRAHEDRON
            .replace("vertex 4", "vertex 5")
            .replace("3 0 1 2\n", "9 9 9\n3 0 1 2\n"),
    );
    let run = place.run(&["ao", "loose.ply", "-o", "a.ply", "--json", "a.json"]);
    let run = run.expect(0);
    assert!(run.stderr.contains("NaN"), "{}", run.stderr);
    assert_eq!(place.json("a.json")["without_value"], 1);
    let found = values(&place.bytes("a.ply"));
    assert!(found[4].0.is_nan() && found[4].1 == 0);
    assert!(found[..4].iter().all(|(value, _)| *value == 1.0), "convex");
}

#[test]
fn no_output_destroys_an_input_or_another_output() {
    let place = Place::with_room();
    place.write("ball.pbrt", "WorldBegin Shape \"sphere\" WorldEnd");
    let before = place.bytes("thing.ply");
    let refused: &[(&[&str], i32, &str)] = &[
        (&["thing.ply", "-o", "./thing.ply"], 2, "destroy"),
        (&["room.pbrt", "-o", "thing.ply"], 2, "destroy"),
        (
            &["thing.ply", "-o", "a.ply", "--json", "thing.ply"],
            2,
            "destroy",
        ),
        (
            &["thing.ply", "-o", "a.ply", "--json", "./a.ply"],
            2,
            "two outputs",
        ),
        (&["thing.ply", "-o", "-", "--json", "-"], 2, "two outputs"),
        (&["thing.ply", "-o", "a.obj"], 2, "ply"),
        (&["thing.ply"], 2, "--output"),
        (
            &["thing.ply", "-o", "a.ply", "--samples", "0"],
            2,
            "--samples",
        ),
        (
            &["thing.ply", "-o", "a.ply", "--distance", "0"],
            2,
            "above 0",
        ),
        (
            &["thing.ply", "-o", "a.ply", "--distance", "nan"],
            2,
            "above 0",
        ),
        (&["thing.ply", "-o", "none/a.ply"], 1, "none/a.ply"),
        (&["ball.pbrt", "-o", "a.ply"], 65, "no mesh"),
        (
            &["builtin:city", "-o", "a.ply", "--max-memory", "1M"],
            65,
            "--max-memory",
        ),
    ];
    let files = place.files();
    for (args, code, hint) in refused {
        let run = place.run(&[&["ao"], *args].concat()).expect(*code);
        assert!(run.stderr.contains(hint), "{args:?}: {}", run.stderr);
        assert_eq!(run.stdout, "", "{args:?}");
    }
    assert_eq!(place.files(), files);
    assert_eq!(place.bytes("thing.ply"), before);
    // A name that the command line gives is replaced.
    place.write("a.ply", "anything");
    place.run(&["ao", "thing.ply", "-o", "a.ply"]).expect(0);
    assert_eq!(values(&place.bytes("a.ply")).len(), 12);
}

/// A square with texture coordinates over the lower left quarter of the texture, under a low ceiling without any.
const TEXTURED: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property float u\nproperty float v\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    -1 -1 0 0 0\n1 -1 0 0.5 0\n1 1 0 0.5 0.5\n-1 1 0 0 0.5\n4 0 1 2 3\n";

#[test]
fn textures_hold_values_where_triangles_have_coordinates() {
    let place = Place::empty();
    place.write("square.ply", TEXTURED);
    place
        .run(&[
            "ao",
            "square.ply",
            "-o",
            "ao.exr",
            "--atlas",
            "16",
            "--dilate",
            "1",
        ])
        .expect(0);
    let image = place.image("ao.exr");
    assert_eq!((image.width(), image.height()), (16, 16));
    // 8 x 8 texels and those around them, from the lower left.
    let white = image
        .pixels()
        .iter()
        .filter(|pixel| **pixel == [1.0; 3])
        .count();
    assert_eq!(white, 81);
    assert_eq!(image.get(0, 15), Some([1.0; 3]));
    assert_eq!(image.get(15, 0), Some([0.0; 3]));
    place
        .run(&["ao", "square.ply", "-o", "ao.png", "--atlas", "16"])
        .expect(0);
    assert!(place.bytes("ao.png").starts_with(b"\x89PNG"));
    let run = place
        .run(&["ao", "square.ply", "-o", "ao.ply", "--atlas", "16"])
        .expect(2);
    assert!(run.stderr.contains("--atlas"), "{}", run.stderr);
    place.write("bare.obj", cube(false));
    let run = place
        .run(&["ao", "bare.obj", "-o", "ao.png", "--atlas", "16"])
        .expect(2);
    assert!(run.stderr.contains("texture coordinates"), "{}", run.stderr);
}

/// A square with coordinates over one half of the texture: of the upper rows, since v of glTF runs downwards.
#[test]
fn textures_follow_the_coordinates_of_gltf_and_obj() {
    let place = Place::empty();
    place.write(
        "square.obj",
        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0.5\nvt 1 0.5\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n",
    );
    let floats = |list: &[f32]| {
        list.iter()
            .flat_map(|x| x.to_le_bytes())
            .collect::<Vec<u8>>()
    };
    let mut bytes = floats(&[-1., -1., 0., 1., -1., 0., 1., 1., 0., -1., 1., 0.]);
    bytes.extend(floats(&[0., 0.5, 1., 0.5, 1., 0., 0., 0.]));
    bytes.extend([0, 1, 2, 0, 2, 3]);
    place.write("square.bin", &bytes);
    place.write(
        "square.gltf",
        r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "square.bin", "byteLength": 86}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 6}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5121, "count": 6, "type": "SCALAR"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}]}],
        "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}"#,
    );
    for name in ["square.obj", "square.gltf"] {
        let flags = ["-o", "ao.exr", "--atlas", "8", "--dilate", "0"];
        place.run(&[&["ao", name][..], &flags].concat()).expect(0);
        let image = place.image("ao.exr");
        for y in 0..8 {
            for x in 0..8 {
                let expected = if y < 4 { [1.0; 3] } else { [0.0; 3] };
                assert_eq!(image.get(x, y), Some(expected), "{name}: {x}, {y}");
            }
        }
    }
}

#[test]
fn meshes_for_other_programs_and_pictures() {
    let place = Place::empty();
    place.write("in.obj", cube(true));
    place.write("out.obj", cube(false));
    place
        .run(&["ao", "in.obj", "-o", "in.glb", "--bent-normals"])
        .expect(0);
    // The program reads it again, with the same corners and normals.
    let again = place
        .run(&["ao", "in.glb", "-o", "again.ply", "--json", "-"])
        .expect(0)
        .json();
    assert_eq!(
        (&again["vertices"], &again["triangles"]),
        (&24.into(), &12.into())
    );
    assert_eq!(again["mean"], 0.0);
    place.run(&["ao", "in.obj", "-o", "in.npz"]).expect(0);
    assert!(place.bytes("in.npz").starts_with(b"PK"));

    let picture = ["--resolution", "40x30", "--samples", "64"];
    place
        .run(&[&["ao", "out.obj", "-o", "out.exr"], &picture[..]].concat())
        .expect(0);
    let open = place.image("out.exr");
    assert_eq!((open.width(), open.height()), (40, 30));
    // A cube is open outside, and edges are mixed with the black around it.
    let has = |value: f32| open.pixels().contains(&[value; 3]);
    assert!(has(1.0) && has(0.0));
    let mut numbers = open.pixels().as_flattened().iter();
    assert!(numbers.all(|x| (0.0..=1.0).contains(x)));
    place.write("wall.obj", under(WALL));
    place
        .run(
            &[
                &["ao", "wall.obj", "-o", "wall.exr", "--bent-normals"],
                &picture[..],
            ]
            .concat(),
        )
        .expect(0);
    assert!(
        place
            .image("wall.exr")
            .pixels()
            .iter()
            .any(|pixel| *pixel != [0.0; 3])
    );
}

#[test]
fn shares_make_the_same_file() {
    let place = Place::empty();
    let job = ["ao", "builtin:city:2000", "--samples", "2048"];
    place
        .run(&[&job[..], &["-o", "whole.ply"]].concat())
        .expect(0);
    for shard in ["0/3", "1/3", "2/3"] {
        let part = format!("{}.part", &shard[..1]);
        place
            .run(&[&job[..], &["--shard", shard, "-o", &part]].concat())
            .expect(0);
    }
    place
        .run(&["merge", "2.part", "0.part", "1.part", "-o", "joined.ply"])
        .expect(0);
    assert_eq!(place.bytes("joined.ply"), place.bytes("whole.ply"));
}

#[test]
fn rendered_occlusion_of_a_mesh_is_at_most_1_and_that_of_pbrt_pi() {
    let place = Place::with_room();
    place.write("out.obj", cube(false));
    let render = |scene: &str, flags: &[&str]| {
        let common = [
            "--integrator",
            "ambientocclusion",
            "--resolution",
            "16x16",
            "--spp",
            "4",
            "-o",
            "a.exr",
        ];
        place
            .run(&[&["render", scene], &common[..], flags].concat())
            .expect(0);
        let image = place.image("a.exr");
        image
            .pixels()
            .iter()
            .map(|pixel| pixel[0])
            .fold(0.0, f32::max)
    };
    assert_eq!(render("out.obj", &[]), 1.0);
    let room = render("room.pbrt", &[]);
    assert!(room > 1.5 && room < 3.2, "{room}");
    let near = render("room.pbrt", &["--ao-distance", "1e-3"]);
    assert!((near - std::f32::consts::PI).abs() < 1e-3, "{near}");
    let run = place.run(&[
        "render",
        "room.pbrt",
        "--ao-distance",
        "1",
        "-o",
        "b.exr",
        "--integrator",
        "path",
    ]);
    let run = run.expect(2);
    assert!(run.stderr.contains("--ao-distance"), "{}", run.stderr);
}

#[cfg(target_os = "linux")]
#[test]
fn an_interruption_leaves_nothing() {
    let place = Place::with_room();
    let files = place.files();
    let args = [
        "ao",
        "builtin:city:20000",
        "-o",
        "a.ply",
        "--samples",
        "1000000",
    ];
    let code = place.interrupt(&args, std::time::Duration::from_millis(200));
    assert_eq!(code, Some(130));
    assert_eq!(place.files(), files);
}
