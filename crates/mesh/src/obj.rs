//! Wavefront OBJ: the positions and faces of a file as one mesh, read by the crate `tobj`.
//!
//! Normals, texture coordinates, colours, groups and material libraries are ignored. Lines, points and faces of fewer
//! than three corners have no surface and are ignored too.

use std::fmt;
use std::ops::Range;
use std::path::Path;

use antumbra_scene::TriangleMesh;
use tobj::{LoadError, LoadOptions};

use crate::{Error, file};

/// Largest number of mistakes in an error. A broken file may have millions.
const MAX_MISTAKES_SHOWN: usize = 20;
/// Statements that do not define surfaces.
const IGNORED_STATEMENTS: &[&str] = &[
    "vt",
    "vn",
    "vp",
    "g",
    "o",
    "s",
    "usemtl",
    "mtllib",
    "l",
    "p",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "maplib",
    "usemap",
];
/// Options of the parser. Polygons become fans of triangles around their first corner.
const OPTIONS: LoadOptions = LoadOptions {
    single_index: false,
    triangulate: true,
    ignore_points: true,
    ignore_lines: true,
};

/// Bytes that the parser needs for a vertex, beside the file: its coordinates, an entry of a hash table and the copy.
const PER_VERTEX: u64 = 96;
/// Bytes that the parser needs for a face and for each of its corners.
const PER_FACE: u64 = 40;
const PER_CORNER: u64 = 36;

/// Reads an OBJ file, within `max_bytes` of memory for the file and for its parser.
///
/// The mesh takes a small multiple of the file's size. A file without faces gives a mesh without triangles.
/// Positions may be NaN or infinite.
///
/// # Errors
/// [`Error::Io`], or [`Error::Broken`] with the first mistakes: unknown statements, corners that refer to missing
/// vertices, and mistakes that the parser finds.
pub fn load_obj(path: &Path, max_bytes: u64) -> Result<TriangleMesh, Error> {
    let bytes = file::read(path, max_bytes, is_text).map_err(Error::io(path))?;
    parse_within(bytes, path, max_bytes)
}

/// A file without text is refused before it is read.
fn is_text(start: &[u8]) -> Result<(), String> {
    match start.iter().position(|&byte| byte == 0) {
        Some(place) => Err(format!("not an OBJ file: byte {place} is 0")),
        None => Ok(()),
    }
}

/// Reads the bytes of an OBJ file. Errors name `path`, which need not exist.
///
/// # Errors
/// [`Error::Broken`], as for [`load_obj`].
pub fn parse_obj(bytes: Vec<u8>, path: &Path) -> Result<TriangleMesh, Error> {
    parse_within(bytes, path, u64::MAX)
}

fn parse_within(bytes: Vec<u8>, path: &Path, max_bytes: u64) -> Result<TriangleMesh, Error> {
    parse(bytes, max_bytes).map_err(|mistakes| {
        let shown = mistakes.iter().take(MAX_MISTAKES_SHOWN);
        let mut lines: Vec<_> = shown
            .map(|mistake| format!("{}:{mistake}", path.display()))
            .collect();
        if mistakes.len() > MAX_MISTAKES_SHOWN {
            lines.push(format!("and {} more", mistakes.len() - MAX_MISTAKES_SHOWN));
        }
        Error::Broken(lines)
    })
}

/// Reads the mesh, or lists its mistakes.
///
/// Unknown statements and corners that refer to missing vertices are all listed as `line:column: error: message`. The
/// first other mistake follows as `line: error: message`.
fn parse(mut bytes: Vec<u8>, max_bytes: u64) -> Result<TriangleMesh, Vec<String>> {
    let (mut mistakes, needed) = check(&mut bytes);
    let needed = needed.saturating_add(bytes.len() as u64);
    if mistakes.is_empty() && needed > max_bytes {
        return Err(vec![format!(
            " error: the mesh needs {needed} bytes of memory to be read, more than the {max_bytes} bytes that are \
             allowed"
        )]);
    }
    let has_bad_corners = mistakes.iter().any(|mistake| mistake.is_corner);
    mistakes.sort_by_key(|mistake| (mistake.line, mistake.column));
    let mut mistakes: Vec<_> = mistakes.iter().map(Mistake::to_string).collect();
    let mut rest = &bytes[..];
    match tobj::load_obj_buf(&mut rest, &OPTIONS, |_| Ok(Default::default())) {
        Ok((models, _)) if mistakes.is_empty() => {
            // Statements that begin a second mesh were blanked.
            let mesh = models.into_iter().next().map(|model| model.mesh);
            let mesh = mesh.unwrap_or_default();
            return Ok(TriangleMesh {
                positions: mesh.positions.as_chunks::<3>().0.to_vec(),
                indices: mesh.indices.as_chunks::<3>().0.to_vec(),
                ..TriangleMesh::default()
            });
        }
        Ok(_) => {}
        Err(LoadError::FaceVertexOutOfBounds) if has_bad_corners => {}
        Err(error @ (LoadError::FaceVertexOutOfBounds | LoadError::InvalidPolygon)) => {
            mistakes.push(format!(" error: {error}"));
        }
        Err(error) => {
            let read = &bytes[..bytes.len() - rest.len()];
            let line = read.split_inclusive(|&byte| byte == b'\n').count();
            mistakes.push(format!("{line}: error: {error}"));
        }
    }
    Err(mistakes)
}

/// Mistake with its place.
struct Mistake {
    line: usize,
    /// Column in bytes, from 1.
    column: usize,
    text: String,
    /// True if a corner refers to a missing vertex.
    is_corner: bool,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            line, column, text, ..
        } = self;
        write!(f, "{line}:{column}: error: {text}")
    }
}

/// Blanks everything but surfaces, and finds unknown statements and corners that refer to missing vertices.
///
/// The parser finds such corners only after the last line, and does not say where they are.
///
/// Returns also the memory that the parser needs, in bytes.
fn check(bytes: &mut [u8]) -> (Vec<Mistake>, u64) {
    let mut mistakes = Vec::new();
    let mut needed = 0;
    // Corners that refer to vertices which may still follow.
    let mut open = Vec::new();
    let mut vertices = 0;
    for (index, text) in bytes.split_mut(|&byte| byte == b'\n').enumerate() {
        let line = index + 1;
        match keep_surface(text) {
            Ok(Statement::Vertex) => {
                vertices += 1;
                needed += PER_VERTEX;
            }
            Ok(Statement::Face) => {
                needed += PER_FACE;
                for (column, corner) in corners(text) {
                    needed += PER_CORNER;
                    if corner > vertices {
                        open.push((line, column, corner));
                    } else if corner == 0 || corner < -vertices {
                        mistakes.push(Mistake {
                            line,
                            column,
                            text: format!(
                                "there is no vertex {corner}: {vertices} vertices stand before it, where 1 is the \
                                 first and -1 the last"
                            ),
                            is_corner: true,
                        });
                    }
                }
            }
            Ok(Statement::Ignored) => {}
            Err((column, word)) => mistakes.push(Mistake {
                line,
                column,
                text: format!("unknown statement `{word}`"),
                is_corner: false,
            }),
        }
    }
    open.retain(|&(_, _, corner)| corner > vertices);
    let beyond = |(line, column, corner)| Mistake {
        line,
        column,
        text: format!("there is no vertex {corner}: the file has {vertices} vertices"),
        is_corner: true,
    };
    mistakes.extend(open.into_iter().map(beyond));
    (mistakes, needed)
}

/// Columns and vertex numbers of a face's corners. The parser reports words that are no numbers.
fn corners(line: &[u8]) -> impl Iterator<Item = (usize, i64)> {
    words(line).skip(1).filter_map(|word| {
        let column = word.start + 1;
        let vertex = line[word].split(|&byte| byte == b'/').next()?;
        let number = str::from_utf8(vertex).ok()?.parse().ok()?;
        Some((column, number))
    })
}

/// Kind of a line.
enum Statement {
    Vertex,
    Face,
    /// Empty line, comment or statement that does not define surfaces.
    Ignored,
}

/// Overwrites with blanks all parts of a line that do not define surfaces, and returns the kind of the line.
///
/// Blanked are comments, values after the three coordinates of a vertex, and ignored statements. Unknown statements are
/// blanked and returned as errors with their column in bytes, from 1. The parser panics on some broken normals, texture
/// coordinates and materials, so it never sees any.
fn keep_surface(line: &mut [u8]) -> Result<Statement, (usize, String)> {
    if let Some(comment) = line.iter().position(|&byte| byte == b'#') {
        line[comment..].fill(b' ');
    }
    let mut words = words(line);
    let (first, last_coordinate) = (words.next(), words.nth(2));
    drop(words);
    let Some(first) = first else {
        return Ok(Statement::Ignored);
    };
    match &line[first.clone()] {
        b"f" => Ok(Statement::Face),
        b"v" => {
            let end = last_coordinate.map_or(line.len(), |word| word.end);
            line[end..].fill(b' ');
            Ok(Statement::Vertex)
        }
        word => {
            let known = IGNORED_STATEMENTS
                .iter()
                .any(|name| name.as_bytes() == word);
            let unknown = (first.start + 1, String::from_utf8_lossy(word).into_owned());
            line.fill(b' ');
            if known {
                Ok(Statement::Ignored)
            } else {
                Err(unknown)
            }
        }
    }
}

/// Byte ranges of the words of a line.
fn words(line: &[u8]) -> impl Iterator<Item = Range<usize>> {
    line.split(|byte| byte.is_ascii_whitespace())
        .scan(0, |next, word| {
            let start = *next;
            *next += word.len() + 1;
            Some(start..start + word.len())
        })
        .filter(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_become_fans() {
        let text =
            b"# caf\xe9\r\no thing\nv 0 0 0\nv 1 0 0 0.5\nv 1 1 0 .1 .2 .3 .4\n\nvn 1\n  v 0 1 0\n\
            usemtl red\nf 1/1 2//2 3/3/3 -1 # a square\r\ng two\nf 4 2 1\nf 1 2 3 4 1\nf 1 2";
        let mesh = parse(text.to_vec(), u64::MAX).expect("a good file");
        let square = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
        assert_eq!(mesh.positions, square);
        let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 0]];
        assert_eq!(mesh.indices[..2], fan[..2]);
        assert_eq!(mesh.indices[2], [3, 1, 0]);
        assert_eq!(mesh.indices[3..], fan);
    }

    #[test]
    fn files_without_faces_are_empty_meshes() {
        for text in ["", "\n\n", "v 1 2 3", "#v\nl 1 2\n"] {
            let mesh = parse(text.into(), u64::MAX).expect(text);
            assert_eq!(mesh.indices.len(), 0, "{text}");
        }
    }

    #[test]
    fn every_mistake_is_named() {
        let cases: [(&[u8], &[&str]); 10] = [
            (b"v 0 0\n", &["1: error: position"]),
            (
                b"\nv 0 zero 0\nf 0",
                &["3:3: error: there is no vertex 0", "2: error: position"],
            ),
            (b"v 1 2 3\n\nf 1 x 1", &["3: error: face"]),
            (b"f 1 1/1/1/1 1\nv 1 2 3\n", &["1: error: face"]),
            (b"v 1 2 3\nf 1 1 \xff\n", &["2: error: read"]),
            (
                b"v 1 2 3\nf 1 1 2\n",
                &["2:7: error: there is no vertex 2: the file has 1 vertices"],
            ),
            (
                b"f 2/1 1 3//9\nv 1 2 3\nf 0 1 1\nv 4 5 6\n",
                &[
                    "1:9: error: there is no vertex 3: the file has 2 vertices",
                    "3:3: error: there is no vertex 0: 1 vertices stand",
                ],
            ),
            (
                b"v 1 2 3\nf 1 1 -2\nv 1 2 3\n",
                &["2:7: error: there is no vertex -2: 1 vertices stand"],
            ),
            (b"v 1 2 3\nf", &[" error: invalid polygon"]),
            (
                b"vv 1\nf 1 1 1\n  oops #v\n",
                &[
                    "1:1: error: unknown statement `vv`",
                    "2:3: error: there is no vertex 1: the file has 0 vertices",
                    "2:5: error: there is no vertex 1",
                    "2:7: error: there is no vertex 1",
                    "3:3: error: unknown statement `oops`",
                ],
            ),
        ];
        for (text, expected) in cases {
            let mistakes = parse(text.to_vec(), u64::MAX).expect_err("a bad file");
            assert_eq!(mistakes.len(), expected.len(), "{mistakes:#?}");
            for (mistake, start) in mistakes.iter().zip(expected) {
                assert!(mistake.starts_with(start), "{start}: {mistake}");
            }
        }
    }

    #[test]
    fn memory_is_counted_before_the_parser_takes_it() {
        let mut text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_vec();
        text.extend(b"f 1 2 3\n".repeat(1000));
        assert!(parse(text.clone(), 200_000).is_ok());
        let mistakes = parse(text, 100_000).expect_err("too large");
        assert!(
            mistakes[0].contains("more than the 100000 bytes"),
            "{mistakes:?}"
        );
    }

    #[test]
    fn files_without_text_are_not_read() {
        let folder = std::env::temp_dir().join(format!("antumbra-obj-{}", std::process::id()));
        let file = std::fs::File::create(&folder).expect("a file");
        file.set_len(1 << 40).expect("a sparse file");
        let error = load_obj(&folder, u64::MAX)
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
            if let Ok(mesh) = parse(text.clone().into(), u64::MAX) {
                let vertices = mesh.positions.len();
                let mut corners = mesh.indices.iter().flatten();
                let inside = corners.all(|&corner| (corner as usize) < vertices);
                assert!(inside, "round {round}: {text}");
                good += 1;
            }
        }
        assert!(good > 0);
    }
}
