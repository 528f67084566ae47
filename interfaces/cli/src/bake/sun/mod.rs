//! `antumbra sun`: hours of direct sun, sky view factors and irradiation of sensors.
//!
//! The steps of the command, each in a file of its own: `when`: place and times, before anything is traced;  `around`: terrain around
//! the scene;  `values`: the list of
//! values, after it;  `outputs`, with the `words` of maps;  `hourly`, `frames`, `groups`: values by step of time, moving shadows,
//! means by object;  `report`: what is said at the end

mod around;
mod frames;
mod groups;
mod hourly;
mod outputs;
mod report;
mod values;
mod when;
mod words;

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Instant;

use antumbra::LocalOrigin;
use antumbra_bake::{
    FieldSunJob, Moment, Monitor, Sensors, SkyDivision, SunFound, SunJob, Sunlight, Surroundings,
    UpAxis, Weather,
};
use antumbra_tiles::Indexed;
use clap::{ArgGroup, Args};

use super::city::Around;
use super::command::{Bake, Baking, Done, Figure, Named};
use super::files::Format;
use super::ground::Ground;
use super::map;
use super::parts::By;
use super::places::{self, Places};
use super::site::Asked;
use super::terrain::{Terrain, is_terrain};
use super::tile::Tiling;
use crate::args::{
    ChunkArgs, MapArgs, PlaceArgs, RasterArgs, SCENE, TimeArgs, heading, rasters_long,
    values as checked,
};
use crate::exit::Failure;
use crate::json::Destination;
use crate::output::{Files, is_one_of};
use crate::progress::Progress;
use crate::{input, interrupt};
use groups::Row;
use values::{Shown, Value};
use when::{When, read_weather};

/// Flags of `sun`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("where").required(true))]
pub struct SunArgs {
    #[arg(required = true, help = SCENE, long_help = rasters_long())]
    pub scene: Vec<PathBuf>,
    /// Result: .csv, .ply, .npz, .png, .svg, .pdf or .tif
    ///
    /// May be given several times. A .csv has a line per sensor, a .ply the mesh or the sensors in colours, a .png, .svg
    /// or .pdf a map of a --grid or of the --cells of a height raster, and an .npz all values with the visibility matrices. Beside
    /// a .png is a .pgw, the world file for GIS programs. A .tif (GeoTIFF), .asc or .npy has the value of --show in the cells of a --grid or of a scene that is a
    /// raster. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = checked::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Value that colours show
    ///
    /// hours, sky-view, and with --epw direct, diffuse and total.
    #[arg(long, value_enum, default_value_t = Shown::Hours, hide_possible_values = true, help_heading = heading::OUTPUT)]
    pub show: Shown,
    #[command(flatten)]
    pub map: MapArgs,
    #[command(flatten)]
    pub raster: RasterArgs,
    /// Table of every step of time and every sensor
    ///
    /// A .csv with a line per step and a column per sensor: the value of --show of this step, in hours or Wh/m². An .npz has the
    /// array values, steps x sensors, with times, the beginnings of the steps in Unix time, and points.
    #[arg(long, value_name = "FILE", value_parser = checked::output_file(), conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub hourly: Option<PathBuf>,
    /// Means, ends and sums by object, material or facade
    ///
    /// A .csv or .json with a line for each group of --by: its area in m², its sensors, and of each value the mean, the smallest and
    /// the largest of them. Energies have a sum too: the mean times the area, in kWh. Sensors belong to the surface that they are on,
    /// or that is below them.
    #[arg(long, value_name = "FILE", value_parser = checked::output_file(), conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub groups: Option<PathBuf>,
    /// object, material or facade
    ///
    /// Lines `o`, or else `g`, begin objects in an .obj; nodes are objects in a .gltf. Where nothing has a name, surfaces that touch are a
    /// body. A facade is all of an object that faces one of eight sides of the compass; roofs, ground and undersides have lines too.
    #[arg(long, value_name = "KIND", value_enum, default_value_t = By::Object, hide_possible_values = true, requires = "groups", help_heading = heading::OUTPUT)]
    pub by: By,
    /// Moving shadows: .gif, or .png for each step
    ///
    /// A map of each step of time with a sun above the horizon, with its time in the title. A .gif has them all. Of NAME.png, the
    /// files are NAME-0001.png and so on. Needs --grid, or --cells of a height raster.
    #[arg(long, value_name = "FILE", value_parser = checked::output_file(), conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub frames: Option<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    #[command(flatten)]
    pub places: PlaceArgs,
    /// Heights around the scene, which cast shadows
    ///
    /// Hills hide the sun and the sky as the scene does, without a mesh of them. Several files, a folder or a .vrt, after the scene and
    /// in its coordinates. Its coordinate system gives place, unit and north, unless flags do. With --cells, sensors are its cells, on which
    /// the scene casts shadows.
    #[arg(long, value_name = "RASTER", num_args = 1.., help_heading = heading::SUN)]
    pub terrain: Vec<PathBuf>,
    /// Meshes around the scene, which cast shadows
    ///
    /// The index of a city in many files, by `antumbra index`. Those that touch the scene are read with it, and others when a ray may reach
    /// them, so that a city may be larger than memory. Results are as if all were one file. If the scene is one of the files, it counts once.
    #[arg(long, value_name = "INDEX", conflicts_with = "cells", help_heading = heading::SUN)]
    pub city: Option<PathBuf>,
    /// Latitude, south negative [default: by --crs]
    ///
    /// If absent: the middle of the scene in its coordinate system (--crs, or the one in a GeoTIFF), or else the place of --epw.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, requires = "lon", help_heading = heading::SUN)]
    pub lat: Option<f64>,
    /// Longitude, west negative [default: by --crs]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, requires = "lat", help_heading = heading::SUN)]
    pub lon: Option<f64>,
    /// Above the sea [default: the weather's, or 0]
    #[arg(long, value_name = "METRES", allow_negative_numbers = true, help_heading = heading::SUN)]
    pub altitude: Option<f64>,
    #[command(flatten)]
    pub times: TimeArgs,
    /// Weather of a year, for irradiance
    ///
    /// An .epw file of EnergyPlus. Gives the place and the steps of time, too.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["step", "year"], help_heading = heading::SUN)]
    pub epw: Option<PathBuf>,
    /// First moment, as 2024-06-21[T08:00]
    ///
    /// If absent: all of --year, or of the weather.
    #[arg(long, value_name = "TIME", requires = "to", help_heading = heading::SUN)]
    pub from: Option<Moment>,
    /// End of the time; a date counts to its end
    #[arg(long, value_name = "TIME", requires = "from", value_parser = end_of, help_heading = heading::SUN)]
    pub to: Option<Moment>,
    /// Year, without --from and --to
    #[arg(long, value_name = "YEAR", default_value_t = 2025, conflicts_with = "from", value_parser = clap::value_parser!(i32).range(1..=5999), help_heading = heading::SUN)]
    pub year: i32,
    /// Light that the ground reflects, with --epw
    ///
    /// As a part of what open level ground receives: 0.2 is usual. A tilted sensor receives albedo times that, times (1 - cos
    /// tilt) / 2, whatever shades the ground. In the column reflected_kwh_m2, and in the total of --show.
    #[arg(long, value_name = "PART", requires = "epw", value_parser = checked::part, help_heading = heading::SUN)]
    pub albedo: Option<f64>,
    /// Leave out suns lower than this
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, value_parser = checked::from_zero, help_heading = heading::SUN)]
    pub min_elevation: f64,
    /// Class of sunlight by EN 17037
    ///
    /// In the column en17037 of a .csv: none, minimum (from 1.5 h), medium (3 h) or high (4 h). The time must be one day from 1
    /// February to 21 March, in steps of at most 10 minutes. Give the least elevation of your country with --min-elevation.
    #[arg(long, conflicts_with = "epw", help_heading = heading::SUN)]
    pub en17037: bool,
    /// Minutes from sun to sun
    ///
    /// Each sun stands for the step around it: the sun of the middle of the step.
    #[arg(long, value_name = "MINUTES", default_value_t = 60.0, value_parser = checked::positive, help_heading = heading::SUN)]
    pub step: f64,
    /// 145, 577, 2305 or uniform:N
    ///
    /// 145 are by Tregenza, 577 and 2305 by Reinhart. uniform:N are N patches of the same size.
    #[arg(long, value_name = "PATCHES", default_value = "145", value_parser = sky, help_heading = heading::SUN)]
    pub sky: SkyDivision,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}

/// Parses an end: a date counts to the midnight after it.
fn end_of(text: &str) -> Result<Moment, String> {
    let mut moment = Moment::from_str(text).map_err(|error| error.to_string())?;
    if !text.contains(':') {
        moment.seconds = 86_400.0;
    }
    Ok(moment)
}

/// Parses a division of the sky.
fn sky(text: &str) -> Result<SkyDivision, String> {
    let division = match text {
        "145" | "tregenza" => SkyDivision::Tregenza,
        "577" | "reinhart" => SkyDivision::Reinhart(2),
        "2305" => SkyDivision::Reinhart(4),
        _ => {
            let count = text.strip_prefix("uniform:").and_then(|n| n.parse().ok());
            let known = "known are 145, 577, 2305 and uniform:N";
            SkyDivision::Uniform(count.ok_or(known)?)
        }
    };
    division.patches().map_err(|error| error.to_string())?;
    Ok(division)
}

/// Everything that files are made of.
struct Baked<'a> {
    /// Name of the scene.
    name: &'a str,
    /// Mesh and places on it, or a raster, or both.
    mesh: Option<(&'a Ground, &'a Places)>,
    terrain: Option<&'a Terrain>,
    local: LocalOrigin,
    sensors: &'a Sensors,
    sunlight: &'a Sunlight,
    values: Vec<Value<'a>>,
    args: &'a SunArgs,
    when: &'a When,
    /// Name of the weather.
    weather: Option<&'a str>,
    up: UpAxis,
    /// Figures of terrain around the scene.
    around: Option<around::Figures<'a>>,
}

impl Baking for SunArgs {
    fn check(&self) -> Result<(), Failure> {
        for path in &self.output {
            match Format::of_sensors(path)? {
                Format::Picture if !self.has_maps() => {
                    let reason = "a map needs --grid, or --cells of a height raster";
                    return Err(Failure::name(path, reason));
                }
                Format::Raster => places::check_raster(path, &self.places, self.raster_scene())?,
                _ => {}
            }
        }
        places::check(&self.places)?;
        when::check(self)?;
        if self.frames.is_some() && !self.has_maps() {
            let reason = "--frames: maps need --grid, or --cells of a height raster";
            return Err(Failure::Usage(reason.into()));
        }
        self.frames.as_deref().map(frames::is_gif).transpose()?;
        self.groups.as_deref().map(groups::is_table).transpose()?;
        if self.en17037 {
            check_day(self)?;
        }
        self.map.check()?;
        self.hourly.as_deref().map(hourly::format).transpose()?;
        if self.epw.is_none() && self.show.needs_weather() {
            return Err(Failure::Usage("--show: irradiation needs --epw".into()));
        }
        Ok(())
    }

    fn files(&self) -> [Vec<Named<'_>>; 2] {
        let mut read = self.places.files().to_vec();
        read.push(("--epw", self.epw.as_deref()));
        read.push(("--city", self.city.as_deref()));
        read.extend(self.terrain.iter().map(|path| ("--terrain", Some(&**path))));
        let written = vec![
            ("--hourly", self.hourly.as_deref()),
            ("--groups", self.groups.as_deref()),
            ("--frames", self.frames.as_deref()),
        ];
        [written, read]
    }

    fn tiling(&self, _: &Indexed) -> Result<Tiling, Failure> {
        if !self.is_of_cells() || self.has_terrain_cells() {
            let reason = "tiles of an index are for --cells of the index";
            return Err(Failure::usage(reason));
        }
        let [name, unit] = self.show.name_and_unit();
        Ok(Tiling {
            directions: Vec::new(),
            bands: vec![[name, unit].map(str::to_owned)],
            eyes: Vec::new(),
        })
    }

    fn check_city(&self) -> Result<(), Failure> {
        let is_on_files = self.places.vertices || self.places.placement.surfaces.is_some();
        let reason = match (is_on_files, &self.city) {
            (false, _) => "sensors of a city are on its files: --vertices or --surfaces",
            (true, Some(_)) => "--city: it is the scene of the plan",
            (true, None) => return Ok(()),
        };
        Err(Failure::usage(reason))
    }

    fn bake(&self, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
        around::check(self)?;
        let begin = Instant::now();
        bake.tell_neighbours(match self.terrain.is_empty() {
            true => &self.scene,
            false => &self.terrain,
        });
        let weather = self.epw.as_deref().map(read_weather).transpose()?;
        if self.is_of_cells() {
            return self.of_cells(bake, (weather.as_ref(), begin), files);
        }
        let terrain =
            (!self.terrain.is_empty()).then(|| bake.terrain_of(&self.terrain, &mut files));
        let terrain = terrain.transpose()?;
        terrain.iter().for_each(Terrain::tell_read);
        let mut ground = bake.ground_in(&mut files, self.city.as_deref())?;
        let up = ground.up(self.places.up)?;
        let site = match &terrain {
            Some(terrain) => around::settle(self, (&ground, up), terrain)?,
            None => {
                Asked::new(&self.raster, &self.places).of((&ground.loaded, ground.extent()), up)?
            }
        };
        let (when, sunlight) = When::at(self, weather.as_ref(), site, up)?;
        let mut frames = self.frames.iter();
        frames.try_for_each(|path| frames::declare(path, &sunlight, &mut files))?;
        let places = Places::new(&self.places, &mut ground, up)?;
        if self.groups.is_some() && ground.surfaces.is_none() {
            ground.face(&sunlight.orientation);
        }
        let sensors = &places.sensors;
        let field = terrain.as_ref().map(Terrain::field).transpose()?;
        let around = field.as_ref().map(|field| {
            let compass = (up, self.places.north.degrees());
            Surroundings::new(field, ground.local, compass)
        });
        let around = around.transpose()?;
        let mut job = SunJob::new(&sensors.points, &sensors.normals, &sunlight)?;
        let mut figures = None;
        if let (Some(terrain), Some(around)) = (&terrain, &around) {
            job = job.within(around)?;
            let below = around.buried(&ground.bvh, &sensors.points);
            let below = [below, sensors.points.len()];
            figures = Some(around::figures(terrain, &ground, around, below));
        }
        let city = ground.around.as_ref();
        let load = city.map(Around::loader);
        let pieces = city.zip(load.as_ref());
        let pieces = pieces.map(|(city, load)| city.pieces(load)).transpose()?;
        if let Some(pieces) = &pieces {
            job = job.beside(pieces);
        }
        let done = bake.compute(&job, &ground, &ground.bvh);
        let done = done.map_err(|failure| match city {
            Some(city) => city.failure(failure),
            None => failure,
        })?;
        city.into_iter().for_each(Around::tell);
        let baked = Baked {
            name: &ground.loaded.scene.name,
            mesh: Some((&ground, &places)),
            terrain: None,
            local: ground.local,
            sensors,
            sunlight: &sunlight,
            values: Vec::new(),
            args: self,
            when: &when,
            weather: weather.as_ref().map(|weather| &*weather.name),
            up,
            around: figures,
        };
        let triangles = ground.mesh.indices.len();
        let read = terrain.as_ref().map_or(0.0, |terrain| terrain.load_seconds);
        let seconds = [read + ground.loaded.seconds, ground.build_seconds];
        baked.end(bake, (triangles, job.rays(), seconds, begin), &done)
    }
}

impl SunArgs {
    /// Whether sensors are the cells of a height raster.
    fn is_of_cells(&self) -> bool {
        let is_terrain = || is_terrain(self.raster_scene(), self.places.up);
        self.has_terrain_cells() || self.places.vertices && is_terrain()
    }

    /// Whether sensors are on a map.
    fn has_maps(&self) -> bool {
        self.places.grid.is_some() || self.is_of_cells()
    }

    /// Whether sensors are the cells of `--terrain`.
    fn has_terrain_cells(&self) -> bool {
        self.places.cells && !self.terrain.is_empty()
    }

    /// The raster whose cells may be sensors: the scene, if it is one, or the terrain around it.
    fn raster_scene(&self) -> &[PathBuf] {
        match self.has_terrain_cells() {
            true => &self.terrain,
            false => &self.scene,
        }
    }

    /// Sun and sky of the cells of a height raster: without a mesh, unless outputs are made of one or it is around a scene.
    fn of_cells(
        &self,
        bake: &Bake<'_>,
        (weather, begin): (Option<&Weather>, Instant),
        mut files: Files,
    ) -> Result<(), Failure> {
        let terrain = bake.terrain_of(self.raster_scene(), &mut files)?;
        terrain.tell_read();
        let town = self.has_terrain_cells().then(|| {
            let ground = bake.ground(&mut files, None)?;
            let up = ground.up(self.places.up)?;
            Ok::<_, Failure>((ground, up))
        });
        let town = town.transpose()?;
        let site = match &town {
            Some((ground, up)) => around::settle(self, (ground, *up), &terrain)?,
            None => terrain.settle(&Asked::new(&self.raster, &self.places))?,
        };
        map::check_cells(&terrain, self.output.iter().chain(&self.frames))?;
        let (when, sunlight) = When::at(self, weather, site, UpAxis::Z)?;
        let mut frames = self.frames.iter();
        frames.try_for_each(|path| frames::declare(path, &sunlight, &mut files))?;
        let has_mesh = town.is_none() && (self.groups.is_some() || self.writes(&["ply"]));
        let ground = has_mesh.then(|| bake.ground(&mut files, None));
        let ground = ground.transpose()?.map(|mut ground| {
            if self.groups.is_some() {
                ground.face(&sunlight.orientation);
            }
            let places = Places::new(&self.places, &mut ground, UpAxis::Z);
            places.map(|places| (ground, places))
        });
        let ground = ground.transpose()?;
        let start = Instant::now();
        let field = terrain.field()?;
        let north = self.places.north.degrees();
        let rise = self.places.placement.height / self.places.units.metres();
        let by_month = self.writes(&["csv", "npz"]);
        let job = FieldSunJob::new(&field, &sunlight, (rise, north), by_month);
        let mut job = job.map_err(|error| Failure::scene(&terrain.name, error))?;
        let around = town.as_ref().map(|(ground, up)| {
            let around = Surroundings::new(&field, ground.local, (*up, north))?;
            Ok::<_, Failure>((ground, around))
        });
        let around = around.transpose()?;
        let mut figures = None;
        if let Some((ground, around)) = &around {
            job = job.among(&ground.bvh, around)?;
            figures = Some(around::figures(&terrain, ground, around, [0; 2]));
        }
        // Rasters need no list of sensors, which is longer than all that is computed.
        let are_rasters = |path| is_one_of(path, &["tif", "tiff", "asc", "npy"]);
        let has_list = self.hourly.is_some() || self.groups.is_some() || self.albedo.is_some();
        let mut sensors = Sensors::default();
        if has_list || !self.output.iter().all(|path| are_rasters(path)) {
            sensors = terrain.sensors(rise);
            sensors.normals = job.normals();
        }
        let lit = bake.tile.map(|work| {
            move |directions: &[[f64; 2]], monitor: &dyn Monitor| {
                work.lit(rise, directions, monitor)
            }
        });
        if let Some(lit) = &lit {
            job = job.lit_by(lit);
        }
        let build_seconds = start.elapsed().as_secs_f64();
        let done = match &town {
            _ if bake.is_whole() => self.whole(&job, (bake, &terrain.name))?,
            Some((ground, _)) => bake.compute(&job, ground, &ground.bvh)?,
            None => bake.compute_cells(&job, &terrain.name)?,
        };
        let baked = Baked {
            name: &terrain.name,
            mesh: ground.as_ref().map(|(ground, places)| (ground, places)),
            terrain: Some(&terrain),
            local: terrain.local(),
            sensors: &sensors,
            sunlight: &sunlight,
            values: Vec::new(),
            args: self,
            when: &when,
            weather: weather.map(|weather| &*weather.name),
            up: UpAxis::Z,
            around: figures,
        };
        let seconds = [terrain.load_seconds, build_seconds];
        let directions = sunlight.suns.times.len() + sunlight.patches.len();
        let answers = (directions * terrain.known) as u64;
        let own = town.as_ref().map(|(ground, _)| ground.mesh.indices.len());
        let triangles = own.unwrap_or_else(|| field.triangles());
        baked.end(bake, (triangles, answers, seconds, begin), &done)
    }

    /// Computes all of a job with little memory.
    fn whole(
        &self,
        job: &FieldSunJob<'_>,
        (bake, name): (&Bake<'_>, &str),
    ) -> Result<Done<SunFound>, Failure> {
        let keeps = self.writes(&["npz"]) || self.hourly.is_some() || self.frames.is_some();
        input::check_answers(name, job.memory(keeps))?;
        let (start, progress) = (Instant::now(), Progress::new(name));
        let found = job.whole(keeps, &progress);
        progress.finish();
        let found = found.map_err(|error| match bake.tile {
            Some(work) => work.failure(error),
            None => error.into(),
        });
        Ok(Done::whole(found?, start.elapsed().as_secs_f64()))
    }

    /// Whether an output has one of these extensions.
    fn writes(&self, kinds: &[&str]) -> bool {
        self.output.iter().any(|path| is_one_of(path, kinds))
    }

    /// Light from the ground, if it is wanted.
    fn reflected(&self, sensors: &Sensors, sunlight: &Sunlight) -> Option<Vec<f64>> {
        let albedo = self.albedo?;
        Some(sunlight.reflected(albedo, &sensors.normals, sensors.points.len()))
    }
}

impl<'a> Baked<'a> {
    /// Number of sensors, of which there is no list if only rasters are written.
    fn number(&self) -> usize {
        self.terrain
            .map_or(self.sensors.points.len(), |terrain| terrain.known)
    }

    /// Writes all files and the document, and says what was done: of so many rays, or answers without rays.
    fn end(
        mut self,
        bake: &Bake<'_>,
        (triangles, number, [load_seconds, build_seconds], begin): (usize, u64, [f64; 2], Instant),
        done: &'a Done<SunFound>,
    ) -> Result<(), Failure> {
        let (sensors, sunlight) = (self.sensors, self.sunlight);
        let mut groups = None;
        if let Some(found) = &done.found {
            let reflected = self.args.reflected(sensors, sunlight);
            self.values = values::list(&found.values, reflected);
            groups = self.write_all(bake.outputs, found)?;
        }
        let shown = [Shown::Hours, Shown::SkyView, Shown::Direct, Shown::Diffuse];
        let means @ [hours, view, direct, diffuse] = shown.map(|shown| self.value(shown)?.mean());
        let number = if done.found.is_some() { number } else { 0 };
        let rays = match (self.terrain, &self.around) {
            // Only cells that the terrain leaves lit have rays.
            (Some(_), Some(_)) => None,
            (Some(_), None) => Some(0),
            (None, _) => Some(number),
        };
        let (suns, place) = (&sunlight.suns, &self.when.place);
        let total = begin.elapsed().as_secs_f64();
        let figures: &[Figure<'_>] = &[
            ("outputs", &bake.output_names()),
            ("shard", &bake.shard()),
            ("triangles", &triangles),
            ("terrain", &self.around),
            ("sensors", &self.number()),
            ("place", &self.weather),
            ("latitude", &place.latitude),
            ("longitude", &place.longitude),
            ("timezone", &self.when.zone),
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
            ("load_seconds", &load_seconds),
            ("build_seconds", &build_seconds),
            ("trace_seconds", &done.seconds),
            ("total_seconds", &total),
        ];
        let name = ("antumbra.sun/1", self.name);
        bake.document(name, figures, (done, &format!("; {total:.2} s")))?;
        if let Some(found) = &done.found {
            match (self.terrain, self.mesh) {
                (Some(terrain), _) => terrain.tell(),
                (None, Some((ground, _))) => ground.tell(""),
                (None, None) => {}
            }
            if let Some(around) = &self.around {
                around.tell(triangles);
            }
            self.tell(found, means);
            let things = if self.terrain.is_some() {
                "answers"
            } else {
                "rays"
            };
            bake.end(things, number, done);
        }
        Ok(())
    }

    /// The mesh and the places on it.
    fn mesh(&self) -> Result<(&'a Ground, &'a Places), Failure> {
        let reason = "a height raster has no mesh: take --grid instead of --cells";
        self.mesh.ok_or_else(|| Failure::Usage(reason.into()))
    }

    /// Writes all files, during which no signal ends the program. Returns the rows of `--groups`.
    fn write_all(
        &self,
        outputs: &[PathBuf],
        found: &SunFound,
    ) -> Result<Option<Vec<Row>>, Failure> {
        let _writing = interrupt::writing();
        let args = self.args;
        outputs
            .iter()
            .try_for_each(|path| self.write(path, found))?;
        let mut hourly = args.hourly.iter();
        hourly.try_for_each(|path| self.hourly(path, found))?;
        let mut frames = args.frames.iter();
        frames.try_for_each(|path| self.frames(path, found))?;
        args.groups
            .as_ref()
            .map(|path| self.groups(path))
            .transpose()
    }

    /// A value that colours can show.
    fn value(&self, shown: Shown) -> Option<&Value<'a>> {
        self.values.iter().find(|value| value.shown == Some(shown))
    }

    /// The value of `--show`.
    fn shown(&self) -> &Value<'a> {
        self.value(self.args.show).unwrap_or(&self.values[0])
    }

    /// Values that tables have.
    fn columns(&self) -> impl Iterator<Item = &Value<'a>> + Clone {
        let all = self.values.iter();
        all.filter(|value| value.shown != Some(Shown::Total))
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
