//! Generated files: valid ones in every packing, and one for every mistake.

use antumbra_scene::material::{Metallic, NormalMapped};
use antumbra_scene::{Geometry, Material, Param, Rgb, Texture};
use glam::Vec3;

use ::gltf::mesh::Mode;

use super::reader::triangles;
use glam::DVec3;

use super::*;

/// Buffer 0 of a square of two triangles: 48 bytes of positions, then 6 indices of 16 bits.
fn square() -> Vec<u8> {
    let positions: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
    let positions = positions.iter().flatten().flat_map(|x| x.to_le_bytes());
    let indices = [0u16, 1, 2, 0, 2, 3];
    let indices = indices.iter().flat_map(|i| i.to_le_bytes());
    positions.chain(indices).collect()
}

/// JSON of the square. `uri` is the whole member, or empty.
fn json(uri: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
        "nodes": [{{"children": [1], "translation": [10, 0, 0]}}, {{"mesh": 0, "scale": [2, 2, 2]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [0.5, 0.25, 0.125, 1]}}}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "material": 0}},
            {{"attributes": {{"POSITION": 0}}, "mode": 6}}, {{"attributes": {{"POSITION": 0}}, "mode": 1}}]}}],
        "extensionsRequired": ["KHR_materials_sheen"],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
            {{"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 12}}],
        "buffers": [{{{uri} "byteLength": 60}}]}}"#
    )
}

fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + json.len() + 8 + binary.len();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((length as u32).to_le_bytes());
    for (kind, data) in [(b"JSON", &json[..]), (b"BIN\0", binary)] {
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(data);
    }
    bytes
}

fn encode(bytes: &[u8]) -> String {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |group: &[u8]| {
        let mut three = [0; 4];
        three[1..=group.len()].copy_from_slice(group);
        let bits = u32::from_be_bytes(three);
        let digit = |i: usize| char::from(DIGITS[(bits >> (18 - 6 * i)) as usize & 63]);
        (0..4)
            .map(|i| if i <= group.len() { digit(i) } else { '=' })
            .collect::<String>()
    };
    bytes.chunks(3).map(group).collect()
}

/// Reads a file from a folder with other files.
fn read_files(bytes: &[u8], others: &[(&str, &[u8])]) -> Result<Model, Vec<String>> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in others {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    parse(bytes, folder.path(), u64::MAX, DVec3::ZERO, true)
}

#[test]
fn the_same_scene_in_every_packing() {
    let data = format!(
        r#""uri": "data:application/octet-stream;base64,{}","#,
        encode(&square())
    );
    let results = [
        read_files(&glb(&json(""), &square()), &[]),
        read_files(
            json(r#""uri": "the%20data.bin","#).as_bytes(),
            &[("the data.bin", &square())],
        ),
        read_files(json(&data).as_bytes(), &[]),
    ];
    for result in results {
        let model = result.expect("a good file");
        let (shapes, materials) = (&model.shapes, &model.materials);
        assert_eq!(shapes.len(), 2, "lines are no shape");
        assert_eq!(materials.len(), 2);
        let Material::Metallic(Metallic {
            color, metallic, ..
        }) = &materials[0]
        else {
            panic!("{:?}", materials[0]);
        };
        assert_eq!(color, &Rgb::new(0.5, 0.25, 0.125).into());
        assert_eq!(metallic, &1.0.into(), "the default of glTF");
        assert_eq!(materials[1], crate::plain_material());
        assert_eq!(model.notes, ["points and lines are left out"]);
        assert_eq!(shapes[0].material, 0);
        assert_eq!(shapes[1].material, 1);
        for shape in shapes {
            let Geometry::Mesh(mesh) = &shape.geometry else {
                panic!("a mesh")
            };
            assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3]]);
            assert_eq!(mesh.positions[2], [12.0, 2.0, 0.0]);
        }
    }
}

#[test]
fn strips_keep_their_orientation() {
    assert_eq!(
        triangles(Mode::TriangleStrip, &[0, 1, 2, 3]),
        [[0, 1, 2], [2, 1, 3]]
    );
    assert_eq!(triangles(Mode::Triangles, &[0, 1, 2, 3, 4]), [[0, 1, 2]]);
    assert_eq!(triangles(Mode::TriangleFan, &[0, 1]), [[0u32; 3]; 0]);
}

#[test]
fn every_mistake_is_named() {
    let good = json("");
    let cases = [
        (
            r#""version": "2.0""#,
            r#""version": "1.0""#,
            "version `1.0`",
        ),
        (r#""scene": 0"#, r#""scene": 7"#, "scene: Index out"),
        (
            r#""nodes": [0]"#,
            r#""nodes": [9]"#,
            "scenes[0].nodes[0]: Index out",
        ),
        (
            r#""children": [1]"#,
            r#""children": [0]"#,
            "its own ancestor",
        ),
        (r#""mesh": 0"#, r#""mesh": 3"#, "nodes[1].mesh: Index out"),
        (
            r#""material": 0"#,
            r#""material": 4"#,
            "primitives[0].material: Index out",
        ),
        (
            r#""indices": 1"#,
            r#""indices": 0"#,
            "accessor 0 holds Vec3 of F32, not Scalar of",
        ),
        (
            r#""indices": 1"#,
            r#""indices": 5"#,
            "primitives[0].indices: Index out",
        ),
        (
            r#""count": 4"#,
            r#""count": 5"#,
            "accessor 0 has 5 elements",
        ),
        (
            r#""count": 4"#,
            r#""count": 18446744073709551615"#,
            "more than fit in the 48 bytes",
        ),
        (
            r#""count": 4"#,
            r#""count": 3"#,
            "vertex 3 is used, but there are only 3",
        ),
        (
            r#""byteLength": 48"#,
            r#""byteLength": 480"#,
            "bufferView 0 has 480 bytes",
        ),
        (
            r#""byteLength": 60"#,
            r#""byteLength": 61"#,
            "buffer 0: the buffer declares 61 bytes",
        ),
        (
            r#""count": 4"#,
            r#""count": 0"#,
            "vertex 0 is used, but there are only 0",
        ),
        (
            r#""count": 6"#,
            r#""byteOffset": 18446744073709551615, "count": 6"#,
            "accessor 1 has 6 elements",
        ),
        (
            r#""count": 6"#,
            r#""count": 6, "sparse": {"count": 1, "indices": {"bufferView": 0, "byteOffset": 14, "componentType": 5123},
                "values": {"bufferView": 1}}"#,
            "accessor 1 has 6 elements, but its sparse list changes element 16256",
        ),
        (
            r#""count": 6"#,
            r#""count": 6, "sparse": {"count": 7, "indices": {"bufferView": 1, "componentType": 5123},
                "values": {"bufferView": 1}}"#,
            "accessor 1 has 7 elements, more than fit in the 12 bytes",
        ),
        (
            r#""byteLength": 48"#,
            r#""byteStride": 8, "byteLength": 48"#,
            "a stride of 8 bytes, less than its elements of 12 bytes",
        ),
        (
            r#""byteOffset": 48"#,
            r#""byteOffset": 18446744073709551615"#,
            "bufferView 1 has 12 bytes",
        ),
        (
            r#""count": 4"#,
            r#""min": ["a"], "count": 4"#,
            "attributes[\"POSITION\"].min: Invalid",
        ),
        (
            r#""POSITION": 0"#,
            r#""POSITION": 7"#,
            "mesh 0, primitive 0: accessor 7 is used, but there are only 2 accessors",
        ),
        (
            r#""POSITION": 0"#,
            r#""POSITION": 0, "NORMAL": 1"#,
            "accessor 1 holds Scalar of U16, not Vec3",
        ),
        (
            r#""componentType": 5126"#,
            r#""componentType": 5125"#,
            "accessor 0 holds Vec3 of U32",
        ),
        (
            r#""mode": 6"#,
            r#""mode": 8"#,
            "primitives[1].mode: Invalid",
        ),
        (
            r#""KHR_materials_sheen"#,
            r#""VENDOR_shape"#,
            "requires the extension VENDOR_shape, which is not supported",
        ),
        (
            r#""asset": {"version": "2.0"},"#,
            "",
            "JSON: missing field `asset`",
        ),
    ];
    for (from, to, hint) in cases {
        let broken = good.replacen(from, to, 1);
        assert_ne!(broken, good);
        let mistakes = read_files(&glb(&broken, &square()), &[]).expect_err(hint);
        assert!(
            mistakes.iter().any(|text| text.contains(hint)),
            "{hint}: {mistakes:?}"
        );
    }
}

#[test]
fn buffers_that_are_not_there_are_named() {
    let cases = [
        ("", "no binary chunk"),
        (r#""uri": "a%20b.bin","#, "a b.bin: "),
        (r#""uri": "%ff.bin","#, "`%ff.bin` is not the name"),
        (r#""uri": "https://example.org/a.bin","#, "is not the name"),
        (r#""uri": "data:;base64","#, "comma"),
        (r#""uri": "data:;base64,A","#, "lone alphabet symbol"),
        (r#""uri": "data:;base64,AA-_","#, "not expected"),
        (
            r#""uri": "data:;base64,AAAA","#,
            "declares 60 bytes, but its data has only 3",
        ),
    ];
    for (uri, hint) in cases {
        let mistakes = read_files(json(uri).as_bytes(), &[]).expect_err(hint);
        assert!(mistakes[0].starts_with("buffer 0: "), "{mistakes:?}");
        assert!(mistakes[0].contains(hint), "{hint}: {mistakes:?}");
    }
}

#[test]
fn broken_glb_headers_are_errors() {
    let good = glb(&json(""), &square());
    // Text to replace, its replacement, and words of the message.
    let cases: [(usize, &[u8], &str); 5] = [
        (4, &[1], "version"),
        (8, &[11, 0, 0, 0], "shorter than its header"),
        (8, &[255; 4], "ends early"),
        (12, &[255; 4], "JSON chunk length"),
        (16, b"BIN\0", "not expecting BIN"),
    ];
    let mistakes = read_files(&[], &[]).expect_err("nothing");
    assert_eq!(mistakes, ["the file is empty"]);
    let mistakes = read_files(&good[..good.len() - 8], &[]).expect_err("a part");
    assert!(mistakes[0].contains("ends early"), "{mistakes:?}");
    for (place, bytes, hint) in cases {
        let mut broken = good.clone();
        broken[place..][..bytes.len()].copy_from_slice(bytes);
        let mistakes = read_files(&broken, &[]).expect_err(hint);
        assert!(mistakes[0].contains(hint), "{hint}: {mistakes:?}");
    }
}

#[test]
fn a_file_without_scenes_starts_with_its_roots() {
    let text = json("").replacen(r#""scene": 0, "scenes": [{"nodes": [0]}],"#, "", 1);
    let model = read_files(&glb(&text, &square()), &[]).expect("a good file");
    let Geometry::Mesh(mesh) = &model.shapes[0].geometry else {
        panic!("a mesh")
    };
    assert_eq!(mesh.positions[2], [12.0, 2.0, 0.0]);
}

/// Damaged files never panic, wherever bytes are cut off or changed.
///
/// The random numbers use the multiplier of Knuth's MMIX.
#[test]
fn damaged_files_are_errors_or_other_scenes() {
    damage(&glb(&json(""), &square()), 2, 20_000);
    for ((json, more), shapes) in [(skinned(), 1), (morphed(), 2), (instanced(), 0)] {
        damage(&triangle(&json, &more), shapes, 5_000);
    }
}

/// Reads a file of so many shapes in parts, and with so many random changes.
fn damage(good: &[u8], shapes: usize, rounds: usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let read_bytes = |bytes: &[u8]| {
        parse(bytes, folder.path(), u64::MAX, DVec3::ZERO, true).map(|model| model.shapes.len())
    };
    assert_eq!(read_bytes(good), Ok(shapes));
    for length in 0..good.len() {
        assert!(read_bytes(&good[..length]).is_err(), "{length}");
    }
    let seed = 1u64;
    println!("seed {seed}");
    let mut state = seed;
    let mut read = 0;
    for round in 0..rounds {
        let mut bytes = good.to_vec();
        for _ in 0..3 {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            let place = (state >> 33) as usize % bytes.len();
            let byte = (state >> 24) as u8;
            // Digits change the meaning of JSON without breaking its syntax.
            bytes[place] = if round % 4 == 0 {
                byte
            } else {
                b'0' + byte % 10
            };
        }
        read += usize::from(read_bytes(&bytes).is_ok());
    }
    assert!(read > 0);
}

/// Refusal of a thousand nodes with one mesh, which would take a thousand times its memory.
#[test]
fn meshes_that_are_named_often_stay_within_the_memory_allowed() {
    let many =
        |count: usize, node: &str| {
            let nodes: Vec<_> = (0..count).map(|i| i.to_string()).collect();
            let node = vec![node; count].join(",");
            let text = json("")
            .replace(r#"[{"nodes": [0]}]"#, &format!(r#"[{{"nodes": [{}]}}]"#, nodes.join(",")))
            .replace(
                r#"{"children": [1], "translation": [10, 0, 0]}, {"mesh": 0, "scale": [2, 2, 2]}"#,
                &node,
            );
            let read = parse(
                &glb(&text, &square()),
                Path::new(""),
                50_000,
                DVec3::ZERO,
                true,
            );
            read.map(|model| (model.shapes.len(), model.instances.len()))
        };
    assert_eq!(many(100, r#"{"mesh": 0}"#), Ok((0, 100)));
    // A mesh without depth has no inverse, so it is copied.
    let flat = r#"{"mesh": 0, "scale": [1, 1, 0]}"#;
    assert_eq!(many(80, flat), Ok((160, 0)));
    let mistakes = many(300, flat).expect_err("too much");
    assert!(
        mistakes[0].contains("of the memory allowed"),
        "{}",
        mistakes[0]
    );
}

/// A few bytes of JSON become hundreds: the memory is counted before the JSON is read.
#[test]
fn the_json_stays_within_the_memory_allowed() {
    let nodes = vec!["{}"; 10_000].join(",");
    let text = format!(r#"{{"asset": {{"version": "2.0"}}, "nodes": [{nodes}]}}"#);
    assert!(parse(text.as_bytes(), Path::new(""), 4 << 20, DVec3::ZERO, true).is_ok());
    let mistakes =
        parse(text.as_bytes(), Path::new(""), 1 << 20, DVec3::ZERO, true).expect_err("too much");
    assert!(mistakes[0].contains("the JSON needs"), "{}", mistakes[0]);
}

/// Reads the generated model with all kinds of textures.
fn all_textures() -> Model {
    let bytes = antumbra_testkit::model::all_textures();
    let read = parse_gltf(&bytes, Path::new("/nowhere/model.glb"), 1 << 26);
    read.expect("a good file")
}

#[test]
fn all_kinds_of_textures_are_read() {
    let model = all_textures();
    assert_eq!(
        model.notes,
        [
            "extension KHR_materials_sheen is not supported and is left out",
            "occlusion textures are left out: light is traced",
        ]
    );
    let with = |wanted: fn(&Material) -> bool| model.materials.iter().filter(|m| wanted(m)).count();
    assert_eq!(with(|m| matches!(m, Material::NormalMapped(_))), 1);
    assert_eq!(with(|m| matches!(m, Material::Glass(_))), 1);
    let mapped = model.materials.iter().find_map(|material| match material {
        Material::NormalMapped(NormalMapped {
            material, scale, ..
        }) => Some((&**material, *scale)),
        _ => None,
    });
    let Some((
        Material::Metallic(Metallic {
            color,
            metallic,
            roughness,
            ..
        }),
        scale,
    )) = mapped
    else {
        panic!("{mapped:?}");
    };
    assert_eq!(scale, 0.5);
    for texture in [metallic, roughness] {
        let Param::Texture(texture) = texture else {
            panic!("a constant");
        };
        assert!(matches!(&**texture, Texture::Image(image) if !image.gamma));
    }
    let Param::Texture(color) = color else {
        panic!("a constant");
    };
    assert!(matches!(&**color, Texture::Image(image) if image.gamma));
    let masks: Vec<_> = model
        .shapes
        .iter()
        .filter_map(|shape| shape.alpha.as_ref())
        .collect();
    assert_eq!(masks.len(), 2, "one MASK, one BLEND");
    let lamps: Vec<_> = model
        .shapes
        .iter()
        .filter_map(|shape| shape.area_light.as_ref())
        .collect();
    assert_eq!(lamps.len(), 1);
    assert_eq!(
        lamps[0].radiance,
        Vec3::splat(8.0),
        "the strength is a factor"
    );
    assert!(lamps[0].texture.is_some());
}

#[test]
fn nodes_with_one_mesh_are_instances() {
    let model = all_textures();
    assert_eq!((model.objects.len(), model.instances.len()), (1, 3));
    let moved = model.instances[1]
        .world_from_object
        .transform_point3(Vec3::ZERO);
    assert_ne!(
        moved,
        model.instances[0]
            .world_from_object
            .transform_point3(Vec3::ZERO)
    );
}

#[test]
fn cameras_and_lights_stand_where_their_nodes_are() {
    let model = all_textures();
    let view = model.camera.as_ref().expect("a camera");
    assert_eq!(view.aspect_ratio, Some(1.5));
    assert!((view.camera.fov - 40.0).abs() < 1e-3, "{}", view.camera.fov);
    let looks = view.camera.world_from_camera.transform_vector3(Vec3::Z);
    assert!((looks - Vec3::NEG_Z).length() < 1e-6, "{looks}");
    let [sun, point, spot] = &model.lights[..] else {
        panic!("{} lights", model.lights.len());
    };
    use antumbra_scene::Light;
    let Light::Distant { to_light, radiance } = sun else {
        panic!("{sun:?}");
    };
    assert!((*to_light - Vec3::Y).length() < 1e-6, "{to_light}");
    assert_eq!(*radiance, Vec3::new(3.0, 3.0, 1.5));
    assert!(
        matches!(point, Light::Point { position, .. } if *position == Vec3::new(1.0, 2.0, 3.0))
    );
    assert!(matches!(spot, Light::Spot { axis, .. } if *axis == Vec3::NEG_Z));
}

/// The mapping gives the coordinates of the extension's transform, turned upside down.
#[test]
fn transformed_coordinates_follow_the_extension() {
    let bytes = antumbra_testkit::model::all_textures();
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains("KHR_texture_transform"));
    let model = all_textures();
    let mask = model
        .shapes
        .iter()
        .find_map(|shape| match shape.alpha.as_ref()? {
            Param::Texture(texture) => match &**texture {
                Texture::AtLeast { value, .. } => Some(value),
                _ => None,
            },
            Param::Constant(_) => None,
        });
    let Some(Param::Texture(value)) = mask else {
        panic!("no mask");
    };
    let Texture::Image(image) = &**value else {
        panic!("{value:?}");
    };
    let antumbra_scene::Mapping::Affine { columns, offset } = image.mapping else {
        panic!("{:?}", image.mapping);
    };
    // Scale 2 and 3, a quarter turn, offset 0.25 and 0.5: u' = 3 v + 0.25 and v' = -2 u + 0.5.
    for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.3, 0.8)] {
        let found = columns[0] * u + columns[1] * (1.0 - v) + offset;
        let expected = glam::Vec2::new(3.0 * v + 0.25, 1.0 - (-2.0 * u + 0.5));
        assert!((found - expected).length() < 1e-5, "{found} {expected}");
    }
}

#[test]
fn missing_images_are_warnings_with_their_material() {
    let texture = r#""textures": [{"source": 0}], "images": [{"uri": "no.png"}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],"#;
    let text = json("")
        .replacen("\"materials\"", "\"unused\"", 1)
        .replacen("\"meshes\"", &format!("{texture} \"meshes\""), 1);
    let bytes = glb(&text, &square());
    let model = read_files(&bytes, &[]).expect("a model");
    let [warning] = &model.warnings[..] else {
        panic!("{:?}", model.warnings);
    };
    let start = "material 0: image 0: no.png: ";
    assert!(warning.text.starts_with(start), "{warning:?}");
    let Material::Metallic(Metallic { color, .. }) = &model.materials[0] else {
        panic!("{:?}", model.materials);
    };
    assert_eq!(color.constant(), Some(&Rgb::splat(0.6)), "plain grey");
    let model = parse_gltf(&bytes, Path::new("no/such.glb"), u64::MAX).expect("a model");
    let shown = model.warnings[0].to_string();
    assert!(
        shown.starts_with("no/such.glb: warning: material 0: image 0: no.png: "),
        "{shown}"
    );
    // Damaged images are errors.
    let mistakes = read_files(&bytes, &[("no.png", b"\x89PNG")]).expect_err("no image");
    assert_eq!(mistakes.len(), 1, "{mistakes:?}");
    assert!(mistakes[0].starts_with(start), "{mistakes:?}");
}

#[test]
fn invisible_surfaces_stay_only_if_nothing_else_is_there() {
    let material = r#""materials": [{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}}],"#;
    let text = json("")
        .replacen("\"materials\"", "\"unused\"", 1)
        .replacen("\"meshes\"", &format!("{material} \"meshes\""), 1);
    let masks = |text: &str| {
        let model = read_files(&glb(text, &square()), &[]).expect("a model");
        let masks = model.shapes.iter().map(|shape| shape.alpha.clone());
        masks.collect::<Vec<_>>()
    };
    // The fan has no material, so it can be seen.
    assert_eq!(masks(&text), [None]);
    let text = text.replace("\"mode\": 6", "\"mode\": 6, \"material\": 0");
    assert_eq!(masks(&text), [Some(0.0.into()), Some(0.0.into())]);
}

/// A GLB of a triangle with the corners 0, x and y, whose buffer goes on with these bytes. In the JSON, `VIEW` begins a view of
/// so many bytes from there.
fn triangle(json: &str, more: &[u8]) -> Vec<u8> {
    let corners = [[0.0_f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]];
    let corners = corners.iter().flatten().flat_map(|x| x.to_le_bytes());
    let bytes: Vec<u8> = corners.chain(more.iter().copied()).collect();
    let json = json.replace("VIEW", r#""buffer": 0, "byteOffset": 36, "byteLength""#);
    let start = format!(
        r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"byteLength": {}}}],
        "#,
        bytes.len()
    );
    glb(&json.replacen('{', &start, 1), &bytes)
}

fn floats(values: &[f32]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

/// All positions of the world, of shapes and of instances.
fn positions(model: &Model) -> Vec<[f32; 3]> {
    let of = |shape: &antumbra_scene::Shape| match &shape.geometry {
        Geometry::Mesh(mesh) => mesh.positions.clone(),
        Geometry::Sphere(_) | Geometry::Curves(_) => panic!("a mesh"),
    };
    let mut all: Vec<_> = model.shapes.iter().flat_map(of).collect();
    for instance in &model.instances {
        let shapes = model.objects[instance.object].shapes.iter();
        let moved = |point| {
            instance
                .world_from_object
                .transform_point3(Vec3::from(point))
                .to_array()
        };
        all.extend(shapes.flat_map(of).map(moved));
    }
    all
}

const ACCESSOR: &str = r#"{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}"#;
const CORNERS: &str = r#"{"buffer": 0, "byteLength": 36}"#;

/// A triangle with a skin whose joints are in no scene: its JSON and its bytes.
fn skinned() -> (String, Vec<u8>) {
    // Joint 2 is below node 1, which turns x to y, and both are in no scene. Its inverse matrix moves by -1 along x.
    let json = format!(
        r#"{{"scenes": [{{"nodes": [0]}}], "animations": [],
        "nodes": [{{"mesh": 0, "skin": 0, "translation": [10, 0, 0]}},
            {{"children": [2, 3], "rotation": [0, 0, 0.70710678, 0.70710678]}},
            {{"translation": [2, 0, 0]}}, {{"translation": [0, 0, 7], "scale": [2, 2, 2]}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "NORMAL": 4, "JOINTS_0": 1, "WEIGHTS_0": 2}}}}]}}],
        "skins": [{{"joints": [3, 2], "inverseBindMatrices": 3}}],
        "bufferViews": [{CORNERS}, {{VIEW: 12}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 48}},
            {{"buffer": 0, "byteOffset": 96, "byteLength": 128}}],
        "accessors": [{ACCESSOR}, {{"bufferView": 1, "componentType": 5121, "count": 3, "type": "VEC4"}},
            {{"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC4"}},
            {{"bufferView": 3, "componentType": 5126, "count": 2, "type": "MAT4"}}, {ACCESSOR}]}}"#
    );
    let mut more = vec![1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];
    more.extend(floats(&[1., 0., 0., 0., 0.5, 0.5, 0., 0., 2., 0., 0., 0.]));
    let identity = glam::Mat4::IDENTITY.to_cols_array();
    let moved = glam::Mat4::from_translation(Vec3::new(-1., 0., 0.)).to_cols_array();
    more.extend(floats(&[identity, moved].concat()));
    (json, more)
}

#[test]
fn skins_ignore_their_node_and_joints_need_not_be_shown() {
    let (json, more) = skinned();
    let model = read_files(&triangle(&json, &more), &[]).expect("a skin");
    assert!(model.notes.is_empty() && model.warnings.is_empty());
    // By joint 2: p + 1 along x, turned to y. By joint 3: twice p, turned, and 7 up. The second corner is their mean.
    let expected = [[0., 1., 0.], [0., 2., 3.5], [-1., 1., 0.]];
    let found = positions(&model);
    for (found, expected) in found.iter().zip(expected) {
        let apart = (Vec3::from(*found) - Vec3::from(expected)).length();
        assert!(apart < 1e-6, "{found:?} for {expected:?}");
    }
    let Geometry::Mesh(mesh) = &model.shapes[0].geometry else {
        panic!("a mesh")
    };
    // The normals are the positions: 0, x and y, turned.
    let turned = [Vec3::ZERO, Vec3::Y, Vec3::NEG_X];
    assert!(
        mesh.normals
            .iter()
            .zip(turned)
            .all(|(n, t)| (*n - t).length() < 1e-6)
    );
    let broken = json.replace(r#""joints": [3, 2]"#, r#""joints": [3]"#);
    let mistakes = read_files(&triangle(&broken, &more), &[]).expect_err("no joint 1");
    assert_eq!(
        mistakes,
        ["mesh 0, primitive 0: joint 1 is used, but the skin has only 1"]
    );
    // A primitive without joints is placed by its node.
    let plain = json.replace(r#""JOINTS_0": 1, "#, "");
    let model = read_files(&triangle(&plain, &more), &[]).expect("a mesh");
    assert_eq!(positions(&model)[0], [10., 0., 0.]);
}

/// A triangle with two targets, of which the second is sparse: its JSON and its bytes.
fn morphed() -> (String, Vec<u8>) {
    let json = format!(
        r#"{{"scenes": [{{"nodes": [0, 1]}}],
        "nodes": [{{"mesh": 0}}, {{"mesh": 0, "weights": [0, 4], "translation": [0, 0, 100]}}],
        "meshes": [{{"weights": [0.5, 0], "primitives": [{{"attributes": {{"POSITION": 0}},
            "targets": [{{"POSITION": 1}}, {{"POSITION": 2}}]}}]}}],
        "bufferViews": [{CORNERS}, {{VIEW: 36}}],
        "accessors": [{ACCESSOR}, {{"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"}},
            {{"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {{"count": 1,
                "indices": {{"bufferView": 0, "componentType": 5121}}, "values": {{"bufferView": 1}}}}}}]}}"#
    );
    (json, floats(&[0., 0., 4., 0., 0., 4., 0., 0., 8.]))
}

#[test]
fn morph_targets_have_the_weights_of_mesh_or_node() {
    let (json, more) = morphed();
    let model = read_files(&triangle(&json, &more), &[]).expect("targets");
    let expected = [
        [0., 0., 2.],
        [1., 0., 2.],
        [0., 1., 4.],
        [0., 0., 116.],
        [1., 0., 100.],
        [0., 1., 100.],
    ];
    assert_eq!(positions(&model), expected);
    assert!(model.notes.is_empty() && model.warnings.is_empty());
}

/// A triangle in two places by `EXT_mesh_gpu_instancing`: its JSON and its bytes.
fn instanced() -> (String, Vec<u8>) {
    let json = format!(
        r#"{{"scenes": [{{"nodes": [0]}}], "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "nodes": [{{"mesh": 0, "scale": [2, 2, 2], "extensions": {{"EXT_mesh_gpu_instancing": {{"attributes":
            {{"TRANSLATION": 1, "ROTATION": 2, "_ID": 1}}}}}}}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
        "bufferViews": [{CORNERS}, {{VIEW: 24}}, {{"buffer": 0, "byteOffset": 60, "byteLength": 16}}],
        "accessors": [{ACCESSOR}, {{"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC3"}},
            {{"bufferView": 2, "componentType": 5122, "normalized": true, "count": 2, "type": "VEC4"}}]}}"#
    );
    let mut more = floats(&[5., 0., 0., 0., 0., -1.]);
    for turn in [[0_i16, 0, 0, 32767], [0, 0, 32767, 0]] {
        more.extend(turn.iter().flat_map(|x| x.to_le_bytes()));
    }
    (json, more)
}

#[test]
fn instances_of_an_extension_are_instances() {
    let (json, more) = instanced();
    let model = read_files(&triangle(&json, &more), &[]).expect("instances");
    assert_eq!(
        (
            model.shapes.len(),
            model.objects.len(),
            model.instances.len()
        ),
        (0, 1, 2)
    );
    assert!(model.notes.is_empty() && model.warnings.is_empty());
    let expected = [
        [10., 0., 0.],
        [12., 0., 0.],
        [10., 2., 0.],
        [0., 0., -2.],
        [-2., 0., -2.],
        [0., -2., -2.],
    ];
    for (found, expected) in positions(&model).iter().zip(expected) {
        assert!(
            (Vec3::from(*found) - Vec3::from(expected)).length() < 1e-5,
            "{found:?}"
        );
    }
    let broken = json.replace(
        r#"5122, "normalized": true, "count": 2"#,
        r#"5122, "count": 1"#,
    );
    let mistakes = read_files(&triangle(&broken, &more), &[]).expect_err("lengths");
    assert!(mistakes[0].contains("different lengths"), "{mistakes:?}");
    let hidden = json.replace(
        r#""extensions": {"#,
        r#""extensions": {"KHR_node_visibility": {"visible": false}, "#,
    );
    assert_eq!(
        read_files(&triangle(&hidden, &more), &[])
            .expect("nothing")
            .triangles(),
        0
    );
}

#[test]
fn quantized_sparse_and_absent_numbers_are_read() {
    let with = |kind: u32, more: &str, size: usize| {
        let kind = format!(r#""componentType": {kind}, "count": 3, "type": "VEC3""#);
        format!(
            r#"{{"scenes": [{{"nodes": [0]}}], "extensionsRequired": ["KHR_mesh_quantization"],
            "extensionsUsed": ["KHR_mesh_quantization"],
            "nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "bufferViews": [{{VIEW: {size}}}, {CORNERS}], "accessors": [{{{more} {kind}}}]}}"#
        )
    };
    let view = r#""bufferView": 0,"#;
    let normalized = r#""bufferView": 0, "normalized": true,"#;
    let bytes = [0, 127, 0x81, 0x80, 0, 3, 255, 1, 2];
    let shorts: Vec<u8> = [0_i16, 32767, -32768, 1, 2, 3, -3, 0, 8]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let sparse = r#""sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": 5123},
        "values": {"bufferView": 1, "byteOffset": 12}},"#;
    let based = sparse.replace(r#""sparse""#, r#""bufferView": 1, "sparse""#);
    let place = 2_u16.to_le_bytes();
    for (kind, more, data, expected) in [
        (
            5120,
            view,
            &bytes[..],
            [[0., 127., -127.], [-128., 0., 3.], [-1., 1., 2.]],
        ),
        (
            5120,
            normalized,
            &bytes,
            [
                [0., 1., -1.],
                [-1., 0., 3. / 127.],
                [-1. / 127., 1. / 127., 2. / 127.],
            ],
        ),
        (
            5121,
            normalized,
            &bytes,
            [
                [0., 127. / 255., 129. / 255.],
                [128. / 255., 0., 3. / 255.],
                [1., 1. / 255., 2. / 255.],
            ],
        ),
        (
            5122,
            view,
            &shorts,
            [[0., 32767., -32768.], [1., 2., 3.], [-3., 0., 8.]],
        ),
        (
            5126,
            sparse,
            &place,
            [[0., 0., 0.], [0., 0., 0.], [1., 0., 0.]],
        ),
        (
            5126,
            &based,
            &place,
            [[0., 0., 0.], [1., 0., 0.], [1., 0., 0.]],
        ),
        (5126, "", &place, [[0.; 3]; 3]),
    ] {
        let json = with(kind, more, data.len());
        let model = read_files(&triangle(&json, data), &[]).expect(&json);
        assert_eq!(positions(&model), expected, "{json}");
    }
}

#[test]
fn only_what_is_shown_is_checked() {
    let json = format!(
        r#"{{"scene": 1, "scenes": [{{}}, {{"nodes": [1]}}],
        "nodes": [{{"mesh": 1, "skin": 9, "children": [77]}}, {{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "COLOR": 77}}}}, {{"attributes": {{}}}}]}},
            {{"primitives": [{{"attributes": {{"POSITION": 50}}, "material": 3}}]}}],
        "animations": [{{"channels": [{{"sampler": 4, "target": {{"node": 9, "path": "dance"}}}}], "samplers": []}}],
        "bufferViews": [{CORNERS}, {{"buffer": 8, "byteLength": 1}}],
        "accessors": [{ACCESSOR}, {{"bufferView": 9, "componentType": 1, "count": 3, "type": "VEC9"}}]}}"#
    );
    let model = read_files(&triangle(&json, &[]), &[]).expect("the second scene");
    assert_eq!(model.triangles(), 1);
    assert_eq!(
        model.notes,
        [
            "animations are left out: everything is shown at rest",
            "primitives without positions are left out"
        ]
    );
    let other = json.replace(r#""nodes": [1]"#, r#""nodes": [0]"#);
    assert!(read_files(&triangle(&other, &[]), &[]).is_err());
}

#[test]
fn other_versions_and_compressed_files_are_refused_with_a_command() {
    let refused = |bytes: &[u8]| {
        let mistakes = read_files(bytes, &[]).expect_err("refused");
        let [mistake] = <[String; 1]>::try_from(mistakes).expect("one line");
        mistake
    };
    let mut binary = glb(&json(""), &square());
    binary[4] = 1;
    for old in [
        &br#"{"asset": {"version": "1.0"}, "accessors": {}, "meshes": {}}"#[..],
        br#"{"accessors": {}, "meshes": {"a": {}}}"#,
        &binary,
    ] {
        let mistake = refused(old);
        assert!(mistake.contains("glTF version `1.0`"), "{mistake}");
        assert!(
            mistake.contains("`gltf-pipeline -i IN.gltf -o OUT.gltf`"),
            "{mistake}"
        );
    }
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
        let required = json("").replace("KHR_materials_sheen", name);
        let mistake = refused(&glb(&required, &square()));
        assert!(
            mistake.contains(name) && mistake.contains("`gltf-transform copy"),
            "{mistake}"
        );
    }
    // Not required, but without other positions.
    let draco = json("").replacen(
        r#""bufferView": 0, "componentType""#,
        r#""componentType""#,
        1,
    );
    let draco = draco.replacen(
        r#""indices": 1"#,
        r#""indices": 1, "extensions": {"KHR_draco_mesh_compression": {}}"#,
        1,
    );
    assert!(refused(&glb(&draco, &square())).contains("`gltf-transform copy"));
    // Not required: the mesh is there as well.
    let both = json("").replacen(
        r#""indices": 1"#,
        r#""indices": 1, "extensions": {"KHR_draco_mesh_compression": {}}"#,
        1,
    );
    assert_eq!(
        read_files(&glb(&both, &square()), &[])
            .expect("a mesh")
            .triangles(),
        4
    );
}

#[test]
fn what_may_move_the_model_is_a_warning() {
    let used = |name: &str| {
        let used = format!(r#""extensionsUsed": ["{name}"], "accessors""#);
        json("").replacen(r#""accessors""#, &used, 1)
    };
    let read = |text: &str, looks: bool| {
        parse(
            &glb(text, &square()),
            Path::new(""),
            u64::MAX,
            DVec3::ZERO,
            looks,
        )
        .expect("a model")
    };
    let model = read(&used("CESIUM_RTC"), true);
    assert!(
        model.warnings[0].text.contains("CESIUM_RTC"),
        "{:?}",
        model.warnings
    );
    let sheen = used("KHR_materials_sheen");
    assert_eq!(read(&sheen, true).notes.len(), 2);
    assert_eq!(read(&sheen, false).notes, ["points and lines are left out"]);
}
