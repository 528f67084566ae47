//! Flags of `index`, `plan`, `run` and `check`.

use std::path::PathBuf;

use clap::Args;

use super::{SCENE, ThreadArgs, heading, scene_of_all};
use crate::json::Destination;

/// Flags of `index`.
#[derive(Debug, Args)]
pub struct IndexArgs {
    /// Height rasters that are one, or meshes of a city
    ///
    /// .tif, .asc, or .npy with a .wld, or folders of them, whose cells fall on each other: where several have data in a cell, the first one
    /// has it. Or .ply, .obj, .stl, .gltf or .glb in the same coordinates.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Index to write, such as country.index
    ///
    /// Text with a JSON object in each line. With an index of rasters FILE.peaks is written, by which tiles find what of other files matters.
    #[arg(short, long, value_name = "FILE", required = true, help_heading = heading::OUTPUT)]
    pub output: PathBuf,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Flags of `plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    #[arg(help = SCENE, long_help = scene_of_all("An index of height rasters"))]
    pub scene: PathBuf,
    /// Plan to write, such as plan.jsonl
    ///
    /// Text: a JSON object with the whole in the first line, and one for each task in the others.
    #[arg(short, long, value_name = "FILE", required = true, help_heading = heading::OUTPUT)]
    pub output: PathBuf,
    /// Where results and receipts go [default: FILE.results]
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    pub folder: Option<PathBuf>,
    /// Cells on a side of the tiles of an index
    #[arg(long, value_name = "CELLS", default_value_t = 2048, help_heading = heading::JOB, value_parser = clap::value_parser!(u32).range(16..=1 << 16))]
    pub tile: u32,
    /// Number of tasks of any other scene
    #[arg(long, value_name = "N", default_value_t = 4, help_heading = heading::JOB, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub tasks: u32,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Command of every task, with its flags
    ///
    /// Without its scene and its output: for example sun --cells --from 2025-01-01 --to 2025-12-31 --step 60. Parts of render --stderr-image FILE have what
    /// merge --stderr-image needs.
    #[arg(
        required = true,
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "COMMAND"
    )]
    pub command: Vec<String>,
}

/// Flags of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Plan, as `plan` has written it
    pub plan: PathBuf,
    /// Tasks to run, by id or by number
    ///
    /// The first task has the number 0. If absent, all that are not done, one after the other.
    #[arg(long, value_name = "ID", num_args = 1.., help_heading = heading::JOB)]
    pub task: Vec<String>,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Flags of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Plan, as `plan` has written it
    pub plan: PathBuf,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
}
