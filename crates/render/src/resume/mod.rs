//! A rendering that was interrupted, or divided among machines, in files.
//!
//! - `archive.rs`: the frame of all files: format, version, checksum
//! - `identity.rs`: whose samples or training rays a file holds
//! - `snapshot.rs`: the state of a rendering, to be resumed or joined

pub mod archive;
mod identity;
mod snapshot;

pub use identity::{Identity, Place};
pub use snapshot::{Earlier, Snapshot};
