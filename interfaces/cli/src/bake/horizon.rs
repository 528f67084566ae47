//! `antumbra horizon`: how high surfaces reach in each direction of the compass.

use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra::LocalOrigin;
use antumbra_bake::{Array, Entry, FieldHorizonJob, HorizonJob, Observer, Orientation, Sensors};
use antumbra_lab::count;
use antumbra_raster::{Quantity, RasterCells};
use clap::{ArgGroup, Args};

use super::command::{Bake, Baking, Done, Figure, Named};
use super::files::{self, Column, Format};
use super::places::{self, Places};
use super::raster;
use super::site::Asked;
use super::terrain::is_terrain;
use crate::args::{ChunkArgs, PlaceArgs, RasterArgs, SCENE, SCENE_LONG, heading, values};
use crate::exit::{Failure, tell};
use crate::interrupt;
use crate::json::Destination;
use crate::output::Files;

/// Name and unit of rasters.
const QUANTITY: Quantity<'static> = Quantity {
    name: "horizon",
    unit: "degrees",
};

/// Flags of `horizon`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("where").required(true))]
pub struct HorizonArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
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
    /// Number of azimuths, evenly spread
    #[arg(long, value_name = "N", default_value_t = 36, value_parser = clap::value_parser!(u32).range(1..=3600), help_heading = heading::WORK)]
    pub azimuths: u32,
    /// The first azimuth; north is 0, east 90
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, value_parser = values::finite, help_heading = heading::WORK)]
    pub first: f64,
    #[command(flatten)]
    pub places: PlaceArgs,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}

impl HorizonArgs {
    /// Degrees from north through east, from 0 to 360.
    pub fn degrees(&self) -> Vec<f64> {
        let step = 360.0 / f64::from(self.azimuths);
        let degrees =
            (0..self.azimuths).map(|i| (self.first + f64::from(i) * step).rem_euclid(360.0));
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
            if self.azimuths != 1 {
                let reason = "a raster has one azimuth: --azimuths 1 with --first";
                return Err(Failure::name(path, reason));
            }
        }
        places::check(&self.places)
    }

    fn files(&self) -> [Vec<Named<'_>>; 2] {
        [Vec::new(), self.places.files().to_vec()]
    }

    fn bake(&self, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
        let azimuths = self.degrees();
        if self.places.vertices && is_terrain(&self.scene, self.places.up) {
            return of_cells(self, bake, files, &azimuths);
        }
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
            sensors,
            local: ground.local,
            triangles: ground.mesh.indices.len(),
            seconds: [ground.loaded.seconds, ground.build_seconds],
            done: bake.compute(&job, &ground, &ground.bvh)?,
        };
        let place = (self.raster.crs.as_ref(), self.places.units.metres());
        horizon.write(bake, |path, angles| {
            raster::write(path, &ground, (sensors, angles), place, (up, QUANTITY))
        })?;
        horizon.end(bake, || ground.tell(""))
    }
}

/// The horizon of all cells of a height raster, without a mesh and without a tree.
fn of_cells(
    args: &HorizonArgs,
    bake: &Bake<'_>,
    mut files: Files,
    azimuths: &[f64],
) -> Result<(), Failure> {
    let terrain = bake.terrain(&mut files)?;
    let start = Instant::now();
    terrain.settle(&Asked::new(&args.raster, &args.places))?;
    let field = terrain.field()?;
    let (grid, values) = (
        terrain.grid(args.raster.crs.as_ref()),
        &terrain.heights.raster.values,
    );
    let has_data = |cell: &usize| values[*cell].is_finite();
    let cells: Vec<usize> = (0..values.len()).filter(has_data).collect();
    let rise = args.places.placement.height / args.places.units.metres();
    let observer = |&cell: &usize| Observer {
        place: [cell % grid.width, cell / grid.width].map(|at| at as f64),
        height: values[cell] + rise,
        normal: [0.0; 3],
    };
    let observers: Vec<Observer> = cells.iter().map(observer).collect();
    // Clockwise from the north of the map.
    let north = args.places.north.degrees();
    let turned: Vec<f64> = azimuths.iter().map(|azimuth| azimuth + north).collect();
    let job = FieldHorizonJob::new(&field, &observers, &turned, 0.0)?;
    let build_seconds = start.elapsed().as_secs_f64();
    let local = terrain.local();
    let point = |&cell: &usize| {
        let [x, y] = grid.centre(cell % grid.width, cell / grid.width);
        local.local([x, y, values[cell]])
    };
    let horizon = Horizon {
        name: &terrain.name,
        azimuths,
        sensors: &Sensors {
            points: cells.iter().map(point).collect(),
            ..Sensors::default()
        },
        local,
        triangles: field.triangles(),
        seconds: [terrain.load_seconds, build_seconds],
        done: bake.compute_cells(&job, &terrain.name)?,
    };
    horizon.write(bake, |path, angles| {
        let all = RasterCells {
            grid: grid.clone(),
            cells: cells.iter().map(|&cell| cell as u32).collect(),
        };
        raster::write_cells(path, &all, angles, QUANTITY)
    })?;
    horizon.end(bake, || ())
}

/// Angles of sensors.
struct Horizon<'a> {
    /// Name of the scene.
    name: &'a str,
    azimuths: &'a [f64],
    sensors: &'a Sensors,
    local: LocalOrigin,
    triangles: usize,
    /// Seconds of loading and of building.
    seconds: [f64; 2],
    done: Done<Vec<f32>>,
}

impl Horizon<'_> {
    /// Writes all outputs; `raster` those that are rasters.
    fn write(
        &self,
        bake: &Bake<'_>,
        raster: impl Fn(&Path, &[f32]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let Some(angles) = &self.done.found else {
            return Ok(());
        };
        let _writing = interrupt::writing();
        let (width, sensors) = (self.azimuths.len(), self.sensors);
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
                    files::table(path, (sensors, &sensors.normals, self.local), &[], &columns)
                }
                Format::Npz => {
                    let entries = [
                        Entry::new("horizon", Array::F32(angles)).columns(width),
                        Entry::new("azimuths", Array::F64(self.azimuths)),
                        Entry::new("points", Array::Places(&sensors.points, self.local)),
                    ];
                    files::npz(path, &entries)
                }
                _ => raster(path, angles),
            })
    }

    /// Writes the document, and says what was done: first of the scene by `tell_scene`.
    fn end(&self, bake: &Bake<'_>, tell_scene: impl Fn()) -> Result<(), Failure> {
        let angles = self.done.found.as_deref().unwrap_or_default();
        let known = || angles.iter().filter(|angle| !angle.is_nan());
        let (sum, number) = (
            known().map(|&angle| f64::from(angle)).sum::<f64>(),
            known().count(),
        );
        let mean = (number > 0).then(|| sum / number as f64);
        let figures: &[Figure<'_>] = &[
            ("outputs", &bake.output_names()),
            ("shard", &bake.shard()),
            ("triangles", &self.triangles),
            ("sensors", &self.sensors.points.len()),
            ("azimuths", &self.azimuths),
            ("mean_degrees", &mean),
            ("load_seconds", &self.seconds[0]),
            ("build_seconds", &self.seconds[1]),
            ("trace_seconds", &self.done.seconds),
        ];
        let name = ("antumbra.horizon/1", self.name);
        if bake.document(name, figures, (&self.done, ""))? {
            tell_scene();
            tell(format_args!(
                "{} sensors, {} azimuths; the horizon is {:.2} degrees high on average",
                count(self.sensors.points.len() as u64),
                self.azimuths.len(),
                mean.unwrap_or(f64::NAN),
            ));
            bake.end("angles", angles.len() as u64, &self.done);
        }
        Ok(())
    }
}
