//! Flags of `ao`.

use std::path::PathBuf;

use antumbra_bake::AmbientOcclusion;
use clap::Args;

use super::{MachineArgs, SCENE, SCENE_LONG, heading, values};
use crate::json::Destination;

/// Flags of `ao`.
#[derive(Debug, Args)]
pub struct AoArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Mesh to write, .ply; - is the standard output
    ///
    /// Holds the triangles of all meshes in world space, with normals. Every vertex has the value as the float property
    /// ao, and as a grey colour of 8 bits.
    #[arg(short, long, value_name = "FILE|-", value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: PathBuf,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Rays per vertex and side
    ///
    /// Powers of two are spread most evenly.
    #[arg(
        long, value_name = "N", default_value_t = AmbientOcclusion::default().samples,
        help_heading = heading::WORK, value_parser = clap::value_parser!(u32).range(1..=1 << 20)
    )]
    pub samples: u32,
    /// Distance up to which surfaces occlude [default: any]
    ///
    /// In units of the scene.
    #[arg(long, value_name = "D", value_parser = distance, help_heading = heading::WORK)]
    pub distance: Option<f32>,
    /// Look to both sides, and keep the more open one
    ///
    /// For meshes whose triangles face anywhere.
    #[arg(long, help_heading = heading::WORK)]
    pub two_sided: bool,
    /// Also write the mean direction of the open sky
    ///
    /// As the float properties bent_x, bent_y and bent_z, of length 1.
    #[arg(long, help_heading = heading::WORK)]
    pub bent_normals: bool,
    /// Count all parts of the sky alike
    ///
    /// If absent: by the cosine of the angle to the normal, as an even sky lights a matt surface.
    #[arg(long, help_heading = heading::WORK)]
    pub uniform: bool,
    /// Seed of all directions
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = heading::WORK)]
    pub seed: u64,
    #[command(flatten)]
    pub machine: MachineArgs,
}

/// Parses a distance above 0.
fn distance(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(distance) if distance > 0.0 => Ok(distance),
        _ => Err("it must be a number above 0".into()),
    }
}
