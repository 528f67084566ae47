//! PLY meshes: ASCII and binary in either byte order.
//!
//! The `vertex` element gives positions, and normals and texture coordinates if all their components exist. The `face`
//! element gives triangles and quads. Other elements and properties are ignored. Declared counts are compared with
//! the size of the file before anything is allocated.
//!
//! - `header`: format, elements and properties
//! - `body`: values, in the order of the header

mod body;
mod header;

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
    pub(crate) fn located(&self) -> String {
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

    fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// Reads a PLY file as a mesh in object space.
///
/// Quads become the triangles `0 1 2` and `0 2 3`, as in pbrt-v3. Normals are scaled to unit length, except zero
/// vectors. Positions may be NaN or infinite.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, is larger than 16 GiB, or is not a regular file. [`Error::Ply`] for a
/// broken header, counts larger than the file, missing positions or faces, polygons of more than four or fewer than
/// three corners, and vertex indices out of range.
pub fn load_ply(path: &Path) -> Result<TriangleMesh, Error> {
    load_ply_within(path, u64::MAX)
}

/// Reads a PLY file as [`load_ply`], within so many bytes of memory for the file and for its mesh.
///
/// # Errors
/// As [`load_ply`]. [`Error::Io`] for a larger file, and [`Error::Ply`] for a larger mesh.
pub fn load_ply_within(path: &Path, max_bytes: u64) -> Result<TriangleMesh, Error> {
    load_ply_from(path, max_bytes, DVec3::ZERO)
}

/// Reads a PLY file as [`load_ply_within`], with positions that are measured from `origin`, and rounded after that.
pub(crate) fn load_ply_from(
    path: &Path,
    max_bytes: u64,
    origin: DVec3,
) -> Result<TriangleMesh, Error> {
    load(path, max_bytes, false, origin)
}

/// Reads a PLY file as [`load_ply_within`], and the colours of its vertices if there are any. Positions are measured from
/// `origin`, and rounded after that.
///
/// The properties are `red`, `green` and `blue`, or `r`, `g` and `b`. Bytes and 16-bit numbers are decoded from sRGB.
/// Floats are taken as linear.
///
/// # Errors
/// As [`load_ply_within`].
pub fn load_colored_ply_within(
    path: &Path,
    max_bytes: u64,
    origin: DVec3,
) -> Result<TriangleMesh, Error> {
    load(path, max_bytes, true, origin)
}

fn load(path: &Path, max_bytes: u64, colors: bool, origin: DVec3) -> Result<TriangleMesh, Error> {
    const LIMIT: u64 = 1 << 34;
    // Of other files the first bytes are enough for the error.
    let starts = |bytes: &[u8]| bytes.starts_with(b"ply");
    let limit = LIMIT.min(max_bytes);
    let bytes = read_regular_file_that(path, limit, starts).map_err(|source| Error::Io {
        path: path.to_path_buf(),
        source,
    })?;
    parse_within(
        &bytes,
        path,
        max_bytes - (bytes.len() as u64).min(max_bytes),
        colors,
        origin,
    )
}

/// Reads a mesh from the bytes of a PLY file. Errors name `path`, which need not exist.
///
/// # Errors
/// [`Error::Ply`], as for [`load_ply`].
pub fn parse_ply(bytes: &[u8], path: &Path) -> Result<TriangleMesh, Error> {
    parse_within(bytes, path, u64::MAX, false, DVec3::ZERO)
}

fn parse_within(
    bytes: &[u8],
    path: &Path,
    max_bytes: u64,
    colors: bool,
    origin: DVec3,
) -> Result<TriangleMesh, Error> {
    mesh_within(bytes, max_bytes, colors, origin).map_err(|fault| {
        Error::Ply(PlyError {
            path: path.to_path_buf(),
            place: fault.place,
            message: fault.message,
            help: fault.help,
        })
    })
}

#[cfg(test)]
fn parse(bytes: &[u8]) -> Result<TriangleMesh, Fault> {
    mesh_within(bytes, u64::MAX, true, DVec3::ZERO)
}

fn mesh_within(
    bytes: &[u8],
    max_bytes: u64,
    colors: bool,
    origin: DVec3,
) -> Result<TriangleMesh, Fault> {
    let header = header::parse(bytes)?;
    header.check_memory(max_bytes)?;
    body::parse(bytes, &header, colors, origin)
}

#[cfg(test)]
mod tests;
