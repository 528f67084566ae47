//! `antumbra visible --viewshed` of the cells of a height raster: without a mesh and without a tree.

use std::path::Path;
use std::time::Instant;

use antumbra::{Bvh, Isa, LocalOrigin, Recipe};
use antumbra_bake::{
    Curvature, HeightField, Key, Mesh, Observer, Orientation, Sensors, UpAxis, ViewshedJob,
    Viewsheds,
};
use antumbra_lab::count;
use antumbra_load::{Extent, Heights, MemorySize};
use antumbra_raster::{Quantity, RasterCells};

use super::chunks;
use super::command::{Bake, text};
use super::files::{self, Format};
use super::raster;
use super::visible::{self, Document, Ends};
use crate::args::VisibleArgs;
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::{input, interrupt, json, scenes};

/// Name of the value in files.
const NAME: &str = "seen_by";

/// Whether a command wants the cells of a height raster. Rays serve the rest: other places, lines without their ends, and rasters
/// on their side.
pub fn is_of_cells(args: &VisibleArgs) -> bool {
    let is_upright = args.up.is_none_or(|up| up == UpAxis::Z);
    args.viewshed
        && args.grid.is_none()
        && args.margin.is_none()
        && is_upright
        && raster::is_raster(&args.scene)
}

/// Runs the command, or merges parts of it. `files` has all files but those that are read with the raster.
pub fn run(
    args: &VisibleArgs,
    bake: &Bake<'_>,
    mut files: Files,
    isa: Isa,
    memory: MemorySize,
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
    tell_read(&name, &heights, extent);
    let middle = extent.low.midpoint(extent.high).to_array();
    visible::asked(args).settle(&name, heights.raster.grid.crs.as_ref(), middle)?;
    let start = Instant::now();
    let grid = &heights.raster.grid;
    let field = HeightField::new(
        [grid.width, grid.height],
        &heights.raster.values,
        grid.transform,
    )?;
    let build_seconds = start.elapsed().as_secs_f64();
    let table = Table::read(&args.from, &field, (extent, args.eye))?;
    let job = ViewshedJob {
        field: &field,
        observers: &table.observers,
        target: args.target,
        drop: drop(args)?,
        range: args.radius.unwrap_or(f64::INFINITY),
    };
    let buried = table
        .observers
        .iter()
        .filter(|observer| job.is_buried(observer));
    let buried = buried.count();
    if buried > 0 {
        tell(format_args!(
            "warning: {}: {buried} of {} eyes are below the surface and see nothing",
            args.from.display(),
            table.observers.len(),
        ));
    }
    let no_tree =
        Bvh::build(&[], &Recipe::default()).map_err(|error| Failure::work(error.to_string()))?;
    let key = Key::of(&job, |_| {});
    let done = bake.compute_known(&job, (&name, key), &no_tree)?;
    let cells = heights
        .raster
        .values
        .iter()
        .filter(|height| height.is_finite());
    let [from, to] = [table.observers.len(), cells.count()];
    let mut document = Document {
        head: bake.head("antumbra.visible/1", isa, &name),
        outputs: bake.output_names(),
        lines: args.lines.as_deref().map(text),
        shard: bake.shard(),
        triangles: field.triangles(),
        from,
        to,
        viewshed: true,
        pairs: from as u64 * to as u64,
        visible_pairs: None,
        visible_share: None,
        load_seconds,
        build_seconds,
        trace_seconds: done.seconds,
    };
    let Some(found) = done.found else {
        json::write(&document, args.json.as_ref())?;
        let outputs = document.outputs.join(", ");
        tell(format_args!("wrote {outputs}, for merge"));
        return Ok(());
    };
    let counts = found.counts();
    write(args, (&heights, extent), &table, &found, &counts)?;
    document.fill(counts.iter().map(|&count| u64::from(count)).sum());
    json::write(&document, args.json.as_ref())?;
    tell(format_args!(
        "{name}: {} cells, loaded in {load_seconds:.2} s",
        count(to as u64)
    ));
    document.tell();
    bake.tell_done("pairs", document.pairs, document.trace_seconds);
    chunks::forget(done.checkpoint.as_deref());
    Ok(())
}

/// Says what was read.
fn tell_read(name: &str, heights: &Heights, extent: Extent) {
    let [x, y, z] = extent.size().to_array().map(scenes::rounded);
    let grid = &heights.raster.grid;
    let unit = scenes::unit(grid.crs.as_ref());
    tell(format_args!(
        "{name}: {x} x {y} x {z} {unit} (x, y, z); z is up, as rasters of heights have it; {} x {} cells",
        grid.width, grid.height
    ));
}

/// Height that places lose per squared distance.
fn drop(args: &VisibleArgs) -> Result<f64, Failure> {
    if !args.curvature {
        return Ok(0.0);
    }
    let radius = args.earth_radius / args.units.metres();
    let earth = Curvature::new(radius, args.refraction, [0.0; 3], Orientation::default());
    Ok(earth.map_err(Failure::usage)?.factor())
}

/// Observers of a table.
struct Table {
    observers: Vec<Observer>,
    /// Points of the world; where the table leaves out heights, points are on the surface.
    points: Vec<[f64; 3]>,
}

impl Table {
    /// Reads a table. Eyes are so high above its points, and points without a height are on the surface.
    fn read(
        path: &Path,
        field: &HeightField<'_>,
        (extent, eye): (Extent, f64),
    ) -> Result<Self, Failure> {
        let name = path.display();
        let bad = |line: usize, reason: &str| Failure::Data(format!("{name}:{line}: {reason}"));
        let (sensors, mut points) = Sensors::and_points_of_table(&input::text(path)?)
            .map_err(|error| bad(error.line, &error.reason))?;
        if let Some(axis) = (0..2).find(|&axis| points.iter().any(|point| point[axis].is_nan())) {
            let axis = ["x", "y"][axis];
            return Err(bad(1, &format!("found no column {axis}, which is not up")));
        }
        let mut observers = Vec::with_capacity(points.len());
        for (index, point) in points.iter_mut().enumerate() {
            let place = field.place([point[0], point[1]]);
            if point[2].is_nan() {
                let off = || antumbra_bake::Error::OffSurface { index };
                let height = field.surface(place).ok_or_else(off);
                point[2] = height.map_err(|error| Failure::Data(format!("{name}: {error}")))?;
            }
            observers.push(Observer {
                place,
                height: point[2] + eye,
                normal: sensors
                    .normals
                    .get(index)
                    .map_or([0.0; 3], |normal| normal.map(f64::from)),
            });
        }
        let ends = [extent.low, extent.high].map(|corner| corner.to_array());
        visible::warn_of_far(path, points.iter().copied(), ("raster", ends));
        Ok(Self { observers, points })
    }
}

/// Writes all files.
fn write(
    args: &VisibleArgs,
    (heights, extent): (&Heights, Extent),
    table: &Table,
    found: &Viewsheds,
    counts: &[u32],
) -> Result<(), Failure> {
    let _writing = interrupt::writing();
    let mut others = Vec::new();
    for path in &args.output {
        match Format::of_sensors(path)? {
            Format::Raster => {
                let mut grid = heights.raster.grid.clone();
                if let Some(crs) = &args.raster.crs {
                    grid.crs = Some(crs.clone());
                }
                let with_data = counts.iter().zip(&heights.raster.values);
                let values = with_data.map(|(&count, height)| match height.is_finite() {
                    true => count as f32,
                    false => f32::NAN,
                });
                let values: Vec<f32> = values.collect();
                let quantity = Quantity {
                    name: NAME,
                    unit: "",
                };
                raster::write_values(path, &grid, &values, quantity)?;
            }
            format => others.push((path, format)),
        }
    }
    if others.is_empty() && args.lines.is_none() {
        return Ok(());
    }
    // The other files name the cells as the vertices of a mesh.
    let origin = extent.local_origin().to_array();
    let local = LocalOrigin { origin };
    let surface = heights.raster.mesh(origin);
    let mut mesh = Mesh::default();
    mesh.push(
        (&surface.positions, &surface.indices),
        &surface.normals,
        &[],
        false,
    );
    let cells = RasterCells {
        grid: heights.raster.grid.clone(),
        cells: surface.cells,
    };
    let mut rows = Sensors::of_vertices(&mesh);
    let seen: Vec<u32> = cells
        .cells
        .iter()
        .map(|&cell| counts[cell as usize])
        .collect();
    for (path, format) in others {
        match format {
            Format::Csv => {
                let places = (&rows.points[..], local);
                files::table(path, places, (&[], &[]), (NAME, 40), |row| {
                    vec![f64::from(seen[row])]
                })?;
            }
            Format::Npz => {
                let matrix = found.matrix(&cells.cells)?;
                let counts: Vec<u64> = seen.iter().map(|&count| u64::from(count)).collect();
                let observers = table.points.iter().map(|&point| local.local(point));
                let observers: Vec<[f32; 3]> = observers.collect();
                let places = [&rows.points[..], &observers];
                visible::npz(path, (true, places, local), &matrix, &counts)?;
            }
            _ => {
                let values: Vec<f32> = seen.iter().map(|&count| count as f32).collect();
                let level = ([0.0; 3], args.map.colours());
                files::coloured(path, (NAME, &values), &rows, (&mesh, local), level)?;
            }
        }
    }
    if let Some(path) = &args.lines {
        let matrix = found.matrix(&cells.cells)?;
        for point in &mut rows.points {
            point[2] = (f64::from(point[2]) + args.target) as f32;
        }
        let eyes = table.points.iter().zip(&table.observers);
        let eyes: Vec<[f32; 3]> = eyes
            .map(|(&[x, y, _], observer)| local.local([x, y, observer.height]))
            .collect();
        let ends = Ends {
            rows: &rows.points,
            columns: Some(&eyes),
            curvature: None,
            local,
            is_viewshed: true,
        };
        visible::lines(path, &ends, &matrix)?;
    }
    Ok(())
}
