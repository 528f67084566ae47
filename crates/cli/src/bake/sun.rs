//! `antumbra sun`: hours of direct sun, sky view factors and irradiation of sensors.

use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use antumbra_bake::{
    BitMatrix, Irradiance, Moment, Orientation, Place, Refraction, SkyPatches, SunPosition, UpAxis,
    Weather, Weighting, ones, perez_sky, sees_directions, sun_positions,
};
use antumbra_lab::{Machine, count};
use antumbra_load::MemorySize;
use rayon::prelude::*;
use serde::Serialize;

use super::chunks::{self, Part, Work};
use super::hash::Key;
use super::mesh::Ground;
use super::sensors::Sensors;
use super::sun_files;
use crate::args::{Shown, SunArgs};
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::progress::Progress;
use crate::{json, version};

/// Suns at the steps of time that have one above the horizon.
pub struct Suns {
    /// Middle of each step, in Unix time.
    pub times: Vec<f64>,
    pub positions: Vec<SunPosition>,
    /// Hours that each sun stands for.
    pub hours: Vec<f64>,
    /// Month of each sun, 0 to 11.
    pub months: Vec<usize>,
    /// Direct normal irradiation of each step in Wh/m², if the weather is known.
    pub direct: Vec<f64>,
    /// Months that have steps, with or without a sun.
    pub covered: [bool; 12],
}

/// What sensors get.
#[derive(Default)]
pub struct Values {
    pub hours: Vec<f64>,
    /// Hours of each month, twelve for each sensor.
    pub by_month: Vec<f64>,
    pub sky_view: Vec<f64>,
    /// In kWh/m²; empty without weather.
    pub direct: Vec<f64>,
    pub diffuse: Vec<f64>,
    /// Irradiation of each month, twelve values for each sensor.
    pub direct_by_month: Vec<f64>,
    pub diffuse_by_month: Vec<f64>,
}

/// What the sky sends from each patch in Wh/(m² sr).
struct SkyLight {
    of_all: Vec<f64>,
    /// Empty for months without steps.
    by_month: [Vec<f64>; 12],
}

/// Everything that files are made of.
pub struct Baked<'a> {
    pub ground: &'a Ground,
    pub sensors: &'a Sensors,
    pub suns: &'a Suns,
    pub sun_directions: Vec<[f32; 3]>,
    pub patches: &'a SkyPatches,
    pub patch_directions: Vec<[f32; 3]>,
    pub suns_seen: BitMatrix,
    pub sky_seen: BitMatrix,
    pub values: Values,
    pub shown: Shown,
}

impl Baked<'_> {
    /// The value that colours show, of every sensor.
    pub fn shown(&self) -> Vec<f32> {
        let values = &self.values;
        let list: Vec<f64> = match self.shown {
            Shown::Hours => values.hours.clone(),
            Shown::SkyView => values.sky_view.clone(),
            Shown::Direct => values.direct.clone(),
            Shown::Diffuse => values.diffuse.clone(),
            Shown::Total => values.total(),
        };
        list.into_iter().map(|x| x as f32).collect()
    }
}

impl Values {
    /// Direct and diffuse irradiation.
    pub fn total(&self) -> Vec<f64> {
        let pairs = self.direct.iter().zip(&self.diffuse);
        pairs.map(|(direct, diffuse)| direct + diffuse).collect()
    }
}

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    #[serde(flatten)]
    machine: Machine,
    scene: &'a str,
    outputs: Vec<String>,
    shard: Option<String>,
    triangles: usize,
    sensors: usize,
    place: Option<String>,
    latitude: f64,
    longitude: f64,
    timezone: f64,
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
    load_seconds: f64,
    build_seconds: f64,
    trace_seconds: f64,
    total_seconds: f64,
}

/// Runs the command, or merges parts of it.
pub fn run(args: &SunArgs, memory: MemorySize, parts: Option<&[Part]>) -> Result<(), Failure> {
    let begin = Instant::now();
    let isa = args.machine.isa()?;
    if args.chunks.shard.is_none() {
        sun_files::check(args)?;
    }
    let mut files = Files::default();
    chunks::declare(&args.output, args.chunks.shard, &mut files)?;
    if let Some(json) = &args.json {
        files.writes("--json", json.path())?;
    }
    chunks::reads(parts, &mut files)?;
    files.reads("the scene", &args.scene)?;
    for (purpose, path) in [("--sensors", &args.sensors), ("--epw", &args.epw)] {
        if let Some(path) = path {
            files.reads(purpose, path)?;
        }
    }
    files.check()?;
    let weather = args.epw.as_ref().map(read_weather).transpose()?;
    let when = When::new(args, weather.as_ref())?;
    let suns = when.suns(args, weather.as_ref())?;
    let steps = when.steps(args, weather.as_ref())?.len();
    args.machine.start_threads()?;
    let ground = Ground::load(&args.scene, isa, memory, &mut files)?;
    let up = up_axis(args.up, &args.scene);
    let plan = Orientation::new(up, 0.0).map_err(Failure::usage)?;
    let orientation = Orientation::new(up, args.north).map_err(Failure::usage)?;
    let sensors = match (&args.sensors, args.grid) {
        (Some(path), _) => Sensors::from_csv(path)?,
        (None, Some(spacing)) => {
            Sensors::on_grid(&ground.bvh, spacing / args.units.metres(), &plan)?
        }
        (None, None) => Sensors::of_vertices(&ground.vertices),
    };
    let patches = args.sky.patches().map_err(Failure::usage)?;
    let patch_directions = patches.directions(&orientation);
    let sun_directions: Vec<[f32; 3]> = (suns.positions.iter())
        .map(|sun| {
            orientation
                .direction(sun.azimuth, sun.elevation)
                .map(|x| x as f32)
        })
        .collect();
    let directions = [&sun_directions[..], &patch_directions].concat();

    let mut key = Key::new("sun/1", &ground.loaded.scene)?;
    for list in [&sensors.points, &sensors.normals, &directions] {
        key.floats(list.as_flattened());
    }
    let work = Work {
        key: key.value(),
        items: sensors.points.len(),
        rays_per_item: directions.len() as u64,
        shard: args.chunks.shard,
        output: &args.output[0],
        restart: args.chunks.restart,
        parts,
    };
    let start = Instant::now();
    let progress = Progress::new(&ground.loaded.scene.name);
    let chunks = work.run(&progress, |range, monitor| {
        let normals = sensors.normals.get(range.clone()).unwrap_or_default();
        let points = &sensors.points[range];
        let seen = sees_directions(
            &ground.bvh,
            points,
            normals,
            &directions,
            f32::INFINITY,
            monitor,
        )?;
        Ok(seen
            .words()
            .iter()
            .flat_map(|word| word.to_le_bytes())
            .collect())
    })?;
    progress.finish();
    let trace_seconds = start.elapsed().as_secs_f64();
    let mut document = Document {
        schema: "antumbra.sun/1",
        machine: version::machine(isa),
        scene: &ground.loaded.scene.name,
        outputs: args
            .output
            .iter()
            .map(|path| path.to_string_lossy().into_owned())
            .collect(),
        shard: args.chunks.shard.map(|shard| shard.to_string()),
        triangles: ground.vertices.indices.len(),
        sensors: sensors.points.len(),
        place: weather.as_ref().map(|weather| weather.name.clone()),
        latitude: when.place.latitude,
        longitude: when.place.longitude,
        timezone: when.zone,
        steps,
        suns: suns.times.len(),
        step_hours: suns.hours.first().copied().unwrap_or_default(),
        patches: patches.len(),
        rays: 0,
        mean_hours: None,
        mean_sky_view: None,
        mean_direct_kwh_m2: None,
        mean_diffuse_kwh_m2: None,
        load_seconds: ground.loaded.seconds,
        build_seconds: ground.build_seconds,
        trace_seconds,
        total_seconds: 0.0,
    };
    let Some(found) = chunks else {
        document.total_seconds = begin.elapsed().as_secs_f64();
        json::write(&document, args.json.as_ref())?;
        tell(format_args!(
            "wrote {}, for merge; {:.2} s",
            args.output[0].display(),
            document.total_seconds
        ));
        return Ok(());
    };
    let (suns_seen, sky_seen) = split(
        &found,
        sensors.points.len(),
        suns.times.len(),
        patches.len(),
    )?;
    drop(found);
    document.rays = rays_of(&sensors, &directions);
    let sky = sky_light(&patches, &when, args, weather.as_ref())?;
    let values = values(
        &sensors,
        &orientation,
        (&suns, &suns_seen),
        (&patches, &sky_seen),
        sky.as_ref(),
    );
    let baked = Baked {
        ground: &ground,
        sensors: &sensors,
        suns: &suns,
        sun_directions,
        patches: &patches,
        patch_directions,
        suns_seen,
        sky_seen,
        values,
        shown: args.show,
    };
    for path in &args.output {
        sun_files::write(path, &baked)?;
    }
    document.mean_hours = mean(&baked.values.hours);
    document.mean_sky_view = mean(&baked.values.sky_view);
    document.mean_direct_kwh_m2 = mean(&baked.values.direct);
    document.mean_diffuse_kwh_m2 = mean(&baked.values.diffuse);
    document.total_seconds = begin.elapsed().as_secs_f64();
    json::write(&document, args.json.as_ref())?;
    summarise(&document, parts);
    Ok(())
}

/// Mean of the values that are numbers.
fn mean(values: &[f64]) -> Option<f64> {
    let known = || values.iter().filter(|value| !value.is_nan());
    let count = known().count();
    (count > 0).then(|| known().sum::<f64>() / count as f64)
}

/// Up axis of a mesh: the one asked for, or that of its format.
pub fn up_axis(asked: Option<UpAxis>, scene: &std::path::Path) -> UpAxis {
    let extension = scene.extension().unwrap_or_default();
    let is_gltf = ["gltf", "glb"]
        .iter()
        .any(|name| extension.eq_ignore_ascii_case(name));
    asked.unwrap_or(if is_gltf { UpAxis::Y } else { UpAxis::Z })
}

fn read_weather(path: &PathBuf) -> Result<Weather, Failure> {
    let name = path.display();
    let text =
        fs::read(path).map_err(|error| Failure::Work(format!("cannot read {name}: {error}")))?;
    // Names of places are in Latin-1 now and then.
    let text = String::from_utf8_lossy(&text);
    Weather::read(&text).map_err(|error| Failure::Data(format!("{name}: {error}")))
}

/// The place and the steps of time.
struct When {
    place: Place,
    zone: f64,
}

/// Most steps of time.
const MOST_STEPS: f64 = 1e7;

impl When {
    fn new(args: &SunArgs, weather: Option<&Weather>) -> Result<Self, Failure> {
        let mut place = weather.map(|weather| weather.place).unwrap_or_default();
        if let (Some(latitude), Some(longitude)) = (args.lat, args.lon) {
            (place.latitude, place.longitude) = (latitude, longitude);
        }
        place.height = args.altitude.unwrap_or(place.height);
        // Refuses places that are not on the earth, before anything is read.
        sun_positions(&place, Refraction::default(), &[]).map_err(Failure::usage)?;
        let by_longitude = (place.longitude / 15.0).round();
        let zone = match (args.timezone, weather) {
            (Some(zone), _) => zone,
            (None, Some(weather)) => weather.zone,
            (None, None) => by_longitude,
        };
        if !(zone.abs() <= 26.0) {
            return Err(Failure::Usage(format!(
                "--timezone {zone}: it must be from -26 to 26"
            )));
        }
        Ok(Self { place, zone })
    }

    /// Steps of time: middle in Unix time, moment of their beginning, hours, and what was measured.
    fn steps(
        &self,
        args: &SunArgs,
        weather: Option<&Weather>,
    ) -> Result<Vec<(f64, Moment, f64, Irradiance)>, Failure> {
        if let Some(weather) = weather {
            // Years of typical years differ, so that the day of the year decides.
            let place = |moment: &Moment| (moment.month, moment.day, moment.seconds);
            let is_in = |moment: &Moment| match (&args.from, &args.to) {
                (Some(from), Some(to)) if place(from) <= place(to) => {
                    place(from) <= place(moment) && place(moment) < place(to)
                }
                (Some(from), Some(to)) => place(from) <= place(moment) || place(moment) < place(to),
                _ => true,
            };
            let records = weather.records.iter().filter(|record| is_in(&record.begin));
            return Ok(records
                .map(|record| {
                    let middle = record.begin.unix(self.zone) + 1800.0 * record.hours;
                    (middle, record.begin, record.hours, record.irradiance)
                })
                .collect());
        }
        let midnight = |year| Moment {
            year,
            month: 1,
            day: 1,
            seconds: 0.0,
        };
        let from = args.from.unwrap_or(midnight(args.year)).unix(self.zone);
        let to = args.to.unwrap_or(midnight(args.year + 1)).unix(self.zone);
        let step = 60.0 * args.step;
        let count = ((to - from) / step - 1e-9).ceil();
        if !(count >= 1.0) {
            return Err(Failure::Usage("--to must lie behind --from".into()));
        }
        if count > MOST_STEPS {
            return Err(Failure::Usage(format!(
                "--step: {count:.0} steps are more than ten million"
            )));
        }
        let steps = (0..count as usize).map(|index| {
            let begin = from + step * index as f64;
            // The last step may be shorter.
            let length = step.min(to - begin);
            let moment = Moment::at_unix(begin, self.zone);
            (
                begin + 0.5 * length,
                moment,
                length / 3600.0,
                Irradiance::default(),
            )
        });
        Ok(steps.collect())
    }

    /// Suns above the horizon.
    fn suns(&self, args: &SunArgs, weather: Option<&Weather>) -> Result<Suns, Failure> {
        let steps = self.steps(args, weather)?;
        let times: Vec<f64> = steps.iter().map(|step| step.0).collect();
        let positions = sun_positions(&self.place, Refraction::Standard, &times);
        let positions = positions.map_err(Failure::usage)?;
        let mut suns = Suns {
            times: Vec::new(),
            positions: Vec::new(),
            hours: Vec::new(),
            months: Vec::new(),
            direct: Vec::new(),
            covered: [false; 12],
        };
        for ((time, begin, hours, irradiance), position) in steps.into_iter().zip(positions) {
            let month = begin.month as usize - 1;
            suns.covered[month] = true;
            if position.elevation > 0.0 {
                suns.times.push(time);
                suns.positions.push(position);
                suns.hours.push(hours);
                suns.months.push(month);
                if weather.is_some() {
                    suns.direct.push(irradiance.direct_normal * hours);
                }
            }
        }
        Ok(suns)
    }
}

/// Rows of bits of all chunks, as a matrix of suns and one of patches.
fn split(
    chunks: &[Vec<u8>],
    rows: usize,
    suns: usize,
    patches: usize,
) -> Result<(BitMatrix, BitMatrix), Failure> {
    let per_row = 8 * (suns + patches).div_ceil(64);
    let mut suns_seen = BitMatrix::new(rows, suns).map_err(Failure::work)?;
    let mut sky_seen = BitMatrix::new(rows, patches).map_err(Failure::work)?;
    let mut row = 0;
    let mut words = Vec::new();
    for bytes in chunks.iter().flat_map(|bytes| bytes.chunks(per_row)) {
        if row == rows || bytes.len() != per_row {
            break;
        }
        words.clear();
        words.extend(
            bytes
                .as_chunks::<8>()
                .0
                .iter()
                .map(|word| u64::from_le_bytes(*word)),
        );
        for column in ones(&words) {
            match column < suns {
                true => suns_seen.set(row, column, true),
                false => sky_seen.set(row, column - suns, true),
            }
        }
        row += 1;
    }
    if row < rows {
        return Err(Failure::Data(
            "the chunks of an earlier run do not fit".into(),
        ));
    }
    Ok((suns_seen, sky_seen))
}

/// Rays that were traced: those above the planes of the sensors.
fn rays_of(sensors: &Sensors, directions: &[[f32; 3]]) -> u64 {
    if sensors.normals.is_empty() {
        return sensors.points.len() as u64 * directions.len() as u64;
    }
    let above = |normal: &[f32; 3]| {
        let faces = |direction: &&[f32; 3]| {
            let products = normal.iter().zip(direction.iter());
            products
                .map(|(a, b)| f64::from(*a) * f64::from(*b))
                .sum::<f64>()
                > 0.0
        };
        directions.iter().filter(faces).count() as u64
    };
    sensors.normals.par_iter().map(above).sum()
}

/// Irradiation by each patch over all steps, if the weather is known.
fn sky_light(
    patches: &SkyPatches,
    when: &When,
    args: &SunArgs,
    weather: Option<&Weather>,
) -> Result<Option<SkyLight>, Failure> {
    let Some(weather) = weather else {
        return Ok(None);
    };
    let steps = when.steps(args, Some(weather))?;
    let times: Vec<f64> = steps.iter().map(|step| step.0).collect();
    let positions =
        sun_positions(&when.place, Refraction::Standard, &times).map_err(Failure::usage)?;
    let none = || vec![0.0; patches.len()];
    let mut light = SkyLight {
        of_all: none(),
        by_month: Default::default(),
    };
    for ((_, begin, hours, irradiance), sun) in steps.iter().zip(&positions) {
        let of_month = &mut light.by_month[begin.month as usize - 1];
        if of_month.is_empty() {
            *of_month = none();
        }
        if irradiance.diffuse_horizontal > 0.0 {
            let sky =
                perez_sky(patches, sun, begin.day_of_year(), irradiance).map_err(Failure::work)?;
            for sums in [&mut light.of_all, of_month] {
                let pairs = sums.iter_mut().zip(&sky);
                pairs.for_each(|(sum, radiance)| *sum += radiance * hours);
            }
        }
    }
    Ok(Some(light))
}

/// Values of all sensors from what they see.
fn values(
    sensors: &Sensors,
    orientation: &Orientation,
    (suns, suns_seen): (&Suns, &BitMatrix),
    (patches, sky_seen): (&SkyPatches, &BitMatrix),
    sky: Option<&SkyLight>,
) -> Values {
    let to_suns: Vec<[f64; 3]> = (suns.positions.iter())
        .map(|sun| Orientation::default().direction(sun.azimuth, sun.elevation))
        .collect();
    let mut values = Values::default();
    for row in 0..sensors.points.len() {
        // Of points in free space, what falls on a level surface there.
        let normal = match sensors.normals.get(row) {
            None => Some([0.0, 0.0, 1.0]),
            Some(normal) => unit(orientation.local(normal.map(f64::from))),
        };
        let Some(normal) = normal else {
            values.push_none(sky.is_some());
            continue;
        };
        let (mut months, mut direct_months) = ([0.0; 12], [0.0; 12]);
        let (mut hours, mut direct) = (0.0, 0.0);
        for sun in ones(suns_seen.row(row)) {
            hours += suns.hours[sun];
            months[suns.months[sun]] += suns.hours[sun];
            if let Some(beam) = suns.direct.get(sun) {
                let products = normal.iter().zip(&to_suns[sun]);
                let beam = beam * products.map(|(a, b)| a * b).sum::<f64>().max(0.0);
                direct += beam;
                direct_months[suns.months[sun]] += beam;
            }
        }
        values.hours.push(hours);
        values.by_month.extend(months);
        values
            .sky_view
            .push(patches.view(normal, Weighting::Cosine, sky_seen.row(row)));
        if let Some(sky) = sky {
            let seen = sky_seen.row(row);
            let diffuse = |sky: &Vec<f64>| match sky.is_empty() {
                true => 0.0,
                false => patches.irradiance(normal, sky, seen) / 1000.0,
            };
            values.direct.push(direct / 1000.0);
            values.diffuse.push(diffuse(&sky.of_all));
            let direct = direct_months.iter().map(|direct| direct / 1000.0);
            values.direct_by_month.extend(direct);
            values
                .diffuse_by_month
                .extend(sky.by_month.iter().map(diffuse));
        }
    }
    values
}

impl Values {
    /// Adds a sensor without values.
    fn push_none(&mut self, with_weather: bool) {
        self.hours.push(f64::NAN);
        self.by_month.extend([f64::NAN; 12]);
        self.sky_view.push(f64::NAN);
        if with_weather {
            self.direct.push(f64::NAN);
            self.diffuse.push(f64::NAN);
            self.direct_by_month.extend([f64::NAN; 12]);
            self.diffuse_by_month.extend([f64::NAN; 12]);
        }
    }
}

/// The vector scaled to length 1, if it has a direction.
fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length > 0.0 && length.is_finite()).then(|| vector.map(|x| x / length))
}

fn summarise(document: &Document<'_>, parts: Option<&[Part]>) {
    tell(format_args!(
        "{}: {} triangles, loaded in {:.2} s, tree built in {:.2} s",
        document.scene,
        count(document.triangles as u64),
        document.load_seconds,
        document.build_seconds,
    ));
    tell(format_args!(
        "{} sensors, {} suns of {} steps at {:.4}, {:.4} and UTC{:+}, {} patches",
        count(document.sensors as u64),
        count(document.suns as u64),
        count(document.steps as u64),
        document.latitude,
        document.longitude,
        document.timezone,
        document.patches,
    ));
    if let (Some(hours), Some(view)) = (document.mean_hours, document.mean_sky_view) {
        tell(format_args!(
            "mean: {hours:.1} hours of direct sun, sky view factor {view:.3}"
        ));
    }
    if let (Some(direct), Some(diffuse)) =
        (document.mean_direct_kwh_m2, document.mean_diffuse_kwh_m2)
    {
        tell(format_args!(
            "mean: {direct:.1} kWh/m² from the sun, {diffuse:.1} from the sky"
        ));
    }
    tell(format_args!(
        "{}; wrote {}",
        chunks::work_done("rays", document.rays, document.trace_seconds, parts),
        document.outputs.join(", "),
    ));
}
