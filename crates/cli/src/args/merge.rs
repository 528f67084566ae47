//! Flags of `merge`.

use std::path::PathBuf;

use clap::Args;

use super::{heading, values};
use crate::json::Destination;

/// Flags of `merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// All parts of one picture, in any order
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// Image to write; - is the standard output
    #[arg(short, long, value_name = "FILE|-", value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: PathBuf,
    /// Standard error of every pixel's mean, as .exr
    ///
    /// The parts must have been rendered with it.
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub stderr_image: Option<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
}
