//! STL, ASCII and binary: triangles without looks.
//!
//! Vertices at the same place become one. Facet normals follow from the corners, whatever the file says. Attribute bytes,
//! in which some programs keep colours in ways of their own, are not read.
//!
//! No crate reads the files, because mistakes name the line of a text, and the count of a binary file is compared with its
//! size before memory is taken.

use std::collections::HashMap;
use std::path::Path;

use antumbra_scene::TriangleMesh;
use glam::DVec3;

use crate::{Error, file};

/// Bytes before the triangles of a binary file, and bytes of a triangle.
const HEADER: usize = 84;
const FACET: usize = 50;
/// Bytes of memory per triangle beside the file: corners, and an entry of the table of vertices for each.
const PER_TRIANGLE: u64 = 12 + 3 * (12 + 24);

/// Mesh, and a note about what was not read.
type Noted = (TriangleMesh, Option<String>);

/// Reads an STL file, within `max_bytes` of memory for the file and for its mesh. Positions are measured from `origin`, and
/// rounded after that. The second value is a note, if bytes follow the triangles of a binary file.
///
/// Positions may be NaN or infinite.
///
/// # Errors
/// [`Error::Io`]. [`Error::Broken`] with the first mistake and its line or byte.
pub fn load_stl(
    path: &Path,
    max_bytes: u64,
    origin: DVec3,
) -> Result<(TriangleMesh, Option<String>), Error> {
    let bytes = file::read(path, max_bytes, |_| Ok(())).map_err(Error::io(path))?;
    parse(&bytes, max_bytes, origin)
        .map_err(|mistake| Error::Broken(vec![format!("{}:{mistake}", path.display())]))
}

/// Reads the bytes of an STL file. Errors name `path`, which need not exist.
///
/// # Errors
/// As [`load_stl`].
pub fn parse_stl(bytes: &[u8], path: &Path) -> Result<(TriangleMesh, Option<String>), Error> {
    parse(bytes, u64::MAX, DVec3::ZERO)
        .map_err(|mistake| Error::Broken(vec![format!("{}:{mistake}", path.display())]))
}

fn parse(bytes: &[u8], max_bytes: u64, origin: DVec3) -> Result<Noted, String> {
    // Binary files may begin with `solid` as well, so the size decides.
    let count = bytes.get(80..HEADER).and_then(<[u8]>::first_chunk::<4>);
    let count = count.map(|&count| u32::from_le_bytes(count) as usize);
    let behind = count.and_then(|count| bytes.len().checked_sub(HEADER + FACET * count));
    if behind == Some(0) {
        return Ok((binary(&bytes[HEADER..], max_bytes, origin)?, None));
    }
    let text = antumbra_scene::without_mark(bytes).trim_ascii_start();
    let first = text.get(..5).unwrap_or_default();
    if first.eq_ignore_ascii_case(b"solid") && !bytes.contains(&0) {
        return Ok((ascii(bytes, max_bytes, origin)?, None));
    }
    if let (Some(count @ 1..), Some(behind)) = (count, behind) {
        let facets = &bytes[HEADER..HEADER + FACET * count];
        let note = format!("{behind} bytes behind the last triangle are not read");
        return Ok((binary(facets, max_bytes, origin)?, Some(note)));
    }
    Err(match count {
        Some(count) => format!(
            " error: byte 80 announces {count} triangles, which take {} bytes, but the file has {}",
            HEADER + FACET * count,
            bytes.len()
        ),
        None => " error: not an STL file: it neither begins with `solid` nor has 84 bytes".into(),
    })
}

struct Mesh {
    origin: DVec3,
    mesh: TriangleMesh,
    known: HashMap<[u32; 3], u32>,
}

impl Mesh {
    fn new(origin: DVec3) -> Self {
        Self {
            origin,
            mesh: TriangleMesh::default(),
            known: HashMap::new(),
        }
    }

    fn add(&mut self, corners: [[f64; 3]; 3]) {
        let indices = corners.map(|corner| {
            let corner = (DVec3::from(corner) - self.origin).as_vec3().to_array();
            // 0 and -0 are one place.
            let key = corner.map(|value| (value + 0.0).to_bits());
            let positions = &mut self.mesh.positions;
            *self.known.entry(key).or_insert_with(|| {
                positions.push(corner);
                (positions.len() - 1) as u32
            })
        });
        self.mesh.indices.push(indices);
    }
}

fn check_memory(triangles: u64, max_bytes: u64) -> Result<(), String> {
    let needed = triangles.saturating_mul(PER_TRIANGLE);
    if needed > max_bytes {
        return Err(format!(
            " error: {triangles} triangles need {needed} bytes of memory, more than the {max_bytes} that are allowed"
        ));
    }
    if triangles > u64::from(u32::MAX / 3) {
        return Err(format!(
            " error: {triangles} triangles are more than 32 bits can count"
        ));
    }
    Ok(())
}

fn binary(facets: &[u8], max_bytes: u64, origin: DVec3) -> Result<TriangleMesh, String> {
    check_memory((facets.len() / FACET) as u64, max_bytes)?;
    let mut mesh = Mesh::new(origin);
    for facet in facets.chunks_exact(FACET) {
        let value = |index: usize| {
            let bytes = facet[12 + 4 * index..].first_chunk::<4>();
            f64::from(f32::from_le_bytes(bytes.copied().unwrap_or_default()))
        };
        mesh.add([0, 1, 2].map(|corner| [0, 1, 2].map(|axis| value(3 * corner + axis))));
    }
    Ok(mesh.mesh)
}

fn ascii(bytes: &[u8], max_bytes: u64, origin: DVec3) -> Result<TriangleMesh, String> {
    let mut mesh = Mesh::new(origin);
    let mut corners: Vec<[f64; 3]> = Vec::new();
    let lines = bytes.split(|&byte| byte == b'\n');
    for (index, line) in lines.enumerate() {
        let at = |reason: String| format!("{}: error: {reason}", index + 1);
        let text = String::from_utf8_lossy(antumbra_scene::without_mark(line));
        let mut words = text.split_ascii_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let mut corner = [0.0; 3];
                for value in &mut corner {
                    let word = words.next().unwrap_or_default();
                    let number = word.parse();
                    *value = number.map_err(|_| at(format!("`{word}` is not a number")))?;
                }
                corners.push(corner);
            }
            Some("endloop") => {
                let Ok(three) = <[[f64; 3]; 3]>::try_from(&corners[..]) else {
                    let found = corners.len();
                    return Err(at(format!("a facet has {found} corners, not 3")));
                };
                check_memory(mesh.mesh.indices.len() as u64 + 1, max_bytes)?;
                mesh.add(three);
                corners.clear();
            }
            // Names of solids may hold any words.
            None | Some("solid" | "endsolid" | "facet" | "outer" | "endfacet") => {}
            Some(word) => return Err(at(format!("unknown word `{word}`"))),
        }
    }
    if corners.is_empty() {
        Ok(mesh.mesh)
    } else {
        Err(" error: the file ends inside a facet".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facet(corners: [[f32; 3]; 3]) -> Vec<u8> {
        let mut bytes = vec![0; 12];
        bytes.extend(corners.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0, 0]);
        bytes
    }

    const A: [[f32; 3]; 3] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]];
    const B: [[f32; 3]; 3] = [[1., 0., 0.], [1., 1., 0.], [0., 1., -0.]];

    #[test]
    fn both_kinds_give_one_mesh() {
        let mut bytes = b"solid that is binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(2u32.to_le_bytes());
        bytes.extend(facet(A));
        bytes.extend(facet(B));
        let of_binary = parse(&bytes, u64::MAX, DVec3::ZERO).expect("a mesh");
        bytes.extend(b"more");
        let (mesh, note) = parse(&bytes, u64::MAX, DVec3::ZERO).expect("a mesh");
        assert_eq!(mesh, of_binary.0);
        assert_eq!(
            note.as_deref(),
            Some("4 bytes behind the last triangle are not read")
        );
        let mut text = "solid two words\n".to_owned();
        for facet in [A, B] {
            text += " facet normal 0 0 1\n  outer loop\r\n";
            for [x, y, z] in facet {
                text += &format!("   vertex {x} {y} {z:e}\n");
            }
            text += "  endloop\n endfacet\n";
        }
        text += "endsolid\n";
        let of_text = parse(text.as_bytes(), u64::MAX, DVec3::ZERO).expect("a mesh");
        assert_eq!(of_binary, of_text);
        let text = format!("\u{feff}{}", text.to_uppercase());
        let of_capitals = parse(text.as_bytes(), u64::MAX, DVec3::ZERO).expect("a mesh");
        assert_eq!(of_capitals, of_text);
        let (of_text, _) = of_text;
        assert_eq!(of_text.indices, [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(of_text.positions.len(), 4);
    }

    #[test]
    fn mistakes_have_their_place() {
        for (text, expected) in [
            ("solid\nvertex 0 zero 0\n", "2: error: `zero`"),
            ("solid\nvertex 0 0 0\nendloop", "3: error: a facet has 1"),
            ("solid\nvertex 0 0 0\n", " error: the file ends inside"),
            ("solid\n\nfacets\n", "3: error: unknown word `facets`"),
            ("nothing", " error: not an STL file"),
        ] {
            let mistake = parse(text.as_bytes(), u64::MAX, DVec3::ZERO).expect_err(text);
            assert!(mistake.starts_with(expected), "{mistake}");
        }
        let mut cut = vec![0; 80];
        cut.extend(9u32.to_le_bytes());
        let mistake = parse(&cut, u64::MAX, DVec3::ZERO).expect_err("cut");
        assert!(
            mistake.contains("9 triangles, which take 534 bytes"),
            "{mistake}"
        );
        let mut two = vec![0; 80];
        two.extend(2u32.to_le_bytes());
        two.extend([facet(A), facet(B)].concat());
        assert!(parse(&two, 100, DVec3::ZERO).is_err() && parse(&two, 1000, DVec3::ZERO).is_ok());
    }
}
