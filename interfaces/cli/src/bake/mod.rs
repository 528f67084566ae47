//! Bakes: numbers about points of a scene that are computed once and kept. `ao`, `sun`, `visible`, `horizon`, `factors`.
//!
//! Each command turns its arguments into a job of the crate `antumbra-bake`, and the result into files and a document.
//!
//! - `ao`, `sun`, `visible`, `horizon`, `factors`: one command each;  `merge`: parts of one of them become the whole
//! - `site`: where on the earth a scene is;  `when`: times of `sun`;  `hourly`, `frames`, `groups`: values by step of time, moving shadows, means by object;  `viewshed`: `visible --viewshed` of a height raster
//! - `command`: the steps that all of them have in common
//! - `ground`, `parts`, `places`, `view`: scenes, names of their triangles, and points of them
//! - `chunks`: files of unfinished work and of shares
//! - `files`: formats and writers of results;  `map`: maps of grids;  `raster`: results as GeoTIFF, .asc and .npy

pub mod ao;
pub mod chunks;
mod command;
pub mod factors;
mod files;
mod frames;
mod ground;
mod groups;
pub mod horizon;
mod hourly;
pub mod map;
pub mod merge;
mod parts;
mod places;
mod raster;
pub mod site;
pub mod sun;
mod view;
mod viewshed;
pub mod visible;
mod when;
