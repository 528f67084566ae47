//! Rays and trees for a laboratory that measures kernels.
//!
//! - `rays.rs`: the rays of camera paths, by purpose
//! - `sampled.rs`: lots of occlusion rays that share no sample: training rays and held-out rays
//! - `trees.rs`: trees of any builder, collapse and order, made step by step

mod rays;
mod sampled;
mod trees;

pub use rays::{Rays, collect_rays};
pub use sampled::{Lot, SampledRays};
pub use trees::{CollapsedTree, OrderedTree, RaysFrom, TrainedTree};
