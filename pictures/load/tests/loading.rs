//! Every kind of name becomes a scene, and every mistake an error that names its place.

use std::fs;
use std::path::Path;

use antumbra_load::{Error, MemorySize, Options, Up, load};
use antumbra_scene::{Geometry, Light, Scene};

const TETRAHEDRON: &str =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n";

fn error(name: &Path) -> Error {
    load(name, &Options::default()).expect_err("no scene")
}

#[test]
fn files_and_names_become_scenes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("Thing.OBJ");
    fs::write(&path, TETRAHEDRON).expect("a file");
    let loaded = load(&path, &Options::default()).expect("a scene");
    assert_eq!(
        (loaded.scene.name.as_str(), loaded.scene.triangle_count()),
        ("Thing", 4)
    );
    assert!(loaded.times.is_none() && loaded.files.is_empty() && loaded.notes.is_empty());

    let path = folder.path().join("ball.pbrt");
    fs::write(&path, "WorldBegin Shape \"sphere\" WorldEnd").expect("a file");
    let loaded = load(&path, &Options::default()).expect("a scene");
    assert_eq!(loaded.scene.name, "ball");
    assert!(loaded.times.is_some());
    assert_eq!(loaded.files, [path.canonicalize().expect("a file")]);

    let city = load("builtin:city:2000".as_ref(), &Options::default()).expect("a scene");
    assert!(city.scene.triangle_count() > 1000);
}

#[test]
fn mistakes_name_their_place() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("broken.pbrt");
    fs::write(&path, "WorldBegin\n  Shpae \"sphere\"\nWorldEnd\n").expect("a file");
    let found = error(&path);
    assert!(found.names_places());
    let places: Vec<_> = found
        .diagnostics()
        .iter()
        .map(|mistake| (mistake.file.clone(), mistake.line, mistake.column))
        .collect();
    assert_eq!(places, [(path, 2, 3)]);

    let path = folder.path().join("broken.obj");
    fs::write(&path, "v 0 0 0\nv oops\n").expect("a file");
    let text = error(&path).to_string();
    assert!(text.contains("broken.obj:2:3: error:"), "{text}");

    let missing = error(&folder.path().join("missing.pbrt"));
    assert!(!missing.names_places() && missing.to_string().contains("missing.pbrt"));
    let blend = error("room.blend".as_ref()).to_string();
    assert!(
        blend.contains("`blend`") && blend.contains(".pbrt"),
        "{blend}"
    );
    let moon = error("builtin:moon".as_ref()).to_string();
    assert!(moon.contains("builtin:city"), "{moon}");
}

#[test]
fn warnings_are_errors_if_strict() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("thing.obj");
    fs::write(&path, format!("mtllib no.mtl\n{TETRAHEDRON}")).expect("a file");
    let loaded = load(&path, &Options::default()).expect("a scene");
    assert!(!loaded.is_invisible);
    let [warning] = &loaded.warnings[..] else {
        panic!("{:?}", loaded.warnings);
    };
    assert!(warning.place.ends_with("thing.obj:1:8"), "{warning}");
    let strict = Options {
        strict: true,
        ..Options::default()
    };
    let refused = load(&path, &strict).expect_err("strict");
    assert!(refused.names_places());
    let text = refused.to_string();
    let start = format!("{}: error: cannot read `no.mtl`: ", warning.place);
    assert!(text.starts_with(&start), "{text}");
    fs::write(&path, TETRAHEDRON).expect("a file");
    assert!(load(&path, &strict).is_ok());
}

#[test]
fn bakes_are_not_warned_of_materials() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("thing.obj");
    let text = format!("mtllib a.mtl\nusemtl a\n{TETRAHEDRON}oops\n");
    fs::write(&path, text).expect("a file");
    let mtl = "newmtl a\nKt 1\nmap_Kd no.png\nd 0\nnewmtl b\nTr 1\n";
    fs::write(folder.path().join("a.mtl"), mtl).expect("a file");
    let warnings = |looks: bool| {
        let options = Options {
            looks,
            ..Options::default()
        };
        let loaded = load(&path, &options).expect("a scene");
        assert_eq!(loaded.scene.triangle_count(), 4);
        (loaded.warnings.len(), loaded.left_out.len())
    };
    assert_eq!(warnings(true), (3, 1));
    assert_eq!(warnings(false), (1, 0));
}

#[test]
fn zero_normals_beside_others_become_those_of_faces() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("thing.obj");
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn 1 0 0\nf 1//1 2//1 3//2\n";
    fs::write(&path, text).expect("a file");
    let loaded = load(&path, &Options::default()).expect("a scene");
    let Geometry::Mesh(mesh) = &loaded.scene.shapes[0].geometry else {
        panic!("a mesh");
    };
    let normals: Vec<_> = mesh
        .normals
        .iter()
        .map(|normal| normal.to_array())
        .collect();
    assert_eq!(normals, [[0., 0., 1.], [0., 0., 1.], [1., 0., 0.]]);
    assert!(loaded.warnings.is_empty());
}

#[test]
fn meshes_that_can_be_seen_in_part_are_not_invisible() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let of = |second: &str| {
        let path = folder.path().join("thing.obj");
        let materials = format!("newmtl a\nTr 0.25\nnewmtl b\n{second}\n");
        fs::write(folder.path().join("a.mtl"), materials).expect("a file");
        let text = TETRAHEDRON.replacen("f ", "usemtl a\nf ", 1);
        let text = text.replace("f 2 4 3", "usemtl b\nf 2 4 3");
        fs::write(&path, format!("mtllib a.mtl\n{text}")).expect("a file");
        load(&path, &Options::default()).expect("a scene")
    };
    // One can be seen in part.
    for second in ["d 0", "d 1"] {
        let loaded = of(second);
        assert!(!loaded.is_invisible && loaded.warnings.is_empty());
    }
}

#[test]
fn a_scene_beyond_the_budget_is_refused() {
    let max_memory = MemorySize::new(1 << 16);
    let options = Options {
        max_memory,
        ..Options::default()
    };
    let refused = load("builtin:city:2000".as_ref(), &options).expect_err("too large");
    assert!(matches!(refused, Error::SceneTooLarge { allowed, .. } if allowed == max_memory));
    assert!(
        refused.to_string().contains("64.0 KiB allowed"),
        "{refused}"
    );
}

/// Files of one tetrahedron whose corners are moved: as double precision has them, or as single precision would.
fn far_files(at: [f64; 3]) -> Vec<(&'static str, String)> {
    let corners = [
        [0.0, 0.0, 0.0],
        [1.25, 0.0, 0.0],
        [0.0, 1.25, 0.0],
        [0.0, 0.0, 1.25],
    ];
    let corners = corners.map(|corner| [0, 1, 2].map(|axis| corner[axis] + at[axis]));
    let lines = |word: &str| {
        let lines = corners.map(|[x, y, z]| format!("{word}{x} {y} {z}\n"));
        lines.concat()
    };
    let faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];
    let obj = faces.map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    let ply = faces.map(|[a, b, c]| format!("3 {a} {b} {c}\n"));
    let stl = faces.map(|face| {
        let loops = face.map(|i| {
            format!(
                "vertex {} {} {}\n",
                corners[i][0], corners[i][1], corners[i][2]
            )
        });
        format!(
            "facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n",
            loops.concat()
        )
    });
    let [x, y, z] = at;
    let shape_of = |corners: &[[f64; 3]; 4]| {
        let corners = corners.map(|[x, y, z]| format!("{x} {y} {z} ")).concat();
        format!("\"integer indices\" [0 1 2  0 2 3  0 3 1  1 3 2] \"point P\" [{corners}]")
    };
    let shape = shape_of(&[
        [0.0, 0.0, 0.0],
        [1.25, 0.0, 0.0],
        [0.0, 1.25, 0.0],
        [0.0, 0.0, 1.25],
    ]);
    let shape_there = shape_of(&corners);
    let shape_halfway = shape_of(&corners.map(|[x, y, z]| [0.5 * x, 0.5 * y, 0.5 * z]));
    let bytes = "AAAAAAAAAAAAAAAAAACgPwAAAAAAAAAAAAAAAAAAoD8AAAAAAAAAAAAAAAAAAKA/AAABAAIAAAACAAMAAAADAAEAAQADAAIA";
    let gltf = format!(
        r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0, "translation": [{x}, {y}, {z}]}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
            {{"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 24}}],
        "buffers": [{{"uri": "data:application/octet-stream;base64,{bytes}", "byteLength": 72}}]}}"#
    );
    vec![
        ("a.obj", lines("v ") + &obj.concat()),
        (
            "a.ply",
            format!(
                "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n\
                 element face 4\nproperty list uchar int vertex_indices\nend_header\n{}{}",
                lines(""),
                ply.concat()
            ),
        ),
        ("a.stl", format!("solid a\n{}endsolid a\n", stl.concat())),
        ("a.gltf", gltf),
        (
            "a.pbrt",
            format!(
                "LookAt {} {y} {z}  {x} {y} {z}  0 0 1\nCamera \"perspective\"\nWorldBegin\n\
                 AttributeBegin Translate {x} {y} {z} LightSource \"point\" \"point from\" [3 0 0]\n\
                 Shape \"trianglemesh\" {shape}\nAttributeEnd\n\
                 Shape \"trianglemesh\" {shape_there}\n\
                 AttributeBegin Translate 1 2 3 Scale 2 2 2 Shape \"trianglemesh\" {shape_halfway} AttributeEnd\n\
                 Shape \"plymesh\" \"string filename\" \"a.ply\"\n\
                 ObjectBegin \"a\" Shape \"trianglemesh\" {shape} ObjectEnd\n\
                 Translate {x} {y} {z} ObjectInstance \"a\"\nWorldEnd\n",
                x + 9.0
            ),
        ),
    ]
}

#[test]
fn scenes_far_away_are_those_at_the_origin() {
    // Half a metre is all that single precision tells there.
    let far = [600_000.25, 5_340_000.0, 128.0];
    let folder = tempfile::tempdir().expect("a temporary folder");
    for ((name, near), (_, text)) in far_files([0.0; 3]).into_iter().zip(far_files(far)) {
        let read = |place: &str, text: String| {
            let folder = folder.path().join(place);
            fs::create_dir_all(&folder).expect("a folder");
            fs::write(folder.join(name), text).expect("a file");
            load(&folder.join(name), &Options::default()).expect("a scene")
        };
        let near = read("near", near).scene;
        let far_one = read("far", text);
        assert_eq!(near.origin, glam::DVec3::ZERO, "{name}");
        let moved = far_one.scene.origin - glam::DVec3::from(far);
        assert!(moved.length() < 8.0, "{name}: {moved}");
        let back = glam::DMat4::from_translation(moved);
        for (a, b) in near
            .stored_shapes()
            .zip(far_one.scene.stored_shapes())
            .take(near.shapes.len())
        {
            assert_eq!(
                Some(&a.geometry),
                b.transformed(&back).map(|shape| shape.geometry).as_ref(),
                "{name}"
            );
        }
        for (a, b) in near.instances.iter().zip(&far_one.scene.instances) {
            let there = b.world_from_object.translation.as_dvec3() + moved;
            assert_eq!(a.world_from_object.translation.as_dvec3(), there, "{name}");
        }
        for (a, b) in near.lights.iter().zip(&far_one.scene.lights) {
            if let (Light::Point { position: a, .. }, Light::Point { position: b, .. }) = (a, b) {
                assert_eq!(a.as_dvec3(), b.as_dvec3() + moved, "{name}");
            }
        }
        if name == "a.pbrt" {
            let eye = |scene: &Scene| scene.camera.world_from_camera.w_axis.truncate().as_dvec3();
            assert_eq!(eye(&near), eye(&far_one.scene) + moved);
        } else {
            let is_map = far_one.up.axis == if name == "a.gltf" { Up::Y } else { Up::Z };
            assert!(is_map, "{name}: {:?}", far_one.up);
        }
    }
}
