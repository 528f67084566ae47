//! Tables of groups: `sun --groups`, and the surfaces of `factors`.

use std::fmt::Write as _;
use std::path::Path;

use antumbra_bake::{Groups, Orientation};
use antumbra_image::atomic_write;
use antumbra_lab::write_json;
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::files::{Format, field};
use super::ground::Ground;
use super::sun::Baked;
use crate::args::By;
use crate::exit::Failure;
use crate::interrupt;

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

/// Groups of the triangles of a scene. `compass` says where its north is.
pub fn of(ground: &Ground, by: By, compass: &Orientation) -> Result<Groups, Failure> {
    let (mesh, parts) = (&ground.mesh, &ground.parts);
    match by {
        By::Material if !parts.has_materials() => {
            let reason = "--by material: no material of the scene has a name";
            Err(Failure::scene(&ground.loaded.scene.name, reason))
        }
        By::Material => Ok(Groups::new(mesh, vec!["material"], |triangle| {
            let part = parts.part(triangle);
            vec![part.map_or_else(String::new, |part| part.material.clone())]
        })),
        By::Object => {
            let objects = parts.objects(mesh);
            let name = |triangle| vec![objects.name(triangle)];
            Ok(Groups::new(mesh, vec!["object"], name))
        }
        By::Facade => {
            let objects = parts.objects(mesh);
            let sides = mesh.sides(&ground.bvh, compass);
            let name = |triangle: usize| vec![objects.name(triangle), sides[triangle].to_owned()];
            Ok(Groups::new(mesh, vec!["object", "facade"], name))
        }
    }
}

impl Baked<'_> {
    /// Writes means, ends and sums of the values of each group, and returns them.
    pub fn groups(&self, path: &Path) -> Result<Vec<Row>, Failure> {
        let _writing = interrupt::writing();
        let groups = of(self.ground, self.args.by, &self.sunlight.orientation)?;
        let triangles = self.places.triangles(self.ground, self.up)?;
        let values = &self.found.values;
        let reflected = self.reflected();
        let metres = self.args.places.units.metres();
        let areas: Vec<f64> = groups
            .areas
            .iter()
            .map(|area| area * metres * metres)
            .collect();
        let mut columns = vec![("hours", &values.hours), ("sky_view", &values.sky_view)];
        if !values.direct.is_empty() {
            columns.push(("direct_kwh_m2", &values.direct));
            columns.push(("diffuse_kwh_m2", &values.diffuse));
            columns.extend(reflected.iter().map(|list| ("reflected_kwh_m2", list)));
        }
        let mut rows: Vec<Row> = Vec::new();
        for (names, area) in groups.names.iter().zip(&areas) {
            let mut row = Row(Vec::new());
            for (column, name) in groups.columns.iter().zip(names) {
                row.push(*column, name.clone().into());
            }
            row.push("area_m2", number(*area));
            rows.push(row);
        }
        for (index, (name, list)) in columns.into_iter().enumerate() {
            let found = groups.statistics(&triangles, list);
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
        match is_table(path)? {
            true => atomic_write(path, |file| file.write_all(table(&rows).as_bytes()))?,
            false => write_json(&rows, path)?,
        }
        Ok(rows)
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
