//! `antumbra horizon`: how high surfaces reach in each direction of the compass.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra::LocalOrigin;
use antumbra_bake::{
    Array, Direction, Entry, FieldHorizonJob, HorizonJob, Lattice, Monitor, Orientation, Sensors,
};
use antumbra_image::atomic_write;
use antumbra_lab::count;
use antumbra_raster::{Grid, Quantity};
use clap::{ArgGroup, Args};

use super::command::{Bake, Baking, Done, Figure, Named};
use super::files::{self, Column, Format};
use super::places::{self, Places};
use super::raster;
use super::site::Asked;
use super::terrain::is_terrain;
use crate::args::{ChunkArgs, PlaceArgs, RasterArgs, SCENE, heading, rasters_long, values};
use crate::exit::{Failure, tell};
use crate::interrupt;
use crate::json::Destination;
use crate::output::{Files, check_room, is_one_of};
use crate::progress::Progress;

/// Name and unit of rasters.
const QUANTITY: Quantity<'static> = Quantity {
    name: "horizon",
    unit: "degrees",
};

/// Flags of `horizon`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("where").required(true))]
pub struct HorizonArgs {
    #[arg(required = true, help = SCENE, long_help = rasters_long())]
    pub scene: Vec<PathBuf>,
    /// Result: .csv, .npz or .tif
    ///
    /// May be given several times. A .csv has a line per sensor and a column per azimuth, such as horizon_090. An .npz has the
    /// array horizon, sensors x azimuths, with azimuths and points. A .tif (GeoTIFF), .asc or .npy has one azimuth (--azimuths 1) in
    /// the cells of a --grid or of a scene that is a raster. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
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

    /// Degrees of `count` azimuths from north through east, from 0 to 360.
    fn degrees(&self, count: u32) -> Vec<f64> {
        let step = 360.0 / f64::from(count);
        let degrees = (0..count).map(|i| (self.first + f64::from(i) * step).rem_euclid(360.0));
        degrees.collect()
    }
}

impl Baking for HorizonArgs {
    fn check(&self) -> Result<(), Failure> {
        let sentence = "horizons are written as csv, npz, tif, asc or npy";
        for path in &self.output {
            let known = ["csv", "npz", "tif", "tiff", "asc", "npy"];
            if Format::of(path, &known, sentence)? != Format::Raster {
                continue;
            }
            places::check_raster(path, &self.places, &self.scene)?;
            let is_one = self.azimuths() == Azimuths::Even(1);
            if !(is_one || self.places.vertices && has_planes(path)) {
                let reason = "a raster has one azimuth: --azimuths 1 with --first; .npz and .npy of cells have all";
                return Err(Failure::name(path, reason));
            }
        }
        if !self.is_of_cells() {
            self.even()?;
        } else if self.first != 0.0 && self.even().is_err() {
            let reason =
                "--first is for azimuths that are evenly spread, and a lattice has its own";
            return Err(Failure::Usage(reason.into()));
        }
        places::check(&self.places)
    }

    fn files(&self) -> [Vec<Named<'_>>; 2] {
        [Vec::new(), self.places.files().to_vec()]
    }

    fn bake(&self, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
        if self.is_of_cells() {
            return of_cells(self, bake, files);
        }
        let azimuths = self.degrees(self.even()?);
        let mut ground = bake.ground(&mut files, None)?;
        let up = ground.up(self.places.up)?;
        Asked::new(&self.raster, &self.places).of(&ground.loaded, up)?;
        let places = Places::new(&self.places, &mut ground, up)?;
        let compass = Orientation::new(up, self.places.north.degrees()).map_err(Failure::usage)?;
        let sensors = &places.sensors;
        let job = HorizonJob::new(&sensors.points, &sensors.normals, &azimuths, &compass)?;
        let horizon = Horizon {
            name: &ground.loaded.scene.name,
            azimuths: &azimuths,
            number: sensors.points.len(),
            triangles: ground.mesh.indices.len(),
            seconds: [ground.loaded.seconds, ground.build_seconds],
        };
        let done = bake.compute(&job, &ground, &ground.bvh)?;
        let place = (self.raster.crs.as_ref(), self.places.units.metres());
        horizon.write(bake, (sensors, ground.local, &done), |path, angles| {
            raster::write(path, &ground, (sensors, angles), place, (up, QUANTITY))
        })?;
        let all = Sum::of(done.found.as_deref());
        horizon.end(bake, all, &done, || ground.tell(""))
    }
}

/// The horizon of all cells of a height raster, without a mesh and without a tree.
fn of_cells(args: &HorizonArgs, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
    let terrain = bake.terrain(&mut files)?;
    let start = Instant::now();
    terrain.settle(&Asked::new(&args.raster, &args.places))?;
    let field = terrain.field()?;
    let (grid, values) = (
        terrain.grid(args.raster.crs.as_ref()),
        &terrain.heights.raster.values,
    );
    // Clockwise from the north of the map.
    let north = args.places.north.degrees();
    let (azimuths, directions) = match args.azimuths() {
        Azimuths::Even(count) => {
            let azimuths = args.degrees(count);
            let of = |azimuth: &f64| Direction::new(&field, azimuth + north);
            let directions: Vec<Direction> = azimuths.iter().map(of).collect();
            (azimuths, directions)
        }
        Azimuths::Lattice(count) => {
            let lattice = Lattice::new(&field, count).map_err(Failure::usage)?;
            let azimuths = lattice.azimuths.into_iter();
            let azimuths = azimuths.map(|azimuth| (azimuth - north).rem_euclid(360.0));
            let directions = lattice.steps.into_iter().map(Direction::Step);
            (azimuths.collect(), directions.collect())
        }
    };
    let rise = args.places.placement.height / args.places.units.metres();
    let job = FieldHorizonJob::new(&field, &directions, rise, 0.0)?;
    let horizon = Horizon {
        name: &terrain.name,
        azimuths: &azimuths,
        number: terrain.cells().count(),
        triangles: field.triangles(),
        seconds: [terrain.load_seconds, start.elapsed().as_secs_f64()],
    };
    if let ([path], true) = (bake.outputs, bake.is_whole())
        && has_planes(path)
    {
        return horizon.write_planes(bake, path, &grid, &job);
    }
    let mut done = bake.compute_cells(&job, &terrain.name)?;
    let planes = done.found.take();
    // Of cells with data, all azimuths of one after the other.
    let of_cell = |planes: &Vec<f32>| {
        let angles =
            |cell: usize| (0..azimuths.len()).map(move |at| planes[at * values.len() + cell]);
        terrain.cells().flat_map(angles).collect()
    };
    done.found = planes.as_ref().map(of_cell);
    let sensors = terrain.sensors(0.0);
    horizon.write(bake, (&sensors, terrain.local(), &done), |path, _| {
        let planes = planes.as_deref().unwrap_or_default();
        raster::write_values(path, &grid, planes, QUANTITY)
    })?;
    horizon.end(bake, Sum::of(done.found.as_deref()), &done, || ())
}

/// Whether a file has all azimuths as planes of cells.
fn has_planes(path: &Path) -> bool {
    is_one_of(path, &["npy"])
}

/// A horizon of sensors in some azimuths.
struct Horizon<'a> {
    /// Name of the scene.
    name: &'a str,
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
        job: &FieldHorizonJob<'_>,
    ) -> Result<(), Failure> {
        let (start, planes) = (Instant::now(), self.azimuths.len());
        check_room(path, 4 * (planes * grid.width * grid.height) as u64)?;
        let progress = Progress::new(self.name);
        let (mut all, mut failure) = (Sum::default(), None);
        let written = atomic_write(path, |file| {
            antumbra_raster::write_planes(file, grid, planes, &mut |index| {
                let plane = job.plane(index, &Planes(&progress, [index, planes]));
                let plane = plane.map_err(|error| {
                    failure = Some(error);
                    io::Error::other("cancelled")
                })?;
                let Sum(sum, number) = Sum::of(Some(&plane));
                all = Sum(all.0 + sum, all.1 + number);
                Ok(plane)
            })
        });
        progress.finish();
        failure.map_or(Ok(()), |error| Err(Failure::from(error)))?;
        written?;
        let done = Done::whole((), start.elapsed().as_secs_f64());
        self.end(bake, all, &done, || ())
    }

    /// Writes all outputs of angles; `raster` those that are rasters.
    fn write(
        &self,
        bake: &Bake<'_>,
        (sensors, local, done): (&Sensors, LocalOrigin, &Done<Vec<f32>>),
        raster: impl Fn(&Path, &[f32]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let Some(angles) = &done.found else {
            return Ok(());
        };
        let _writing = interrupt::writing();
        let width = self.azimuths.len();
        bake.outputs
            .iter()
            .try_for_each(|path| match Format::of_sensors(path)? {
                Format::Csv => {
                    let column = |(at, azimuth): (usize, &f64)| {
                        // Whole degrees are the rule, and their names sort.
                        let name = match azimuth.fract() == 0.0 {
                            true => format!("horizon_{azimuth:03}"),
                            false => format!("horizon_{azimuth:06.2}"),
                        };
                        let angle = move |row: usize| f64::from(angles[row * width + at]);
                        Column::new(name, move |row| (angle(row) * 1e4).round() / 1e4)
                    };
                    let columns: Vec<Column<'_>> =
                        self.azimuths.iter().enumerate().map(column).collect();
                    files::table(path, (sensors, &sensors.normals, local), &[], &columns)
                }
                Format::Npz => {
                    let entries = [
                        Entry::new("horizon", Array::F32(angles)).columns(width),
                        Entry::new("azimuths", Array::F64(self.azimuths)),
                        Entry::new("points", Array::Places(&sensors.points, local)),
                    ];
                    files::npz(path, &entries)
                }
                _ => raster(path, angles),
            })
    }

    /// Writes the document, and says what was done: first of the scene by `tell_scene`.
    fn end<T>(
        &self,
        bake: &Bake<'_>,
        Sum(sum, number): Sum,
        done: &Done<T>,
        tell_scene: impl Fn(),
    ) -> Result<(), Failure> {
        let mean = (number > 0).then(|| sum / number as f64);
        let figures: &[Figure<'_>] = &[
            ("outputs", &bake.output_names()),
            ("shard", &bake.shard()),
            ("triangles", &self.triangles),
            ("sensors", &self.number),
            ("azimuths", &self.azimuths),
            ("mean_degrees", &mean),
            ("load_seconds", &self.seconds[0]),
            ("build_seconds", &self.seconds[1]),
            ("trace_seconds", &done.seconds),
        ];
        let name = ("antumbra.horizon/1", self.name);
        if bake.document(name, figures, (done, ""))? {
            tell_scene();
            tell(format_args!(
                "{} sensors, {} azimuths; the horizon is {:.2} degrees high on average",
                count(self.number as u64),
                self.azimuths.len(),
                mean.unwrap_or(f64::NAN),
            ));
            bake.end("angles", (self.number * self.azimuths.len()) as u64, done);
        }
        Ok(())
    }
}

/// Progress of one of so many planes.
struct Planes<'a>(&'a Progress, [usize; 2]);

impl Monitor for Planes<'_> {
    fn progress(&self, done: usize, total: usize) {
        // Planes differ in what they count.
        let Self(progress, [index, planes]) = self;
        let part = 1000 * done / total.max(1);
        Monitor::progress(*progress, 1000 * index + part, 1000 * planes);
    }

    fn cancelled(&self) -> bool {
        Monitor::cancelled(self.0)
    }
}
