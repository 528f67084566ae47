//! Flags of `view`.

use std::path::PathBuf;

use antumbra_bake::Moment;
use clap::Args;

use super::tree::TreeArgs;
use super::{CameraArgs, MachineArgs, NorthArgs, PictureArgs, SCENE, SCENE_LONG, heading};

/// Flags of `view`.
#[derive(Debug, Args)]
#[command(mut_arg("north", |north| north.requires("day").help_heading(heading::SUN)))]
pub struct ViewArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Port of the page on 127.0.0.1 [default: any]
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true, help_heading = heading::OUTPUT)]
    pub port: u16,
    /// Show the sun of a day, such as 2025-06-21
    ///
    /// The page paints hours of direct sun on the model, shows its shadows at a time that a slider sets, and draws the hours of
    /// points that are clicked. Needs --lat and --lon.
    #[arg(long, value_name = "DATE", requires = "lat", requires = "lon", help_heading = heading::SUN)]
    pub day: Option<Moment>,
    /// Latitude in degrees, south negative
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, requires = "day", help_heading = heading::SUN)]
    pub lat: Option<f64>,
    /// Longitude in degrees, west negative
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, requires = "day", help_heading = heading::SUN)]
    pub lon: Option<f64>,
    /// Hours ahead of UTC [default: by the longitude]
    #[arg(long, value_name = "HOURS", allow_negative_numbers = true, requires = "day", help_heading = heading::SUN)]
    pub timezone: Option<f64>,
    #[command(flatten)]
    pub north: NorthArgs,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub tree: TreeArgs,
    #[command(flatten)]
    pub machine: MachineArgs,
}
