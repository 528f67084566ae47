//! `antumbra horizon`: how high surfaces reach in each direction of the compass.

use std::path::Path;
use std::time::Instant;

use antumbra::{Bvh, Isa, LocalOrigin, Recipe};
use antumbra_bake::{
    Array, Entry, FieldHorizonJob, HeightField, HorizonJob, Key, Label, Observer, Orientation,
    UpAxis,
};
use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_raster::{Quantity, RasterCells};
use serde::Serialize;

use super::chunks::{self, PartFile};
use super::command::{Bake, Head};
use super::files::{self, Format};
use super::places::{self, Places};
use super::raster;
use super::site::Asked;
use crate::args::HorizonArgs;
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::{interrupt, json, scenes};

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    head: Head<'a>,
    outputs: Vec<String>,
    shard: Option<String>,
    triangles: usize,
    sensors: usize,
    azimuths: &'a [f64],
    /// Mean over all sensors and azimuths.
    mean_degrees: Option<f64>,
    load_seconds: f64,
    build_seconds: f64,
    trace_seconds: f64,
}

/// Refuses outputs that cannot be made, before anything is read.
pub fn check(args: &HorizonArgs) -> Result<(), Failure> {
    let sentence = "horizons are written as csv, npz, tif, asc or npy";
    for path in &args.output {
        let known = ["csv", "npz", "tif", "tiff", "asc", "npy"];
        if Format::of(path, &known, sentence)? != Format::Raster {
            continue;
        }
        places::check_raster(path, &args.places, &args.scene)?;
        if args.azimuths != 1 {
            let path = path.display();
            let reason = "a raster has one azimuth: --azimuths 1 with --first";
            return Err(Failure::Usage(format!("{path}: {reason}")));
        }
    }
    places::check(&args.places)
}

/// Runs the command, or merges parts of it.
pub fn run(
    args: &HorizonArgs,
    memory: MemorySize,
    parts: Option<&[PartFile]>,
) -> Result<(), Failure> {
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
    ];
    let mut files = bake.declare(&[], &read)?;
    let azimuths = args.degrees();
    if args.places.vertices && raster::is_raster(&args.scene) && is_upright(args) {
        return of_cells(args, &bake, files, &azimuths, (isa, memory));
    }
    let mut ground = bake.ground(isa, memory, &mut files)?;
    let up = ground.up(args.places.up)?;
    asked(args).of(&ground.loaded, up)?;
    let places = Places::new(&args.places, &mut ground, up)?;
    let compass = Orientation::new(up, args.places.north.degrees()).map_err(Failure::usage)?;
    let sensors = &places.sensors;
    let job = HorizonJob::new(&sensors.points, &sensors.normals, &azimuths, &compass)?;
    let done = bake.compute(&job, &ground, &ground.bvh)?;
    let document = Document {
        head: bake.head("antumbra.horizon/1", isa, &ground.loaded.scene.name),
        outputs: bake.output_names(),
        shard: bake.shard(),
        triangles: ground.mesh.indices.len(),
        sensors: sensors.points.len(),
        azimuths: &azimuths,
        mean_degrees: None,
        load_seconds: ground.loaded.seconds,
        build_seconds: ground.build_seconds,
        trace_seconds: done.seconds,
    };
    let Some(angles) = done.found else {
        return document.end(args, &bake, None);
    };
    let _writing = interrupt::writing();
    let table = Table {
        azimuths: &azimuths,
        angles: &angles,
        points: &sensors.points,
        local: ground.local,
    };
    for path in &args.output {
        let labels = (&sensors.normals[..], &sensors.labels[..]);
        if !table.write(path, labels)? {
            let values = (sensors, &angles[..]);
            let place = (args.raster.crs.as_ref(), args.places.units.metres());
            raster::write(path, &ground, values, place, (up, QUANTITY))?;
        }
    }
    ground.tell("");
    document.end(args, &bake, Some(&angles))?;
    chunks::forget(done.checkpoint.as_deref());
    Ok(())
}

/// Flags that a coordinate system may answer.
fn asked(args: &HorizonArgs) -> Asked<'_> {
    Asked {
        crs: args.raster.crs.as_ref(),
        units: Some(&args.places.units),
        north: Some(&args.places.north),
    }
}

/// Whether a height raster is as it is on a map.
fn is_upright(args: &HorizonArgs) -> bool {
    args.places.up.is_none_or(|up| up == UpAxis::Z)
}

/// Name and unit of rasters.
const QUANTITY: Quantity<'static> = Quantity {
    name: "horizon",
    unit: "degrees",
};

/// The horizon of all cells of a height raster, without a mesh and without a tree.
fn of_cells(
    args: &HorizonArgs,
    bake: &Bake<'_>,
    mut files: Files,
    azimuths: &[f64],
    (isa, memory): (Isa, MemorySize),
) -> Result<(), Failure> {
    bake.machine.start_threads()?;
    let name = args.scene.file_stem().unwrap_or_default();
    let name = name.to_string_lossy().into_owned();
    let start = Instant::now();
    let heights = scenes::load_heights(&args.scene, memory)?;
    files.reads_all(&heights.inputs)?;
    let load_seconds = start.elapsed().as_secs_f64();
    let Some(extent) = heights.extent else {
        let reason = "it has no cell with data";
        return Err(Failure::scene(&name, reason));
    };
    let start = Instant::now();
    let grid = &heights.raster.grid;
    let middle = extent.low.midpoint(extent.high).to_array();
    asked(args).settle(&name, grid.crs.as_ref(), middle)?;
    let values = &heights.raster.values;
    let field = HeightField::new([grid.width, grid.height], values, grid.transform)?;
    let has_data = |cell: &usize| values[*cell].is_finite();
    let cells: Vec<usize> = (0..values.len()).filter(has_data).collect();
    let rise = args.places.placement.height / args.places.units.metres();
    let observers: Vec<Observer> = cells
        .iter()
        .map(|&cell| Observer {
            place: [cell % grid.width, cell / grid.width].map(|at| at as f64),
            height: values[cell] + rise,
            normal: [0.0; 3],
        })
        .collect();
    // Clockwise from the north of the map.
    let turned: Vec<f64> = azimuths
        .iter()
        .map(|azimuth| azimuth + args.places.north.degrees())
        .collect();
    let job = FieldHorizonJob::new(&field, &observers, &turned, 0.0)?;
    let build_seconds = start.elapsed().as_secs_f64();
    let no_tree =
        Bvh::build(&[], &Recipe::default()).map_err(|error| Failure::work(error.to_string()))?;
    let key = Key::of(&job, |_| {});
    let done = bake.compute_known(&job, (&name, key), &no_tree)?;
    let document = Document {
        head: bake.head("antumbra.horizon/1", isa, &name),
        outputs: bake.output_names(),
        shard: bake.shard(),
        triangles: field.triangles(),
        sensors: observers.len(),
        azimuths,
        mean_degrees: None,
        load_seconds,
        build_seconds,
        trace_seconds: done.seconds,
    };
    let Some(angles) = done.found else {
        return document.end(args, bake, None);
    };
    let _writing = interrupt::writing();
    let local = LocalOrigin {
        origin: extent.local_origin().to_array(),
    };
    let points: Vec<[f32; 3]> = cells
        .iter()
        .map(|&cell| {
            let [x, y] = grid.centre(cell % grid.width, cell / grid.width);
            local.local([x, y, values[cell]])
        })
        .collect();
    let table = Table {
        azimuths,
        angles: &angles,
        points: &points,
        local,
    };
    for path in &args.output {
        if !table.write(path, (&[], &[]))? {
            let mut all = RasterCells {
                grid: grid.clone(),
                cells: cells.iter().map(|&cell| cell as u32).collect(),
            };
            if let Some(crs) = &args.raster.crs {
                all.grid.crs = Some(crs.clone());
            }
            raster::write_cells(path, &all, &angles, QUANTITY)?;
        }
    }
    document.end(args, bake, Some(&angles))?;
    chunks::forget(done.checkpoint.as_deref());
    Ok(())
}

/// Angles of sensors.
struct Table<'a> {
    azimuths: &'a [f64],
    angles: &'a [f32],
    points: &'a [[f32; 3]],
    local: LocalOrigin,
}

impl Table<'_> {
    /// Writes a table or arrays; false for a raster, which is written otherwise.
    fn write(&self, path: &Path, labels: (&[[f32; 3]], &[Label])) -> Result<bool, Failure> {
        let width = self.azimuths.len();
        match Format::of_sensors(path)? {
            Format::Csv => {
                // Whole degrees are the rule, and their names sort.
                let column = |azimuth: &f64| match azimuth.fract() == 0.0 {
                    true => format!("horizon_{azimuth:03}"),
                    false => format!("horizon_{azimuth:06.2}"),
                };
                let head: Vec<String> = self.azimuths.iter().map(column).collect();
                let head = (&head.join(",")[..], 10 * (4 + width as u64));
                files::table(path, (self.points, self.local), labels, head, |row| {
                    let angles = &self.angles[row * width..][..width];
                    let rounded = |&angle: &f32| (f64::from(angle) * 1e4).round() / 1e4;
                    angles.iter().map(rounded).collect()
                })?;
            }
            Format::Npz => {
                let entries = [
                    Entry::new("horizon", Array::F32(self.angles)).columns(width),
                    Entry::new("azimuths", Array::F64(self.azimuths)),
                    Entry::new("points", Array::Places(self.points, self.local)),
                ];
                files::npz(path, &entries)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }
}

impl Document<'_> {
    /// Says what was done, or that a share is there for `merge`.
    fn end(
        mut self,
        args: &HorizonArgs,
        bake: &Bake<'_>,
        angles: Option<&[f32]>,
    ) -> Result<(), Failure> {
        let Some(angles) = angles else {
            json::write(&self, args.json.as_ref())?;
            let outputs = self.outputs.join(", ");
            tell(format_args!("wrote {outputs}, for merge"));
            return Ok(());
        };
        let known = || angles.iter().filter(|angle| !angle.is_nan());
        let number = known().count();
        let sum: f64 = known().map(|&angle| f64::from(angle)).sum();
        self.mean_degrees = (number > 0).then(|| sum / number as f64);
        json::write(&self, args.json.as_ref())?;
        tell(format_args!(
            "{} sensors, {} azimuths; the horizon is {:.2} degrees high on average",
            count(self.sensors as u64),
            self.azimuths.len(),
            self.mean_degrees.unwrap_or(f64::NAN),
        ));
        bake.tell_done("angles", angles.len() as u64, self.trace_seconds);
        Ok(())
    }
}
