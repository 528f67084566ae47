//! Words of maps: value, place and time.

use antumbra_bake::{Clock, Moment, Place};

use super::Baked;
use crate::bake::map::{self, Plan, Sheet, Words};
use crate::exit::Failure;

impl Baked<'_> {
    /// Words on maps of a value at a time.
    pub fn words(
        &self,
        (quantity, unit): (&'static str, &'static str),
        time: Option<String>,
    ) -> Words<'_> {
        let args = self.args;
        let Place {
            latitude,
            longitude,
            ..
        } = self.when.place;
        let zone = self.when.zone;
        let clock = match &self.when.clock {
            Clock::Zone(zone) => zone.iana_name().unwrap_or_default().to_owned(),
            Clock::Fixed(_) => format!("UTC{zone:+}"),
        };
        let mut subtitle: Vec<String> = time.into_iter().collect();
        if let Some(side) = args.places.seen_from {
            subtitle.push(format!("seen from the {}", side.name()));
        }
        subtitle.extend([map::place(latitude, longitude), clock]);
        subtitle.extend(self.weather.map(str::to_owned));
        let mut title = format!("{quantity}, {}", self.name);
        if let Some(name) = &args.places.only {
            title += &format!(", {name}");
        }
        Words {
            title,
            subtitle: subtitle.join("  ·  "),
            quantity,
            unit: unit.to_owned(),
            none: None,
            files: vec![&args.scene, &args.terrain, args.epw.as_slice()],
        }
    }

    /// A sheet for maps of sensors on a grid, or of the cells of a raster.
    pub fn sheet(&self) -> Result<Sheet<'_>, Failure> {
        let (args, places) = (&self.args.map, &self.args.places);
        let (north, metres) = (places.north.degrees(), places.units.metres());
        if let Some(terrain) = self.terrain {
            return Sheet::of_cells(args, terrain, (north, Some(metres)));
        }
        let (ground, sensors) = self.mesh()?;
        let plan = Plan {
            ground,
            bvh: sensors.bvh(ground),
            orientation: &sensors.plan,
            up: self.up,
            cell: places.grid.unwrap_or_default() / metres,
            north: places.seen_from.is_none().then_some(north),
            metres: Some(metres),
        };
        Sheet::new(args, &plan, self.sensors)
    }

    /// The time that values are of, as maps write it.
    pub fn period(&self) -> String {
        let times = &self.args.times;
        if !times.at.is_empty() {
            let moments: Vec<String> = times.at.iter().map(Moment::to_string).collect();
            return moments.join(", ");
        }
        let mut period = self.whole_period();
        if let Some(months) = times.months {
            let [first, last] = months.at(self.when.place.latitude);
            period += &format!(", months {first} to {last}");
        }
        if let Some([from, to]) = times.hours {
            period += &format!(", {from} to {to} o'clock");
        }
        if self.args.min_elevation > 0.0 {
            period += &format!(", suns above {} degrees", self.args.min_elevation);
        }
        period
    }

    /// The time before parts of it are chosen.
    fn whole_period(&self) -> String {
        match (self.args.from.zip(self.args.to), self.weather) {
            (Some((from, to)), _) => map::period(&from, &to),
            (None, Some(_)) => "a year of weather".to_owned(),
            (None, None) => self.args.year.to_string(),
        }
    }
}
