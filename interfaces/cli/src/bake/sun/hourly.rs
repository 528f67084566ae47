//! Values of sensors step by step: `sun --hourly`.

use std::fmt::Write as _;
use std::path::Path;

use antumbra_bake::{Array, Entry, Hourly, SunFound};
use antumbra_image::atomic_write;

use super::Baked;
use crate::bake::files::{self, Format};
use crate::exit::Failure;
use crate::output;

/// Format of a file of steps of time.
pub fn format(path: &Path) -> Result<Format, Failure> {
    let sentence = "steps of time are written as csv or npz";
    Format::of(path, &["csv", "npz"], sentence)
}

impl Baked<'_> {
    /// Writes the value of each sensor in each step of time: as a table with a line for each step, or as arrays.
    pub fn hourly(&self, path: &Path, found: &SunFound) -> Result<(), Failure> {
        let format = format(path)?;
        let sensors = self.sensors;
        let hourly = Hourly::new(self.sunlight)?;
        if format == Format::Npz {
            return self.hourly_arrays(path, &hourly, found);
        }
        let cells = hourly.len() as u64 * sensors.points.len() as u64;
        output::check_room(path, 4 * cells)?;
        Ok(atomic_write(path, |file| {
            let names = sensors.label("name");
            let mut line = "time".to_owned();
            for row in 0..sensors.points.len() {
                let _ = match names {
                    Some(names) => write!(line, ",{}", files::field(&names[row])),
                    None => write!(line, ",{}", row + 1),
                };
            }
            writeln!(file, "{line}")?;
            for step in 0..hourly.len() {
                line.clear();
                let _ = write!(line, "{}", hourly.begin(step));
                for value in self.step(&hourly, step, found) {
                    let _ = write!(line, ",{}", (value * 1e6).round() / 1e6);
                }
                writeln!(file, "{line}")?;
            }
            Ok(())
        })?)
    }

    /// Values of all sensors in a step of time; NaN for a sensor without a value.
    fn step<'a>(
        &'a self,
        hourly: &'a Hourly<'_>,
        step: usize,
        found: &'a SunFound,
    ) -> impl Iterator<Item = f64> + 'a {
        let (sensors, shown) = (self.sensors, self.shown());
        (0..sensors.points.len()).map(move |row| {
            let seen = (&found.suns_seen, &found.sky_seen, row);
            let normal = sensors.normals.get(row).copied();
            let receipt = hourly.receipt(step, seen, normal);
            receipt.map_or(f64::NAN, |receipt| {
                (shown.of_step)(&receipt).unwrap_or(shown.list[row])
            })
        })
    }

    /// Writes steps of time as arrays: `values` has a row for each step and a column for each sensor.
    fn hourly_arrays(
        &self,
        path: &Path,
        hourly: &Hourly<'_>,
        found: &SunFound,
    ) -> Result<(), Failure> {
        let sensors = self.sensors;
        let count = sensors.points.len();
        let too_large = || {
            let cells = hourly.len() as u64 * count as u64;
            let reason = format!("{}: {cells} values do not fit into memory", path.display());
            Failure::Usage(format!("{reason}; a .csv is written line by line"))
        };
        let mut values: Vec<f32> = Vec::new();
        let room = hourly.len().checked_mul(count);
        let room = room.and_then(|room| values.try_reserve_exact(room).ok());
        room.ok_or_else(too_large)?;
        for step in 0..hourly.len() {
            values.extend(self.step(hourly, step, found).map(|value| value as f32));
        }
        let times: Vec<f64> = (0..hourly.len()).map(|step| hourly.unix(step)).collect();
        let entries = [
            Entry::new("times", Array::F64(&times)),
            Entry::new("values", Array::F32(&values)).columns(count),
            Entry::new("points", Array::Places(&sensors.points, self.local)),
        ];
        files::npz(path, &entries)
    }
}
