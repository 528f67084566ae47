//! `antumbra horizon`: how high surfaces reach in each direction of the compass, and how much sky they leave open.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra::LocalOrigin;
use antumbra_bake::{
    Array, Direction, Entry, Error, FieldHorizonJob, FieldSky, HeightField, HorizonJob, Lattice,
    Orientation, Sensors, SkyMeasure, SkyValues,
};
use antumbra_image::atomic_write_seeking;
use antumbra_lab::count;
use antumbra_raster::{Grid, Quantity, Site};
use antumbra_terrain::{Monitor, Share};
use antumbra_tiles::Indexed;
use clap::{ArgGroup, Args, ValueEnum};

use super::command::{Bake, Baking, Done, Figure, Named};
use super::files::{self, Column, Format};
use super::map;
use super::places::{self, Places};
use super::raster;
use super::site::Asked;
use super::terrain::is_terrain;
use super::tile::{self, Tiling};
use crate::args::{
    ChunkArgs, MapArgs, PlaceArgs, RasterArgs, SCENE, heading, rasters_long, values,
};
use crate::exit::{Failure, tell};
use crate::input::check_answers;
use crate::interrupt;
use crate::json::Destination;
use crate::output::{Files, check_room, is_one_of};
use crate::progress::Progress;

/// What is written of horizons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shown {
    /// Elevation of the horizon in each azimuth, in degrees
    Angles,
    /// Part of the light of an even sky that the surface of a cell receives
    SkyView,
    /// Part of the hemisphere above that is not hidden, by solid angle
    SkyOpen,
    /// Degrees from the zenith to the horizon, on average
    Openness,
}

impl Shown {
    /// What is measured, but for angles.
    fn measure(self) -> Option<SkyMeasure> {
        match self {
            Self::Angles => None,
            Self::SkyView => Some(SkyMeasure::View),
            Self::SkyOpen => Some(SkyMeasure::Open),
            Self::Openness => Some(SkyMeasure::Openness),
        }
    }

    /// Name and unit in files.
    fn quantity(self) -> Quantity<'static> {
        let (name, unit) = match self {
            Self::Angles => ("horizon", "degrees"),
            Self::SkyView => ("sky_view", ""),
            Self::SkyOpen => ("sky_open", ""),
            Self::Openness => ("openness", "degrees"),
        };
        Quantity { name, unit }
    }
}

/// Flags of `horizon`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("where").required(true))]
pub struct HorizonArgs {
    #[arg(required = true, help = SCENE, long_help = rasters_long())]
    pub scene: Vec<PathBuf>,
    /// Result: .csv, .npz, .tif, .png, .svg or .pdf
    ///
    /// May be given several times. A .csv has a line per sensor and a column per azimuth, such as horizon_090. An .npz has the
    /// array horizon, sensors x azimuths, with azimuths and points. A .tif (GeoTIFF) has a band, and a .npy a plane, for each azimuth of
    /// the --cells of a raster, or the value of --show. An .asc, or a raster of a --grid, has one azimuth (--azimuths 1). A .png, .svg or
    /// .pdf is a map of one azimuth or of --show, of --cells; beside a .png is a .pgw, the world file for GIS programs. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Angles, or how open the sky is
    ///
    /// angles are degrees for each azimuth. All others are for --cells of a height raster, and one number for each cell, a sum over its
    /// horizons: sky-view is the part of the light of an even sky that the surface of the cell receives, sky-open the part of the
    /// hemisphere above that nothing hides, and openness degrees from the zenith down to the horizon. The sky ends at the horizontal. The
    /// end of the run says how much values of the next coarser lattice, or of every second azimuth, differ.
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = Shown::Angles, hide_possible_values = true, help_heading = heading::OUTPUT)]
    pub show: Shown,
    #[command(flatten)]
    pub map: MapArgs,
    #[command(flatten)]
    pub raster: RasterArgs,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Number of azimuths, evenly spread, or lattice:N
    ///
    /// A lattice has the azimuths of steps between the cells of a raster. So lines of sight pass through cells, and one sweep answers all
    /// of them. lattice:8, 16, 32, 48 and 80 have steps of at most 1, 2, 3, 4 and 5 columns and rows. Azimuths are not evenly
    /// spread, and results name them. By default lattice:16 for --cells of a raster, else 36.
    #[arg(long, value_name = "N", value_parser = Azimuths::parse, help_heading = heading::WORK)]
    pub azimuths: Option<Azimuths>,
    /// The first azimuth; north is 0, east 90
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, value_parser = values::finite, help_heading = heading::WORK)]
    pub first: f64,
    #[command(flatten)]
    pub places: PlaceArgs,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}

/// How azimuths are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Azimuths {
    /// So many, evenly spread.
    Even(u32),
    /// A lattice of so many.
    Lattice(usize),
}

impl Azimuths {
    fn parse(text: &str) -> Result<Self, String> {
        let wanted = "wanted 1 to 3600, or lattice:8, lattice:16, lattice:32, ...";
        let found = match text.strip_prefix("lattice:") {
            Some(count) => count.parse().ok().map(Self::Lattice),
            None => text.parse().ok().map(Self::Even),
        };
        let is_in = |azimuths: &Self| !matches!(azimuths, Self::Even(0) | Self::Even(3601..));
        found.filter(is_in).ok_or_else(|| wanted.to_owned())
    }
}

impl HorizonArgs {
    /// Whether sensors are the cells of a height raster.
    fn is_of_cells(&self) -> bool {
        self.places.vertices && is_terrain(&self.scene, self.places.up)
    }

    /// How azimuths are chosen.
    fn azimuths(&self) -> Azimuths {
        self.azimuths.unwrap_or_else(|| match self.is_of_cells() {
            true => Azimuths::Lattice(16),
            false => Azimuths::Even(36),
        })
    }

    /// Number of azimuths that are evenly spread.
    fn even(&self) -> Result<u32, Failure> {
        match self.azimuths() {
            Azimuths::Even(count) => Ok(count),
            Azimuths::Lattice(_) => Err(Failure::Usage(
                "a lattice of azimuths is for --cells of a height raster".into(),
            )),
        }
    }

    /// Azimuths from true north, and directions on the map.
    fn directions(&self, field: &HeightField<'_>) -> Result<(Vec<f64>, Vec<Direction>), Failure> {
        // Clockwise from the north of the map.
        let north = self.places.north.degrees();
        Ok(match self.azimuths() {
            Azimuths::Even(count) => {
                let azimuths = self.degrees(count);
                let of = |azimuth: &f64| Direction::new(field, azimuth + north);
                let directions: Vec<Direction> = azimuths.iter().map(of).collect();
                (azimuths, directions)
            }
            Azimuths::Lattice(count) => {
                let lattice = Lattice::new(field, count).map_err(Failure::usage)?;
                let azimuths = lattice.azimuths.into_iter();
                let azimuths = azimuths.map(|azimuth| (azimuth - north).rem_euclid(360.0));
                let directions = lattice.steps.into_iter().map(Direction::Step);
                (azimuths.collect(), directions.collect())
            }
        })
    }

    /// Degrees of `count` azimuths from north through east, from 0 to 360.
    fn degrees(&self, count: u32) -> Vec<f64> {
        let step = 360.0 / f64::from(count);
        let degrees = (0..count).map(|i| (self.first + f64::from(i) * step).rem_euclid(360.0));
        degrees.collect()
    }
}

impl Baking for HorizonArgs {
    fn check(&self) -> Result<(), Failure> {
        let sentence = "horizons are written as csv, npz, tif, asc, npy, png, svg or pdf";
        for path in &self.output {
            let known = [
                "csv", "npz", "tif", "tiff", "asc", "npy", "png", "svg", "pdf",
            ];
            match Format::of(path, &known, sentence)? {
                Format::Raster => places::check_raster(path, &self.places, &self.scene)?,
                Format::Picture if !self.is_of_cells() => {
                    let reason = "a map of horizons needs --cells of a height raster";
                    return Err(Failure::name(path, reason));
                }
                Format::Picture => {}
                _ => continue,
            }
            let is_one = self.azimuths() == Azimuths::Even(1) || self.show != Shown::Angles;
            if !(is_one || self.is_of_cells() && has_planes(path)) {
                let reason = "a map, an .asc, or a raster of a --grid has one azimuth: --azimuths 1 with --first; .tif, .npy and .npz of --cells have all";
                return Err(Failure::name(path, reason));
            }
        }
        if !self.is_of_cells() {
            self.even()?;
            if self.show != Shown::Angles {
                let name = self.show.quantity().name.replace('_', "-");
                return Err(Failure::Usage(format!(
                    "--show {name} is for --cells of a height raster; of other scenes, sun has the sky view of sensors and ao that of vertices"
                )));
            }
        } else if self.first != 0.0 && self.even().is_err() {
            let reason =
                "--first is for azimuths that are evenly spread, and a lattice has its own";
            return Err(Failure::Usage(reason.into()));
        }
        self.map.check()?;
        places::check(&self.places)
    }

    fn files(&self) -> [Vec<Named<'_>>; 2] {
        [Vec::new(), self.places.files().to_vec()]
    }

    fn tiling(&self, raster: &Indexed) -> Result<Tiling, Failure> {
        if !self.is_of_cells() {
            let reason = "tiles of an index are for --cells of the index";
            return Err(Failure::usage(reason));
        }
        let index = raster.index();
        // Where no azimuth follows from the place, a plan can do without the files.
        if matches!(self.azimuths(), Azimuths::Even(_)) {
            tile::settle(raster, &self.scene, &Asked::new(&self.raster, &self.places))?;
        }
        let field = HeightField::new([2, 2], &[0.0; 4], index.transform);
        let (azimuths, directions) = self.directions(&field.map_err(Error::from)?)?;
        let Quantity { name, unit } = self.show.quantity();
        let names = match self.show {
            Shown::Angles => azimuths.iter().map(column_name).collect(),
            _ => vec![name.to_owned()],
        };
        let bands = names.into_iter().map(|name| [name, unit.to_owned()]);
        Ok(Tiling {
            directions,
            bands: bands.collect(),
            eyes: Vec::new(),
        })
    }

    fn bake(&self, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
        bake.tell_neighbours(&self.scene);
        if self.is_of_cells() {
            return of_cells(self, bake, files);
        }
        let azimuths = self.degrees(self.even()?);
        let mut ground = bake.ground(&mut files, None)?;
        let up = ground.up(self.places.up)?;
        Asked::new(&self.raster, &self.places).of((&ground.loaded, ground.extent()), up)?;
        let places = Places::new(&self.places, &mut ground, up)?;
        let compass = Orientation::new(up, self.places.north.degrees()).map_err(Failure::usage)?;
        let sensors = &places.sensors;
        let job = HorizonJob::new(&sensors.points, &sensors.normals, &azimuths, &compass)?;
        let horizon = Horizon {
            name: &ground.loaded.scene.name,
            show: Shown::Angles,
            azimuths: &azimuths,
            number: sensors.points.len(),
            triangles: ground.mesh.indices.len(),
            seconds: [ground.loaded.seconds, ground.build_seconds],
        };
        let done = bake.compute(&job, &ground, &ground.bvh)?;
        let place = (self.raster.crs.as_ref(), self.places.units.metres());
        let rows = (sensors, ground.local, done.found.as_deref());
        horizon.write(bake, rows, |path, angles, bands| {
            raster::write(path, &ground, (sensors, angles), place, (up, bands[0]))
        })?;
        let all = Sum::of(done.found.as_deref());
        horizon.end(bake, (all, None), &done, || ground.tell(""))
    }
}

/// The horizon of all cells of a height raster, without a mesh and without a tree.
fn of_cells(args: &HorizonArgs, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
    let terrain = bake.terrain(&mut files)?;
    let start = Instant::now();
    let site = terrain.settle(&Asked::new(&args.raster, &args.places))?;
    map::check_cells(&terrain, args.output.iter())?;
    let field = terrain.field()?;
    let values = &terrain.heights.raster.values;
    let north = args.places.north.degrees();
    let (azimuths, directions) = args.directions(&field)?;
    let rise = args.places.placement.height / args.places.units.metres();
    if let Some((work, part)) = bake.tile.and_then(|work| Some((work, work.quarter?))) {
        let progress = Progress::new(&terrain.name);
        work.sweep(part, &directions, rise, &progress)?;
        progress.finish();
        return Ok(());
    }
    let job = FieldHorizonJob::new(&field, &directions, rise, 0.0)?;
    let plane: &PlaneOf<'_> = match bake.tile {
        Some(work) => &work.plane(&directions, rise),
        None => &|index, monitor| Ok(job.plane(index, monitor)?),
    };
    let horizon = Horizon {
        name: &terrain.name,
        show: args.show,
        azimuths: &azimuths,
        number: terrain.known,
        triangles: field.triangles(),
        seconds: [terrain.load_seconds, start.elapsed().as_secs_f64()],
    };
    if let ([path], true, Shown::Angles) = (bake.outputs, bake.is_whole(), args.show)
        && has_planes(path)
    {
        return horizon.write_planes(
            bake,
            path,
            &terrain.own_grid(args.raster.crs.as_ref()),
            &|index, monitor| Ok(terrain.own(&plane(index, monitor)?).into_owned()),
        );
    }
    let (done, quadrature_error) = match args.show.measure() {
        None => (bake.compute_cells(&job, &terrain.name)?, None),
        Some(measure) => {
            let found = horizon.sky(bake, (&field, measure, &directions), &job, plane)?;
            let quadrature_error = found.found.as_ref().and_then(|sky| sky.quadrature_error);
            (found.map(|sky| Ok(sky.values))?, quadrature_error)
        }
    };
    let planes = done.found.as_deref().unwrap_or_default();
    // Of cells with data, all values of one after the other.
    let width = horizon.width();
    let of_cell = |cell: usize| (0..width).map(move |at| planes[at * values.len() + cell]);
    let is_known = done.found.is_some();
    let found: Option<Vec<f32>> = is_known.then(|| terrain.cells().flat_map(of_cell).collect());
    let all = Sum::of(found.as_deref());
    let sensors = terrain.sensors(0.0);
    let rows = (&sensors, terrain.local(), found.as_deref());
    horizon.write(bake, rows, |path, _, bands| {
        match Format::of_sensors(path)? {
            Format::Picture => {
                let place = (north, Some(args.places.units.metres()));
                let sheet = map::Sheet::of_cells(&args.map, &terrain, place)?;
                sheet.write(path, &horizon.words(args, site), planes)
            }
            _ => terrain.write(path, args.raster.crs.as_ref(), planes, bands),
        }
    })?;
    horizon.end(bake, (all, quadrature_error), &done, || ())
}

/// Finds the angles of all cells in the direction of a number.
type PlaneOf<'a> = dyn Fn(usize, &dyn Monitor) -> Result<Vec<f32>, Failure> + 'a;

/// Whether a file has all azimuths as planes of cells.
fn has_planes(path: &Path) -> bool {
    is_one_of(path, &["npy", "tif", "tiff"])
}

/// A horizon of sensors in some azimuths.
struct Horizon<'a> {
    /// Name of the scene.
    name: &'a str,
    show: Shown,
    azimuths: &'a [f64],
    /// Number of sensors.
    number: usize,
    triangles: usize,
    /// Seconds of loading and of building.
    seconds: [f64; 2],
}

/// Sum and number of angles.
#[derive(Clone, Copy, Default)]
struct Sum(f64, u64);

impl Sum {
    /// Of these angles, but for unknown ones.
    fn of(angles: Option<&[f32]>) -> Self {
        let known = angles.unwrap_or_default().iter().filter(|x| !x.is_nan());
        let add = |Self(sum, number): Self, &angle: &f32| Self(sum + f64::from(angle), number + 1);
        known.fold(Self::default(), add)
    }
}

impl Horizon<'_> {
    /// Writes the planes of all azimuths as they come, and ends.
    fn write_planes(
        &self,
        bake: &Bake<'_>,
        path: &Path,
        grid: &Grid,
        plane: &PlaneOf<'_>,
    ) -> Result<(), Failure> {
        let (start, planes) = (Instant::now(), self.azimuths.len());
        check_room(path, 4 * (planes * grid.width * grid.height) as u64)?;
        let progress = Progress::new(self.name);
        let (mut all, mut failure) = (Sum::default(), None);
        let names = self.names();
        let written = atomic_write_seeking(path, |file| {
            antumbra_raster::write_planes(path, file, grid, &self.bands(&names), &mut |index| {
                let plane = plane(index, &Share(&progress, [index, planes]));
                let plane = plane.map_err(|error| {
                    failure = Some(error);
                    io::Error::other("cancelled")
                })?;
                let Sum(sum, number) = Sum::of(Some(&plane));
                all = Sum(all.0 + sum, all.1 + number);
                Ok(plane.into())
            })
        });
        progress.finish();
        failure.map_or(Ok(()), Err)?;
        written?;
        let done = Done::whole((), start.elapsed().as_secs_f64());
        self.end(bake, (all, None), &done, || ())
    }

    /// What of the sky the cells see: azimuth by azimuth, or from the angles of shards.
    fn sky(
        &self,
        bake: &Bake<'_>,
        (field, measure, directions): (&HeightField<'_>, SkyMeasure, &[Direction]),
        job: &FieldHorizonJob<'_>,
        plane: &PlaneOf<'_>,
    ) -> Result<Done<SkyValues>, Failure> {
        if !bake.is_whole() {
            let done = bake.compute_cells(job, self.name)?;
            return done.map(|angles| job.sky_of(&angles, measure));
        }
        check_answers(self.name, FieldSky::memory(field))?;
        let (start, progress) = (Instant::now(), Progress::new(self.name));
        let mut sky = FieldSky::new(field, directions, measure).map_err(Error::from)?;
        for index in 0..directions.len() {
            sky.add(
                index,
                &plane(index, &Share(&progress, [index, directions.len()]))?,
            );
        }
        progress.finish();
        Ok(Done::whole(sky.finish(), start.elapsed().as_secs_f64()))
    }

    /// Words of a map.
    fn words<'a>(&self, args: &'a HorizonArgs, site: Option<Site>) -> map::Words<'a> {
        let (quantity, unit) = match self.show {
            Shown::Angles => ("Elevation of the horizon", "degrees"),
            Shown::SkyView => ("Sky view factor", ""),
            Shown::SkyOpen => ("Open part of the hemisphere", ""),
            Shown::Openness => ("Openness", "degrees"),
        };
        let of = match self.azimuths {
            [azimuth] => format!("azimuth {azimuth}"),
            all => format!("{} azimuths", all.len()),
        };
        let place = site.map(|site| map::place(site.latitude, site.longitude));
        map::Words {
            title: format!("{quantity}, {}", self.name),
            subtitle: [Some(of), place]
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join("  ·  "),
            quantity,
            unit: unit.to_owned(),
            none: None,
            files: vec![&args.scene],
        }
    }

    /// Number of values of each sensor.
    fn width(&self) -> usize {
        match self.show {
            Shown::Angles => self.azimuths.len(),
            _ => 1,
        }
    }

    /// Names of the values of each sensor.
    fn names(&self) -> Vec<String> {
        match self.show {
            Shown::Angles => self.azimuths.iter().map(column_name).collect(),
            show => vec![show.quantity().name.to_owned()],
        }
    }

    /// The values of each sensor with their unit.
    fn bands<'a>(&self, names: &'a [String]) -> Vec<Quantity<'a>> {
        let unit = self.show.quantity().unit;
        names.iter().map(|name| Quantity { name, unit }).collect()
    }

    /// Writes all outputs of values, which are `None` for a shard; `raster` those that are rasters.
    fn write(
        &self,
        bake: &Bake<'_>,
        (sensors, local, values): (&Sensors, LocalOrigin, Option<&[f32]>),
        raster: impl Fn(&Path, &[f32], &[Quantity<'_>]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let Some(values) = values else {
            return Ok(());
        };
        let _writing = interrupt::writing();
        let (Quantity { name, unit }, width) = (self.show.quantity(), self.width());
        let names = self.names();
        bake.outputs
            .iter()
            .try_for_each(|path| match Format::of_sensors(path)? {
                Format::Csv => {
                    let steps = if unit.is_empty() { 1e6 } else { 1e4 };
                    let column = |(at, name): (usize, &String)| {
                        let value = move |row: usize| f64::from(values[row * width + at]);
                        Column::new(name.as_str(), move |row| {
                            (value(row) * steps).round() / steps
                        })
                    };
                    let columns: Vec<Column<'_>> = names.iter().enumerate().map(column).collect();
                    files::table(path, (sensors, &sensors.normals, local), &[], &columns)
                }
                Format::Npz => {
                    let entries = [
                        Entry::new(name, Array::F32(values)).columns(width),
                        Entry::new("azimuths", Array::F64(self.azimuths)),
                        Entry::new("points", Array::Places(&sensors.points, local)),
                    ];
                    files::npz(path, &entries)
                }
                _ => raster(path, values, &self.bands(&names)),
            })
    }

    /// Writes the document, and says what was done: first of the scene by `tell_scene`.
    fn end<T>(
        &self,
        bake: &Bake<'_>,
        (Sum(sum, number), quadrature_error): (Sum, Option<[f64; 2]>),
        done: &Done<T>,
        tell_scene: impl Fn(),
    ) -> Result<(), Failure> {
        let mean = (number > 0).then(|| sum / number as f64);
        let Quantity { name, unit } = self.show.quantity();
        let (is_angles, outputs) = (self.show == Shown::Angles, bake.output_names());
        let (shard, planes) = (bake.shard(), self.azimuths.len());
        let mut figures: Vec<Figure<'_>> = vec![
            ("outputs", &outputs),
            ("shard", &shard),
            ("triangles", &self.triangles),
            ("sensors", &self.number),
            ("azimuths", &self.azimuths),
        ];
        match is_angles {
            true => figures.push(("mean_degrees", &mean)),
            false => figures.extend([
                ("show", &name as &dyn erased_serde::Serialize),
                ("mean", &mean),
                ("quadrature_error", &quadrature_error),
            ]),
        }
        figures.extend([
            (
                "load_seconds",
                &self.seconds[0] as &dyn erased_serde::Serialize,
            ),
            ("build_seconds", &self.seconds[1]),
            ("trace_seconds", &done.seconds),
        ]);
        if bake.document(("antumbra.horizon/1", self.name), &figures, (done, ""))? {
            tell_scene();
            let (sensors, mean) = (count(self.number as u64), mean.unwrap_or(f64::NAN));
            if is_angles {
                tell(format_args!(
                    "{sensors} sensors, {planes} azimuths; the horizon is {mean:.2} degrees high on average"
                ));
            } else {
                let gap = if unit.is_empty() { "" } else { " " };
                let name = name.replace('_', " ");
                tell(format_args!(
                    "{sensors} cells, {planes} azimuths; {name} is {mean:.4}{gap}{unit} on average"
                ));
            }
            if let Some([mean, most]) = quadrature_error {
                let finer = match planes < 48 {
                    true => "; --azimuths lattice:48 is finer",
                    false => "",
                };
                tell(format_args!(
                    "the next coarser azimuths differ by {mean:.4} on average and {most:.4} at most{finer}"
                ));
            }
            bake.end("angles", (self.number * planes) as u64, done);
        }
        Ok(())
    }
}

/// Name of the column of an azimuth.
fn column_name(azimuth: &f64) -> String {
    // Whole degrees are the rule, and their names sort.
    match azimuth.fract() == 0.0 {
        true => format!("horizon_{azimuth:03}"),
        false => format!("horizon_{azimuth:06.2}"),
    }
}
