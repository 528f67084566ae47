//! The Python package `antumbra`: occlusion queries on numpy arrays.
//!
//! A door: arguments become what the kernel and its companions take, and answers become arrays. Nothing is decided here.
//!
//! - `arrays`: arguments that are arrays;  `broadcast`: their leading shapes
//! - `meshes`: meshes of a call;  `curves`: curves;  `placements`: instances
//! - `geometry`: what scenes are made of;  `scene`: the same with a tree
//! - `methods`: the class `Queries`, in several files;  `scenes`: the class `Scene`;  `world`: the class `World`
//! - `rays`: rays of a call, in pieces;  `groups`: rays from every point in every direction
//! - `queries`: what rays hit;  `hits`: the results;  `points`: questions about points
//! - `distinct`: hits as trimesh returns them;  `memory`: lists that may not fit
//! - `bake`: ambient occlusion, sky, sun, visibility between points;  `bits`: the class `BitMatrix`;  `picture`: the class `Picture`;  `map`: the
//!   class `Map`
//! - `html`: what notebooks show
//! - `file`: scenes from files;  `saved`: scenes in files and pickles
//! - `threads`: pools of threads, and `fork`;  `watch`: Ctrl-C and progress

mod arrays;
mod bake;
mod bits;
mod broadcast;
mod curves;
mod distinct;
mod file;
mod geometry;
mod groups;
mod hits;
mod html;
mod map;
mod memory;
mod meshes;
mod methods;
mod picture;
mod placements;
mod points;
mod queries;
mod rays;
mod saved;
mod scene;
mod scenes;
mod threads;
mod watch;
mod world;

use pyo3::create_exception;
use pyo3::exceptions::PyUserWarning;

create_exception!(
    antumbra,
    DegenerateWarning,
    PyUserWarning,
    "Triangles or instances that can never be hit were left out of a scene."
);

/// The part of the package that is compiled.
#[pyo3::pymodule(gil_used = false)]
mod _core {
    #[pymodule_export]
    use super::DegenerateWarning;
    #[pymodule_export]
    use super::bake::{sky_patches, sun_positions, texel_atlas};
    #[pymodule_export]
    use super::bits::BitMatrix;
    #[pymodule_export]
    use super::hits::{HitList, Hits};
    #[pymodule_export]
    use super::map::Map;
    #[pymodule_export]
    use super::methods::Queries;
    #[pymodule_export]
    use super::picture::{Picture, heat_map, render};
    #[pymodule_export]
    use super::points::Closest;
    #[pymodule_export]
    use super::scenes::Scene;
    #[pymodule_export]
    use super::threads::{get_threads, set_threads};
    #[pymodule_export]
    use super::world::{ChildOrder, World};
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
