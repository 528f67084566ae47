//! Flags of `merge`.

use std::path::PathBuf;

use clap::Args;

use super::{heading, values};
use crate::json::Destination;

/// Flags of `merge`.
#[derive(Clone, Debug, Args)]
pub struct MergeArgs {
    /// All parts of one picture or bake, or a plan
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// File to write; - is the standard output
    ///
    /// Of a bake, as of its command, which may have several.
    #[arg(short, long, value_name = "FILE|-", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Standard error of every pixel's mean, as .exr
    ///
    /// The parts must have been rendered with it.
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub stderr_image: Option<PathBuf>,
    /// Lines of sight: .csv or .ply, see visible
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub lines: Option<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
}
