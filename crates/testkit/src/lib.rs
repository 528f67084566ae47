//! Generators for tests and benches: geometry nice and nasty, rays aimed where it hurts.
//!
//! Everything is plain arrays, so that no crate of the project is needed here. All of it is a function of
//! a seed: tests print theirs.
//!
//! - [`rng`]: numbers;  [`mesh`]: geometry;  [`rays`]: rays;  [`mod@mutate`]: damaged copies of files;
//!   [`mod@permutations`]: every order of a few things
#![forbid(unsafe_code)]

pub mod mesh;
pub mod mutate;
pub mod permutations;
pub mod rays;
pub mod rng;

pub use mesh::Mesh;
pub use mutate::mutate;
pub use permutations::permutations;
pub use rays::TestRay;
pub use rng::Rng;
