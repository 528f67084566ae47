//! Flags of `view`.

use std::path::PathBuf;

use clap::Args;

use super::tree::TreeArgs;
use super::{CameraArgs, MachineArgs, PictureArgs, SCENE, SCENE_LONG, heading};

/// Flags of `view`.
#[derive(Debug, Args)]
pub struct ViewArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Port of the page on 127.0.0.1 [default: any]
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true, help_heading = heading::OUTPUT)]
    pub port: u16,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub tree: TreeArgs,
    #[command(flatten)]
    pub machine: MachineArgs,
}
