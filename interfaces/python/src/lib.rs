//! The Python package `antumbra`: occlusion queries on numpy arrays.
//!
//! A door: arguments become what the kernel and its companions take, and answers become arrays. Nothing is decided here.
//!
//! - `arrays`: arguments that are arrays;  `call`: threads, Ctrl-C and progress;  `errors`: exceptions
//! - `scene`: a tree with everything that made it
//! - `rays`: rays and what they hit;  `points`: questions about points;  `bakes`: jobs about many points;  `terrain`: height fields
//! - `methods`: the classes `Queries`, `Scene` and `World`
//! - `pictures`: the classes `Picture` and `Map`;  `html`: what notebooks show

mod arrays;
mod bakes;
mod call;
mod errors;
mod html;
mod methods;
mod pictures;
mod points;
mod rays;
mod scene;
mod terrain;

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
    use super::bakes::bits::BitMatrix;
    #[pymodule_export]
    use super::bakes::{sensors::texel_atlas, sky::sky_patches, sun::sun_positions, sun::suns};
    #[pymodule_export]
    use super::call::threads::{get_threads, set_threads};
    #[pymodule_export]
    use super::methods::Queries;
    #[pymodule_export]
    use super::methods::scene::Scene;
    #[pymodule_export]
    use super::methods::world::{ChildOrder, World};
    #[pymodule_export]
    use super::pictures::map::Map;
    #[pymodule_export]
    use super::pictures::picture::{Picture, heat_map, render};
    #[pymodule_export]
    use super::points::Closest;
    #[pymodule_export]
    use super::rays::hits::{HitList, Hits};
    #[pymodule_export]
    use super::terrain::Field;
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
