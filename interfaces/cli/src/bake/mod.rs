//! Bakes: numbers about points of a scene that are computed once and kept. `ao`, `sun`, `visible`, `horizon`, `factors`.
//!
//! Each command turns its arguments into a job of the crate `antumbra-bake`, and the result into files and a document. It is
//! [`Baking`] for its arguments; [`run`] has the steps around it.
//!
//! - `ao`, `sun`, `visible`, `horizon`, `factors`: one command each;  `merge`: parts of one of them become the whole
//! - `site`: where on the earth a scene is;  `when`: times of `sun`;  `hourly`, `frames`, `groups`: values by step of time, moving shadows, means by object;  `viewshed`: `visible --viewshed` of a height raster
//! - `command`: the steps that all of them have in common
//! - `ground`, `parts`, `places`, `view`: scenes, names of their triangles, and points of them;  `terrain`: height rasters without either
//! - `chunks`: files of unfinished work and of shares
//! - `files`: formats and writers of results;  `map`: maps of grids;  `raster`: results as GeoTIFF, .asc and .npy

mod ao;
pub mod chunks;
mod command;
mod factors;
mod files;
mod frames;
mod ground;
mod groups;
mod horizon;
mod hourly;
pub mod map;
pub mod merge;
mod parts;
mod places;
mod raster;
pub mod site;
mod sun;
mod terrain;
mod view;
mod viewshed;
mod visible;
mod when;

pub use command::{Baking, run};
