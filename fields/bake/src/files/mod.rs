//! Results as files.

pub(crate) mod glb;
pub(crate) mod npz;
pub(crate) mod ply;

pub use glb::write_glb;
pub use npz::{Array, Entry, npz_bytes, write_npz};
pub use ply::ShadedMesh;
