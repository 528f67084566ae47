//! Flags of `probe`.

use std::path::PathBuf;

use antumbra_lab::probe::Part;
use clap::Args;

use super::tree::WidthsArgs;
use super::{MachineArgs, PictureArgs, SCENE, SCENE_LONG, heading};

/// Flags of `probe`.
#[derive(Debug, Args)]
pub struct ProbeArgs {
    #[arg(required = true, value_name = "SCENE", help = SCENE, long_help = SCENE_LONG)]
    pub scenes: Vec<PathBuf>,
    /// Rows as CSV
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    pub csv: Option<PathBuf>,
    /// Parts, separated by commas [default: all]
    ///
    /// ways: per node, the static order, near first or far first. splits: trees with spatial splits. model: cost models against measured costs. moving: a tree that learns
    /// while the camera moves.
    #[arg(
        long, value_name = "LIST", value_delimiter = ',', value_parser = part,
        default_value = "ways,splits,model,moving", hide_default_value = true,
        help_heading = heading::WORK
    )]
    pub parts: Vec<Part>,
    /// Held-out rays of each kind
    #[arg(
        long, value_name = "N", default_value_t = 50_000, help_heading = heading::WORK,
        value_parser = clap::value_parser!(u32).range(1..=1 << 24)
    )]
    pub rays: u32,
    /// Training rays of each kind
    #[arg(
        long, value_name = "N", default_value_t = 8192, help_heading = heading::LEARNING,
        value_parser = clap::value_parser!(u32).range(1..=1 << 20)
    )]
    pub log_rays: u32,
    /// Rounds of timing; 0: only counts
    #[arg(
        long, value_name = "N", default_value_t = 7, help_heading = heading::WORK,
        value_parser = clap::value_parser!(u32).range(..=10_000)
    )]
    pub repeat: u32,
    /// Frames of the moving camera
    #[arg(
        long, value_name = "N", default_value_t = 100, help_heading = heading::WORK,
        value_parser = clap::value_parser!(u32).range(1..=10_000)
    )]
    pub frames: u32,
    #[command(flatten)]
    pub widths: WidthsArgs,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub machine: MachineArgs,
}

fn part(name: &str) -> Result<Part, String> {
    let found = Part::ALL.into_iter().find(|part| part.name() == name);
    found.ok_or_else(|| {
        let names = Part::ALL.map(Part::name).join(", ");
        format!("no such part; there are {names}")
    })
}
