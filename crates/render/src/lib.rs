//! A wavefront path tracer on the Antumbra kernel.
//!
//! ```
//! use antumbra_render::{Error, Options, Rendering, World, render};
//! use antumbra_scene::Scene;
//!
//! fn picture(scene: &Scene) -> Result<Rendering, Error> {
//!     let world = World::new(scene)?;
//!     render(&world, &Options::default(), &())
//! }
//! ```
//!
//! Pictures have the expected values of pbrt-v3 for the materials, lights, integrators and films it shares.
//! The same scene, samples per pixel and seed give the same bits, whatever the number of threads, the order in
//! which shadow rays visit the tree, its width and the instruction set.
//!
//! The way of the data: a [`World`] is a lowered scene (`world.rs`, `camera.rs`, `lights.rs`, `light.rs`,
//! `color.rs`, `material.rs`, `bsdf/`, `texture/`). [`render()`] cuts the picture into tiles (`tile.rs`); each thread (`workers.rs`) takes a tile and
//! carries some thousands of its samples at a time (`sampler.rs`) through the stages of an integrator
//! (`integrator/`): closest hits, shading (`hits.rs`, `surface.rs`, `patch.rs`, `frame.rs`), shadow rays (`tracer.rs`). For orders
//! that learn (`learn.rs`), a pre-pass (`prepass.rs`, `evidence.rs`) traces a share of the samples first. Samples meet again on the film
//! (`film.rs`, `filter.rs`); [`Stats`] tell what was done. [`collect_rays()`] (`rays.rs`) gives away the rays of some
//! of the samples, for those who measure kernels.
#![forbid(unsafe_code)]

mod bsdf;
mod camera;
mod color;
mod emitters;
mod error;
mod evidence;
mod film;
mod filter;
mod frame;
mod geometry;
mod hits;
mod integrator;
mod learn;
mod light;
mod lights;

mod material;
mod monitor;
mod options;
mod patch;
mod prepass;
mod rays;
mod render;
mod sampler;
mod shapes;
mod stats;
mod surface;
mod texture;
mod tile;
mod tracer;
mod workers;
mod world;

pub use error::Error;
pub use geometry::Lowered;
pub use monitor::{Monitor, Phase};
pub use options::Options;
pub use rays::{Rays, collect_rays};
pub use render::{Rendering, render};
pub use sampler::Method;
pub use stats::{Split, Stats, image_hash};
pub use world::World;
