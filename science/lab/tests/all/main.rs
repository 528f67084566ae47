//! Tests of the laboratory through its public interface.
//!
//! - `comparing`: trees that are compared on one picture, against pictures that are rendered one by one
//! - `groups`, `rays`: rays of camera paths, and trees made from them
//! - `learning`: effect of learning from one kind of rays on another kind
//! - `plugged`: pictures with trees that plug into the kernel
//! - `experiments`: studies and benchmarks
//! - `support`: a small scene that these share

mod comparing;
mod experiments;
mod groups;
mod learning;
mod plugged;
mod rays;
// Parts of small scenes, from the tests of the renderer, which need more of them.
#[allow(dead_code)]
#[path = "../../../../pictures/render/tests/all/support/mod.rs"]
mod scenes;
mod support;
