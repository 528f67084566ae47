//! Tables of groups: `sun --groups`.

use std::fmt::Write as _;
use std::path::Path;

use antumbra_bake::{Groups, Sensors, Surface};
use antumbra_image::atomic_write;
use antumbra_lab::write_json;
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::Baked;
use crate::bake::files::{Format, field};
use crate::exit::{Failure, say};
use crate::scenes::rounded;

/// Values of a group with their names, in the order of the columns.
pub struct Row(Vec<(String, Value)>);

impl Serialize for Row {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

impl Row {
    fn push(&mut self, name: impl Into<String>, value: Value) {
        self.0.push((name.into(), value));
    }
}

/// Whether a file of groups is a .csv; otherwise it is a .json.
pub fn is_table(path: &Path) -> Result<bool, Failure> {
    let sentence = "groups are written as csv or json";
    Ok(Format::of(path, &["csv", "json"], sentence)? == Format::Csv)
}

impl Baked<'_> {
    /// Writes means, ends and sums of the values of each group, and returns them.
    pub fn groups(&self, path: &Path) -> Result<Vec<Row>, Failure> {
        let (ground, places) = self.mesh()?;
        let groups = self.args.by.groups(ground, &self.sunlight.orientation)?;
        let triangles = places.triangles(ground, self.up, &groups)?;
        let cover = Cover::new(&groups, self.sensors, &triangles);
        let metres = self.args.places.units.metres();
        let whole = groups.areas.iter().map(|area| area * metres * metres);
        let whole: Vec<f64> = whole.collect();
        let open = whole.iter().zip(&cover.shares);
        let areas: Vec<f64> = open.map(|(area, share)| area * (1.0 - share)).collect();
        if let Some(spacing) = self.args.places.placement.surfaces {
            self.check_areas(&groups, &cover, &whole, spacing * spacing);
        }
        let columns = self.columns().filter(|value| value.name != "sky_open");
        let mut rows: Vec<Row> = Vec::new();
        for (names, area) in groups.names.iter().zip(&areas) {
            let mut row = Row(Vec::new());
            for (column, name) in groups.columns.iter().zip(names) {
                row.push(*column, name.clone().into());
            }
            row.push("area_m2", number(*area));
            rows.push(row);
        }
        for (index, column) in columns.enumerate() {
            let name = column.name;
            let found = groups.statistics(&cover.open, &column.list);
            for ((row, own), area) in rows.iter_mut().zip(found).zip(&areas) {
                if index == 0 {
                    row.push("sensors", own.count.into());
                }
                for (kind, value) in [("mean", own.mean), ("min", own.least), ("max", own.most)] {
                    row.push(format!("{name}_{kind}"), number(value));
                }
                if let Some(energy) = name.strip_suffix("_m2") {
                    row.push(energy, number(own.mean * area));
                }
            }
        }
        rows.extend(cover.rows(&groups, &whole, rows.first()));
        match is_table(path)? {
            true => atomic_write(path, |file| file.write_all(table(&rows).as_bytes()))?,
            false => write_json(&rows, path)?,
        }
        Ok(rows)
    }
}

/// Places of groups that are covered.
struct Cover {
    /// Triangle of each sensor that is on one and not covered.
    open: Vec<Option<u32>>,
    /// Number of places of each group that are covered.
    counts: Vec<usize>,
    /// Number of places of each group.
    places: Vec<usize>,
    /// Share of each group that is covered.
    shares: Vec<f64>,
}

impl Cover {
    fn new(groups: &Groups, sensors: &Sensors, triangles: &[Option<u32>]) -> Self {
        let kinds = sensors.label("surface");
        let is_covered =
            |sensor: usize| kinds.is_some_and(|kinds| kinds[sensor] == Surface::Covered.name());
        let mut counts = vec![0; groups.names.len()];
        let mut places = counts.clone();
        let mut open = triangles.to_vec();
        for (sensor, triangle) in open.iter_mut().enumerate() {
            let Some(triangle_of) = *triangle else {
                continue;
            };
            let group = groups.of_triangle[triangle_of as usize] as usize;
            places[group] += 1;
            if is_covered(sensor) {
                counts[group] += 1;
                *triangle = None;
            }
        }
        for &triangle in &sensors.covered {
            let group = groups.of_triangle[triangle as usize] as usize;
            counts[group] += 1;
            places[group] += 1;
        }
        let pairs = counts.iter().zip(&places);
        let shares = pairs.map(|(&count, &all)| count as f64 / all.max(1) as f64);
        Self {
            shares: shares.collect(),
            open,
            counts,
            places,
        }
    }

    /// A row for what is covered of each object, or of all groups that are not facades. It has the columns of `like`.
    fn rows(&self, groups: &Groups, areas: &[f64], like: Option<&Row>) -> Vec<Row> {
        let mut sums: Vec<(Vec<String>, usize, f64)> = Vec::new();
        for (group, names) in groups.names.iter().enumerate() {
            if self.counts[group] == 0 {
                continue;
            }
            let mut names = names.clone();
            names.pop();
            names.push(Surface::Covered.name().into());
            let area = areas[group] * self.shares[group];
            match sums.iter_mut().find(|(known, ..)| *known == names) {
                Some((_, count, sum)) => {
                    *count += self.counts[group];
                    *sum += area;
                }
                None => sums.push((names, self.counts[group], area)),
            }
        }
        let columns = like.iter().flat_map(|row| &row.0).map(|(name, _)| name);
        let row = |(names, count, area): (Vec<String>, usize, f64)| {
            let known = names.into_iter().map(Value::from);
            let known = known.chain([number(area), count.into()]);
            let values = known.chain(std::iter::repeat(Value::Null));
            Row(columns.clone().cloned().zip(values).collect())
        };
        sums.into_iter().map(row).collect()
    }
}

/// Squares of a group below which the shape of its parts decides how many of them have a sensor.
const MANY: f64 = 100.0;

impl Baked<'_> {
    /// Warns of groups whose sensors stand for another area than they have.
    fn check_areas(&self, groups: &Groups, cover: &Cover, areas: &[f64], square: f64) {
        let names: Vec<String> = (0..areas.len())
            .filter(|&group| {
                let area = cover.places[group] as f64 * square;
                // About so much hangs on where the lattice begins.
                let edge = (square * areas[group]).sqrt();
                cover.places[group] > 0
                    && areas[group] > MANY * square
                    && (area - areas[group]).abs() > 0.1 * areas[group] + edge
            })
            .map(|group| {
                let (name, area) = (groups.names[group].join(" "), areas[group]);
                let own = cover.places[group] as f64 * square;
                format!("{name}: {} m² of {}", rounded(own), rounded(area))
            })
            .collect();
        if !names.is_empty() {
            let some = names[..names.len().min(5)].join(", ");
            say(format_args!(
                "warning: the sensors of {} groups stand for an area that is more than a tenth off ({some}): a smaller --surfaces may help",
                names.len(),
            ));
        }
    }
}

/// A number of so many digits as a table needs; null for one that is not finite.
fn number(value: f64) -> Value {
    Value::from((value * 1e6).round() / 1e6)
}

/// Rows as a table. All have the columns of the first.
fn table(rows: &[Row]) -> String {
    let mut text = String::new();
    let columns = rows.iter().take(1).flat_map(|row| &row.0);
    let columns: Vec<&str> = columns.map(|(name, _)| &**name).collect();
    text += &columns.join(",");
    text.push('\n');
    for row in rows {
        for (index, (_, value)) in row.0.iter().enumerate() {
            let comma = if index > 0 { "," } else { "" };
            let _ = match value {
                Value::Null => write!(text, "{comma}"),
                Value::String(name) => write!(text, "{comma}{}", field(name)),
                other => write!(text, "{comma}{other}"),
            };
        }
        text.push('\n');
    }
    text
}
