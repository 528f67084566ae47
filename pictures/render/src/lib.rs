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
//! Pictures have the expected values of pbrt-v3 for the materials, lights, integrators and films that both know.
//! Equal scenes, samples per pixel and seeds give equal bits, whatever the number of threads, the tree, its width and
//! the instruction set.
//!
//! # Source
//!
//! Every folder imports from folders above it only:
//!
//! - `sampler/`: random values of every sample, and warps of the unit square
//! - `surface/`: points of surfaces, and the rays that leave them
//! - `film/`: tiles, filters, and the sums that become pixels
//! - `live.rs`: tiles of a running rendering, for whoever looks at it: [`LiveTiles`]
//! - `texture/`: textures and alpha masks
//! - `light/`: lights, and the choice of one of them
//! - `material/`: materials, and how they scatter light (`bsdf/`)
//! - `medium/`: participating media: distances, directions, transmittance
//! - `training/`: training rays, and the binary trees that learn from them
//! - `world/`: a scene lowered for rendering: [`World`]
//! - `integrator/`: radiance along batches of camera rays
//! - `resume/`: files of unfinished or partial renderings: [`Snapshot`]
//! - `render/`: one rendering from beginning to end: [`render()`]
//!
//! Beside them are `error.rs`, `options.rs`, `color.rs` and `columns.rs`, which import from no folder.
#![forbid(unsafe_code)]

mod clock;
mod color;
mod columns;
mod error;
mod film;
mod integrator;
mod light;
mod live;
mod material;
mod medium;
mod options;
mod render;
mod resume;
mod sampler;
mod surface;
mod texture;
mod training;
mod world;

pub use clock::clock;
pub use error::Error;
pub use film::{BadShard, Shard};
pub use integrator::{Counts, Observer, PathBatch, Queries, SampleCost};
pub use live::{LiveTile, LiveTiles, Seen};
pub use options::Options;
pub use render::{
    Growth, KeptTree, Layers, LearningFigures, Monitor, ObservedPicture, PathRays, PathTracer,
    Paths, Phase, Rendering, Round, Session, Sight, Split, Stats, Task, image_hash, render,
    render_rounds, render_task, training_rays,
};
pub use resume::{Identity, Place, Snapshot};
pub use sampler::Method;
pub use training::Lesson;
pub use world::{Camera, Lowered, World};
