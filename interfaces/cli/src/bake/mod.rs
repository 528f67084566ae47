//! Bakes: numbers about points of a scene that are computed once and kept, with a command for each kind of them.
//!
//! A command turns its arguments into a job of the crate `antumbra-bake`, and the result into files and a document. It is a file
//! with its arguments, for which it implements [`Baking`], and a row of [`BakeCommand`]. Shares, resumed work, `merge`, `farm` and
//! the help follow from both.
//!
//! - `ao`, `sun/`, `visible/`, `horizon`, `factors`: one command each;  `merge`: parts of one of them become the whole
//! - `command`: the steps that all of them have in common
//! - `site`: where on the earth a scene is
//! - `ground`, `parts`, `places`, `view`: scenes, names of their triangles, and points of them;  `terrain`: height rasters without either
//! - `tile`: tiles of rasters of many files
//! - `neighbours`: tiles beside a height raster
//! - `chunks`: files of unfinished work and of shares
//! - `files`: formats and writers of results;  `map`: maps of grids and cells;  `raster`: results as GeoTIFF, .asc and .npy

mod ao;
pub mod chunks;
pub mod city;
mod command;
mod factors;
mod files;
pub mod ground;
mod horizon;
pub mod map;
pub mod merge;
mod neighbours;
mod parts;
mod places;
pub mod raster;
pub mod site;
mod sun;
mod terrain;
pub mod tile;
mod view;
mod visible;

use std::path::PathBuf;

use crate::args::ChunkArgs;
use crate::json::Destination;

pub use command::{run, run_share, run_tile};
pub use raster::write_values;

command::bakes! {
    /// Bake ambient occlusion: of vertices, a texture or a picture
    ///
    /// The value is the open part of the sky above a point: 1 where nothing is in the way, 0 where all is closed. Normals come
    /// from the file. Without them, they are means of the triangles around a vertex, weighted by area, and vertices are
    /// split where triangles meet at more than 40 degrees. So a corner of a roof has the open sky of the roof, and its copies
    /// have what the walls see. The file has the same bytes for any number of threads and shards.
    "ao" Ao(ao::AoArgs),
    /// Bake hours of direct sun, sky view factors and irradiation
    ///
    /// Each sensor traces a ray to every sun and every patch of the sky. Example, for a year in hours:
    ///
    /// antumbra sun city.ply --grid 2 --lat 48.2 --lon 16.4 --timezone 1 -o hours.csv -o hours.png
    ///
    /// Suns are where the algorithm of NREL has them. Light that surfaces reflect is left out.
    #[command(override_usage = "antumbra sun [OPTIONS] -o <OUT> <SENSORS> <SCENE>...")]
    "sun" Sun(sun::SunArgs),
    /// Find which points see each other, and what observers see
    ///
    /// Points see each other if nothing lies between them. With --viewshed, the result is how many points of
    /// A.csv see each place of the mesh.
    "visible" Visible(visible::VisibleArgs),
    /// Find how high the horizon is in each direction
    ///
    /// The angle is the elevation in degrees from which on up to the zenith all of the sky is seen: 0 on an open plain, 90 below a
    /// roof. Directions behind the surface of a sensor count as closed. Cells of a height raster (--cells) are computed exactly, from
    /// its triangles in double precision. Otherwise rays find the angle to less than 0.001 degrees, and may miss surfaces that float
    /// above others and are less than half a degree high.
    #[command(override_usage = "antumbra horizon [OPTIONS] -o <OUT> <SENSORS> <SCENE>...")]
    "horizon" Horizon(horizon::HorizonArgs),
    /// Find how much of the light of a surface arrives at others
    ///
    /// View factors: the part of the light that leaves a surface evenly and arrives at each other one, or nowhere. Rows add up to
    /// 1. Triangles emit on the side from which their corners run anticlockwise; both sides receive.
    "factors" Factors(factors::FactorArgs),
}
