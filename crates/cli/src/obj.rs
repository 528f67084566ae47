//! Wavefront OBJ: the positions and faces of a file as one mesh.
//!
//! Normals, texture coordinates, groups and material libraries are passed over: the mesh is shown in one
//! grey. Lines and points have no surface and are passed over, too. Every mistake is reported with its
//! line and column.

use std::fs;
use std::path::Path;

use antumbra_scene::TriangleMesh;

use crate::exit::Failure;

/// Mistakes that are printed; a broken file may have millions.
const MOST_MISTAKES: usize = 20;
/// Statements that say nothing about where a surface is.
const PASSED_OVER: &[&str] = &[
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

/// Reads the file. Polygons become fans of triangles around their first corner.
pub fn load(path: &Path) -> Result<TriangleMesh, Failure> {
    let bytes = fs::read(path).map_err(|source| Failure::scene(path.display(), source))?;
    parse(&bytes).map_err(|mistakes| {
        let shown = mistakes.iter().take(MOST_MISTAKES);
        let mut lines: Vec<_> = shown
            .map(|mistake| format!("{}:{mistake}", path.display()))
            .collect();
        if mistakes.len() > MOST_MISTAKES {
            lines.push(format!("and {} more", mistakes.len() - MOST_MISTAKES));
        }
        Failure::Scene(lines.join("\n"))
    })
}

/// The mesh, or every mistake as `line:column: error: message`.
fn parse(bytes: &[u8]) -> Result<TriangleMesh, Vec<String>> {
    let mut mesh = TriangleMesh::default();
    let mut mistakes = Vec::new();
    let mut corners = Vec::new();
    for (index, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        let mut words = words(line);
        let result = match words.next() {
            None => Ok(()),
            Some((_, "v")) => position(&mut words).map(|point| mesh.positions.push(point)),
            Some((_, "f")) => {
                corners.clear();
                face(&mut words, mesh.positions.len(), &mut corners).map(|()| {
                    let fan = corners.windows(2).skip(1);
                    mesh.indices
                        .extend(fan.map(|pair| [corners[0], pair[0], pair[1]]));
                })
            }
            Some((_, word)) if PASSED_OVER.contains(&word) || word.starts_with('#') => Ok(()),
            Some((column, word)) => Err((column, format!("unknown statement `{word}`"))),
        };
        if let Err((column, message)) = result {
            mistakes.push(format!("{}:{column}: error: {message}", index + 1));
        }
    }
    if mistakes.is_empty() {
        Ok(mesh)
    } else {
        Err(mistakes)
    }
}

/// What is wrong, and at which column (in bytes), counted from 1.
type Mistake = (usize, String);

/// The words of a line with their columns. What is not text cannot be a number or statement either and
/// shows as a replacement character.
fn words(line: &[u8]) -> impl Iterator<Item = (usize, &str)> {
    line.split(|byte| byte.is_ascii_whitespace())
        .scan(1, |column, word| {
            let start = *column;
            *column += word.len() + 1;
            Some((start, word))
        })
        .filter(|(_, word)| !word.is_empty())
        .map(|(column, word)| (column, std::str::from_utf8(word).unwrap_or("\u{fffd}")))
}

/// Three coordinates; a weight or colour behind them is passed over.
fn position<'a>(words: &mut impl Iterator<Item = (usize, &'a str)>) -> Result<[f32; 3], Mistake> {
    let mut point = [0.0; 3];
    for coordinate in &mut point {
        let (column, word) = words
            .next()
            .ok_or((1, "a vertex needs three coordinates".to_owned()))?;
        *coordinate = word
            .parse()
            .map_err(|_| (column, format!("`{word}` is not a number")))?;
    }
    Ok(point)
}

/// The corners of a face: `v`, `v/vt`, `v//vn` or `v/vt/vn` each, counted from 1 or, if negative, back
/// from the latest vertex.
fn face<'a>(
    words: &mut impl Iterator<Item = (usize, &'a str)>,
    vertices: usize,
    corners: &mut Vec<u32>,
) -> Result<(), Mistake> {
    for (column, word) in words {
        if word.starts_with('#') {
            break;
        }
        let number = word.split('/').next().unwrap_or_default();
        let given: i64 = number
            .parse()
            .map_err(|_| (column, format!("`{word}` is not a vertex number")))?;
        let index = match given {
            1.. => Some(given - 1),
            0 => None,
            _ => i64::try_from(vertices).ok().map(|count| count + given),
        };
        let valid = index
            .and_then(|index| u32::try_from(index).ok())
            .filter(|&index| (index as usize) < vertices);
        let missing = || (column, format!("vertex {given} of {vertices} so far"));
        corners.push(valid.ok_or_else(missing)?);
    }
    if corners.len() < 3 {
        let count = corners.len();
        return Err((
            1,
            format!("a face needs three corners, and this one has {count}"),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_become_fans() {
        let text = b"# a comment\r\no thing\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\n\nv 0 1 0\nf 1/1 2//2 3/3/3 -1\r\n";
        let mesh = parse(text).expect("a good file");
        assert_eq!(mesh.positions.len(), 4);
        assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn every_mistake_has_its_place() {
        let text =
            b"v 0 0\nv 0 zero 0\nv 1 2 3\nf 1 2 3\nf 0 1 1\nf 1 1\nfoo\nf 1 1 \xff\nf 1 1 -2\n";
        let mistakes = parse(text).expect_err("a bad file");
        let expected = [
            "1:1: error: a vertex needs three",
            "2:5: error: `zero` is not a number",
            "4:5: error: vertex 2 of 1",
            "5:3: error: vertex 0 of 1",
            "6:1: error: a face needs three corners, and this one has 2",
            "7:1: error: unknown statement `foo`",
            "8:7: error: `\u{fffd}` is not a vertex",
            "9:7: error: vertex -2 of 1",
        ];
        assert_eq!(mistakes.len(), expected.len(), "{mistakes:#?}");
        for (mistake, start) in mistakes.iter().zip(expected) {
            assert!(mistake.starts_with(start), "{mistake}");
        }
    }
}
