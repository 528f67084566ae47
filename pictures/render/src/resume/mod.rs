//! Files: renderings to be resumed, or joined from several machines, and training rays.
//!
//! - `sums.rs`: the samples of a picture so far
//! - `snapshot.rs`: the state of a rendering
//! - `identity.rs`: the rendering or geometry that a file belongs to
//! - `archive.rs`: the format of all files: kind, version, checksum
//! - `lesson.rs`: training rays as a file

mod archive;
mod identity;
mod lesson;
mod snapshot;
mod sums;

pub use identity::{Identity, Place};
pub use snapshot::{Earlier, Snapshot};
pub use sums::{Effort, Sums, TileWork};
