//! Flags of `visible`.

use std::path::PathBuf;

use antumbra_bake::UpAxis;
use clap::{ArgGroup, Args};

use super::sensors::{UnitArgs, up_axis};
use super::{ChunkArgs, MapArgs, RasterArgs, SCENE, SCENE_LONG, heading, values};
use crate::json::Destination;

/// Flags of `visible`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("surface"))]
pub struct VisibleArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Points that look: x, y [, z] [, nx, ny, nz]
    ///
    /// Points without the column of heights (z, or y where y is up) are put on the surface that is seen from above.
    /// Columns are known by the names in the first line, or else by their order. Points with normals look from a little
    /// above their surface, and see nothing behind it.
    #[arg(value_name = "A.csv")]
    pub from: PathBuf,
    /// Points looked at [default: the points of A.csv]
    #[arg(value_name = "B.csv", conflicts_with = "surface")]
    pub to: Option<PathBuf>,
    /// Result: .npz, .csv, .ply, .png, .svg, .pdf or .tif
    ///
    /// May be given several times. An .npz has the matrix as bits with the counts, a .csv the count of every point of A (of a
    /// viewshed: of every place), a .ply the points of A or the mesh in colours, and a .png, .svg or .pdf a map of
    /// --viewshed with --grid. Beside a .png is a .pgw, the world file for GIS programs. A .tif (GeoTIFF), .asc or .npy has the
    /// counts in the cells of a --grid or of a scene that is a raster. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    #[command(flatten)]
    pub map: MapArgs,
    #[command(flatten)]
    pub raster: RasterArgs,
    /// Lines of sight: .csv of pairs, .ply of edges
    ///
    /// Lines of sight of shards are written by `merge`.
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub lines: Option<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Count the observers that see each vertex
    #[arg(long, group = "surface", help_heading = heading::WORK)]
    pub viewshed: bool,
    /// Take a grid on the surface instead of vertices
    ///
    /// The places lie so many units apart. They are those that are seen from above.
    #[arg(long, value_name = "UNITS", requires = "viewshed", value_parser = values::positive, help_heading = heading::WORK)]
    pub grid: Option<f64>,
    /// Height of observers above A
    #[arg(long, value_name = "UNITS", default_value_t = 0.0, value_parser = values::from_zero, help_heading = heading::WORK)]
    pub eye: f64,
    /// Targets above B, or the surface
    #[arg(long, value_name = "UNITS", default_value_t = 0.0, value_parser = values::from_zero, help_heading = heading::WORK)]
    pub target: f64,
    /// Left out at both ends [default: origin offset]
    ///
    /// The origin offset is about 4 millionths of the largest coordinate of the point and of its surface. A point on a surface is
    /// rounded, and without a margin its own surface hides it now and then. 0 takes the bare lines. The viewshed of a height
    /// raster is then made by rays too, instead of exactly.
    #[arg(long, value_name = "UNITS", value_parser = values::from_zero, help_heading = heading::WORK)]
    pub margin: Option<f64>,
    /// Axis that points up [default: the scene's]
    #[arg(long, value_name = "AXIS", value_parser = up_axis, help_heading = heading::WORK)]
    pub up: Option<UpAxis>,
    /// Greatest distance of sight, in plan
    #[arg(long, value_name = "UNITS", requires = "viewshed", value_parser = values::positive, help_heading = heading::WORK)]
    pub radius: Option<f64>,
    /// Round earth, and light that air bends
    ///
    /// Places d away lie lower by (1 - k) d² / (2 R), with --refraction k and the --earth-radius R.
    #[arg(long, help_heading = heading::WORK)]
    pub curvature: bool,
    /// Refraction; 0 without air
    #[arg(long, value_name = "K", default_value_t = antumbra_bake::REFRACTION, allow_negative_numbers = true, requires = "curvature", help_heading = heading::WORK)]
    pub refraction: f64,
    /// Radius of the earth
    #[arg(long, value_name = "METRES", default_value_t = antumbra_bake::EARTH_RADIUS, requires = "curvature", value_parser = values::positive, help_heading = heading::WORK)]
    pub earth_radius: f64,
    #[command(flatten, next_help_heading = heading::WORK)]
    pub units: UnitArgs,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}
