//! PLY meshes: ascii and binary of either byte order.
//!
//! Read are the `vertex` element (positions, and normals and texture coordinates if all their
//! components are there) and the `face` element (triangles and quads). Other elements and properties
//! are passed over. Counts that the file declares are held against its size before anything is
//! allocated.
//!
//! - `header`: what the file says it holds
//! - `body`: the values, in the order the header gives

mod body;
mod header;

use std::fmt;
use std::path::{Path, PathBuf};

use antumbra_scene::TriangleMesh;

use crate::Error;
use crate::source::read_regular_file;

/// What is wrong with a PLY file. Reading stops at the first mistake: what follows it would be
/// misread.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlyError {
    /// The file.
    pub path: PathBuf,
    /// Where in it.
    pub place: PlyPlace,
    /// What is wrong there, with the value found.
    pub message: String,
    /// What would be right.
    pub help: Option<String>,
}

/// A place in a PLY file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlyPlace {
    /// Line, counted from 1: the header, and the body of ascii files.
    Line(u64),
    /// Bytes before it: the body of binary files.
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

/// An error before its file is known.
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

/// Reads a PLY file as a mesh in its own space.
///
/// Quads become the triangles `0 1 2` and `0 2 3`, as in pbrt-v3. Normals are scaled to unit length;
/// zero ones are left alone. Positions may be NaN or infinite if the file has such.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read or is not a regular file, [`Error::Ply`] if it is not a
/// mesh: a broken header, counts larger than the file, missing positions or faces, polygons of other
/// sizes, vertex indices out of range.
pub fn load_ply(path: &Path) -> Result<TriangleMesh, Error> {
    const LIMIT: u64 = 1 << 34;
    let bytes = read_regular_file(path, LIMIT).map_err(|source| Error::Io {
        path: path.to_path_buf(),
        source,
    })?;
    parse_ply(&bytes, path)
}

/// The same for the bytes of a file; `path` is what messages call it.
///
/// # Errors
/// [`Error::Ply`].
pub fn parse_ply(bytes: &[u8], path: &Path) -> Result<TriangleMesh, Error> {
    parse(bytes).map_err(|fault| {
        Error::Ply(PlyError {
            path: path.to_path_buf(),
            place: fault.place,
            message: fault.message,
            help: fault.help,
        })
    })
}

fn parse(bytes: &[u8]) -> Result<TriangleMesh, Fault> {
    let header = header::parse(bytes)?;
    body::parse(bytes, &header)
}

#[cfg(test)]
mod tests;
