//! Flags of `sun`.

use std::path::PathBuf;
use std::str::FromStr;

use antumbra_bake::{Moment, SkyDivision};
use clap::{ArgGroup, Args, ValueEnum};

use super::{
    ChunkArgs, MapArgs, PlaceArgs, RasterArgs, SCENE, SCENE_LONG, TimeArgs, heading, values,
};
use crate::json::Destination;

/// Flags of `sun`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("where").required(true))]
pub struct SunArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Result: .csv, .ply, .npz, .png, .svg, .pdf or .tif
    ///
    /// May be given several times. A .csv has a line per sensor, a .ply the mesh or the sensors in colours, a .png, .svg
    /// or .pdf a map of a --grid, and an .npz all values with the visibility matrices. Beside a .png is a .pgw, the world file
    /// for GIS programs. A .tif (GeoTIFF), .asc or .npy has the value of --show in the cells of a --grid or of a scene that is a
    /// raster. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Value that colours show
    ///
    /// hours, sky-view, and with --epw direct, diffuse and total.
    #[arg(long, value_enum, default_value_t = Shown::Hours, hide_possible_values = true, help_heading = heading::OUTPUT)]
    pub show: Shown,
    #[command(flatten)]
    pub map: MapArgs,
    #[command(flatten)]
    pub raster: RasterArgs,
    /// Table of every step of time and every sensor
    ///
    /// A .csv with a line per step and a column per sensor: the value of --show of this step, in hours or Wh/m². An .npz has the
    /// array values, steps x sensors, with times, the beginnings of the steps in Unix time, and points.
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub hourly: Option<PathBuf>,
    /// Means, ends and sums by object, material or facade
    ///
    /// A .csv or .json with a line for each group of --by: its area in m², its sensors, and of each value the mean, the smallest and
    /// the largest of them. Energies have a sum too: the mean times the area, in kWh. Sensors belong to the surface that they are on,
    /// or that is below them.
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub groups: Option<PathBuf>,
    /// object, material or facade
    ///
    /// Lines `o`, or else `g`, begin objects in an .obj; nodes are objects in a .gltf. Where nothing has a name, surfaces that touch are a
    /// body. A facade is all of an object that faces one of eight sides of the compass; roofs, ground and undersides have lines too.
    #[arg(long, value_name = "KIND", value_enum, default_value_t = By::Object, hide_possible_values = true, requires = "groups", help_heading = heading::OUTPUT)]
    pub by: By,
    /// Moving shadows: .gif, or .png for each step
    ///
    /// A map of each step of time with a sun above the horizon, with its time in the title. A .gif has them all. Of NAME.png, the
    /// files are NAME-0001.png and so on. Needs --grid.
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub frames: Option<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    #[command(flatten)]
    pub places: PlaceArgs,
    /// Latitude, south negative [default: by --crs]
    ///
    /// If absent: the middle of the scene in its coordinate system (--crs, or the one in a GeoTIFF), or else the place of --epw.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, requires = "lon", help_heading = heading::SUN)]
    pub lat: Option<f64>,
    /// Longitude, west negative [default: by --crs]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, requires = "lat", help_heading = heading::SUN)]
    pub lon: Option<f64>,
    /// Above the sea [default: the weather's, or 0]
    #[arg(long, value_name = "METRES", allow_negative_numbers = true, help_heading = heading::SUN)]
    pub altitude: Option<f64>,
    #[command(flatten)]
    pub times: TimeArgs,
    /// Weather of a year, for irradiance
    ///
    /// An .epw file of EnergyPlus. Gives the place and the steps of time, too.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["step", "year"], help_heading = heading::SUN)]
    pub epw: Option<PathBuf>,
    /// First moment, as 2024-06-21[T08:00]
    ///
    /// If absent: all of --year, or of the weather.
    #[arg(long, value_name = "TIME", requires = "to", help_heading = heading::SUN)]
    pub from: Option<Moment>,
    /// End of the time; a date counts to its end
    #[arg(long, value_name = "TIME", requires = "from", value_parser = end_of, help_heading = heading::SUN)]
    pub to: Option<Moment>,
    /// Year, without --from and --to
    #[arg(long, value_name = "YEAR", default_value_t = 2025, conflicts_with = "from", value_parser = clap::value_parser!(i32).range(1..=5999), help_heading = heading::SUN)]
    pub year: i32,
    /// Light that the ground reflects, with --epw
    ///
    /// As a part of what open level ground receives: 0.2 is usual. A tilted sensor receives albedo times that, times (1 - cos
    /// tilt) / 2, whatever shades the ground. In the column reflected_kwh_m2, and in the total of --show.
    #[arg(long, value_name = "PART", requires = "epw", value_parser = values::part, help_heading = heading::SUN)]
    pub albedo: Option<f64>,
    /// Leave out suns lower than this
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, value_parser = values::from_zero, help_heading = heading::SUN)]
    pub min_elevation: f64,
    /// Class of sunlight by EN 17037
    ///
    /// In the column en17037 of a .csv: none, minimum (from 1.5 h), medium (3 h) or high (4 h). The time must be one day from 1
    /// February to 21 March, in steps of at most 10 minutes. Give the least elevation of your country with --min-elevation.
    #[arg(long, conflicts_with = "epw", help_heading = heading::SUN)]
    pub en17037: bool,
    /// Minutes from sun to sun
    ///
    /// Each sun stands for the step around it: the sun of the middle of the step.
    #[arg(long, value_name = "MINUTES", default_value_t = 60.0, value_parser = values::positive, help_heading = heading::SUN)]
    pub step: f64,
    /// 145, 577, 2305 or uniform:N
    ///
    /// 145 are by Tregenza, 577 and 2305 by Reinhart. uniform:N are N patches of the same size.
    #[arg(long, value_name = "PATCHES", default_value = "145", value_parser = sky, help_heading = heading::SUN)]
    pub sky: SkyDivision,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}

/// What groups of sensors have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum By {
    /// Objects, or bodies that touch
    Object,
    /// Materials
    Material,
    /// Sides of objects
    Facade,
}

/// Value of sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shown {
    /// Hours of direct sun
    Hours,
    /// Sky view factor
    SkyView,
    /// Direct irradiation in kWh/m², with --epw
    Direct,
    /// Diffuse irradiation in kWh/m², with --epw
    Diffuse,
    /// Both together, with --epw
    Total,
}

/// Parses an end: a date counts to the midnight after it.
fn end_of(text: &str) -> Result<Moment, String> {
    let mut moment = Moment::from_str(text).map_err(|error| error.to_string())?;
    if !text.contains(':') {
        moment.seconds = 86_400.0;
    }
    Ok(moment)
}

/// Parses a division of the sky.
fn sky(text: &str) -> Result<SkyDivision, String> {
    let division = match text {
        "145" | "tregenza" => SkyDivision::Tregenza,
        "577" | "reinhart" => SkyDivision::Reinhart(2),
        "2305" => SkyDivision::Reinhart(4),
        _ => {
            let count = text.strip_prefix("uniform:").and_then(|n| n.parse().ok());
            let known = "known are 145, 577, 2305 and uniform:N";
            SkyDivision::Uniform(count.ok_or(known)?)
        }
    };
    division.patches().map_err(|error| error.to_string())?;
    Ok(division)
}
