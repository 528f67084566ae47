//! `antumbra sun`: hours of direct sun, sky view factors and irradiation of sensors.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra_bake::{
    Array, Clock, Entry, Label, Layout, Moment, Orientation, Place, Sensors, SunFound, SunJob,
    SunValues, Sunlight, SunlightClass, Surface, UpAxis,
};
use antumbra_lab::count;
use antumbra_raster::Quantity;

use super::command::{Bake, Baking, Figure, Named};
use super::files::{self, Column, Format};
use super::ground::Ground;
use super::map::{self, Plan, Words};
use super::places::{self, Places};
use super::when::{self, When, read_weather};
use super::{frames, groups, hourly, raster};
use crate::args::{Shown, SunArgs};
use crate::exit::{Failure, say, tell};
use crate::interrupt;
use crate::output::Files;

/// Everything that files are made of.
pub struct Baked<'a> {
    pub ground: &'a Ground,
    pub places: &'a Places,
    pub sensors: &'a Sensors,
    pub sunlight: &'a Sunlight,
    pub found: &'a SunFound,
    pub args: &'a SunArgs,
    pub when: &'a When,
    /// Name of the weather.
    weather: Option<&'a str>,
    pub up: UpAxis,
}

impl Baking for SunArgs {
    fn check(&self) -> Result<(), Failure> {
        for path in &self.output {
            match Format::of_sensors(path)? {
                Format::Picture if self.places.grid.is_none() => {
                    let path = path.display();
                    return Err(Failure::Usage(format!("{path}: a map needs --grid")));
                }
                Format::Raster => places::check_raster(path, &self.places, &self.scene)?,
                _ => {}
            }
        }
        places::check(&self.places)?;
        when::check(self)?;
        if self.frames.is_some() && self.places.grid.is_none() {
            return Err(Failure::Usage("--frames: maps need --grid".into()));
        }
        self.frames.as_deref().map(frames::is_gif).transpose()?;
        self.groups.as_deref().map(groups::is_table).transpose()?;
        if self.en17037 {
            check_day(self)?;
        }
        self.map.check()?;
        self.hourly.as_deref().map(hourly::format).transpose()?;
        if self.epw.is_none() && !matches!(self.show, Shown::Hours | Shown::SkyView) {
            return Err(Failure::Usage("--show: irradiation needs --epw".into()));
        }
        Ok(())
    }

    fn files(&self) -> [Vec<Named<'_>>; 2] {
        let mut read = self.places.files().to_vec();
        read.push(("--epw", self.epw.as_deref()));
        let written = vec![
            ("--hourly", self.hourly.as_deref()),
            ("--groups", self.groups.as_deref()),
            ("--frames", self.frames.as_deref()),
        ];
        [written, read]
    }

    fn bake(&self, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
        let begin = Instant::now();
        let weather = self.epw.as_deref().map(read_weather).transpose()?;
        let mut ground = bake.ground(&mut files, None)?;
        let up = ground.up(self.places.up)?;
        let (when, sunlight) = When::at(self, weather.as_ref(), &ground, up)?;
        let mut frames = self.frames.iter();
        frames.try_for_each(|path| frames::declare(path, &sunlight, &mut files))?;
        let places = Places::new(&self.places, &mut ground, up)?;
        if self.groups.is_some() && ground.surfaces.is_none() {
            ground.face(&sunlight.orientation);
        }
        let sensors = &places.sensors;
        let job = SunJob::new(&sensors.points, &sensors.normals, &sunlight)?;
        let done = bake.compute(&job, &ground, &ground.bvh)?;
        let baked = done.found.as_ref().map(|found| Baked {
            ground: &ground,
            places: &places,
            sensors,
            sunlight: &sunlight,
            found,
            args: self,
            when: &when,
            weather: weather.as_ref().map(|weather| &*weather.name),
            up,
        });
        let mut groups = None;
        if let Some(baked) = &baked {
            let _writing = interrupt::writing();
            bake.outputs.iter().try_for_each(|path| baked.write(path))?;
            self.hourly.iter().try_for_each(|path| baked.hourly(path))?;
            self.frames.iter().try_for_each(|path| baked.frames(path))?;
            if let Some(path) = &self.groups {
                groups = Some(baked.groups(path)?);
            }
        }
        let means = done.found.as_ref().map(|found| means(&found.values));
        let means @ [hours, view, direct, diffuse] = means.unwrap_or_default();
        let rays = baked.as_ref().map_or(0, |_| job.rays());
        let (of, suns) = (sensors.points.len(), &sunlight.suns);
        let total = begin.elapsed().as_secs_f64();
        let figures: &[Figure<'_>] = &[
            ("outputs", &bake.output_names()),
            ("shard", &bake.shard()),
            ("triangles", &ground.mesh.indices.len()),
            ("sensors", &of),
            ("place", &weather.as_ref().map(|weather| &weather.name)),
            ("latitude", &when.place.latitude),
            ("longitude", &when.place.longitude),
            ("timezone", &when.zone),
            ("steps", &sunlight.steps()),
            ("suns", &suns.times.len()),
            ("step_hours", suns.hours.first().unwrap_or(&0.0)),
            ("patches", &sunlight.patches.len()),
            ("rays", &rays),
            ("mean_hours", &hours),
            ("mean_sky_view", &view),
            ("mean_direct_kwh_m2", &direct),
            ("mean_diffuse_kwh_m2", &diffuse),
            ("groups", &groups),
            ("load_seconds", &ground.loaded.seconds),
            ("build_seconds", &ground.build_seconds),
            ("trace_seconds", &done.seconds),
            ("total_seconds", &total),
        ];
        let name = ("antumbra.sun/1", &*ground.loaded.scene.name);
        bake.document(name, figures, (&done, &format!("; {total:.2} s")))?;
        if let Some(baked) = &baked {
            ground.tell("");
            baked.tell(means);
            bake.end("rays", rays, &done);
        }
        Ok(())
    }
}

/// Refuses times that EN 17037 does not mean.
fn check_day(args: &SunArgs) -> Result<(), Failure> {
    let is_day = args.from.zip(args.to).is_some_and(|(from, to)| {
        let ends = [from, to].map(|moment| moment.unix(0.0));
        let is_one = ends[1] - ends[0] <= 86_400.0 && (from.month, from.day) == (to.month, to.day);
        is_one && ((2, 1)..=(3, 21)).contains(&(from.month, from.day))
    });
    let is_whole = args.times.hours.is_none() && args.times.months.is_none();
    match is_day && is_whole && args.step <= 10.0 {
        true => Ok(()),
        false => Err(Failure::Usage(
            "--en17037: wanted --from and --to on one day from 1 February to 21 March, and --step of at most 10".into(),
        )),
    }
}

/// Warns of points of a table that are inside of bodies.
fn warn_inside(ground: &Ground, sensors: &Sensors, sky: &[f64], plan: &Orientation) {
    let mut dark = (0..sensors.points.len())
        .filter(|&index| sky[index] == 0.0)
        .peekable();
    if dark.peek().is_none() {
        return;
    }
    let inside = ground.inside(&sensors.points, dark, plan);
    if let Some(first) = inside.first() {
        say(format_args!(
            "warning: {} of {} points lie inside of bodies and see nothing of the sky; the first is point {}",
            count(inside.len() as u64),
            count(sensors.points.len() as u64),
            first + 1,
        ));
    }
}

/// Share of facades that see nothing, above which something is wrong with the model.
const DARK: f64 = 0.05;

impl Baked<'_> {
    /// Says what was found, with means of hours, sky view, direct and diffuse irradiation.
    fn tell(&self, [hours, view, direct, diffuse]: [Option<f64>; 4]) {
        let (args, sunlight, place) = (self.args, self.sunlight, &self.when.place);
        let zones = match self.when.zones {
            [winter, summer] if winter < summer => format!("UTC{winter:+} and {summer:+}"),
            [zone, _] => format!("UTC{zone:+}"),
        };
        tell(format_args!(
            "{} sensors, {} suns of {} steps at {:.4}, {:.4} and {zones}, {} patches",
            count(self.sensors.points.len() as u64),
            count(sunlight.suns.times.len() as u64),
            count(sunlight.steps() as u64),
            place.latitude,
            place.longitude,
            sunlight.patches.len(),
        ));
        if args.en17037 && args.min_elevation == 0.0 {
            tell(format_args!(
                "EN 17037: suns count from 0 degrees above the horizon; --min-elevation gives the angle of a country, such as 11 in Germany"
            ));
        }
        if let (Some(hours), Some(view)) = (hours, view) {
            tell(format_args!(
                "mean: {hours:.1} hours of direct sun, sky view factor {view:.3}"
            ));
        }
        if let (Some(direct), Some(diffuse)) = (direct, diffuse) {
            tell(format_args!(
                "mean: {direct:.1} kWh/m² from the sun, {diffuse:.1} from the sky"
            ));
        }
        let values = &self.found.values;
        let without = values.hours.iter().filter(|x| x.is_nan()).count();
        if without > 0 {
            tell(format_args!(
                "{} sensors without a normal have the value NaN",
                count(without as u64)
            ));
        }
        self.tell_dark();
        if args.places.sensors.is_some() {
            let plan = &sunlight.orientation;
            warn_inside(self.ground, self.sensors, &values.sky_open, plan);
        }
    }

    /// Says what is covered, and warns of sensors that see nothing of the sky although nobody would expect it.
    fn tell_dark(&self) {
        let sensors = self.sensors;
        if !sensors.covered.is_empty() {
            tell(format_args!(
                "{} places more are covered: inside of bodies, or without sky close below a surface",
                count(sensors.covered.len() as u64),
            ));
        }
        let is_dark = |index: &usize| self.found.values.sky_open[*index] == 0.0;
        let dark: Vec<usize> = (0..sensors.points.len()).filter(is_dark).collect();
        let kinds = sensors.label("surface");
        if let (Some(kinds), Some(_)) = (kinds, self.args.places.placement.surfaces) {
            let is_facade = |kind: &String| kind == Surface::Facade.name();
            let facades = kinds.iter().filter(|kind| is_facade(kind)).count();
            let closed = dark
                .iter()
                .filter(|&&index| is_facade(&kinds[index]))
                .count();
            if closed as f64 > DARK * facades as f64 {
                say(format_args!(
                    "warning: {closed} of {facades} sensors on facades see nothing of the sky: are walls inside of others, or turned the wrong way?",
                ));
            }
        }
    }

    /// Values of all sensors, by their names in files.
    pub fn values(&self) -> Vec<(&'static str, Cow<'_, [f64]>)> {
        let values = &self.found.values;
        let mut all = vec![
            ("hours", Cow::from(&values.hours)),
            ("sky_view", Cow::from(&values.sky_view)),
            ("sky_open", Cow::from(&values.sky_open)),
        ];
        if !values.direct.is_empty() {
            all.push(("direct_kwh_m2", Cow::from(&values.direct)));
            all.push(("diffuse_kwh_m2", Cow::from(&values.diffuse)));
            all.extend(
                self.reflected()
                    .map(|list| ("reflected_kwh_m2", list.into())),
            );
        }
        all
    }

    /// The value that colours show, of every sensor.
    fn shown(&self) -> Vec<f32> {
        let values = &self.found.values;
        let total: Vec<f64>;
        let list = match self.args.show {
            Shown::Hours => &values.hours,
            Shown::SkyView => &values.sky_view,
            Shown::Direct => &values.direct,
            Shown::Diffuse => &values.diffuse,
            Shown::Total => {
                let reflected = self
                    .reflected()
                    .unwrap_or_else(|| vec![0.0; self.sensors.points.len()]);
                let pairs = values.total().into_iter().zip(reflected);
                total = pairs.map(|(total, reflected)| total + reflected).collect();
                &total
            }
        };
        list.iter().map(|&x| x as f32).collect()
    }

    /// Light from the ground, if it is wanted.
    fn reflected(&self) -> Option<Vec<f64>> {
        let Sensors {
            points, normals, ..
        } = self.sensors;
        let albedo = self.args.albedo?;
        Some(self.sunlight.reflected(albedo, normals, points.len()))
    }

    /// The value that colours show: its name and unit in files, and on maps.
    fn quantities(&self) -> [Quantity<'static>; 2] {
        let [name, unit, title, map_unit] = match self.args.show {
            Shown::Hours => ["hours", "h", "Direct sun", "h"],
            Shown::SkyView => ["sky_view", "", "Sky view factor", ""],
            Shown::Direct => ["direct_kwh_m2", "kWh/m2", "Direct irradiation", "kWh/m²"],
            Shown::Diffuse => ["diffuse_kwh_m2", "kWh/m2", "Diffuse irradiation", "kWh/m²"],
            Shown::Total => {
                let title = "Direct and diffuse irradiation";
                ["total_kwh_m2", "kWh/m2", title, "kWh/m²"]
            }
        };
        let on_maps = Quantity {
            name: title,
            unit: map_unit,
        };
        [Quantity { name, unit }, on_maps]
    }

    /// Writes one file.
    fn write(&self, path: &Path) -> Result<(), Failure> {
        let (args, sensors) = (self.args, self.sensors);
        let [quantity, on_map] = self.quantities();
        match Format::of_sensors(path)? {
            Format::Csv => self.csv(path),
            Format::Npz => self.npz(path),
            Format::Picture => {
                let time = (args.show != Shown::SkyView).then(|| self.period());
                let words = self.words((on_map.name, on_map.unit), time);
                let plan = self.plan();
                map::Sheet::new(&args.map, &plan, sensors)?.write(path, &words, &self.shown())
            }
            Format::Raster => {
                let values = (sensors, &self.shown()[..]);
                let place = (args.raster.crs.as_ref(), args.places.units.metres());
                raster::write(path, self.ground, values, place, (self.up, quantity))
            }
            Format::Ply | Format::Glb => {
                let directions = self.sunlight.patch_directions();
                let up = directions.last().copied().unwrap_or_default();
                let values = (quantity.name, &self.shown()[..]);
                let mesh = (&self.ground.mesh, self.ground.local);
                files::coloured(path, values, sensors, mesh, (up, args.map.colours()))
            }
        }
    }

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
        let mut title = format!("{quantity}, {}", self.ground.loaded.scene.name);
        if let Some(name) = &args.places.only {
            title += &format!(", {name}");
        }
        let files = [Some(&args.scene), args.epw.as_ref()];
        Words {
            title,
            subtitle: subtitle.join("  ·  "),
            quantity,
            unit,
            whole: false,
            files: files.into_iter().flatten().map(PathBuf::as_path).collect(),
        }
    }

    /// Where the grid of maps is.
    pub fn plan(&self) -> Plan<'_> {
        let places = &self.args.places;
        let metres = places.units.metres();
        Plan {
            ground: self.ground,
            bvh: self.places.bvh(self.ground),
            orientation: &self.places.plan,
            up: self.up,
            cell: places.grid.unwrap_or_default() / metres,
            north: places.seen_from.is_none().then_some(places.north.degrees()),
            metres: Some(metres),
        }
    }

    /// The time that values are of, as maps write it.
    fn period(&self) -> String {
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

    fn csv(&self, path: &Path) -> Result<(), Failure> {
        let (sensors, values, all) = (self.sensors, &self.found.values, self.values());
        let columns = all.iter();
        let columns = columns.map(|(name, list)| Column::new(*name, |row| list[row]));
        let mut columns: Vec<Column<'_>> = columns.collect();
        // Lists of twelve values for each sensor, of which those of months with steps are written.
        let by_month = [
            ("hours", &values.by_month),
            ("direct_kwh_m2", &values.direct_by_month),
            ("diffuse_kwh_m2", &values.diffuse_by_month),
        ];
        let known = if values.direct.is_empty() { 1 } else { 3 };
        let covered = &self.sunlight.suns.covered;
        for &(name, list) in &by_month[..known] {
            let months = (0..12).filter(|&month| covered[month]);
            columns.extend(months.map(|month| {
                let name = format!("{name}_{:02}", month + 1);
                Column::new(name, move |row| list[12 * row + month])
            }));
        }
        let class = |&hours: &f64| SunlightClass::of_hours(hours).name().to_owned();
        let classes = self.args.en17037.then(|| Label {
            column: "en17037".into(),
            values: values.hours.iter().map(class).collect(),
        });
        let places = (sensors, &sensors.normals[..], self.ground.local);
        files::table(path, places, classes.as_slice(), &columns)
    }

    fn npz(&self, path: &Path) -> Result<(), Failure> {
        let (sensors, suns, values) = (self.sensors, &self.sunlight.suns, &self.found.values);
        let (suns_seen, sky_seen) = (&self.found.suns_seen, &self.found.sky_seen);
        let azimuths: Vec<f64> = suns.positions.iter().map(|sun| sun.azimuth).collect();
        let elevations: Vec<f64> = suns.positions.iter().map(|sun| sun.elevation).collect();
        let counts = [suns_seen.columns() as u64, sky_seen.columns() as u64];
        let sun_directions = self.sunlight.sun_directions();
        let patch_directions = self.sunlight.patch_directions();
        let solid_angles = &self.sunlight.patches.solid_angles;
        let mut entries = vec![
            Entry::new("points", Array::Places(&sensors.points, self.ground.local)),
            Entry::new("normals", Array::Points(&sensors.normals)),
            Entry::new("hours", Array::F64(&values.hours)),
            Entry::new("hours_by_month", Array::F64(&values.by_month)).columns(12),
            Entry::new("sky_view", Array::F64(&values.sky_view)),
            Entry::new("sky_open", Array::F64(&values.sky_open)),
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
        if !values.direct.is_empty() {
            entries.push(Entry::new("direct_kwh_m2", Array::F64(&values.direct)));
            entries.push(Entry::new("diffuse_kwh_m2", Array::F64(&values.diffuse)));
            for (name, list) in [
                ("direct_kwh_m2_by_month", &values.direct_by_month),
                ("diffuse_kwh_m2_by_month", &values.diffuse_by_month),
            ] {
                entries.push(Entry::new(name, Array::F64(list)).columns(12));
            }
        }
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

/// Means of hours, sky view, direct and diffuse irradiation, each over the values that are numbers.
fn means(values: &SunValues) -> [Option<f64>; 4] {
    let lists = [
        &values.hours,
        &values.sky_view,
        &values.direct,
        &values.diffuse,
    ];
    lists.map(|values| {
        let known = || values.iter().filter(|value| !value.is_nan());
        let count = known().count();
        (count > 0).then(|| known().sum::<f64>() / count as f64)
    })
}
