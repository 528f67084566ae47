//! Flags that decide the picture, of `render` and `study`.

use antumbra_load::IntegratorKind;
use clap::Args;

use super::heading;
use super::names::{help_one, named, one_of};
use super::values::{self, Resolution};

/// Flags that decide the picture.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::PICTURE)]
pub struct PictureArgs {
    /// Samples per pixel [default: the scene's]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: Option<u32>,
    /// Size of the full picture [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub resolution: Option<Resolution>,
    #[arg(
        long,
        value_name = "I",
        help = "Integrator, by pbrt's name [default: the scene's]",
        long_help = help_one("Integrator", &named(&IntegratorKind::ALL, IntegratorKind::name),
            "If the scene has the same one, its settings are kept; otherwise they are pbrt-v3's defaults. \
             ambientocclusion is 0 to 1 for a mesh, and 0 to pi for a .pbrt scene. If absent: the scene's."),
        value_parser = one_of::<IntegratorKind>(named(&IntegratorKind::ALL, IntegratorKind::name)), hide_possible_values = true)]
    pub integrator: Option<IntegratorKind>,
    /// Shadow rays per camera ray, or samples per light
    ///
    /// The former for ambientocclusion, the latter for directlighting, where lights without a size get one
    /// ray. Refused for path, which samples one light once at every vertex.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub samples: Option<u32>,
    /// Longest occlusion ray [default: any]
    ///
    /// Distance up to which surfaces occlude in ambientocclusion, in units of the scene.
    #[arg(long, value_name = "D", value_parser = values::distance)]
    pub ao_distance: Option<f32>,
    /// Seed of all random values
    #[arg(
        long,
        value_name = "N",
        allow_negative_numbers = true,
        default_value_t = 0
    )]
    pub seed: u64,
}
