//! Learning: from rays to what orders and collapses are computed from.
//!
//! - `surface_rays`: training rays when nobody gives any;  `placed_surfaces`: of instances
//! - `tree_log`: what training rays hit in the binary tree;  `node_lists`: how it is packed
//! - `log`: what they hit in a wide tree;  `ray_log`: what each of them hits there

pub(crate) mod log;
mod node_lists;
mod placed_surfaces;
pub(crate) mod ray_log;
pub(crate) mod surface_rays;
pub(crate) mod tree_log;

pub use log::{Log, LogKind};
pub use tree_log::TreeLog;
