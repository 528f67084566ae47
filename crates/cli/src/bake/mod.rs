//! Bakes: numbers about points of a scene that are computed once and kept. `ao`, `sun`, `visible`.
//!
//! Each command turns its arguments into a job of the crate `antumbra-bake`, and the result into files and a document.
//!
//! - `ao`, `sun`, `visible`: one command each;  `merge`: parts of one of them become the whole
//! - `hourly`: steps of time of `sun`;  `viewshed`: `visible --viewshed` of a height raster
//! - `command`: the steps that all of them have in common
//! - `ground`, `view`: scenes, and points of them
//! - `chunks`: files of unfinished work and of shares
//! - `files`: formats and writers of results;  `map`: maps of grids;  `raster`: results as GeoTIFF, .asc and .npy

pub mod ao;
pub mod chunks;
mod command;
mod files;
mod ground;
mod hourly;
pub mod map;
pub mod merge;
mod raster;
pub mod sun;
mod view;
mod viewshed;
pub mod visible;
