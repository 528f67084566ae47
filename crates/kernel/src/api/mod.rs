//! What users see first: a tree of any width, how it is made and how it is asked.
//!
//! - `bvh`: the tree;  `build`: making one in one call;  `times`: how long the steps took
//! - `query`: batches of rays;  `tracer`: rays one by one;  `prefetch`: whether batches prefetch

pub(crate) mod build;
pub(crate) mod bvh;
mod prefetch;
mod query;
pub(crate) mod times;
pub(crate) mod tracer;
