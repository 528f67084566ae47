//! Generators for tests and benches: geometry nice and nasty, rays aimed where it hurts.
//!
//! Everything is plain arrays, so that no crate of the project is needed here. All of it is a function of
//! a seed: tests print theirs.
//!
//! - [`rng`]: numbers;  [`mesh`]: geometry;  [`rays`]: rays
#![forbid(unsafe_code)]

pub mod mesh;
pub mod rays;
pub mod rng;

pub use mesh::Mesh;
pub use rays::TestRay;
pub use rng::Rng;
