//! Training rays, and the binary trees that learn from them.
//!
//! - `sample.rs`: what workers keep of the shadow rays of the pre-pass
//! - `lesson.rs`: the training rays of a scene, as they are kept in a file
//! - `trees.rs`: binary trees with the logs of their surface rays

pub mod lesson;
pub mod sample;
pub mod trees;
