//! Outputs of `sun`.

use std::path::Path;

use antumbra_bake::{Array, Entry, Label, Layout, SunFound, SunlightClass};
use antumbra_raster::Quantity;

use super::Baked;
use super::values::{Shown, Value};
use crate::bake::files::{self, Column, Format};
use crate::bake::raster;
use crate::exit::Failure;

impl Baked<'_> {
    /// Writes one file.
    pub fn write(&self, path: &Path, found: &SunFound) -> Result<(), Failure> {
        let (args, sensors) = (self.args, self.sensors);
        let shown = self.shown();
        let &Value { name, unit, .. } = shown;
        match Format::of_sensors(path)? {
            Format::Csv => self.csv(path, found),
            Format::Npz => self.npz(path, found),
            Format::Picture => {
                let time = (args.show != Shown::SkyView).then(|| self.period());
                let words = self.words((shown.title, shown.unit_on_maps()), time);
                let values = self.of_cells(shown.singles());
                self.sheet()?.write(path, &words, &values)
            }
            Format::Raster => {
                let (values, crs) = (shown.singles(), args.raster.crs.as_ref());
                let quantity = Quantity { name, unit };
                if let Some(terrain) = self.terrain {
                    let values = self.of_cells(values);
                    return terrain.write(path, crs, &values, &[quantity]);
                }
                let place = (crs, args.places.units.metres());
                let (ground, _) = self.mesh()?;
                raster::write(path, ground, (sensors, &values), place, (self.up, quantity))
            }
            Format::Ply | Format::Glb => {
                let directions = self.sunlight.patch_directions();
                let up = directions.last().copied().unwrap_or_default();
                let (ground, _) = self.mesh()?;
                let mesh = (&ground.mesh, self.local);
                let values = (name, &shown.singles()[..]);
                files::coloured(path, values, sensors, mesh, (up, args.map.colours()))
            }
        }
    }

    /// Values of all cells, if sensors are the cells of a raster that have data.
    pub fn of_cells(&self, values: Vec<f32>) -> Vec<f32> {
        match self.terrain {
            Some(terrain) => terrain.spread(&values),
            None => values,
        }
    }

    fn csv(&self, path: &Path, found: &SunFound) -> Result<(), Failure> {
        let (sensors, covered) = (self.sensors, &self.sunlight.suns.covered);
        let single = |value| {
            let Value { name, list, .. }: &Value<'_> = value;
            Column::new(*name, move |row: usize| list[row])
        };
        let mut columns: Vec<Column<'_>> = self.columns().map(single).collect();
        // Of twelve values for each sensor, those of months with steps are written.
        for &Value { name, by_month, .. } in self.columns().filter(|v| !v.by_month.is_empty()) {
            let months = (0..12).filter(|&month| covered[month]);
            columns.extend(months.map(|month| {
                let name = format!("{name}_{:02}", month + 1);
                Column::new(name, move |row| by_month[12 * row + month])
            }));
        }
        let class = |&hours: &f64| SunlightClass::of_hours(hours).name().to_owned();
        let classes = self.args.en17037.then(|| Label {
            column: "en17037".into(),
            values: found.values.hours.iter().map(class).collect(),
        });
        let places = (sensors, &sensors.normals[..], self.local);
        files::table(path, places, classes.as_slice(), &columns)
    }

    fn npz(&self, path: &Path, found: &SunFound) -> Result<(), Failure> {
        let (sensors, suns) = (self.sensors, &self.sunlight.suns);
        let (suns_seen, sky_seen) = (&found.suns_seen, &found.sky_seen);
        let azimuths: Vec<f64> = suns.positions.iter().map(|sun| sun.azimuth).collect();
        let elevations: Vec<f64> = suns.positions.iter().map(|sun| sun.elevation).collect();
        let counts = [suns_seen.columns() as u64, sky_seen.columns() as u64];
        let sun_directions = self.sunlight.sun_directions();
        let patch_directions = self.sunlight.patch_directions();
        let solid_angles = &self.sunlight.patches.solid_angles;
        let months: Vec<String> = (self.values.iter())
            .map(|value| format!("{}_by_month", value.name))
            .collect();
        let number = |value: usize| {
            let Value { name, list, .. } = &self.values[value];
            Entry::new(name, Array::F64(list))
        };
        let by_month = |value: usize| {
            Entry::new(&months[value], Array::F64(self.values[value].by_month)).columns(12)
        };
        let mut entries = vec![
            Entry::new("points", Array::Places(&sensors.points, self.local)),
            Entry::new("normals", Array::Points(&sensors.normals)),
            number(0),
            by_month(0),
            number(1),
            number(2),
            Entry::new("suns_seen", Array::Bits(suns_seen)),
            Entry::new("patches_seen", Array::Bits(sky_seen)),
            Entry::new("suns_and_patches", Array::Counts(&counts)),
            Entry::new("sun_times", Array::F64(&suns.times)),
            Entry::new("sun_hours", Array::F64(&suns.hours)),
            Entry::new("sun_azimuths", Array::F64(&azimuths)),
            Entry::new("sun_elevations", Array::F64(&elevations)),
            Entry::new("sun_directions", Array::Points(&sun_directions)),
            Entry::new("patch_directions", Array::Points(&patch_directions)),
            Entry::new("patch_solid_angles", Array::F64(solid_angles)),
        ];
        let has_months = |value: &usize| !self.values[*value].by_month.is_empty();
        let energies = (3..self.values.len()).filter(has_months);
        entries.extend(energies.clone().map(number));
        entries.extend(energies.map(by_month));
        let cells: Vec<u64>;
        let shape: [u64; 2];
        if let Layout::Grid(grid) = &sensors.layout {
            cells = grid.cells.iter().map(|&cell| u64::from(cell)).collect();
            shape = [grid.height as u64, grid.width as u64];
            entries.push(Entry::new("cells", Array::Counts(&cells)));
            entries.push(Entry::new("grid", Array::Counts(&shape)));
        }
        files::npz(path, &entries)
    }
}
