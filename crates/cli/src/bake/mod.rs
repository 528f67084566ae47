//! Bakes: numbers about points of a scene that are computed once and kept. `ao`, `sun`, `visible`.
//!
//! - `ao`, `sun` with `sun_files`, `visible`: one command each;  `merge`: parts of one of them become the whole
//! - `mesh`, `sensors`, `view`, `texels`: points that are asked about
//! - `chunks`: work in chunks that can be resumed and spread;  `hash`: what tells one work from another
//! - `learn`: trees that learn from a bake's own rays

pub mod ao;
pub mod chunks;
mod hash;
mod learn;
pub mod merge;
mod mesh;
mod sensors;
pub mod sun;
mod sun_files;
mod texels;
mod view;
pub mod visible;
