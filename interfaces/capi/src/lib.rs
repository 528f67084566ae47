//! The C interface of [`antumbra`]: the functions that `include/antumbra.h` declares.
//!
//! A door: arguments become what the kernel takes, and answers become structures of C. Nothing is decided here. The header is
//! the manual: it says what callers promise, and each `SAFETY` comment that mentions it refers to these promises.
//!
//! - `status`: codes, the text of the last error, panics;  `arrays`: memory of the caller
//! - `interface`: the form of all functions, and their list for the header
//! - `threads`: pools of threads, and work shared among them
//! - `scene`: lists of geometries;  `meshes`: triangles and quads;  `functions`: user geometry and opacities
//! - `recipe`: choices of a build;  `build`: trees and objects;  `tree`: what they are, refit
//! - `learning`: orders that copies learn and others adopt
//! - `single`: queries of one ray;  `batch`: many rays with conditions;  `queries`: what they hit;  `hits`: all they hit
//! - `groups`: points times directions;  `points`: what is near points, and around them
//! - `world`: instances that move;  `save`: files;  `fields`: what cells of height rasters see
#![allow(
    clippy::missing_safety_doc,
    reason = "the header says what callers of each function promise"
)]
#![allow(
    clippy::too_many_arguments,
    reason = "C has no slices: an array is an address, a count and a stride"
)]
#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "the docs are comments of the header, where brackets index arrays"
)]
#![allow(missing_docs, reason = "the header describes the fields of structures")]

pub mod arrays;
pub mod batch;
pub mod build;
pub mod fields;
pub mod functions;
pub mod groups;
pub mod hits;
mod interface;
pub mod learning;
pub mod meshes;
pub mod points;
pub mod queries;
pub mod recipe;
pub mod save;
pub mod scene;
pub mod single;
pub mod status;
pub mod threads;
pub mod tree;
pub mod world;
