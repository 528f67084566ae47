//! Baked occlusion: numbers about points of a scene that are computed once and kept.
//!
//! Commands and other languages share these functions. Trees are the kernel's, and so are all answers about rays.
//!
//! ```
//! use antumbra::{Bvh, Geometry, Recipe};
//! use antumbra_bake::{AmbientOcclusion, ambient_occlusion, vertex_normals};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let indices = [[0, 1, 2]];
//! let geometry = [Geometry::triangles(&positions[..], &indices[..])];
//! let bvh = Bvh::build(&geometry, &Recipe::default())?;
//!
//! let normals = vertex_normals(&positions, &indices);
//! let open = ambient_occlusion(&bvh, &positions, &normals, &AmbientOcclusion::default(), &())?;
//! assert_eq!(open, [1.0; 3], "nothing stands above a triangle on its own");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - `ambient_occlusion`: the open part of the sky above points
//! - `directions`: directions over a hemisphere, spread evenly and different at every point
//! - `normals`: normals of vertices from the triangles around them
//! - `ply`: meshes with a value at every vertex as PLY files
//! - `monitor`: progress and cancellation;  `error`: why there is no result
#![forbid(unsafe_code)]

mod ambient_occlusion;
mod directions;
mod error;
mod monitor;
mod normals;
mod ply;

pub use ambient_occlusion::{AmbientOcclusion, BentNormal, ambient_occlusion, bent_normals};
pub use directions::Weighting;
pub use error::Error;
pub use monitor::Monitor;
pub use normals::vertex_normals;
pub use ply::ShadedMesh;
