//! Readers of mesh files without a scene: Wavefront OBJ and glTF 2.0.
//!
//! The crates `tobj` and `gltf` parse the files. Code here selects the surfaces, refuses files that a parser would
//! panic on or misread, and keeps memory within a limit of the caller.
//!
//! - `obj.rs`: [`load_obj`], the positions and faces of an OBJ file as one mesh
//! - `gltf.rs`: [`load_gltf`], the triangles of a glTF scene with their base colours
//! - `file.rs`: regular files of limited size, read into memory
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//!
//! let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
//! let mesh = antumbra_mesh::parse_obj(text.to_vec(), Path::new("triangle.obj"))?;
//! assert_eq!(mesh.indices, [[0, 1, 2]]);
//!
//! let broken = antumbra_mesh::parse_obj(b"f 1 2 3\n".to_vec(), Path::new("broken.obj"));
//! let message = broken.unwrap_err().to_string();
//! assert!(message.starts_with("broken.obj:1:3: error: there is no vertex 1"));
//! # Ok::<(), antumbra_mesh::Error>(())
//! ```
#![forbid(unsafe_code)]

mod file;
mod gltf;
mod obj;

use std::io;
use std::path::{Path, PathBuf};

pub use gltf::{gltf_files, load_gltf, parse_gltf};
pub use obj::{load_obj, parse_obj};

/// Reason why a mesh file could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file cannot be read, is not a regular file, or is larger than the memory allowed.
    #[error("error: {}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system, or the reason for the refusal.
        source: io::Error,
    },
    /// The contents of the file are wrong. Each line is one mistake, which names the file and contains `error`.
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
