//! Generators for tests and benchmarks: geometry and rays with special cases, and damaged files.
//!
//! Results are plain arrays, so no other crate of the project is needed. Results depend only on a seed, which tests
//! print.
//!
//! - [`rng`]: random numbers
//! - [`mesh`]: triangle meshes
//! - [`rays`]: rays for a mesh
//! - [`model`]: glTF and OBJ files with all kinds of looks
//! - [`picture`]: PNG files
//! - [`mod@mutate`]: damaged copies of files
//! - [`mod@permutations`]: every order of a few items
//! - [`sample`]: some of the combinations of several lists
//!
//! # Example
//!
//! ```
//! use antumbra_testkit::{Rng, mesh, rays};
//!
//! let mut rng = Rng::new(7);
//! for generate in mesh::ALL {
//!     let mesh = generate(&mut rng, 100);
//!     let rays = rays::around(&mut rng, &mesh, 50);
//!     assert_eq!(rays.len(), 50, "{}", mesh.name);
//! }
//! ```
#![forbid(unsafe_code)]

pub mod mesh;
pub mod model;
pub mod mutate;
pub mod permutations;
pub mod picture;
pub mod rays;
pub mod rng;
pub mod sample;

pub use mesh::Mesh;
pub use mutate::mutate;
pub use permutations::permutations;
pub use rays::TestRay;
pub use rng::Rng;
