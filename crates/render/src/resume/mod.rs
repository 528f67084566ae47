//! A rendering that was interrupted, or divided among machines, in files.
//!
//! - `archive.rs`: the frame of all files: format, version, checksum
//! - `identity.rs`: whose samples or training rays a file holds
//! - `snapshot.rs`: the state of a rendering, to be resumed or joined

mod archive;
mod identity;
mod lesson;
mod snapshot;
mod sums;

pub use identity::{Identity, Place};
pub use snapshot::{Earlier, Snapshot};
pub use sums::{Effort, Sums, TileWork};
