//! Tests of the PLY reader on bytes in memory.

use antumbra_scene::TriangleMesh;

use super::{Counted, Fault, PlyPlace, Wanted};

fn mesh_within(bytes: &[u8], max_bytes: u64, colors: bool) -> Result<Counted, Fault> {
    let wanted = Wanted {
        colors,
        ..Wanted::mesh(max_bytes)
    };
    super::parse(bytes, &wanted)
}

fn parse(bytes: &[u8]) -> Result<TriangleMesh, Fault> {
    Ok(mesh_within(bytes, u64::MAX, true)?.0)
}

fn bytes_of(lines: &str) -> Vec<u8> {
    lines.trim_start().as_bytes().to_vec()
}

/// Header of two triangles over four vertices in a given format.
fn header(format: &str) -> String {
    format!(
        "ply\r\nformat {format} 1.0\r\ncomment made by hand\r\nobj_info nothing\r\n\
         element before 2\r\nproperty list uint8 double junk\r\nproperty short more\r\n\
         element vertex 4\r\nproperty int16 tag\r\nproperty double z\r\nproperty float x\r\n\
         property float y\r\nproperty uchar s\r\nproperty int t\r\n\
         element face 1\r\nproperty list int8 uint8 others\r\n\
         property list uint16 uint32 vertex_index\r\nproperty float weight\r\nend_header\r\n"
    )
}

/// Values for [`header`]: `(type, value)` in order.
fn values() -> Vec<(&'static str, f64)> {
    let mut values = vec![("u8", 2.0), ("f64", 1.5), ("f64", -2.5), ("i16", 3.0)];
    values.extend([("u8", 0.0), ("i16", -4.0)]);
    for i in 0..4 {
        let i = f64::from(i);
        values.extend([
            ("i16", -7.0),
            ("f64", i),
            ("f32", 10.0 + i),
            ("f32", 20.0 + i),
        ]);
        values.extend([("u8", 200.0 + i), ("i32", -30.0 - i)]);
    }
    values.extend([("i8", 2.0), ("u8", 9.0), ("u8", 8.0)]);
    values.extend([
        ("u16", 4.0),
        ("u32", 3.0),
        ("u32", 2.0),
        ("u32", 1.0),
        ("u32", 0.0),
    ]);
    values.push(("f32", 0.5));
    values
}

fn encoded(big_endian: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (kind, value) in values() {
        let mut value_bytes = match kind {
            "i8" => (value as i8).to_le_bytes().to_vec(),
            "u8" => (value as u8).to_le_bytes().to_vec(),
            "i16" => (value as i16).to_le_bytes().to_vec(),
            "u16" => (value as u16).to_le_bytes().to_vec(),
            "i32" => (value as i32).to_le_bytes().to_vec(),
            "u32" => (value as u32).to_le_bytes().to_vec(),
            "f32" => (value as f32).to_le_bytes().to_vec(),
            _ => value.to_le_bytes().to_vec(),
        };
        if big_endian {
            value_bytes.reverse();
        }
        bytes.extend(value_bytes);
    }
    bytes
}

#[test]
fn the_three_formats_give_the_same_mesh() {
    let words: Vec<String> = values().iter().map(|(_, v)| v.to_string()).collect();
    let mut ascii = header("ascii").into_bytes();
    ascii.extend(words.join(" ").into_bytes());
    let mut little = header("binary_little_endian").into_bytes();
    little.extend(encoded(false));
    let mut big = header("binary_big_endian").into_bytes();
    big.extend(encoded(true));

    let mesh = parse(&ascii).unwrap();
    assert_eq!(mesh.positions[1], [11.0, 21.0, 1.0]);
    assert_eq!(mesh.indices, [[3, 2, 1], [3, 1, 0]]);
    assert_eq!(mesh.uvs[3].to_array(), [203.0, -33.0]);
    assert!(mesh.normals.is_empty());
    assert_eq!(parse(&little).unwrap(), mesh);
    assert_eq!(parse(&big).unwrap(), mesh);
    // A file that is cut anywhere is an error, not a smaller mesh.
    for file in [&little, &big] {
        for end in 0..file.len() {
            assert!(parse(&file[..end]).is_err(), "cut at {end}");
        }
    }
}

#[test]
fn texture_coordinates_have_four_pairs_of_names() {
    for [u, v] in [
        ["u", "v"],
        ["s", "t"],
        ["texture_u", "texture_v"],
        ["texture_s", "texture_t"],
    ] {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float {v}\n\
             property float y\nproperty float {u}\nproperty float z\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n1 2 3 4 5\n3 0 0 0\n"
        );
        let mesh = parse(text.as_bytes()).unwrap();
        assert_eq!(mesh.positions, [[1.0, 3.0, 5.0]]);
        assert_eq!(mesh.uvs[0].to_array(), [4.0, 2.0]);
    }
}

#[test]
fn normals_need_all_components_and_become_unit() {
    let text = |names: [&str; 3]| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
             property float z\nproperty float {}\nproperty float {}\nproperty float {}\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 0 0 3 4\n0 0 0 0 0 0\n3 0 0 0\n",
            names[0], names[1], names[2]
        )
    };
    let mesh = parse(text(["nx", "ny", "nz"]).as_bytes()).unwrap();
    assert!((mesh.normals[0] - glam::Vec3::new(0.0, 0.6, 0.8)).length() < 1e-6);
    assert_eq!(mesh.normals[1], glam::Vec3::ZERO);
    let mesh = parse(text(["nx", "ny", "nw"]).as_bytes()).unwrap();
    assert!(mesh.normals.is_empty());
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    const START: &str = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n0 0 0\n0 0 0\n";
    let with = |from: &str, to: &str, body: &str| format!("{}{body}", START.replace(from, to));
    for (text, line, words) in [
        (String::new(), 1, "not a PLY file"),
        ("plx\n".into(), 1, "not a PLY file"),
        ("ply\nformat ascii 1.0\n".into(), 2, "ends in its header"),
        ("ply\nend_header\n".into(), 2, "no format line"),
        (with("1.0", "2.0", ""), 2, "version 2.0"),
        (with("ascii", "text", ""), 2, "unknown format text"),
        (with("vertex 2", "vertex two", ""), 3, "two is not a count"),
        (with("vertex 2", "vertex -2", ""), 3, "-2 is not a count"),
        (
            with("float x", "half x", ""),
            4,
            "unknown property type half",
        ),
        (
            with("float x", "float", ""),
            4,
            "property has the wrong form",
        ),
        (
            with("float x", "float w", ""),
            3,
            "no properties x, y and z",
        ),
        (
            with("list uchar", "list float", ""),
            8,
            "must be an integer",
        ),
        (
            with("vertex_indices", "corners", ""),
            7,
            "no list vertex_indices",
        ),
        (
            with("element face 1", "element face 0", ""),
            7,
            "the file has no face",
        ),
        (
            with("element face 1", "element face 99999999999", ""),
            7,
            "cannot hold",
        ),
        (
            with("vertex 2", "vertex 18446744073709551615", ""),
            3,
            "32 bits",
        ),
        (
            with("element face 1", "element vertex 1", ""),
            7,
            "declared twice",
        ),
        (
            with("element face 1", "elephant face 1", ""),
            9,
            "declares no element face",
        ),
        (
            with("", "", "3 0 1 2\n"),
            12,
            "face 0: vertex index 2 is not one of the 2",
        ),
        (with("", "", "\n3 0 1 -1\n"), 13, "vertex index -1"),
        (with("", "", "3 0 1 0.5\n"), 12, "vertex index 0.5"),
        (
            with("", "", "3 0 1 0 7\n"),
            12,
            "the line has 5 values, but the header declares 4 for this face",
        ),
        (
            with("0 0 0\n0 0 0\n", "0 0 0 9\n0 0 0 9\n", "3 0 1 0\n"),
            10,
            "the line has 4 values, but the header declares 3 for this vertex",
        ),
        (
            with("", "", "3 0 1 x\n"),
            12,
            "face 0: the value is not a number",
        ),
        (with("", "", "3 0 1"), 12, "ends in face 0"),
    ] {
        let fault = parse(&bytes_of(&text)).unwrap_err();
        assert!(fault.message.contains(words), "{words}: {fault:?}");
        assert_eq!(fault.place, PlyPlace::Line(line), "{words}: {fault:?}");
    }
}

#[test]
fn places_in_binary_files_are_bytes() {
    let head = b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty char x\n\
property char y\nproperty char z\nelement face 1\nproperty list uchar uchar vertex_indices\nend_header\n";
    let mut bytes = head.to_vec();
    bytes.extend([1, 2, 3, 3, 0, 0, 5]);
    let fault = parse(&bytes).unwrap_err();
    assert_eq!(fault.place, PlyPlace::Byte(head.len() as u64 + 6));
    assert!(fault.message.contains("vertex index 5"), "{fault:?}");
}

#[test]
fn elements_without_properties_and_lone_carriage_returns_are_fine() {
    let text = "ply\rformat ascii 1.0\relement nothing 18446744073709551615\relement vertex 1\r\
        property float x\rproperty float y\rproperty float z\relement face 1\r\
        property list uchar int vertex_indices\rend_header\r1 2 3\r3 0 0 0\r";
    assert_eq!(parse(text.as_bytes()).unwrap().positions, [[1.0, 2.0, 3.0]]);
}

/// A file of these vertices in the plane z = 0, and these other elements.
fn flat(vertices: &[[i32; 2]], elements: &str, body: &str) -> String {
    let rows: String = vertices
        .iter()
        .map(|[x, y]| format!("{x} {y} 0\n"))
        .collect();
    let list = "property list uchar int vertex_indices";
    let count = vertices.len();
    let elements = elements.replace("LIST", list);
    format!(
        "\u{feff}ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
         property float z\n{elements}\nend_header\n{rows}{body}"
    )
}

#[test]
fn polygons_are_split_and_lesser_faces_counted() {
    let arrow = [[0, 2], [1, 1], [0, 0], [2, 1]];
    let text = flat(
        &arrow,
        "element face 5\nLIST",
        "4 0 1 2 3\n0\n1 2\n2 0 1\n3 0 1 3\n",
    );
    let (mesh, count, unknown) = mesh_within(text.as_bytes(), u64::MAX, true).unwrap();
    assert_eq!((mesh.indices.len(), count, unknown), (3, 3, None));
    // A comment that does not say so.
    let odd = text.replace("format ascii 1.0", "format ascii 1.0\nmade by hand");
    let within = |colors| mesh_within(odd.as_bytes(), u64::MAX, colors);
    let (same, _, unknown) = within(true).unwrap();
    let unknown = unknown.unwrap();
    assert_eq!(same, mesh);
    assert_eq!(
        (unknown.place, &*unknown.message),
        (PlyPlace::Line(3), "unknown header line: made by hand")
    );
    assert_eq!(within(false), Err(unknown));
    // The edge between the triangles begins at the inward corner 1.
    for corners in &mesh.indices[..2] {
        assert!(corners.contains(&1) && corners.contains(&3), "{corners:?}");
    }
    // Faces before vertices, and a hexagon.
    let text = "ply\nformat ascii 1.0\nelement face 2\nproperty list uchar int vertex_index\nelement vertex 6\n\
        property float x\nproperty float y\nproperty float z\nend_header\n6 0 1 2 3 4 5\n4 5 2 1 3\n\
        0 0 0\n2 0 0\n3 1 0\n2 2 0\n0 2 0\n-1 1 0\n";
    let mesh = parse(text.as_bytes()).unwrap();
    assert_eq!(
        mesh.indices[..4],
        [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    );
    assert_eq!(mesh.indices.len(), 6);
}

#[test]
fn strips_turn_every_other_triangle_and_end_at_minus_one() {
    let square = [[0, 0], [1, 0], [0, 1], [1, 1]];
    let text = flat(
        &square,
        "element tristrips 2\nLIST",
        "9 0 1 2 3 -1 3 2 1 -1\n2 0 1\n",
    );
    let mesh = parse(text.as_bytes()).unwrap();
    assert_eq!(mesh.indices, [[0, 1, 2], [2, 1, 3], [3, 2, 1]]);
    let both = flat(
        &square,
        "element face 0\nLIST\nelement tristrips 1\nLIST",
        "3 0 1 2\n",
    );
    assert_eq!(parse(both.as_bytes()).unwrap().indices.len(), 1);
    // Two triangles take 24 bytes beside four vertices.
    let text = flat(&square, "element tristrips 1\nLIST", "4 0 1 2 3\n");
    let within = |bytes| mesh_within(text.as_bytes(), bytes, false);
    assert!(within(4 * 32 + 24).is_ok());
    let fault = within(4 * 32 + 12).unwrap_err();
    assert!(
        fault.message.contains("more triangles than the 1"),
        "{fault:?}"
    );
    let bad = flat(&square, "element face 1\nLIST", "3 0 1 -1\n");
    assert!(parse(bad.as_bytes()).is_err());
}
