//! Files made here: good ones in every packing, and one for every mistake.

use super::*;

/// A square of two triangles in buffer 0: 48 bytes of positions, then 6 short indices.
fn square() -> Vec<u8> {
    let positions: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
    let positions = positions.iter().flatten().flat_map(|x| x.to_le_bytes());
    let indices = [0u16, 1, 2, 0, 2, 3];
    let indices = indices.iter().flat_map(|i| i.to_le_bytes());
    positions.chain(indices).collect()
}

/// The JSON for it; `uri` is the whole member, or nothing.
fn json(uri: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
        "nodes": [{{"children": [1], "translation": [10, 0, 0]}}, {{"mesh": 0, "scale": [2, 2, 2]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [0.5, 0.25, 0.125, 1]}}}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "material": 0}},
            {{"attributes": {{"POSITION": 0}}, "mode": 6}}, {{"attributes": {{"POSITION": 0}}, "mode": 1}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
            {{"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 12}}],
        "buffers": [{{{uri} "byteLength": 60}}]}}"#
    )
}

fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
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

/// Reads files, the first being the one to open.
fn read_files(files: &[(&str, &[u8])]) -> Result<(Vec<Shape>, Vec<Material>), Vec<String>> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    read(&folder.path().join(files[0].0))
}

#[test]
fn the_same_scene_in_every_packing() {
    let data = format!(
        r#""uri": "data:application/octet-stream;base64,{}","#,
        encode(&square())
    );
    let results = [
        read_files(&[("a.glb", &glb(&json(""), &square()))]),
        read_files(&[
            ("a.gltf", json(r#""uri": "the%20data.bin","#).as_bytes()),
            ("the data.bin", &square()),
        ]),
        read_files(&[("a.gltf", json(&data).as_bytes())]),
    ];
    for result in results {
        let (shapes, materials) = result.expect("a good file");
        assert_eq!(shapes.len(), 2, "lines are no shape");
        assert_eq!(materials.len(), 2);
        assert_eq!(shapes[0].material, 0);
        assert_eq!(shapes[1].material, 1);
        for shape in &shapes {
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
    assert_eq!(triangles(5, &[0, 1, 2, 3]), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(triangles(4, &[0, 1, 2, 3, 4]), [[0, 1, 2]]);
    assert_eq!(triangles(6, &[0, 1]), [[0u32; 3]; 0]);
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
        (
            r#""scene": 0"#,
            r#""scene": 7"#,
            "scene 7 is used, but there are 1",
        ),
        (r#""nodes": [0]"#, r#""nodes": [9]"#, "node 9 is used"),
        (
            r#""children": [1]"#,
            r#""children": [0]"#,
            "its own ancestor",
        ),
        (r#""mesh": 0"#, r#""mesh": 3"#, "mesh 3 is used"),
        (r#""material": 0"#, r#""material": 4"#, "material 4 is used"),
        (
            r#""indices": 1"#,
            r#""indices": 0"#,
            "accessor 0 holds VEC3, not SCALAR",
        ),
        (r#""indices": 1"#, r#""indices": 5"#, "accessor 5 is used"),
        (
            r#""count": 4"#,
            r#""count": 5"#,
            "accessor 0 has 5 elements",
        ),
        (
            r#""count": 4"#,
            r#""count": 18446744073709551615"#,
            "more than the 48 bytes",
        ),
        (
            r#""count": 4"#,
            r#""count": 3"#,
            "vertex 3 is used, but there are 3",
        ),
        (
            r#""byteLength": 48"#,
            r#""byteLength": 480"#,
            "bufferView 0 is 480 bytes",
        ),
        (
            r#""byteLength": 60"#,
            r#""byteLength": 61"#,
            "buffer 0: it should hold 61 bytes",
        ),
        (
            r#""componentType": 5126"#,
            r#""componentType": 5123"#,
            "component type 5123",
        ),
        (r#""mode": 6"#, r#""mode": 8"#, "mode 8"),
        (r#""POSITION""#, r#""COLOR""#, "POSITION"),
        (
            r#""asset""#,
            r#""extensionsRequired": ["KHR_draco_mesh_compression"], "asset""#,
            "draco",
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
        let mistakes = read_files(&[("a.glb", &glb(&broken, &square()))]).expect_err(hint);
        assert!(
            mistakes.iter().any(|text| text.contains(hint)),
            "{hint}: {mistakes:?}"
        );
    }
    let no_data = read_files(&[("a.gltf", good.as_bytes())]).expect_err("no data");
    assert!(no_data[0].contains("no binary chunk"), "{no_data:?}");
}

/// Bytes cut off or changed anywhere never panic. (The generator is the multiplier of Knuth's MMIX.)
#[test]
fn damaged_files_are_errors_or_other_scenes() {
    let good = glb(&json(""), &square());
    let read_bytes = |bytes: &[u8]| {
        let (json, binary) = container::open(bytes).ok()?;
        let document: Document = serde_json::from_slice(json).ok()?;
        let mut mistakes = Vec::new();
        let buffers = container::buffers(&document, binary, Path::new("/"), &mut mistakes);
        let mut reader = Reader {
            document: &document,
            accessors: Accessors::new(&document, &buffers),
            shapes: Vec::new(),
            mistakes,
        };
        reader.walk();
        Some(reader.shapes.len())
    };
    assert_eq!(read_bytes(&good), Some(2));
    for length in 0..good.len() {
        read_bytes(&good[..length]);
    }
    let mut state = 1u64;
    for _ in 0..20_000 {
        let mut bytes = good.clone();
        for _ in 0..3 {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            let place = (state >> 33) as usize % bytes.len();
            // Digits make the most of the JSON.
            bytes[place] = b'0' + (state >> 24) as u8 % 10;
        }
        read_bytes(&bytes);
    }
}

#[test]
fn base64_is_strict() {
    for text in ["", "AA==", "AAA=", "AAAA", "Zm9vYmFy", "Zm9vYg"] {
        assert!(container::base64(text).is_ok(), "{text}");
    }
    assert_eq!(container::base64("Zm9vYmE="), Ok(b"fooba".to_vec()));
    for text in ["A", "AAAAA", "A A=", "AA-_"] {
        assert!(container::base64(text).is_err(), "{text}");
    }
}
