//! Scenes from whatever the user calls a scene.
//!
//! [`load`] takes a path (`.pbrt`, `.ply`, `.obj`, `.stl`, `.gltf`, `.glb`), a height
//! raster (`.tif`, `.asc`, `.npy`, `.vrt`, or a folder of them) or `builtin:NAME[:TRIANGLES]` and returns a
//! [`Scene`](antumbra_scene::Scene):
//!
//! ```
//! use antumbra_load::{Error, Options, load};
//!
//! # fn main() -> Result<(), Error> {
//! let city = load("builtin:city:2000".as_ref(), &Options::default())?;
//! println!("{} triangles in {:.2} s", city.scene.triangle_count(), city.seconds);
//! # Ok(())
//! # }
//! ```
//!
//! Nothing here prints. Notes of a reader are in [`Loaded::notes`], and missing materials and images in
//! [`Loaded::warnings`]. Mistakes are in [`Error`]. All name file, line and column where there is one.
//!
//! - `file`: from a name to a scene, by its extension
//! - `terrain`: height rasters as meshes
//! - `stage`: camera, sun, sky and ground for meshes without them;  `clear_sky`: that sky
//! - `extent`, `up`: where a scene is, and which axis is up
//! - `adjust`, `crop`: what a caller may choose instead of the scene: camera, film, integrator, samples
//! - `memory`: sizes of memory;  `estimate`: memory that a scene and its picture take
//! - `error`: why there is no scene
#![forbid(unsafe_code)]

mod adjust;
mod clear_sky;
mod crop;
mod error;
mod estimate;
mod extent;
mod file;
mod memory;
mod stage;
mod terrain;
mod up;

pub use adjust::{
    FilterKind, IntegratorKind, LookAt, SamplerName, choose_integrator, set_ambient, set_camera,
    set_crop, set_max_depth, set_resolution, set_samples,
};
pub use antumbra_mesh::{Names, Part, Warning};
pub use antumbra_pbrt::{Diagnostic, Severity};
pub use antumbra_raster::{RasterCells, Tiles};
pub use crop::Crop;
pub use error::Error;
pub use estimate::check_picture;
pub use extent::Extent;
pub use file::{Loaded, Options, file_stem, load, load_all, load_text, raster_name};
pub use memory::{BadSize, MemorySize};
pub use stage::{
    OwnStage, Sky, Stage, Sun, Up, scene_of_mesh, scene_of_model, set_ground, set_stage,
};
pub use terrain::{Heights, load_heights, raster_warnings};
pub use up::Upright;
