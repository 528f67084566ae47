//! `antumbra sun`: hours of direct sun, sky view factors and irradiation of sensors.

use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra_bake::{
    Array, Clock, Entry, Label, Layout, Moment, Orientation, Place, Sensors, SunFound, SunJob,
    SunValues, Sunlight, SunlightClass, Surface, UpAxis,
};
use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_raster::Quantity;
use serde::Serialize;

use super::chunks::{self, PartFile};
use super::command::{Bake, Head};
use super::files::{self, Format};
use super::ground::Ground;
use super::map::{self, Plan, Words};
use super::places::{self, Places};
use super::when::{self, When, read_weather};
use super::{frames, groups, hourly, raster};
use crate::args::{Shown, SunArgs};
use crate::exit::{Failure, say, tell};
use crate::{interrupt, json};

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    head: Head<'a>,
    outputs: Vec<String>,
    shard: Option<String>,
    triangles: usize,
    sensors: usize,
    place: Option<String>,
    latitude: f64,
    longitude: f64,
    timezone: f64,
    /// Hours ahead of UTC, as people read them: two where the clocks change.
    #[serde(skip)]
    zones: String,
    /// Steps of time, and those with a sun above the horizon.
    steps: usize,
    suns: usize,
    step_hours: f64,
    patches: usize,
    rays: u64,
    mean_hours: Option<f64>,
    mean_sky_view: Option<f64>,
    mean_direct_kwh_m2: Option<f64>,
    mean_diffuse_kwh_m2: Option<f64>,
    /// Rows of --groups.
    groups: Option<Vec<groups::Row>>,
    load_seconds: f64,
    build_seconds: f64,
    trace_seconds: f64,
    total_seconds: f64,
}

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

/// Refuses outputs that cannot be made, before anything is read.
pub fn check(args: &SunArgs) -> Result<(), Failure> {
    for path in &args.output {
        if Format::of_sensors(path)? == Format::Picture && args.places.grid.is_none() {
            let path = path.display();
            return Err(Failure::Usage(format!("{path}: a map needs --grid")));
        }
        if Format::of_sensors(path)? == Format::Raster {
            places::check_raster(path, &args.places, &args.scene)?;
        }
    }
    places::check(&args.places)?;
    when::check(args)?;
    if args.frames.is_some() && args.places.grid.is_none() {
        return Err(Failure::Usage("--frames: maps need --grid".into()));
    }
    args.frames
        .as_deref()
        .map_or(Ok(()), |path| frames::is_gif(path).map(drop))?;
    args.groups
        .as_deref()
        .map_or(Ok(()), |path| groups::is_table(path).map(drop))?;
    if args.en17037 {
        check_day(args)?;
    }
    args.map.check()?;
    args.hourly
        .as_deref()
        .map_or(Ok(()), |path| hourly::format(path).map(drop))?;
    if args.epw.is_none() && !matches!(args.show, Shown::Hours | Shown::SkyView) {
        return Err(Failure::Usage("--show: irradiation needs --epw".into()));
    }
    Ok(())
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

/// Runs the command, or merges parts of it.
pub fn run(args: &SunArgs, memory: MemorySize, parts: Option<&[PartFile]>) -> Result<(), Failure> {
    let begin = Instant::now();
    let isa = args.machine.isa()?;
    if args.chunks.shard.is_none() {
        check(args)?;
    }
    let bake = Bake {
        scene: &args.scene,
        outputs: &args.output,
        json: args.json.as_ref(),
        chunks: &args.chunks,
        machine: &args.machine,
        parts,
        earth: None,
    };
    let read = [
        ("--sensors", args.places.sensors.as_deref()),
        ("--along", args.places.placement.along.as_deref()),
        ("--epw", args.epw.as_deref()),
    ];
    let world_files = map::world_files(&args.output)?;
    let mut written = vec![
        ("--hourly", args.hourly.as_deref()),
        ("--groups", args.groups.as_deref()),
        ("--frames", args.frames.as_deref()),
    ];
    written.extend(
        world_files
            .iter()
            .map(|path| ("the world file", Some(&**path))),
    );
    let mut files = bake.declare(&written, &read)?;
    let weather = args.epw.as_deref().map(read_weather).transpose()?;
    let mut ground = bake.ground(isa, memory, &mut files)?;
    let up = ground.up(args.places.up)?;
    let (when, sunlight) = When::at(args, weather.as_ref(), &ground, up)?;
    if let Some(path) = &args.frames {
        frames::declare(path, &sunlight, &mut files)?;
    }
    let places = Places::new(&args.places, &mut ground, up)?;
    if args.groups.is_some() && ground.surfaces.is_none() {
        ground.face(&sunlight.orientation);
    }
    let sensors = &places.sensors;
    let job = SunJob::new(&sensors.points, &sensors.normals, &sunlight)?;
    let done = bake.compute(&job, &ground, &ground.bvh)?;
    let mut document = Document {
        place: weather.as_ref().map(|weather| weather.name.clone()),
        trace_seconds: done.seconds,
        ..Document::new(
            &bake,
            bake.head("antumbra.sun/1", isa, &ground.loaded.scene.name),
            &ground,
            &when,
        )
    };
    document.describe(sensors, &sunlight);
    let Some(found) = done.found else {
        document.total_seconds = begin.elapsed().as_secs_f64();
        json::write(&document, args.json.as_ref())?;
        tell(format_args!(
            "wrote {}, for merge; {:.2} s",
            document.outputs.join(", "),
            document.total_seconds
        ));
        return Ok(());
    };
    let baked = Baked {
        ground: &ground,
        places: &places,
        sensors,
        sunlight: &sunlight,
        found: &found,
        args,
        when: &when,
        weather: weather.as_ref().map(|weather| &*weather.name),
        up,
    };
    for path in &args.output {
        baked.write(path)?;
    }
    if let Some(path) = &args.hourly {
        baked.hourly(path)?;
    }
    if let Some(path) = &args.frames {
        baked.frames(path)?;
    }
    if let Some(path) = &args.groups {
        document.groups = Some(baked.groups(path)?);
    }
    document.rays = job.rays();
    document.fill(&found.values);
    document.total_seconds = begin.elapsed().as_secs_f64();
    json::write(&document, args.json.as_ref())?;
    ground.tell("");
    document.tell(args.en17037.then_some(args.min_elevation));
    let without = found.values.hours.iter().filter(|x| x.is_nan()).count();
    if without > 0 {
        tell(format_args!(
            "{} sensors without a normal have the value NaN",
            count(without as u64)
        ));
    }
    baked.tell_dark();
    if args.places.sensors.is_some() {
        warn_inside(
            &ground,
            &places.sensors,
            &found.values.sky_open,
            &sunlight.orientation,
        );
    }
    bake.tell_done("rays", document.rays, document.trace_seconds);
    chunks::forget(done.checkpoint.as_deref());
    Ok(())
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
        let kinds = sensors
            .labels
            .iter()
            .find(|label| label.column == "surface");
        if let (Some(kinds), Some(_)) = (kinds, self.args.places.placement.surfaces) {
            let is_facade = |kind: &String| kind == Surface::Facade.name();
            let facades = kinds.values.iter().filter(|kind| is_facade(kind)).count();
            let closed = dark
                .iter()
                .filter(|&&index| is_facade(&kinds.values[index]))
                .count();
            if closed as f64 > DARK * facades as f64 {
                say(format_args!(
                    "warning: {closed} of {facades} sensors on facades see nothing of the sky: are walls inside of others, or turned the wrong way?",
                ));
            }
        }
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
                let reflected = self.reflected();
                let add = |(row, total): (usize, f64)| {
                    total + reflected.as_ref().map_or(0.0, |reflected| reflected[row])
                };
                total = values.total().into_iter().enumerate().map(add).collect();
                &total
            }
        };
        list.iter().map(|&x| x as f32).collect()
    }

    /// Light from the ground, if it is wanted.
    pub fn reflected(&self) -> Option<Vec<f64>> {
        let Sensors {
            points, normals, ..
        } = self.sensors;
        let albedo = self.args.albedo?;
        Some(self.sunlight.reflected(albedo, normals, points.len()))
    }

    /// Name and unit of the value that colours show.
    fn quantity(&self) -> Quantity<'static> {
        let (name, unit) = match self.args.show {
            Shown::Hours => ("hours", "h"),
            Shown::SkyView => ("sky_view", ""),
            Shown::Direct => ("direct_kwh_m2", "kWh/m2"),
            Shown::Diffuse => ("diffuse_kwh_m2", "kWh/m2"),
            Shown::Total => ("total_kwh_m2", "kWh/m2"),
        };
        Quantity { name, unit }
    }

    /// Writes one file.
    fn write(&self, path: &Path) -> Result<(), Failure> {
        let _writing = interrupt::writing();
        match Format::of_sensors(path)? {
            Format::Csv => self.csv(path),
            Format::Npz => self.npz(path),
            Format::Picture => self.map(path),
            Format::Raster => {
                let values = (self.sensors, &self.shown()[..]);
                let place = (
                    self.args.raster.crs.as_ref(),
                    self.args.places.units.metres(),
                );
                raster::write(path, self.ground, values, place, (self.up, self.quantity()))
            }
            Format::Ply | Format::Glb => {
                let name = self.quantity().name;
                let directions = self.sunlight.patch_directions();
                let up = directions.last().copied().unwrap_or_default();
                let values = (name, &self.shown()[..]);
                let mesh = (&self.ground.mesh, self.ground.local);
                let colours = self.args.map.colours();
                files::coloured(path, values, self.sensors, mesh, (up, colours))
            }
        }
    }

    fn map(&self, path: &Path) -> Result<(), Failure> {
        let (quantity, unit) = match self.args.show {
            Shown::Hours => ("Direct sun", "h"),
            Shown::SkyView => ("Sky view factor", ""),
            Shown::Direct => ("Direct irradiation", "kWh/m²"),
            Shown::Diffuse => ("Diffuse irradiation", "kWh/m²"),
            Shown::Total => ("Direct and diffuse irradiation", "kWh/m²"),
        };
        let time = (self.args.show != Shown::SkyView).then(|| self.period());
        let words = self.words((quantity, unit), time);
        let plan = self.plan();
        let sheet = map::Sheet::new(&self.args.map, &plan, self.sensors)?;
        sheet.write(path, &words, &self.shown())
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
        let (sensors, values) = (self.sensors, &self.found.values);
        let covered = self.sunlight.suns.covered;
        let months: Vec<usize> = (0..12).filter(|&month| covered[month]).collect();
        let reflected = self.reflected();
        let mut columns = vec![
            ("hours", &values.hours),
            ("sky_view", &values.sky_view),
            ("sky_open", &values.sky_open),
        ];
        // Columns of twelve values for each sensor, of which those of months with steps are written.
        let mut by_month = vec![("hours", &values.by_month)];
        if !values.direct.is_empty() {
            columns.extend([
                ("direct_kwh_m2", &values.direct),
                ("diffuse_kwh_m2", &values.diffuse),
            ]);
            columns.extend(reflected.iter().map(|list| ("reflected_kwh_m2", list)));
            by_month.extend([
                ("direct_kwh_m2", &values.direct_by_month),
                ("diffuse_kwh_m2", &values.diffuse_by_month),
            ]);
        }
        let mut head: Vec<String> = columns.iter().map(|(name, _)| (*name).to_owned()).collect();
        for (name, _) in &by_month {
            head.extend(
                months
                    .iter()
                    .map(|month| format!("{name}_{:02}", month + 1)),
            );
        }
        let room = 10 * (12 + (by_month.len() * months.len()) as u64);
        let head = (&head.join(",")[..], room);
        let points = (&sensors.points[..], self.ground.local);
        let mut labels = sensors.labels.clone();
        if self.args.en17037 {
            let class = |&hours: &f64| SunlightClass::of_hours(hours).name().to_owned();
            labels.push(Label {
                column: "en17037".into(),
                values: values.hours.iter().map(class).collect(),
            });
        }
        files::table(path, points, (&sensors.normals, &labels), head, |row| {
            let mut numbers: Vec<f64> = columns.iter().map(|(_, list)| list[row]).collect();
            for (_, list) in &by_month {
                numbers.extend(months.iter().map(|month| list[12 * row + month]));
            }
            numbers
        })
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

/// Mean of the values that are numbers.
fn mean(values: &[f64]) -> Option<f64> {
    let known = || values.iter().filter(|value| !value.is_nan());
    let count = known().count();
    (count > 0).then(|| known().sum::<f64>() / count as f64)
}

impl<'a> Document<'a> {
    /// A document of the scene and the place.
    fn new(bake: &Bake<'_>, head: Head<'a>, ground: &Ground, when: &When) -> Self {
        Self {
            head,
            outputs: bake.output_names(),
            shard: bake.shard(),
            triangles: ground.mesh.indices.len(),
            sensors: 0,
            place: None,
            latitude: when.place.latitude,
            longitude: when.place.longitude,
            timezone: when.zone,
            zones: match when.zones {
                [winter, summer] if winter < summer => format!("UTC{winter:+} and {summer:+}"),
                [zone, _] => format!("UTC{zone:+}"),
            },
            steps: 0,
            suns: 0,
            step_hours: 0.0,
            patches: 0,
            rays: 0,
            mean_hours: None,
            mean_sky_view: None,
            mean_direct_kwh_m2: None,
            mean_diffuse_kwh_m2: None,
            groups: None,
            load_seconds: ground.loaded.seconds,
            build_seconds: ground.build_seconds,
            trace_seconds: 0.0,
            total_seconds: 0.0,
        }
    }

    /// Fills in counts of the sensors, the suns and the sky.
    fn describe(&mut self, sensors: &Sensors, sunlight: &Sunlight) {
        self.sensors = sensors.points.len();
        self.steps = sunlight.steps();
        self.suns = sunlight.suns.times.len();
        self.step_hours = sunlight.suns.hours.first().copied().unwrap_or_default();
        self.patches = sunlight.patches.len();
    }

    /// Fills in figures about the values.
    fn fill(&mut self, values: &SunValues) {
        self.mean_hours = mean(&values.hours);
        self.mean_sky_view = mean(&values.sky_view);
        self.mean_direct_kwh_m2 = mean(&values.direct);
        self.mean_diffuse_kwh_m2 = mean(&values.diffuse);
    }

    /// Prints the figures. `en17037_from` is the least elevation of suns, where the standard is applied.
    fn tell(&self, en17037_from: Option<f64>) {
        tell(format_args!(
            "{} sensors, {} suns of {} steps at {:.4}, {:.4} and {}, {} patches",
            count(self.sensors as u64),
            count(self.suns as u64),
            count(self.steps as u64),
            self.latitude,
            self.longitude,
            self.zones,
            self.patches,
        ));
        if en17037_from == Some(0.0) {
            tell(format_args!(
                "EN 17037: suns count from 0 degrees above the horizon; --min-elevation gives the angle of a country, such as 11 in Germany"
            ));
        }
        if let (Some(hours), Some(view)) = (self.mean_hours, self.mean_sky_view) {
            tell(format_args!(
                "mean: {hours:.1} hours of direct sun, sky view factor {view:.3}"
            ));
        }
        if let (Some(direct), Some(diffuse)) = (self.mean_direct_kwh_m2, self.mean_diffuse_kwh_m2) {
            tell(format_args!(
                "mean: {direct:.1} kWh/m² from the sun, {diffuse:.1} from the sky"
            ));
        }
    }
}
