//! Training rays: which samples yield them, and how they are kept.
//!
//! - `selection.rs`: which samples the pre-pass takes
//! - `sample.rs`: the shadow rays of the pre-pass that threads keep
//! - `lesson.rs`: the training rays of a scene

mod lesson;
mod sample;
mod selection;

pub use lesson::Lesson;
pub use sample::{RaySample, TrainingSample};
pub use selection::Selection;
