//! Flags of `factors`.

use std::path::PathBuf;

use antumbra_bake::UpAxis;
use clap::Args;

use super::sensors::up_axis;
use super::{By, ChunkArgs, SCENE, SCENE_LONG, heading, values};
use crate::json::Destination;

/// Flags of `factors`.
#[derive(Debug, Args)]
pub struct FactorArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Result: .csv or .npz
    ///
    /// May be given several times. A .csv has a line for each surface: its names, its area in squared units, its factor to every
    /// surface, and the part that arrives nowhere. An .npz has the array factors with the last column for nowhere, the areas, and the
    /// surface of each triangle. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Surfaces: object, material or facade
    ///
    /// Lines `o`, or else `g`, begin objects in an .obj; nodes are objects in a .gltf. Where nothing has a name, surfaces that touch are a
    /// body. A facade is all of an object that faces one of eight sides of the compass; roofs, ground and undersides are surfaces too.
    #[arg(long, value_name = "KIND", value_enum, default_value_t = By::Object, hide_possible_values = true, help_heading = heading::WORK)]
    pub by: By,
    /// Rays of each surface
    ///
    /// Errors of a factor are about 1 / N to 1 / sqrt(N).
    #[arg(long, value_name = "N", default_value_t = 65_536, value_parser = clap::value_parser!(u32).range(1..), help_heading = heading::WORK)]
    pub samples: u32,
    /// Axis that points up [default: the scene's]
    #[arg(long, value_name = "AXIS", value_parser = up_axis, help_heading = heading::WORK)]
    pub up: Option<UpAxis>,
    /// Angle from mesh to true north
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, value_parser = values::finite, help_heading = heading::WORK)]
    pub north: f64,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}
