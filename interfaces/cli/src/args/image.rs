//! Flags of `image`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::values::output_file;
use super::{DisplayArgs, heading};
use crate::json::Destination;

/// Commands of `image`.
#[derive(Debug, Subcommand)]
pub enum ImageCommand {
    /// Compare an image with a reference
    ///
    /// A crop is compared with its part of a whole picture. The exit code is 1 if they differ by more than chance, and 2 or more if they cannot be compared. Every pixel is tested: z is the difference over the
    /// standard error of the difference. An image without standard errors is taken as exact. Without any, the test is
    /// for equality up to rounding.
    Compare(CompareArgs),
    /// Convert an image to the format of the extension
    Convert {
        /// Image to read, .exr, .hdr, .png or .jpg
        input: PathBuf,
        /// Image to write: .exr, .hdr, .png, .jpg; - is stdout, .exr
        #[arg(value_parser = output_file())]
        output: PathBuf,
        /// Layer of an .exr, such as Albedo, Ns or Z
        ///
        /// See `render --layers`. A layer of one channel is grey.
        #[arg(long, value_name = "NAME")]
        layer: Option<String>,
        #[command(flatten)]
        display: DisplayArgs,
    },
    /// Remove noise by Intel Open Image Denoise
    ///
    /// The library is loaded when the command runs. Layers Albedo and Ns (or N) in the image help it to keep edges, see
    /// `render --layers`.
    Denoise {
        /// Image to read, .exr or .hdr
        input: PathBuf,
        /// Image to write, .exr, .hdr, .png or .jpg
        output: PathBuf,
        /// File of the library, or folder that holds it
        ///
        /// If absent: the environment variable OIDN_LIBRARY, what the system finds, or pyoidn in a Python environment.
        #[arg(long, value_name = "PATH")]
        library: Option<PathBuf>,
        #[command(flatten)]
        display: DisplayArgs,
    },
    /// Draw the mean of the channels, or a layer, in colours
    Heatmap {
        /// Image to read, .exr
        input: PathBuf,
        /// Picture to write, .png; - is the standard output
        #[arg(value_parser = output_file())]
        output: PathBuf,
        /// Values of the darkest and lightest colour
        ///
        /// If absent: 0 and the largest value.
        #[arg(long, num_args = 2, value_names = ["MIN", "MAX"], allow_negative_numbers = true)]
        range: Option<Vec<f32>>,
        /// Layer of an .exr, such as Z or SampleCount
        #[arg(long, value_name = "NAME")]
        layer: Option<String>,
    },
}

/// Flags of `image compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Image
    pub image: PathBuf,
    /// Reference
    pub reference: PathBuf,
    /// Measures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Picture of |z| of every pixel in colours, .png
    #[arg(long, value_name = "FILE", value_parser = output_file(), help_heading = heading::OUTPUT)]
    pub map: Option<PathBuf>,
    /// Standard errors of the image
    #[arg(long, value_name = "FILE")]
    pub stderr_a: Option<PathBuf>,
    /// Standard errors of the reference
    #[arg(long, value_name = "FILE")]
    pub stderr_b: Option<PathBuf>,
    /// Limit on |z| of every channel of a pixel
    #[arg(long, value_name = "Z", default_value_t = 4.0)]
    pub limit: f64,
    /// Share of pixels beyond the limit
    ///
    /// From 0 to 1. With a larger share, the images differ.
    #[arg(long, value_name = "S", default_value_t = 0.01)]
    pub share: f64,
    /// Relative difference by rounding
    #[arg(long, value_name = "R", default_value_t = 1e-5)]
    pub rounding: f64,
}
