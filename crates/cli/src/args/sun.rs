//! Flags of `sun`.

use std::path::PathBuf;
use std::str::FromStr;

use antumbra_bake::{Moment, SkyDivision, UpAxis};
use clap::{ArgGroup, Args, ValueEnum};

use super::{ChunkArgs, MachineArgs, MapArgs, SCENE, SCENE_LONG, heading, values};
use crate::json::Destination;

/// Flags of `sun`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("where").required(true))]
pub struct SunArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// What to write: .csv, .ply, .npz, .png, .svg or .pdf
    ///
    /// May be given several times. A .csv has a line per sensor, a .ply the mesh or the sensors in colours, a .png, .svg
    /// or .pdf a map of a --grid, and an .npz all values with the visibility matrices. Beside a .png is a .pgw, the world file
    /// for GIS programs. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Value that colours show
    ///
    /// hours, sky-view, and with --epw direct, diffuse and total.
    #[arg(long, value_enum, default_value_t = Shown::Hours, hide_possible_values = true, help_heading = heading::OUTPUT)]
    pub show: Shown,
    #[command(flatten)]
    pub map: MapArgs,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Sensors from a table: x, y, z [, nx, ny, nz]
    ///
    /// Columns are known by the names in the first line, or else by their order. Sensors without normals see all around.
    /// Coordinates are those of the mesh.
    #[arg(long, value_name = "FILE", group = "where", help_heading = heading::SENSORS)]
    pub sensors: Option<PathBuf>,
    /// A sensor in every square of this size
    ///
    /// Sensors lie on the surfaces that are uppermost, roofs and ground alike, and face as these do.
    #[arg(long, value_name = "METRES", group = "where", value_parser = values::positive, help_heading = heading::SENSORS)]
    pub grid: Option<f64>,
    /// A sensor at every vertex of the mesh
    #[arg(long, group = "where", help_heading = heading::SENSORS)]
    pub vertices: bool,
    /// Axis that points up [default: that of the scene]
    ///
    /// North is y where z points up, and -z where y does.
    #[arg(long, value_name = "AXIS", value_parser = up_axis, help_heading = heading::SENSORS)]
    pub up: Option<UpAxis>,
    /// Angle from mesh north to true north
    ///
    /// Clockwise as seen from above: 90 where the x axis of a mesh with z up points north.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, help_heading = heading::SENSORS)]
    pub north: f64,
    /// Unit of the mesh: mm, cm, m, km, in or ft
    #[arg(long, value_enum, default_value_t = Unit::M, hide_possible_values = true, help_heading = heading::SENSORS)]
    pub units: Unit,
    /// Latitude in degrees, south negative
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, requires = "lon", required_unless_present = "epw", help_heading = heading::SUN)]
    pub lat: Option<f64>,
    /// Longitude in degrees, west negative
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, requires = "lat", help_heading = heading::SUN)]
    pub lon: Option<f64>,
    /// Metres above the sea [default: the weather's, or 0]
    #[arg(long, value_name = "METRES", allow_negative_numbers = true, help_heading = heading::SUN)]
    pub altitude: Option<f64>,
    /// Hours ahead of UTC [default: by the longitude]
    ///
    /// Without summer time. Of a weather file, its own is the default. Otherwise it is the longitude over 15, rounded.
    #[arg(long, value_name = "HOURS", allow_negative_numbers = true, help_heading = heading::SUN)]
    pub timezone: Option<f64>,
    /// Weather of a year, for irradiance
    ///
    /// An .epw file of EnergyPlus. Gives the place and the steps of time, too.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["step", "year"], help_heading = heading::SUN)]
    pub epw: Option<PathBuf>,
    /// First moment, as 2024-06-21 or 2024-06-21T08:00
    ///
    /// If absent: all of --year, or of the weather.
    #[arg(long, value_name = "TIME", requires = "to", help_heading = heading::SUN)]
    pub from: Option<Moment>,
    /// End of the time; a date counts to its end
    #[arg(long, value_name = "TIME", requires = "from", value_parser = end_of, help_heading = heading::SUN)]
    pub to: Option<Moment>,
    /// Year, if --from and --to are absent
    #[arg(long, value_name = "YEAR", default_value_t = 2025, conflicts_with = "from", value_parser = clap::value_parser!(i32).range(1..=5999), help_heading = heading::SUN)]
    pub year: i32,
    /// Minutes from sun to sun
    ///
    /// Each sun stands for the step around it: the sun is that of the middle of the step.
    #[arg(long, value_name = "MINUTES", default_value_t = 60.0, value_parser = values::positive, help_heading = heading::SUN)]
    pub step: f64,
    /// Patches: 145, 577, 2305 or uniform:N
    ///
    /// 145 are those of Tregenza, 577 and 2305 those of Reinhart. uniform:N are N patches of the same size.
    #[arg(long, value_name = "PATCHES", default_value = "145", value_parser = sky, help_heading = heading::SUN)]
    pub sky: SkyDivision,
    #[command(flatten)]
    pub chunks: ChunkArgs,
    #[command(flatten)]
    pub machine: MachineArgs,
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

/// Unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Unit {
    Mm,
    Cm,
    M,
    Km,
    In,
    Ft,
}

impl Unit {
    /// Length in metres.
    pub const fn metres(self) -> f64 {
        match self {
            Self::Mm => 0.001,
            Self::Cm => 0.01,
            Self::M => 1.0,
            Self::Km => 1000.0,
            Self::In => 0.0254,
            Self::Ft => 0.3048,
        }
    }
}

/// Parses an axis.
pub fn up_axis(text: &str) -> Result<UpAxis, String> {
    match text {
        "y" | "Y" => Ok(UpAxis::Y),
        "z" | "Z" => Ok(UpAxis::Z),
        _ => Err("it must be y or z".into()),
    }
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
