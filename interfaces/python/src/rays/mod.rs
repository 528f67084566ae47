//! Rays, what they hit, and the results.
//!
//! - `arguments`: rays as callers give them;  `groups`: rays from every point in every direction
//! - `piece`: rays before the kernel, some at a time
//! - `queries`: what rays hit;  `hits`: the results;  `distinct`: hits as trimesh returns them

pub mod arguments;
pub mod distinct;
pub mod groups;
pub mod hits;
pub mod piece;
pub mod queries;
