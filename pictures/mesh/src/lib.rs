//! Readers of mesh files without a scene: Wavefront OBJ, glTF 2.0 and STL.
//!
//! A file gives a [`Model`]: geometry with its materials and textures, and lights and a camera where the format has them.
//! Features that are left out are named in [`Model::notes`]. Missing materials and images are named in [`Model::warnings`],
//! with their place, and replaced by plain grey. Memory stays within a limit of the caller.
//!
//! - `model.rs`: [`Model`], the contents of a file
//! - `names.rs`: [`Names`] of objects and materials
//! - `obj/`: [`load_obj`], with the materials of its `.mtl` files
//! - `gltf/`: [`load_gltf`]; the crate `gltf` parses the JSON
//! - `stl.rs`: [`load_stl`]
//! - `images.rs`: images of textures
//! - `file.rs`: regular files of limited size, read into memory
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//!
//! let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
//! let model = antumbra_mesh::parse_obj(text, Path::new("triangle.obj"))?;
//! assert_eq!(model.triangles(), 1);
//!
//! let broken = antumbra_mesh::parse_obj(b"f 1 2 3\n", Path::new("broken.obj"));
//! let message = broken.unwrap_err().to_string();
//! assert!(message.starts_with("broken.obj:1:3: error: there is no vertex 1"));
//! # Ok::<(), antumbra_mesh::Error>(())
//! ```
#![forbid(unsafe_code)]

mod file;
mod gltf;
mod images;
mod model;
mod names;
mod obj;
mod stl;

use std::io;
use std::path::{Path, PathBuf};

use antumbra_scene::material::Matte;
use antumbra_scene::{Material, Rgb};

pub use gltf::{load_gltf, parse_gltf};
pub use model::{Model, View, Warning};
pub use names::{Names, Part};
pub use obj::{load_obj, parse_obj};
pub use stl::{load_stl, parse_stl};

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

/// Largest number of mistakes in an error. A broken file may have millions.
const MAX_MISTAKES_SHOWN: usize = 20;

/// The first mistakes as an error.
fn broken(mut lines: Vec<String>) -> Error {
    let more = lines.len().saturating_sub(MAX_MISTAKES_SHOWN);
    lines.truncate(MAX_MISTAKES_SHOWN);
    if more > 0 {
        lines.push(format!("and {more} more"));
    }
    Error::Broken(lines)
}

/// Grey of surfaces without a material, and of missing images.
const PLAIN_GREY: Rgb = Rgb::splat(0.6);

/// Grey of surfaces without a material.
pub fn plain_material() -> Material {
    Material::Matte(Matte {
        kd: PLAIN_GREY.into(),
        sigma: 0.0.into(),
    })
}
