//! What users see first: a tree of any width, how it is made and how it is asked.
//!
//! - `bvh`: the tree;  `recipe`: every choice that makes one;  `learn`: making one in one call
//! - `report`: what was built;  `times`: how long the steps took
//! - `lab`: the steps of learning one by one
//! - `query`: batches of rays;  `tracer`: rays one by one;  `prefetch`: whether batches prefetch

pub(crate) mod bvh;
pub(crate) mod lab;
pub(crate) mod learn;
mod prefetch;
mod query;
pub(crate) mod recipe;
pub(crate) mod report;
pub(crate) mod times;
pub(crate) mod tracer;
