//! PLY meshes: ASCII and binary in either byte order.
//!
//! The `vertex` element gives positions, and normals and texture coordinates if all their components exist. The `face`
//! element gives polygons, and `tristrips` strips of triangles, which -1 ends. Other elements and properties are ignored. Declared counts are compared with
//! the size of the file before anything is allocated.
//!
//! No crate reads the files, because mistakes name the line or the byte, and a header that promises more than the file
//! holds is refused before memory is taken.
//!
//! - `header`: format, elements and properties
//! - `body`: vertices and faces, in the order of the header
//! - `values`: single values, of ASCII and binary files

mod body;
mod header;
mod values;

use std::fmt;
use std::path::{Path, PathBuf};

use antumbra_scene::TriangleMesh;
use glam::DVec3;

use crate::Error;
use crate::source::read_regular_file_that;

/// Mistake in a PLY file. Reading stops at the first one, after which values would be misread.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PlyError {
    /// Path of the file.
    pub path: PathBuf,
    /// Line or byte of the mistake.
    pub place: PlyPlace,
    /// Problem, with the value found.
    pub message: String,
    /// Advice on what would be right, if known.
    pub help: Option<String>,
}

/// Place in a PLY file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PlyPlace {
    /// Line, counted from 1, in the header and in the body of ASCII files.
    Line(u64),
    /// Offset in bytes, in the body of binary files.
    Byte(u64),
}

impl fmt::Display for PlyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.located())?;
        if let Some(help) = &self.help {
            write!(f, " ({help})")?;
        }
        Ok(())
    }
}

impl std::error::Error for PlyError {}

impl PlyError {
    /// Place and message without the path.
    pub fn located(&self) -> String {
        match self.place {
            PlyPlace::Line(line) => format!("line {line}: {}", self.message),
            PlyPlace::Byte(byte) => format!("byte {byte}: {}", self.message),
        }
    }
}

/// Mistake without the path of its file.
#[derive(Debug, PartialEq, Eq)]
struct Fault {
    place: PlyPlace,
    message: String,
    help: Option<String>,
}

impl Fault {
    fn new(place: PlyPlace, message: impl Into<String>) -> Self {
        Self {
            place,
            message: message.into(),
            help: None,
        }
    }

    fn at_line(line: u64, message: impl Into<String>) -> Self {
        Self::new(PlyPlace::Line(line), message)
    }

    fn of(self, path: &Path) -> PlyError {
        PlyError {
            path: path.to_path_buf(),
            place: self.place,
            message: self.message,
            help: self.help,
        }
    }

    fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// Reads a PLY file as a mesh in object space.
///
/// Quads become the triangles `0 1 2` and `0 2 3`, as in pbrt-v3, and other polygons fans as well, unless they have inward
/// corners ([`antumbra_scene::polygon`]). Faces of fewer than three corners are left out. Normals are scaled to unit length,
/// except zero vectors. Positions may be NaN or infinite.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, is larger than 16 GiB, or is not a regular file. [`Error::Ply`] for a
/// broken header, counts larger than the file, missing positions or faces, lines of more values than the header declares,
/// and vertex indices out of range.
pub fn load_ply(path: &Path) -> Result<TriangleMesh, Error> {
    load_ply_within(path, u64::MAX)
}

/// Reads a PLY file as [`load_ply`], within so many bytes of memory for the file and for its mesh.
///
/// # Errors
/// As [`load_ply`]. [`Error::Io`] for a larger file, and [`Error::Ply`] for a larger mesh.
pub fn load_ply_within(path: &Path, max_bytes: u64) -> Result<TriangleMesh, Error> {
    Ok(load(path, &Wanted::mesh(max_bytes))?.0)
}

/// Reads a PLY file as [`load_ply_within`], with positions that are measured from `origin`, and rounded after that.
pub(crate) fn load_ply_from(
    path: &Path,
    max_bytes: u64,
    origin: DVec3,
) -> Result<TriangleMesh, Error> {
    let wanted = Wanted {
        origin,
        ..Wanted::mesh(max_bytes)
    };
    Ok(load(path, &wanted)?.0)
}

/// Reads a PLY file as [`load_ply_within`], and the colours of its vertices if there are any. Positions are measured from
/// `origin`, and rounded after that.
///
/// The properties are `red`, `green` and `blue`, or `r`, `g` and `b`. Bytes and 16-bit numbers are decoded from sRGB.
/// Floats are taken as linear. A line of the header that is not known is a warning.
///
/// # Errors
/// As [`load_ply_within`].
pub fn load_colored_ply_within(
    path: &Path,
    max_bytes: u64,
    origin: DVec3,
) -> Result<ColoredPly, Error> {
    let wanted = Wanted {
        max_bytes,
        colors: true,
        origin,
    };
    let (mesh, flat, unknown) = load(path, &wanted)?;
    let note = || format!("{flat} faces of fewer than three corners are left out");
    Ok(ColoredPly {
        mesh,
        note: (flat > 0).then(note),
        warning: unknown.map(|fault| fault.of(path)),
    })
}

/// A PLY file that [`load_colored_ply_within`] reads.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ColoredPly {
    /// The mesh, with colours if there are any.
    pub mesh: TriangleMesh,
    /// How many faces are left out, because they have fewer than three corners.
    pub note: Option<String>,
    /// What is wrong with the file, although its mesh is whole.
    pub warning: Option<PlyError>,
}

/// What a caller wants of a file.
struct Wanted {
    /// Most memory for the file and its mesh, or only for the mesh where the bytes are there.
    max_bytes: u64,
    colors: bool,
    /// Point from which positions are measured before they are rounded.
    origin: DVec3,
}

impl Wanted {
    fn mesh(max_bytes: u64) -> Self {
        Self {
            max_bytes,
            colors: false,
            origin: DVec3::ZERO,
        }
    }
}

/// Mesh, the number of faces of fewer than three corners, and a line of the header that is not known.
type Counted = (TriangleMesh, u64, Option<Fault>);

fn load(path: &Path, wanted: &Wanted) -> Result<Counted, Error> {
    const LIMIT: u64 = 1 << 34;
    // Of other files the first bytes are enough for the error.
    let starts = |bytes: &[u8]| antumbra_scene::without_mark(bytes).starts_with(b"ply");
    let limit = LIMIT.min(wanted.max_bytes);
    let bytes = read_regular_file_that(path, limit, starts).map_err(|source| Error::Io {
        path: path.to_path_buf(),
        source,
    })?;
    let max_bytes = wanted.max_bytes.saturating_sub(bytes.len() as u64);
    let rest = Wanted {
        max_bytes,
        ..*wanted
    };
    parse(&bytes, &rest).map_err(|fault| Error::Ply(fault.of(path)))
}

/// Reads a mesh from the bytes of a PLY file. Errors name `path`, which need not exist.
///
/// # Errors
/// [`Error::Ply`], as for [`load_ply`].
pub fn parse_ply(bytes: &[u8], path: &Path) -> Result<TriangleMesh, Error> {
    match parse(bytes, &Wanted::mesh(u64::MAX)) {
        Ok((mesh, ..)) => Ok(mesh),
        Err(fault) => Err(Error::Ply(fault.of(path))),
    }
}

fn parse(bytes: &[u8], wanted: &Wanted) -> Result<Counted, Fault> {
    let mut header = header::parse(bytes)?;
    let unknown = header.unknown.take();
    let most_triangles = header.check_memory(wanted.max_bytes)?;
    let (mesh, flat) = body::parse(bytes, &header, most_triangles, wanted)?;
    match unknown {
        // Scenes of pbrt are as strict as pbrt.
        Some(fault) if !wanted.colors => Err(fault),
        unknown => Ok((mesh, flat, unknown)),
    }
}

#[cfg(test)]
mod tests;
