//! Flags that place sensors on surfaces and along lines, and lift them.

use std::path::PathBuf;

use antumbra_bake::Surface;
use clap::Args;

use super::{heading, values};

/// Flags that place sensors on surfaces and along lines, and lift them.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::SENSORS)]
pub struct PlacementArgs {
    /// Sensors on all surfaces, so far apart
    ///
    /// Each stands for a square of this side. Triangles face as their corners run anticlockwise. A .csv has the column surface
    /// with roof, ground, facade or underside.
    #[arg(long, value_name = "METRES", group = "where", value_parser = values::positive)]
    pub surfaces: Option<f64>,
    /// Only on roof, ground, facade, underside
    ///
    /// Facades are more than 60 degrees from up and down. Of surfaces that face up, roofs have a surface below, and ground has
    /// none. Several are separated by commas.
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
            true => Surface::ALL.to_vec(),
            false => self.on.clone(),
        }
    }
}

fn surface(text: &str) -> Result<Surface, String> {
    let name = text.trim().trim_end_matches('s');
    let mut all = Surface::ALL.into_iter();
    let found = all.find(|surface| surface.name().eq_ignore_ascii_case(name));
    found.ok_or_else(|| "known are roof, ground, facade and underside".into())
}
