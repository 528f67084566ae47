//! Flags about rasters of results.

use antumbra_raster::Crs;
use clap::Args;

use super::heading;

/// Flags about rasters of results.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::OUTPUT)]
pub struct RasterArgs {
    /// Coordinate system of the scene, as EPSG:25832
    ///
    /// If absent: the one of a scene that is a GeoTIFF, or none. Gives a .tif its coordinate system, and the scene its unit, its place
    /// and true north. Coordinates are not changed.
    #[arg(long, value_name = "EPSG:N", value_parser = crs)]
    pub crs: Option<Crs>,
}

/// Parses a code of EPSG.
fn crs(text: &str) -> Result<Crs, String> {
    let number = match text.split_once(':') {
        Some((name, number)) if name.eq_ignore_ascii_case("epsg") => number,
        Some(_) => "",
        None => text,
    };
    let code = number.parse();
    Crs::from_epsg(code.map_err(|_| "it must be a code such as EPSG:25832".to_owned())?)
}
