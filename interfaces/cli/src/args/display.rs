//! Flags about the values of pictures for displays, of `render` and `image convert`.

use std::path::Path;

use antumbra_image::{Display, Image, Tonemap};
use clap::{Args, ValueEnum};

use super::heading;
use super::names::{named, one_of};
use crate::exit::{Failure, tell};
use crate::output;

/// Flags about values for displays.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::OUTPUT)]
pub struct DisplayArgs {
    /// Exposure of a PNG or JPEG in stops
    ///
    /// 1 is twice as bright. EXR and HDR files keep their linear values.
    #[arg(
        long,
        value_name = "EV",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub exposure: f32,
    /// Tone curve of PNG, JPEG: agx, filmic, none
    ///
    /// agx, the default, lets bright colours fade to white. filmic is the curve of the ACES reference. none cuts off what
    /// is brighter than white, as pbrt does. none is the default where values are no light: for ambient occlusion, and
    /// for layers and PNG or JPEG files that are converted.
    #[arg(long, value_name = "CURVE", value_parser = one_of::<Tonemap>(named(&Tonemap::ALL, Tonemap::name)), hide_possible_values = true)]
    pub tonemap: Option<Tonemap>,
    /// Bits per channel of a PNG: 8 or 16
    #[arg(long, value_name = "N", default_value = "8", value_parser = ["8", "16"], hide_possible_values = true)]
    pub bits: String,
}

impl DisplayArgs {
    /// The values to show, by default from `usual`.
    pub fn display(&self, usual: Display) -> Display {
        Display {
            exposure: self.exposure,
            tonemap: self.tonemap.unwrap_or(usual.tonemap),
        }
    }

    /// Refuses values that no picture can have.
    pub fn check(&self) -> Result<(), Failure> {
        if self.exposure.is_finite() && self.exposure.abs() <= 100.0 {
            return Ok(());
        }
        let exposure = self.exposure;
        Err(Failure::Usage(format!(
            "--exposure {exposure} is not between -100 and 100 stops"
        )))
    }

    /// Writes an image with these values, by default the ones of `usual`. Says so if much of it is brighter than white.
    pub fn write(&self, image: &Image, path: &Path, usual: Display) -> Result<(), Failure> {
        let display = self.display(usual);
        let white = (-self.exposure).exp2();
        let is_burnt = |pixel: &&[f32; 3]| pixel.iter().any(|&value| value > 1.001 * white);
        let burnt = image.pixels().iter().filter(is_burnt).count();
        let share = burnt as f64 / image.pixels().len().max(1) as f64;
        if display.tonemap == Tonemap::None && is_for_displays(path) && share > BURNT {
            tell(format_args!(
                "note: {:.1} % of the pixels are brighter than white; --tonemap agx or a smaller --exposure keeps them",
                100.0 * share
            ));
        }
        if self.bits == "16" && output::is_one_of(path, &["png"]) {
            image.write_png16(path, &display)?;
        } else {
            image.write_for(path, &display)?;
        }
        Ok(())
    }
}

/// Share of pixels brighter than white from which it is said.
const BURNT: f64 = 0.01;

/// How pictures are shown by default: light under a tone curve, and other values as they are.
pub fn usual(is_light: bool) -> Display {
    Display {
        exposure: 0.0,
        tonemap: match is_light {
            true => Tonemap::AgX,
            false => Tonemap::None,
        },
    }
}

/// Whether files of this name hold values for displays.
pub fn is_for_displays(path: &Path) -> bool {
    output::is_one_of(path, &["png", "jpg", "jpeg"])
}

/// Names of layers in an EXR file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum AovNames {
    /// Names of pbrt-v4.
    Pbrt,
    /// Names of Cycles, for its denoising node.
    Cycles,
}
