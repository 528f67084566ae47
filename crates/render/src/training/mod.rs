//! Training rays, and the binary trees that learn from them.
//!
//! - `selection.rs`: which samples the pre-pass takes
//! - `sample.rs`: the shadow rays of the pre-pass that threads keep
//! - `lesson.rs`: the training rays of a scene
//! - `trees.rs`: binary trees with the training logs of their surface rays

mod lesson;
mod sample;
mod selection;
mod trees;

pub use lesson::Lesson;
pub use sample::{RaySample, TrainingSample};
pub use selection::Selection;
pub use trees::BuiltTree;
