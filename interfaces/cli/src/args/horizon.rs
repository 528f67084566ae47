//! Flags of `horizon`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::{ChunkArgs, PlaceArgs, RasterArgs, SCENE, SCENE_LONG, heading, values};
use crate::json::Destination;

/// Flags of `horizon`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("where").required(true))]
pub struct HorizonArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Result: .csv, .npz or .tif
    ///
    /// May be given several times. A .csv has a line per sensor and a column per azimuth, such as horizon_090. An .npz has the
    /// array horizon, sensors x azimuths, with azimuths and points. A .tif (GeoTIFF), .asc or .npy has one azimuth (--azimuths 1) in
    /// the cells of a --grid or of a scene that is a raster. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    #[command(flatten)]
    pub raster: RasterArgs,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Number of azimuths, evenly spread
    #[arg(long, value_name = "N", default_value_t = 36, value_parser = clap::value_parser!(u32).range(1..=3600), help_heading = heading::WORK)]
    pub azimuths: u32,
    /// The first azimuth; north is 0, east 90
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, value_parser = values::finite, help_heading = heading::WORK)]
    pub first: f64,
    #[command(flatten)]
    pub places: PlaceArgs,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}

impl HorizonArgs {
    /// Degrees from north through east, from 0 to 360.
    pub fn degrees(&self) -> Vec<f64> {
        let step = 360.0 / f64::from(self.azimuths);
        let degrees =
            (0..self.azimuths).map(|i| (self.first + f64::from(i) * step).rem_euclid(360.0));
        degrees.collect()
    }
}
