//! Flags of `info`.

use std::path::PathBuf;

use clap::Args;

use super::tree::BuilderArgs;
use super::{PoseArgs, SCENE, SCENE_LONG, heading};
use crate::json::Destination;

/// Flags of `info`.
#[derive(Debug, Args)]
pub struct InfoArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Everything as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    #[command(flatten)]
    pub pose: PoseArgs,
    #[command(flatten)]
    pub builder: BuilderArgs,
}
