//! Flags that place sensors: in grids, on surfaces, along lines.

use std::path::PathBuf;
use std::sync::OnceLock;

use antumbra_bake::{Surface, UpAxis};
use clap::builder::ArgPredicate;
use clap::{Args, ValueEnum};

use super::{heading, values};

/// Flags that say where sensors are, and where up and north are.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::SENSORS)]
pub struct PlaceArgs {
    /// Sensors from a table: x, y [, z] [, nx, ny, nz]
    ///
    /// Columns are known by the names in the first line, or else by their order. Sensors without normals see all around.
    /// Coordinates are in the system of the mesh. Sensors without heights are on the surface that is seen from above. Names, in a column
    /// name or id, come back in a .csv.
    #[arg(long, value_name = "FILE", group = "where")]
    pub sensors: Option<PathBuf>,
    /// A sensor in every square of this size
    ///
    /// Sensors lie on the surfaces that are uppermost, roofs and ground alike, and face as these do.
    #[arg(long, value_name = "METRES", group = "where", value_parser = values::positive)]
    pub grid: Option<f64>,
    /// Look at facades from a side: south, 135, ...
    ///
    /// The squares of --grid are then upright, and cover what is seen from far away on this side: north, east, south, west, or an
    /// azimuth in degrees. Maps show this elevation. Results cannot be GeoTIFF.
    #[arg(long, value_name = "SIDE", requires = "grid", conflicts_with = "height", value_parser = side)]
    pub seen_from: Option<Side>,
    /// Only on one object of the scene, by its name
    ///
    /// As --by object names it. Everything else still casts shadows. With --grid or --surfaces.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["vertices", "cells", "sensors", "along"])]
    pub only: Option<String>,
    /// A sensor at every vertex
    ///
    /// Vertices of a height raster are the centres of its cells.
    #[arg(
        long,
        group = "where",
        default_value_if("cells", ArgPredicate::IsPresent, "true")
    )]
    pub vertices: bool,
    /// A sensor at every cell of a height raster
    ///
    /// The raster is the scene, or the one of sun --terrain. Without either, vertices of the scene are meant.
    #[arg(long, group = "where")]
    pub cells: bool,
    #[command(flatten)]
    pub placement: PlacementArgs,
    /// Axis that points up [default: the scene's]
    ///
    /// North is y where z points up, and -z where y does.
    #[arg(long, value_name = "AXIS", value_parser = up_axis)]
    pub up: Option<UpAxis>,
    #[command(flatten)]
    pub north: NorthArgs,
    #[command(flatten)]
    pub units: UnitArgs,
}

/// Where north is, if the coordinate system does not say.
#[derive(Debug, Args)]
pub struct NorthArgs {
    /// Angle to true north [default: by --crs]
    ///
    /// Clockwise as seen from above: 90 where the x axis of a mesh with z up points north. If absent: the angle between grid north and
    /// true north in the coordinate system of the scene (--crs, or the one in a GeoTIFF), or else 0.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = values::finite)]
    north: Option<f64>,
    #[arg(skip)]
    known: OnceLock<f64>,
}

impl NorthArgs {
    /// Notes the angle of the coordinate system. Returns the one that is taken.
    pub fn settle(&self, degrees: f64) -> f64 {
        self.north.unwrap_or(*self.known.get_or_init(|| degrees))
    }

    /// Degrees from north of the mesh to true north, clockwise as seen from above.
    pub fn degrees(&self) -> f64 {
        let known = self.known.get().copied();
        self.north.or(known).unwrap_or(0.0)
    }
}

/// Unit of the scene, if the coordinate system does not say.
#[derive(Debug, Args)]
pub struct UnitArgs {
    /// Unit, as mm, m or ft [default: by --crs, or m]
    ///
    /// If absent: the unit of the coordinate system of the scene (--crs, or the one in a GeoTIFF), or else metres.
    #[arg(long, value_enum, value_name = "UNIT", hide_possible_values = true)]
    units: Option<Unit>,
    #[arg(skip)]
    known: OnceLock<f64>,
}

impl UnitArgs {
    /// Notes the metres of a unit of the coordinate system. Returns those that are taken.
    pub fn settle(&self, metres: f64) -> f64 {
        let known = *self.known.get_or_init(|| metres);
        self.units.map_or(known, Unit::metres)
    }

    /// Metres in a unit of the scene, if somebody says so.
    pub fn known(&self) -> Option<f64> {
        let known = self.known.get().copied();
        self.units.map(Unit::metres).or(known)
    }

    /// Metres in a unit of the scene.
    pub fn metres(&self) -> f64 {
        self.known().unwrap_or(1.0)
    }
}

/// Flags that place sensors on surfaces and along lines, and lift them.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::SENSORS)]
pub struct PlacementArgs {
    /// Sensors on all surfaces, so far apart
    ///
    /// Each stands for a square of this side. Closed bodies face outwards, other surfaces to the side that sees more sky. A .csv has
    /// the column surface with roof, ground, facade or underside.
    #[arg(long, value_name = "METRES", group = "where", value_parser = values::positive)]
    pub surfaces: Option<f64>,
    /// Only on roof, ground, facade and so on
    ///
    /// Kinds are roof, ground, facade, underside and covered. Facades are more than 60 degrees from up and down. Of surfaces that face up, roofs belong to buildings, and ground does not.
    /// Places that are covered, as inside of houses, are none of these: see --covered. Several are separated by commas.
    #[arg(long, value_name = "KINDS", requires = "surfaces", value_delimiter = ',', value_parser = surface)]
    pub on: Vec<Surface>,
    /// Distance from the surface
    #[arg(
        long,
        value_name = "METRES",
        default_value_t = 0.0,
        requires = "surfaces",
        allow_negative_numbers = true
    )]
    pub offset: f64,
    /// Distance at which a floor covers
    ///
    /// As a floor covers the terrain. Places that see no sky are covered if the first surface above is nearer than this, or if they
    /// are inside of a body. Places below balconies, bridges and trees are not covered, only shaded.
    #[arg(long, value_name = "METRES", default_value_t = 0.5, requires = "surfaces", value_parser = values::from_zero)]
    pub covered: f64,
    /// Number the storeys of facades, from 0
    ///
    /// In the column storey of a .csv: the height above the surface just outside, over this one.
    #[arg(long, value_name = "METRES", requires = "surfaces", value_parser = values::positive)]
    pub storey_height: Option<f64>,
    /// Sensors along lines of a table: x, y [, z]
    ///
    /// Consecutive points with the same name (column name or id) are a line. Lines without heights are on the surface that is
    /// seen from above. Sensors see all around, and are --spacing apart.
    #[arg(long, value_name = "FILE", group = "where", requires = "spacing")]
    pub along: Option<PathBuf>,
    /// Distance between sensors --along lines
    #[arg(long, value_name = "METRES", requires = "along", value_parser = values::positive)]
    pub spacing: Option<f64>,
    /// Raise grids, vertices and lines
    ///
    /// They keep their normals. 1.5 is the height of eyes above a street.
    #[arg(long, value_name = "METRES", default_value_t = 0.0, conflicts_with_all = ["surfaces", "sensors"], value_parser = values::from_zero)]
    pub height: f64,
}

impl PlacementArgs {
    /// A flag that needs another one, and this one. The parser does not see it where the other one excludes what is given.
    pub fn check(&self) -> Result<(), String> {
        let on_surfaces = [
            ("--on", !self.on.is_empty()),
            ("--offset", self.offset != 0.0),
            ("--storey-height", self.storey_height.is_some()),
            ("--covered", self.covered != 0.5),
        ];
        let given = on_surfaces.iter().find(|(_, is_given)| *is_given);
        match (given, self.surfaces, self.spacing, &self.along) {
            (Some((flag, _)), None, ..) => Err(format!("{flag} needs --surfaces")),
            (.., Some(_), None) => Err("--spacing needs --along".into()),
            _ => Ok(()),
        }
    }

    /// Kinds of surfaces with sensors.
    pub fn kinds(&self) -> Vec<Surface> {
        match self.on.is_empty() {
            true => Surface::ALL
                .into_iter()
                .filter(|&kind| kind != Surface::Covered)
                .collect(),
            false => self.on.clone(),
        }
    }
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

/// Side from which facades are seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Degrees from north through east.
    pub azimuth: f64,
}

/// Names of sides, 45 degrees apart.
const SIDES: [&str; 8] = [
    "north",
    "north-east",
    "east",
    "south-east",
    "south",
    "south-west",
    "west",
    "north-west",
];

impl Side {
    /// Name, or the azimuth.
    pub fn name(&self) -> String {
        let place = self.azimuth.rem_euclid(360.0) / 45.0;
        match SIDES.get(place as usize) {
            Some(name) if place.fract() == 0.0 => (*name).to_owned(),
            _ => format!("{}°", self.azimuth),
        }
    }
}

fn side(text: &str) -> Result<Side, String> {
    let name = text.trim().to_ascii_lowercase();
    let known = SIDES.iter().position(|side| *side == name);
    let known = known.map(|place| 45.0 * place as f64);
    let azimuth = known.or(name.parse().ok()).filter(|x: &f64| x.is_finite());
    let azimuth = azimuth.ok_or("wanted north, north-east, east and so on, or degrees")?;
    Ok(Side { azimuth })
}

fn surface(text: &str) -> Result<Surface, String> {
    let name = text.trim().trim_end_matches('s');
    let mut all = Surface::ALL.into_iter();
    let found = all.find(|surface| surface.name().eq_ignore_ascii_case(name));
    found.ok_or_else(|| "known are roof, ground, facade, underside and covered".into())
}
