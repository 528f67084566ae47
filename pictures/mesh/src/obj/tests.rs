//! Files with every statement, and one for every mistake.

use antumbra_scene::material::{Matte, Metallic, NormalMapped, Substrate};
use antumbra_scene::{Material, Param, Texture};
use glam::DVec3;

use super::*;
use crate::Warning;

fn read(text: &[u8]) -> Result<Model, Vec<String>> {
    let read = parse_obj(text, Path::new("a.obj"));
    read.map_err(|error| error.to_string().lines().map(str::to_owned).collect())
}

fn mesh(shape: &Shape) -> &antumbra_scene::TriangleMesh {
    match &shape.geometry {
        Geometry::Mesh(mesh) => mesh,
        Geometry::Sphere(_) | Geometry::Curves(_) => panic!("no mesh"),
    }
}

#[test]
fn polygons_become_fans() {
    let text = b"# caf\xe9\r\no thing\nv 0 0 0\nv 1 0 0 0.5\nv 1 1 0 .1 .2 .3 .4\n\n  v 0 1 0\n\
        f 1 2 3 -1 # a square\r\ng two\nf 4 2 1\nf 1 2 3 4 1\nf 1 2";
    let model = read(text).expect("a good file");
    let mesh = mesh(&model.shapes[0]);
    let square = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
    assert_eq!(mesh.positions, square);
    assert!(mesh.colors.is_empty(), "only one vertex has a colour");
    let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 0]];
    assert_eq!(mesh.indices[..2], fan[..2]);
    assert_eq!(mesh.indices[2], [3, 1, 0]);
    assert_eq!(mesh.indices[3..], fan);
}

#[test]
fn corners_bring_their_coordinates_and_normals() {
    let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 2\nvn 0 1 0\n\
        f 1/1/1 2/2/1 3/3/1\nusemtl b\nf 2/2/1 4/1/2 3/3/1\nf 2//2 4//2 3//2";
    let model = read(text).expect("a good file");
    let [a, b] = &model.shapes[..] else {
        panic!("{} shapes", model.shapes.len());
    };
    assert_eq!(mesh(a).positions.len(), 3);
    assert_eq!(mesh(a).normals, [glam::Vec3::Z; 3]);
    assert_eq!(mesh(a).uvs[1], glam::Vec2::X);
    // Vertex 2 with and without a texture coordinate are two vertices.
    assert_eq!(mesh(b).positions.len(), 6);
    assert_eq!(mesh(b).indices, [[0, 1, 2], [3, 4, 5]]);
    assert_ne!(a.material, b.material);
    // Elsewhere, a corner without a normal has the zero vector.
    let text = text.replace(b"2//2", b"2");
    let model = read(&text).expect("a good file");
    let normals = &mesh(&model.shapes[1]).normals;
    assert_eq!(
        normals[3..],
        [glam::Vec3::ZERO, glam::Vec3::Y, glam::Vec3::Y]
    );
}

trait Replace {
    fn replace(&self, from: &[u8], to: &[u8]) -> Vec<u8>;
}

impl Replace for [u8] {
    fn replace(&self, from: &[u8], to: &[u8]) -> Vec<u8> {
        let (text, from) = (String::from_utf8_lossy(self), String::from_utf8_lossy(from));
        text.replacen(&*from, &String::from_utf8_lossy(to), 1)
            .into_bytes()
    }
}

#[test]
fn vertex_colours_are_kept() {
    let text = b"v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nf 1 2 3";
    let model = read(text).expect("a good file");
    let colors = &mesh(&model.shapes[0]).colors;
    assert_eq!(colors[0], glam::Vec3::X);
    assert!((colors[2].z - 0.214_041).abs() < 1e-5, "{colors:?}");
    let Material::Matte(Matte { kd, .. }) = &model.materials[0] else {
        panic!("not diffuse");
    };
    assert!(kd.constant().is_none());
}

#[test]
fn files_without_faces_are_empty_models() {
    for text in ["", "\n\n", "v 1 2 3", "#v\nl 1 2\n"] {
        let model = read(text.as_bytes()).expect(text);
        assert_eq!(model.shapes.len(), 0, "{text}");
        assert_eq!(model.notes.len(), usize::from(text.contains('l')));
    }
}

/// Model of a file, with its warnings as text.
fn warnings(text: &[u8]) -> (Model, Vec<String>) {
    let model = read(text).expect("a good file");
    let warnings = model.warnings.iter().map(ToString::to_string).collect();
    (model, warnings)
}

#[test]
fn what_leaves_the_geometry_whole_is_a_warning_of_each_kind() {
    let text =
        b"\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt zero\nvn 0 1\nvw 1\n vw 2\ncurv 1\n\
        s off\nf 1/0/1 2/3/9 3/-3/-1\nf 1/1/1 2/1/1 3/1/1\nf 1 2\nf\nf 3\n";
    let (model, found) = warnings(text);
    let lacks = "warning: a corner names a";
    let expected = [
        "5:4: warning: `zero` is not a number, so `vt` counts as 0".to_owned(),
        "6:1: warning: 3 numbers are needed here, and there are 2, so `vn` is left out".into(),
        "7:1: warning: `vw` is unknown or not supported, and is left out (the first of 2 places)"
            .into(),
        "9:1: warning: `curv` is unknown or not supported, and is left out".into(),
        format!(
            "11:3: {lacks} texture coordinate that is not in the file; 0 is used instead (the first of 3 places)"
        ),
        format!("11:9: {lacks} normal that is not in the file; that of the face is used instead"),
    ];
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(*found, format!("a.obj:{expected}"));
    }
    let mesh = mesh(&model.shapes[0]);
    assert_eq!(mesh.indices.len(), 2);
    assert!(mesh.uvs.iter().all(|uv| *uv == glam::Vec2::ZERO));
    assert!(mesh.normals.iter().all(|n| *n == glam::Vec3::ZERO));
    assert_eq!(
        model.notes,
        ["3 faces of fewer than three corners are left out"]
    );
}

#[test]
fn lines_that_end_in_a_backslash_go_on() {
    let text = b"# C:\\folder\\\nv 0 0 \\\r\n 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 \\\n 3 \\  \n# no\nf 1 \\\n x 2\\";
    let mistakes = read(text).expect_err("x");
    assert_eq!(
        mistakes,
        ["a.obj:10:7: error: `x` is not a corner such as 1, 1/2 or 1/2/3"]
    );
    let model = read(&text.replace(b"x 2\\", b"3 4\\")).expect("a good file");
    assert_eq!(mesh(&model.shapes[0]).indices, [[0, 1, 2], [0, 2, 3]]);
    assert!(model.warnings.is_empty() && model.notes.is_empty());
}

#[test]
fn polygons_with_inward_corners_are_split_inside() {
    // An arrow whose first corner is beside the inward one, before and after its vertices.
    let text = b"f 1 2 3 4\nv 0 2 0\nv 1 1 0\nv 0 0 0\nv 2 1 0\nf -4 -3 -2 -1\n";
    let model = read(text).expect("a good file");
    let mesh = mesh(&model.shapes[0]);
    let area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| glam::Vec3::from(mesh.positions[corner as usize]));
        (b - a).cross(c - a).z / 2.0
    };
    let areas: Vec<f32> = mesh.indices.iter().map(area).collect();
    assert_eq!(areas, [0.5; 4], "{:?}", mesh.indices);
}

#[test]
fn every_mistake_is_named() {
    let cases: [(&[u8], &[&str]); 10] = [
        (
            b"v 0 0\n",
            &["1:1: error: 3 numbers are needed here, and there are 2"],
        ),
        (
            b"\nv 0 zero 0\nf 0",
            &[
                "2:5: error: `zero` is not a number",
                "3:3: error: there is no vertex 0",
            ],
        ),
        (b"v 1 2 3\n\nf 1 x 1", &["3:5: error: `x` is not a corner"]),
        (
            b"f 1 1/1/1/1 1\nv 1 2 3\nvt 0\nvn 0 0 1",
            &["1:5: error: `1/1/1/1` is not"],
        ),
        (
            b"v 1 2 3\nf 1 1 \xff\n",
            &["2:7: error: `\u{fffd}` is not a corner"],
        ),
        (
            b"v 1 2 3\nf 1 1 2\n",
            &["2:7: error: there is no vertex 2: the file has 1"],
        ),
        (
            b"f 2/1 1 3//9\nv 1 2 3\nf 0 1 1\nv 4 5 6\n",
            &[
                "1:9: error: there is no vertex 3: the file has 2",
                "3:3: error: there is no vertex 0: 1 stand before it",
            ],
        ),
        (
            b"v 1 2 3\nf 1 1 -2\nv 1 2 3\n",
            &["2:7: error: there is no vertex -2: 1 stand"],
        ),
        (
            b"v 1 2 3\nf 99999999999 1 1",
            &["2:3: error: there is no vertex 99999999999"],
        ),
        (
            b"vv 1\nf 1 1 1\n  oops #v\n",
            &[
                "2:3: error: there is no vertex 1: the file has 0",
                "2:5: error: there is no vertex 1",
                "2:7: error: there is no vertex 1",
            ],
        ),
    ];
    for (text, expected) in cases {
        let mistakes = read(text).expect_err("a bad file");
        assert_eq!(mistakes.len(), expected.len(), "{mistakes:#?}");
        for (mistake, start) in mistakes.iter().zip(expected) {
            let mistake = mistake.strip_prefix("a.obj:").expect("the file");
            assert!(mistake.starts_with(start), "{start}: {mistake}");
        }
    }
}

#[test]
fn memory_is_counted_before_it_is_taken() {
    let mut text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_vec();
    text.extend(b"f 1 2 3\n".repeat(1000));
    let within = |bytes| parse_within(&text, Path::new("a.obj"), None, bytes, DVec3::ZERO);
    assert!(within(200_000).is_ok());
    let error = within(100_000).expect_err("too large").to_string();
    assert!(error.contains("more memory than is allowed"), "{error}");
}

/// Writes files to a folder and reads the one named `a.obj`.
fn read_files(files: &[(&str, &[u8])]) -> Result<Model, String> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, contents) in files {
        std::fs::write(folder.path().join(name), contents).expect("a file");
    }
    let read = load_obj(&folder.path().join("a.obj"), u64::MAX, DVec3::ZERO, true);
    let shown = format!("{}/", folder.path().display());
    read.map_err(|error| error.to_string().replace(&shown, ""))
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";

/// The only warning about files, and the only material.
fn warned(files: &[(&str, &[u8])]) -> (String, Material) {
    let model = read_files(files).expect("a model");
    let [warning] = &model.warnings[..] else {
        panic!("{:?}", model.warnings);
    };
    assert_eq!((model.materials.len(), model.shapes.len()), (1, 1));
    let start = warning.place.rfind('/').map_or(0, |slash| slash + 1);
    let warning = warning.to_string()[start..].to_owned();
    (warning, model.materials[0].clone())
}

/// Diffuse colour of a material without an image.
fn diffuse(material: &Material) -> [f32; 3] {
    let kd = match material {
        Material::Matte(Matte { kd, .. }) => kd,
        Material::Metallic(Metallic { color, .. }) => color,
        other => panic!("{other:?}"),
    };
    kd.constant().expect("no image").to_array()
}

#[test]
fn missing_libraries_materials_and_images_are_warnings_with_places() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl red\nf 1/1 2/2 3/3\n");
    let obj = ("a.obj", obj.as_bytes());
    let (warning, material) = warned(&[obj]);
    let start = "a.obj:1:8: warning: cannot read `a.mtl`: ";
    assert!(warning.starts_with(start), "{warning}");
    assert_eq!(material, plain_material());
    let (warning, material) = warned(&[obj, ("a.mtl", b"newmtl Red\nKd 1 0 0")]);
    let expected =
        "a.obj:8:1: warning: there is no material `red`; did you mean `Red`?; it is plain grey";
    assert_eq!(warning, expected);
    assert_eq!(material, plain_material());
    for (kd, expected) in [("", 0.6), ("Kd 0 0 0\n", 0.6), ("Kd .5 .5 .5\n", 0.3)] {
        let mtl = format!("newmtl red\n{kd} map_Kd -s 2 2 1 no such.png\n");
        let (warning, material) = warned(&[obj, ("a.mtl", mtl.as_bytes())]);
        let line = mtl.lines().count();
        let start = format!("a.mtl:{line}:18: warning: cannot read image `no such.png`: ");
        assert!(warning.starts_with(&start), "{warning}");
        assert_eq!(diffuse(&material), [expected; 3]);
    }
    let mtl = b"newmtl red\nKd 1 0 0\nmap_d t.gif\n";
    let (warning, material) = warned(&[obj, ("a.mtl", mtl), ("t.gif", b"GIF89a")]);
    assert!(warning.contains("a.mtl:3:7: warning: "), "{warning}");
    assert!(warning.contains("format is not supported"), "{warning}");
    assert_eq!(diffuse(&material), [1.0, 0.0, 0.0]);
}

#[test]
fn what_a_library_lacks_is_a_warning_and_a_damaged_image_an_error() {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl red\nf 1/1 2/2 3/3\n");
    let mtl = b"\xef\xbb\xbfKd 1\nnewmtl red\nKt 0 0 0\nKd 1 0 zero\nKs\nKe spectral a\nmap_Kd\nmap_Ks -odd a\nKt 1\nKd 1 \\\n 0 0\n";
    let model = read_files(&[("a.obj", obj.as_bytes()), ("a.mtl", mtl)]).expect("a model");
    let named = |warning: &Warning| warning.to_string().rsplit('/').next().map(str::to_owned);
    let found: Vec<String> = model.warnings.iter().filter_map(named).collect();
    let expected = [
        "a.mtl:1:1: warning: there is no `newmtl` before it; `Kd` is left out",
        "a.mtl:3:1: warning: `Kt` is unknown or not supported, and is left out (the first of 2 places)",
        "a.mtl:4:8: warning: `zero` is not a finite number; `Kd` is left out",
        "a.mtl:5:1: warning: a number is needed here; `Ks` is left out",
        "a.mtl:6:4: warning: colours as `spectral` are not supported; `Ke` is left out",
        "a.mtl:7:1: warning: the name of an image is needed here; `map_Kd` is left out",
        "a.mtl:8:8: warning: option `-odd` is unknown or lacks its value; `map_Ks` is left out",
    ];
    assert_eq!(found, expected);
    assert_eq!(diffuse(&model.materials[0]), [1.0, 0.0, 0.0]);
    // Whoever wants no looks reads no other file.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.obj");
    std::fs::write(&path, &obj).expect("a file");
    let plain = load_obj(&path, u64::MAX, DVec3::ZERO, false).expect("a model");
    assert_eq!((plain.warnings.len(), plain.files.len()), (0, 0));
    assert_eq!(plain.names, model.names);
    let mtl = b"newmtl red\n map_Kd -s 2 2 1 cut.png\n";
    let cut = &antumbra_testkit::picture::png(2, 2, 4, &[128; 16])[..40];
    let files: [(&str, &[u8]); 3] = [("a.obj", obj.as_bytes()), ("a.mtl", mtl), ("cut.png", cut)];
    let error = read_files(&files).expect_err("half an image");
    assert!(
        error.starts_with("a.mtl:2:18: error: cannot read image `cut.png`: "),
        "{error}"
    );
}

/// Material of a library with one material of these statements, and the notes.
fn material(statements: &str) -> (Material, Vec<String>, bool) {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n");
    let mtl = format!("newmtl m\n{statements}");
    let png = antumbra_testkit::picture::png(2, 2, 4, &[128; 16]);
    let files: [(&str, &[u8]); 3] = [
        ("a.obj", obj.as_bytes()),
        ("a.mtl", mtl.as_bytes()),
        ("t.png", &png),
    ];
    let model = read_files(&files).expect("a model");
    let has_mask = model.shapes[0].alpha.is_some();
    (model.materials[0].clone(), model.notes, has_mask)
}

#[test]
fn highlights_lie_over_the_diffuse_colour() {
    let red = [0.8, 0.05, 0.05];
    for (ks, ns, illum) in [
        (1.0_f32, "", ""),
        (1.0, "Ns 0", "illum 2"),
        (0.5, "Ns 96.078431", "illum 2"),
        (0.25, "Ns -1.960784", ""),
        (7.0, "Ns 1000", "illum 2"),
    ] {
        let text = format!("Kd .8 .05 .05\nKs {ks} {ks} {ks}\n{ns}\n{illum}\n");
        let Material::Metallic(Metallic {
            color,
            metallic,
            roughness,
            coat,
            transmission,
        }) = material(&text).0
        else {
            panic!("{text}");
        };
        assert_eq!(color.constant().expect("a colour").to_array(), red);
        assert_eq!(metallic.constant(), Some(&0.0));
        assert_eq!(transmission.constant(), Some(&0.0));
        // No more than twice the reflectance of glass, even where Ks is beyond 1.
        let coat = coat.constant().expect("a colour").x;
        assert!((coat - 0.08 * ks.min(1.0)).abs() < 1e-6, "{coat}");
        let expected = match ns {
            "" => 0.5,
            "Ns 96.078431" => (2.0_f32 / 98.078_43).powf(0.25),
            "Ns 1000" => (2.0_f32 / 1002.0).powf(0.25),
            _ => 1.0,
        };
        let roughness = roughness.constant().expect("a number");
        assert!((roughness - expected).abs() < 1e-5, "{text}: {roughness}");
    }
    for illum in ["illum 0", "illum 1"] {
        let (found, ..) = material(&format!("Kd .8 .05 .05\nKs 1 1 1\n{illum}"));
        assert!(matches!(found, Material::Matte(_)), "{found:?}");
    }
}

#[test]
fn mirrors_and_metals_are_in_the_colour_of_the_highlight() {
    for illum in [3, 5, 8] {
        let (found, ..) = material(&format!("Kd .1\nKs .9 .8 .7\nillum {illum}"));
        let Material::Substrate(Substrate { ks, roughness, .. }) = found else {
            panic!("{found:?}");
        };
        assert_eq!(ks.constant(), Some(&glam::Vec3::new(0.9, 0.8, 0.7)));
        assert!(roughness[0].constant().is_some_and(|&alpha| alpha < 0.05));
    }
    // Without a diffuse colour: gold, but not black plastic.
    for (ks, metal) in [([0.9, 0.8, 0.3], 1.0), ([0.5; 3], 0.0)] {
        let [r, g, b] = ks;
        let (found, ..) = material(&format!("Kd 0 0 0\nKs {r} {g} {b}\nillum 2"));
        let Material::Metallic(Metallic {
            color, metallic, ..
        }) = found
        else {
            panic!("{found:?}");
        };
        assert_eq!(metallic.constant(), Some(&metal));
        let expected = ks.map(|x| x * metal);
        assert_eq!(color.constant().expect("a colour").to_array(), expected);
    }
}

#[test]
fn an_image_over_black_is_the_image() {
    let textured = |material: &Material| match material {
        Material::Metallic(Metallic { color, .. }) => match color {
            Param::Texture(texture) => matches!(&**texture, Texture::Image(_)),
            Param::Constant(_) => false,
        },
        _ => false,
    };
    for kd in ["0 0 0", "1 1 1"] {
        let (found, ..) = material(&format!("Kd {kd}\nKs 1 1 1\nmap_Kd t.png"));
        assert!(textured(&found), "{found:?}");
    }
}

#[test]
fn models_that_are_clear_by_the_letter_are_opaque() {
    for (text, said) in [("Tr 1.000000", "`Tr 1.000000`"), ("d 0", "`d 0`")] {
        let (_, notes, has_mask) = material(&format!("Kd 1 0 0\n  {text} # so it is\n"));
        assert!(!has_mask);
        let [note] = &notes[..] else {
            panic!("{notes:?}");
        };
        let start = format!("every material is wholly transparent ({said} in ");
        assert!(note.starts_with(&start), "{note}");
        let end = "a.mtl:3:3): all are taken as opaque";
        assert!(note.ends_with(end), "{note}");
    }
    let (_, notes, has_mask) = material("Tr 0.75\n");
    assert!(has_mask && notes.is_empty(), "partly clear: {notes:?}");
    let (_, notes, has_mask) = material("Tr 1\nd 1\n");
    assert!(!has_mask && notes[0].contains("contradict"), "{notes:?}");
    let (_, notes, has_mask) = material("d .25\nTr .75\n");
    assert!(has_mask && notes.is_empty(), "{notes:?}");

    // Two materials of which one can be seen: the other one is meant to be clear.
    let mut obj = format!("mtllib a.mtl\n{TRIANGLE}");
    obj += "usemtl a\nf 1 2 3\nusemtl b\nf 3 2 1\n";
    let mtl = b"newmtl a\nTr 1\nnewmtl b\nTr 0\n";
    let model = read_files(&[("a.obj", obj.as_bytes()), ("a.mtl", mtl)]).expect("a model");
    assert!(model.shapes[0].alpha.is_some() && model.shapes[1].alpha.is_none());
    assert!(model.notes.is_empty(), "{:?}", model.notes);
}

#[test]
fn statements_of_libraries_become_materials() {
    let png = antumbra_testkit::picture::png(2, 2, 4, &[128; 16]);
    let mtl = b"newmtl dull\nKd .9 .05 .05\nillum 1\nKs 1 1 1\nKa 1 1 1\n\
        newmtl shiny # comment\nKd .5\nKs .2 .2 .2\nNs 98\nillum 2\nd .25\n\
        newmtl glass\nillum 7\nNi 1.4\nTf .9 .9 1\nd 0.1\n\
        newmtl lamp\nKe 3 2 1\nmap_Ke t.png\nrefl x\n\
        newmtl gold\nPm 1\nPr .3\nmap_Kd t.png\nmap_d t.png\nmap_Bump -bm .5 t.png\n";
    let mut obj = format!("mtllib a.mtl\n{TRIANGLE}");
    for name in ["dull", "shiny", "glass", "lamp", "gold"] {
        obj += &format!("usemtl {name}\nf 1/1 2/2 3/3\n");
    }
    let files: [(&str, &[u8]); 3] = [("a.obj", obj.as_bytes()), ("a.mtl", mtl), ("t.png", &png)];
    let model = read_files(&files).expect("a model");
    let [dull, shiny, glass, _, gold] = &model.materials[..] else {
        panic!("{} materials", model.materials.len());
    };
    let Material::Matte(Matte { kd, .. }) = dull else {
        panic!("{dull:?}");
    };
    assert_eq!(kd.constant(), Some(&glam::Vec3::new(0.9, 0.05, 0.05)));
    let Material::Metallic(Metallic { roughness, .. }) = shiny else {
        panic!("{shiny:?}");
    };
    // The exponent 98 is alpha sqrt(2 / 100), the square of the roughness.
    let roughness = roughness.constant().expect("a number");
    assert!((roughness * roughness - 0.141_421).abs() < 1e-5);
    assert!(model.shapes[1].alpha.is_some() && model.shapes[0].alpha.is_none());
    assert!(matches!(glass, Material::Glass(_)));
    assert!(model.shapes[2].alpha.is_none(), "clear by its material");
    let lamp = model.shapes[3].area_light.as_ref().expect("a lamp");
    assert_eq!(lamp.radiance, glam::Vec3::new(3.0, 2.0, 1.0));
    assert!(lamp.texture.is_some());
    let Material::NormalMapped(NormalMapped {
        material, scale, ..
    }) = gold
    else {
        panic!("{gold:?}");
    };
    assert!(matches!(**material, Material::Metallic(_)));
    assert_eq!(*scale, 0.5);
    // The mask is the alpha channel, 128 of 255.
    let Some(Param::Texture(mask)) = &model.shapes[4].alpha else {
        panic!("no mask");
    };
    let Texture::Dither(Param::Texture(value)) = &**mask else {
        panic!("{mask:?}");
    };
    let Texture::Image(image) = &**value else {
        panic!("{value:?}");
    };
    assert_eq!(
        image.image.pixels,
        antumbra_scene::Pixels::Grey8(vec![128; 4])
    );
    let [warning] = &model.warnings[..] else {
        panic!("{:?}", model.warnings);
    };
    assert!(warning.text.contains("`refl`"), "{warning}");
    assert_eq!(model.files.len(), 2);
}

#[test]
fn files_without_text_are_not_read() {
    let folder = std::env::temp_dir().join(format!("antumbra-obj-{}", std::process::id()));
    let file = std::fs::File::create(&folder).expect("a file");
    file.set_len(1 << 40).expect("a sparse file");
    let error = load_obj(&folder, u64::MAX, DVec3::ZERO, true)
        .expect_err("no text")
        .to_string();
    std::fs::remove_file(&folder).expect("removed");
    assert!(error.contains("not an OBJ file: byte 0 is 0"), "{error}");
}

/// Random files: corners of a mesh refer to existing vertices, whatever the numbers.
///
/// The random numbers use the multiplier of Knuth's MMIX.
#[test]
fn damaged_files_are_errors_or_other_meshes() {
    let words = [
        "v 1 2 3\n",
        "v nan -inf 1e99",
        "f ",
        " 1",
        " -1",
        " 2/9223372036854775807/3",
        "/",
        "//",
        " -9223372036854775808",
        " 6148914691236517206//-6148914691236517207",
        "vt 1\n",
        "vn 1 2 3\n",
        "\n",
        "#",
        "mtllib x\n",
        "usemtl\n",
        "o\n",
        "\r\n",
        "\u{85}",
        " 18446744073709551616",
    ];
    let seed = 1u64;
    println!("seed {seed}");
    let mut state = seed;
    let mut good = 0;
    for round in 0..20_000 {
        let mut text = "v 0 0 0\nv 1 0 0\n".to_owned();
        for _ in 0..12 {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            text += words[(state >> 33) as usize % words.len()];
        }
        if let Ok(model) = read(text.as_bytes()) {
            for shape in &model.shapes {
                let mesh = mesh(shape);
                let vertices = mesh.positions.len();
                let mut corners = mesh.indices.iter().flatten();
                let inside = corners.all(|&corner| (corner as usize) < vertices);
                assert!(inside, "round {round}: {text}");
            }
            good += 1;
        }
    }
    assert!(good > 0);
}

#[test]
fn triangles_have_the_names_of_their_objects_or_groups() {
    let faces = "f 1 2 3\n";
    let names = |text: &str| {
        let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n{text}");
        let model = parse_obj(obj.as_bytes(), Path::new("a.obj")).expect("a model");
        let part =
            |part: &crate::Part| (part.object.clone(), part.material.clone(), part.triangles);
        let parts = model
            .names
            .shapes
            .iter()
            .map(|parts| parts.iter().map(part).collect());
        parts.collect::<Vec<Vec<_>>>()
    };
    let part = |object: &str, material: &str, triangles| {
        (object.to_owned(), material.to_owned(), triangles)
    };
    assert_eq!(names(faces), [vec![part("", "", 1)]]);
    // Groups count in a file without objects, and names may come again.
    let groups =
        format!("g a wall\n{faces}f 1 2 4 3\ng b\n{faces}usemtl m\n{faces}g a wall\n{faces}");
    let wanted = [
        vec![part("a wall", "", 3), part("b", "", 1)],
        vec![part("b", "m", 1), part("a wall", "m", 1)],
    ];
    assert_eq!(names(&groups), wanted);
    let objects = format!("{faces}o house\ng a\n{faces}g b\n{faces}o\n{faces}");
    let wanted = vec![
        part("", "", 1),
        part("house", "", 1),
        part("house", "", 1),
        part("", "", 1),
    ];
    assert_eq!(names(&objects), [wanted]);
}
