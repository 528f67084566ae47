//! Wavefront OBJ: faces with texture coordinates, normals and vertex colours, and the materials of `.mtl` files.
//!
//! Faces with one material make one mesh, whatever their groups. Polygons become fans of triangles around their first
//! corner, or other triangles if they have inward corners. Points and lines are left out with a note, and everything else
//! that is not read with a warning.
//!
//! No crate reads the text, because mistakes name line and column, and memory is counted before it is taken: a face needs
//! 56 bytes per corner, for example, which a small limit refuses at that line.
//!
//! - `scan.rs`: words and numbers with their columns
//! - `faces.rs`: corners of faces, and the meshes that they make
//! - `mtl.rs`: statements of `.mtl` files
//! - `looks.rs`: from statements to materials, masks and emission

mod faces;
mod looks;
mod mtl;
mod scan;

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use antumbra_scene::{Geometry, Shape};
use glam::DVec3;

use crate::images::Images;
use crate::{Error, Model, broken, file, plain_material};
use faces::{Faces, Lists, Part};
use looks::Looks;
use mtl::Mtl;
use scan::{Mistakes, words};

/// Statements without a meaning for a picture.
const SILENT: &[&str] = &[
    "s",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
];

/// Bytes of memory for a vertex, a texture coordinate or a normal, and for a corner with its entry of a hash table.
const PER_VERTEX: u64 = 24;
const PER_CORNER: u64 = 56;
/// Bytes of memory for the name of an object or a group, beside its text.
const PER_NAME: u64 = 48;

/// Reads an OBJ file, within `max_bytes` of memory for each of geometry, materials and textures. Positions are measured from
/// `origin`, and rounded after that. Without `looks`, everything is plain grey and no other file is read.
///
/// A file without faces gives a model without shapes. Positions may be NaN or infinite.
///
/// # Errors
/// [`Error::Io`], or [`Error::Broken`] with the first mistakes: corners that refer to missing vertices, positions that are no
/// numbers, damaged images. Everything that leaves the geometry whole is a [warning](Model::warnings), such as unknown
/// statements, and materials, images, normals and texture coordinates that are missing.
pub fn load_obj(path: &Path, max_bytes: u64, origin: DVec3, looks: bool) -> Result<Model, Error> {
    let bytes = file::read(path, max_bytes, is_text).map_err(Error::io(path))?;
    let folder = path.parent().filter(|_| looks);
    parse_within(&bytes, path, folder, max_bytes, origin)
}

/// A file without text is refused before it is read.
fn is_text(start: &[u8]) -> Result<(), String> {
    if start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff") {
        return Err("the text is UTF-16; save it as UTF-8".into());
    }
    match start.iter().position(|&byte| byte == 0) {
        Some(place) => Err(format!("not an OBJ file: byte {place} is 0")),
        None => Ok(()),
    }
}

/// Reads the bytes of an OBJ file without its `.mtl` files. Errors name `path`, which need not exist.
///
/// # Errors
/// [`Error::Broken`], as for [`load_obj`].
pub fn parse_obj(bytes: &[u8], path: &Path) -> Result<Model, Error> {
    parse_within(bytes, path, None, u64::MAX, DVec3::ZERO)
}

/// Reads a model. Without a folder, material libraries are ignored.
fn parse_within(
    bytes: &[u8],
    path: &Path,
    folder: Option<&Path>,
    max_bytes: u64,
    origin: DVec3,
) -> Result<Model, Error> {
    let mut mistakes = Mistakes::of(path);
    let mut model = Model::default();
    let mut reader = Reader {
        lists: Lists::new(origin),
        faces: Faces::default(),
        materials: HashMap::new(),
        left: max_bytes,
        folder,
        lacks_library: false,
    };
    for (number, line) in scan::lines(bytes) {
        mistakes.line = number;
        if !reader.statement(&line, &mut model, &mut mistakes) {
            break;
        }
    }
    reader.faces.finish(&reader.lists, &mut mistakes);
    if !mistakes.is_empty() {
        return Err(broken(mistakes.into_lines()));
    }
    if reader.faces.flat > 0 {
        let count = reader.faces.flat;
        model.note(format!(
            "{count} faces of fewer than three corners are left out"
        ));
    }
    reader.shapes(&mut model, &mut mistakes);
    if !mistakes.is_empty() {
        return Err(broken(mistakes.into_lines()));
    }
    model.warnings = mistakes.take_warnings();
    model.files.sort();
    model.files.dedup();
    Ok(model)
}

/// Why all materials are taken as opaque, if they are: by the letter of the file, nothing could be seen of it.
///
/// MeshLab and others write `Tr 1` for what is opaque.
fn opaque_instead(parts: &[Part], materials: &HashMap<String, Mtl>) -> Option<String> {
    let used = parts.iter().map(|part| {
        let (name, _, _) = part.material.as_ref()?;
        materials.get(name).filter(|mtl| mtl.opacity() <= 0.0)
    });
    let all_clear: Option<Vec<&Mtl>> = used.collect();
    let first = all_clear?.first()?.clear_at.clone()?;
    Some(format!(
        "every material is wholly transparent ({first}): all are taken as opaque"
    ))
}

/// State of reading.
struct Reader<'a> {
    lists: Lists,
    faces: Faces,
    materials: HashMap<String, Mtl>,
    /// Memory left in bytes.
    left: u64,
    folder: Option<&'a Path>,
    /// Whether a library is missing.
    lacks_library: bool,
}

impl Reader<'_> {
    /// Reads a line. `false`: there is no memory for more.
    fn statement(&mut self, line: &[u8], model: &mut Model, mistakes: &mut Mistakes) -> bool {
        let mut rest = words(line);
        let Some((column, first)) = rest.next() else {
            return true;
        };
        let needed = match first {
            b"v" | b"vt" | b"vn" => PER_VERTEX,
            b"o" | b"g" => PER_NAME + line.len() as u64,
            b"f" => PER_CORNER * rest.clone().count() as u64,
            _ => 0,
        };
        let Some(left) = self.left.checked_sub(needed) else {
            mistakes.add(
                column,
                "the mesh needs more memory than is allowed".to_owned(),
            );
            return false;
        };
        self.left = left;
        match first {
            b"v" => self.lists.vertex(column, rest, mistakes),
            b"vt" => self.lists.uv(column, rest, mistakes),
            b"vn" => self.lists.normal(column, rest, mistakes),
            b"f" => self.faces.face(rest, &self.lists, mistakes),
            b"o" | b"g" => {
                let kind = usize::from(first == b"g");
                let name = scan::text_after(line, column + first.len());
                self.faces.set_owner(kind, name);
            }
            b"usemtl" => {
                let name = scan::text_after(line, column + first.len());
                self.faces.set_material((name, mistakes.line, column));
            }
            b"mtllib" => {
                let name = scan::text_after(line, column + first.len());
                self.library(&name, column + first.len() + 1, model, mistakes);
            }
            word => {
                let word = String::from_utf8_lossy(word);
                if matches!(&*word, "l" | "p") {
                    model.note("points and lines are left out");
                } else if !SILENT.contains(&&*word) {
                    let text = format!("`{word}` is unknown or not supported, and is left out");
                    mistakes.warn(mistakes.line, column, text);
                }
            }
        }
        true
    }

    /// Makes a shape of the faces of each material.
    fn shapes(self, model: &mut Model, mistakes: &mut Mistakes) {
        let (lists, materials) = (&self.lists, &self.materials);
        model.names.shapes = self.faces.names();
        let parts = self.faces.into_parts();
        let opaque = opaque_instead(&parts, materials);
        if let Some(note) = &opaque {
            model.note(note);
        }
        let mut images = Images::new(self.left);
        let has_colors = lists.has_colors();
        // A warning about the library says enough.
        let says_missing = self.folder.is_some() && !self.lacks_library;
        for part in parts {
            let mtl = part.material.as_ref().and_then(|(name, line, column)| {
                let mtl = materials.get(name);
                if mtl.is_none() && says_missing {
                    let help = scan::nearest(name, materials.keys().map(String::as_str));
                    let text = format!("there is no material `{name}`{help}; it is plain grey");
                    mistakes.warn(*line, *column, text);
                }
                mtl
            });
            let looks = match mtl {
                Some(mtl) => Looks::of(mtl, has_colors, &mut images, model, mistakes),
                None if has_colors => Looks::of_vertex_colors(),
                None => Looks::plain(plain_material()),
            };
            let material = model.materials.len();
            model.materials.push(looks.material);
            model.shapes.push(Shape {
                area_light: looks.emission,
                alpha: looks.alpha.filter(|_| opaque.is_none()),
                ..Shape::new(Geometry::Mesh(Arc::new(lists.mesh(&part))), material)
            });
        }
        model.files.extend(images.paths().cloned());
    }

    /// Reads the libraries that a line names. A name may contain spaces if such a file exists.
    fn library(&mut self, names: &str, column: usize, model: &mut Model, mistakes: &mut Mistakes) {
        let Some(folder) = self.folder else {
            return;
        };
        let whole = folder.join(names);
        let names: Vec<&str> = if whole.is_file() {
            vec![names]
        } else {
            names.split_ascii_whitespace().collect()
        };
        for name in names {
            // Files of other systems name folders with backslashes.
            let path = folder.join(name.replace('\\', "/"));
            match file::read(&path, self.left, is_text) {
                Ok(bytes) => {
                    for mtl in mtl::parse(&bytes, &path, model, mistakes) {
                        self.materials.entry(mtl.name.clone()).or_insert(mtl);
                    }
                    model.files.push(path);
                }
                Err(error) => {
                    self.lacks_library = true;
                    let text =
                        format!("cannot read `{name}`: {error}; its materials are plain grey");
                    mistakes.warn(mistakes.line, column, text);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
