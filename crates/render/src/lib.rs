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
//! (`film.rs`, `filter.rs`), by way of the desk where each thread puts down its tile (`pass.rs`, `desk.rs`), so that what is
//! done can be kept at any time, gone on with and joined ([`Snapshot`]: `snapshot.rs`, `shard.rs`, `lesson.rs`; `identity.rs`, `archive.rs`); [`Stats`] tell what was done. [`collect_rays()`] (`rays.rs`) gives away the rays of some
//! of the samples, for those who measure kernels; [`SampledRays`] (`sampled.rs`) gives rays to learn from and others to
//! test by, and [`Forest`] (`technique.rs`) makes trees of any builder, collapse and order from them.
#![forbid(unsafe_code)]

mod color;
mod error;
mod film;
mod integrator;
mod lab;
mod light;
mod material;
mod options;
mod render;
mod resume;
mod sampler;
mod surface;
mod texture;
mod training;
mod world;

pub use error::Error;
pub use film::{BadShard, Shard};
pub use lab::{Forest, Grove, Grown, Lot, Rays, RaysFrom, SampledRays, collect_rays};
pub use options::Options;
pub use render::{Monitor, Phase, Rendering, Split, Stats, Task, image_hash, render, render_task};
pub use resume::{Identity, Place, Snapshot};
pub use sampler::Method;
pub use training::Lesson;
pub use world::{Lowered, World};
