//! `antumbra visible --viewshed` of the cells of a height raster: without a mesh and without a tree.

use std::time::Instant;

use antumbra::{Bvh, Recipe};
use antumbra_bake::{
    Curvature, HeightField, Limits, Mesh, Observer, Orientation, Sensors, TargetHeightJob,
    ViewshedJob, Viewsheds,
};
use antumbra_raster::Quantity;
use antumbra_terrain::{Monitor, Share, Tile};
use antumbra_tiles::Indexed;

use super::lines::{self, Ends};
use super::{Shown, Sight, VisibleArgs};
use crate::bake::command::{Bake, Done};
use crate::bake::files::{self, Column, Format};
use crate::bake::map;
use crate::bake::terrain::{Terrain, is_terrain};
use crate::bake::tile::{self, TileWork, Tiling};
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::progress::Progress;
use crate::{input, interrupt};

/// Whether a command wants the cells of a height raster. Rays serve the rest: other places, lines without their ends, and rasters
/// on their side.
pub fn is_of_cells(args: &VisibleArgs) -> bool {
    let is_plain = args.grid.is_none() && args.margin.is_none();
    args.viewshed && is_plain && is_terrain(&args.scene, args.up)
}

/// Refuses what `--show` cannot be.
pub fn check(args: &VisibleArgs) -> Result<(), Failure> {
    let show = args.show.name();
    if args.show == Shown::SeenBy {
        return Ok(());
    }
    if args.lines.is_some() {
        let reason = format!("--lines are of pairs that see each other: leave out --show {show}");
        return Err(Failure::Usage(reason));
    }
    for path in &args.output {
        let format = Format::of_sensors(path)?;
        if !matches!(format, Format::Raster | Format::Csv | Format::Picture) {
            let reason = format!("--show {show} is written as tif, asc, npy, csv, png, svg or pdf");
            return Err(Failure::name(path, reason));
        }
    }
    Ok(())
}

/// Runs the command. `files` has all files but those that are read with the raster.
pub fn run(args: &VisibleArgs, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
    let terrain = bake.terrain(&mut files)?;
    terrain.tell_read();
    let site = terrain.settle(&super::asked(args))?;
    map::check_cells(&terrain, args.output.iter())?;
    let start = Instant::now();
    let field = terrain.field()?;
    let build_seconds = start.elapsed().as_secs_f64();
    let table = match bake.tile {
        Some(work) => Table::read(args, |point| TileWork::observer(work.raster, point))?,
        None => Table::read(args, |point| Ok(field.observer(point)))?,
    };
    if bake.tile.is_none() {
        let ends = [terrain.extent.low, terrain.extent.high].map(|corner| corner.to_array());
        super::warn_of_far(&args.from, table.points.iter().copied(), ("raster", ends));
    }
    let limits = Limits {
        target: args.target,
        drop: drop(args)?,
        range: args.radius.unwrap_or(f64::INFINITY),
    };
    if args.show == Shown::Height && args.target > 0.0 {
        let reason = "--show height is the height that targets need: leave out --target";
        return Err(Failure::Usage(reason.into()));
    }
    if let Some(work) = bake.tile {
        let progress = Progress::new(&terrain.name);
        let mut values = Values::new(args.show, &terrain.heights.raster.values);
        for (index, observer) in table.observers.iter().enumerate() {
            let share = Share(&progress, [index, table.observers.len()]);
            work.seen(observer, &limits, |field, observer, own| {
                values.add((field, observer, limits), own, &share)
            })?;
        }
        progress.finish();
        return write(args, (&terrain, 0.0), &table, &values.all, None);
    }
    let job = ViewshedJob::new(&field, &table.observers, limits)?;
    let of = table.observers.len();
    let buried = table
        .observers
        .iter()
        .filter(|eye| field.buries(eye))
        .count();
    if buried > 0 {
        tell(format_args!(
            "warning: {}: {buried} of {of} eyes are below the surface and see nothing",
            args.from.display(),
        ));
    }
    let heights = &terrain.heights.raster.values;
    let cells = terrain.known;
    let mut seen = None;
    let done = match args.show {
        Shown::Height => raised(bake, &TargetHeightJob(job), &terrain.name)?,
        show => bake.compute_cells(&job, &terrain.name)?.map(|found| {
            let values = match show {
                Shown::Angle => job.elevations(&found),
                _ => counts(&found, heights),
            };
            seen = Some(found);
            Ok(values)
        })?,
    };
    if let Some(values) = &done.found {
        let north = site.map_or(0.0, |site| site.north);
        write(args, (&terrain, north), &table, values, seen.as_ref())?;
    }
    let sight = Sight {
        name: &terrain.name,
        triangles: field.triangles(),
        counts: [Some(cells), Some(of)],
        visible: seen.as_ref().map(Viewsheds::count),
        seconds: [terrain.load_seconds, build_seconds],
    };
    sight.end(args, bake, &done, || terrain.tell())
}

/// How the viewsheds of tiles are computed.
pub fn tiling(args: &VisibleArgs, raster: &Indexed) -> Result<Tiling, Failure> {
    if !is_of_cells(args) {
        let reason = "tiles of an index are for --viewshed of its cells";
        return Err(Failure::usage(reason));
    }
    tile::settle(raster, &args.scene, &super::asked(args))?;
    let index = raster.index();
    let table = Table::read(args, |point| TileWork::observer(raster, point))?;
    super::warn_of_far(
        &args.from,
        table.points.iter().copied(),
        ("raster", [index.low, index.high]),
    );
    let unit = args.show.unit(args);
    Ok(Tiling {
        directions: Vec::new(),
        bands: vec![[args.show.name().to_owned(), unit]],
        eyes: table
            .observers
            .iter()
            .map(|eye| tile::around(eye.place))
            .collect(),
    })
}

/// Values of a tile, from viewsheds of one observer after the other.
struct Values {
    show: Shown,
    all: Vec<f32>,
}

impl Values {
    /// Of nobody, for cells of these heights.
    fn new(show: Shown, heights: &[f64]) -> Self {
        let none = match show {
            Shown::SeenBy => 0.0,
            Shown::Height => f32::INFINITY,
            Shown::Angle => f32::NAN,
        };
        let of = |height: &f64| if height.is_nan() { f32::NAN } else { none };
        Self {
            show,
            all: heights.iter().map(of).collect(),
        }
    }

    /// Adds an observer on a field, of which the cells are a part.
    fn add(
        &mut self,
        (field, observer, limits): (&HeightField<'_>, &Observer, Limits),
        own: Tile,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let observers = [*observer];
        let job = ViewshedJob::new(field, &observers, limits)?;
        let no_tree = Bvh::build(&[], &Recipe::default()).map_err(Failure::work)?;
        let found = match self.show {
            Shown::Height => TargetHeightJob(job).heights(monitor)?,
            show => {
                let found = antumbra_bake::run(&job, &no_tree, monitor)?;
                match show {
                    Shown::Angle => job.elevations(&found),
                    _ => counts(&found, field.heights()),
                }
            }
        };
        let ([column, row], [width, height]) = (own.at.map(|at| at as usize), own.size);
        let rows = found.chunks_exact(field.size()[0]).skip(row).take(height);
        for (all, found) in self.all.chunks_exact_mut(width).zip(rows) {
            for (own, &found) in all.iter_mut().zip(&found[column..]) {
                *own = match self.show {
                    Shown::SeenBy => *own + found,
                    _ => own.min(found),
                };
            }
        }
        Ok(())
    }
}

/// Numbers of observers that see each cell with data.
fn counts(found: &Viewsheds, heights: &[f64]) -> Vec<f32> {
    let known = |(count, height): (u32, &f64)| match height.is_nan() {
        true => f32::NAN,
        false => count as f32,
    };
    found.counts().into_iter().zip(heights).map(known).collect()
}

/// Heights from which cells are seen: at once, or by shares, which take more memory.
fn raised(
    bake: &Bake<'_>,
    job: &TargetHeightJob<'_>,
    name: &str,
) -> Result<Done<Vec<f32>>, Failure> {
    if !bake.is_whole() {
        return bake.compute_cells(job, name);
    }
    let (start, progress) = (Instant::now(), Progress::new(name));
    let heights = job.heights(&progress);
    progress.finish();
    Ok(Done::whole(heights?, start.elapsed().as_secs_f64()))
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
        args: &VisibleArgs,
        observer: impl Fn([f64; 3]) -> Result<Option<Observer>, Failure>,
    ) -> Result<Self, Failure> {
        let path = &args.from;
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
            let off = || antumbra_bake::Error::OffSurface { index };
            let observer = observer(*point)?.ok_or_else(off);
            let mut observer =
                observer.map_err(|error| Failure::Data(format!("{name}: {error}")))?;
            point[2] = observer.height;
            if let Some(normal) = sensors.normals.get(index) {
                observer.normal = normal.map(f64::from);
            }
            observers.push(observer.raised(args.eye));
        }
        Ok(Self { observers, points })
    }
}

/// Writes all files: values of cells, and who sees them.
fn write(
    args: &VisibleArgs,
    (terrain, north): (&Terrain, f64),
    table: &Table,
    values: &[f32],
    seen: Option<&Viewsheds>,
) -> Result<(), Failure> {
    let _writing = interrupt::writing();
    let name = args.show.name();
    let unit = args.show.unit(args);
    let quantity = Quantity { name, unit: &unit };
    let raster = &terrain.heights.raster;
    let mut others = Vec::new();
    for path in &args.output {
        match Format::of_sensors(path)? {
            Format::Raster => {
                terrain.write(path, args.raster.crs.as_ref(), values, &[quantity])?;
            }
            Format::Picture => {
                let place = (north, args.units.known());
                let sheet = map::Sheet::of_cells(&args.map, terrain, place)?;
                let sheet = sheet.observed(table.points.iter().map(|&[x, y, _]| [x, y]));
                let words = super::words(args, &terrain.name, table.points.len());
                // Where no height helps, there is none.
                let finite = |&value: &f32| if value.is_finite() { value } else { f32::NAN };
                sheet.write(path, &words, &values.iter().map(finite).collect::<Vec<_>>())?;
            }
            format => others.push((path, format)),
        }
    }
    if others.is_empty() && args.lines.is_none() {
        return Ok(());
    }
    // The other files name the cells as the vertices of a mesh.
    let local = terrain.local();
    let surface = raster.mesh(local.origin);
    let mut mesh = Mesh::default();
    let triangles = (&surface.positions[..], &surface.indices[..]);
    mesh.push(triangles, &surface.normals, &[], false);
    let mut rows = Sensors::of_vertices(&mesh);
    let values = surface.cells.iter().map(|&cell| values[cell as usize]);
    let values: Vec<f32> = values.collect();
    for (path, format) in others {
        match (format, seen) {
            (Format::Csv, _) => {
                let column = Column::new(name, |row| f64::from(values[row]));
                files::table(path, (&rows, &[], local), &[], &[column])?;
            }
            (Format::Npz, Some(seen)) => {
                let matrix = seen.matrix(&surface.cells)?;
                let observers = table.points.iter().map(|&point| local.local(point));
                let observers: Vec<[f32; 3]> = observers.collect();
                let places = [&rows.points[..], &observers];
                super::npz(path, (true, places, local), &matrix, &matrix.count_rows())?;
            }
            _ => {
                let level = ([0.0; 3], args.map.colours());
                files::coloured(path, (name, &values), &rows, (&mesh, local), level)?;
            }
        }
    }
    if let (Some(path), Some(seen)) = (&args.lines, seen) {
        let matrix = seen.matrix(&surface.cells)?;
        for point in &mut rows.points {
            point[2] = (f64::from(point[2]) + args.target) as f32;
        }
        let eyes = table.points.iter().zip(&table.observers);
        let eyes = eyes.map(|(&[x, y, _], observer)| local.local([x, y, observer.height]));
        let ends = Ends {
            rows: &rows.points,
            columns: Some(&eyes.collect::<Vec<_>>()),
            curvature: None,
            local,
            is_viewshed: true,
        };
        lines::write(path, &ends, &matrix)?;
    }
    Ok(())
}
