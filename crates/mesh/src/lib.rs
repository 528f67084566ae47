//! Reads meshes that come without a scene: Wavefront OBJ and glTF 2.0.
//!
//! Both formats are parsed by libraries; what is here decides what counts as a surface, refuses what a
//! library would crash on or silently misread, and keeps memory within a limit that the caller gives.
//!
//! - `obj`: positions and faces of an OBJ file;  `gltf`: the triangles of a glTF scene with their base colours
//! - `file`: a file in memory, if it is one that ends
#![forbid(unsafe_code)]

mod file;
mod gltf;
mod obj;

use std::io;
use std::path::{Path, PathBuf};

pub use gltf::{load_gltf, parse_gltf};
pub use obj::{load_obj, parse_obj};

/// Why there is no mesh.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file cannot be read, is no regular file, or is larger than the memory allowed.
    #[error("error: {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file was read and is broken. One mistake per line, each of which names the file and says `error`.
    #[error("{}", .0.join("\n"))]
    Broken(Vec<String>),
}

impl Error {
    fn io(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io {
            path: path.to_path_buf(),
            source,
        }
    }
}
