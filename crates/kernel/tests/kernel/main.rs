//! Tests of the kernel through its public interface.
//!
//! - [`oracle`]: every tree, order and level against brute force, on every kind of geometry
//! - [`watertight`]: closed meshes do not leak
//! - [`orders`]: what orders do to costs, logs, errors
//! - [`learning`]: trees learned from logs: the same answers, lower costs, no harm to other rays
//! - [`build`]: trees are valid, complete and deterministic
//! - [`cutouts`]: partly transparent triangles: what counts as a hit, and that every tree agrees
//! - [`batches`]: batches of every length, on one thread and several
//! - [`instances`]: scenes on two levels
//! - [`support`]: what these share

mod batches;
mod build;
mod cutouts;
mod instances;
mod learning;
mod oracle;
mod orders;
mod support;
mod watertight;
