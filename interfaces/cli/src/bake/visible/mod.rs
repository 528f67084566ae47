//! `antumbra visible`: visibility between points, and viewsheds.
//!
//! - `viewshed`: viewsheds of a height raster, without rays;  `lines`: files of lines of sight

mod lines;
mod viewshed;

use std::path::{Path, PathBuf};

use antumbra::{Aabb, LocalOrigin};
use antumbra_bake::{Array, BitMatrix, Entry, Eyes, Orientation, Sensors, UpAxis, VisibilityJob};
use antumbra_lab::count;
use antumbra_raster::{Quantity, unit_name};
use antumbra_tiles::Indexed;
use clap::{ArgAction, ArgGroup, Args, ValueEnum};

use super::command::{Bake, Baking, Done, Figure, Named};
use super::files::{self, Column, Format};
use super::ground::{self, Ground};
use super::map::{self, Plan, Words};
use super::raster;
use super::site::Asked;
use super::tile::Tiling;
use crate::args::{
    ChunkArgs, MapArgs, RasterArgs, SCENE, SCENE_LONG, UnitArgs, heading, up_axis, values,
};
use crate::exit::{Failure, tell};
use crate::interrupt;
use crate::json::Destination;
use crate::output::{Files, text};
use lines::Ends;

/// Value of the cells of a height raster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shown {
    /// Number of observers that see the cell
    SeenBy,
    /// Least height above ground that an observer sees
    Height,
    /// Least elevation of lines of sight, in degrees
    Angle,
}

impl Shown {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::SeenBy => "seen_by",
            Self::Height => "height",
            Self::Angle => "angle",
        }
    }

    /// Unit in files, once the unit of lengths is settled.
    fn unit(self, args: &VisibleArgs) -> String {
        match self {
            Self::SeenBy => String::new(),
            Self::Height => args.units.known().map(unit_name).unwrap_or_default(),
            Self::Angle => "degrees".to_owned(),
        }
    }
}

/// Flags of `visible`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("surface"))]
pub struct VisibleArgs {
    #[arg(required = true, num_args = 1, action = ArgAction::Set, help = SCENE, long_help = SCENE_LONG)]
    pub scene: Vec<PathBuf>,
    /// Points that look: x, y [, z] [, nx, ny, nz]
    ///
    /// Points without the column of heights (z, or y where y is up) are put on the surface that is seen from above.
    /// Columns are known by the names in the first line, or else by their order. Points with normals look from a little
    /// above their surface, and see nothing behind it.
    #[arg(value_name = "A.csv")]
    pub from: PathBuf,
    /// Points looked at [default: the points of A.csv]
    #[arg(value_name = "B.csv", conflicts_with = "surface")]
    pub to: Option<PathBuf>,
    /// Result: .npz, .csv, .ply, .png, .svg, .pdf or .tif
    ///
    /// May be given several times. An .npz has the matrix as bits with the counts, a .csv the count of every point of A (of a
    /// viewshed: of every place), a .ply the points of A or the mesh in colours, and a .png, .svg or .pdf a map of
    /// --viewshed, with --grid or of the cells of a height raster, on which observers have symbols. Beside a .png is a .pgw, the
    /// world file for GIS programs. A .tif (GeoTIFF), .asc or .npy has the counts in the cells of a --grid, or the value of --show in
    /// the cells of a scene that is a raster. A shard is a .part.
    #[arg(short, long, value_name = "OUT", required = true, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Value of cells of a height raster
    ///
    /// seen-by is the number of observers that see a cell, height is how high a target must be above its ground until one of
    /// the observers sees it: 0 where the ground itself is seen, and inf where no height helps. angle is the least elevation in
    /// degrees of the lines of sight to the cell, which has no data where nobody sees it.
    #[arg(long, value_name = "VALUE", value_enum, default_value_t = Shown::SeenBy, hide_possible_values = true, requires = "viewshed", help_heading = heading::OUTPUT)]
    pub show: Shown,
    #[command(flatten)]
    pub map: MapArgs,
    #[command(flatten)]
    pub raster: RasterArgs,
    /// Lines of sight: .csv of pairs, .ply of edges
    ///
    /// Lines of sight of shards are written by `merge`.
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub lines: Option<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Count the observers that see each vertex
    #[arg(long, group = "surface", help_heading = heading::WORK)]
    pub viewshed: bool,
    /// Take a grid on the surface instead of vertices
    ///
    /// The places lie so many units apart. They are those that are seen from above.
    #[arg(long, value_name = "UNITS", requires = "viewshed", value_parser = values::positive, help_heading = heading::WORK)]
    pub grid: Option<f64>,
    /// Height of observers above A
    #[arg(long, value_name = "UNITS", default_value_t = 0.0, value_parser = values::from_zero, help_heading = heading::WORK)]
    pub eye: f64,
    /// Targets above B, or the surface
    #[arg(long, value_name = "UNITS", default_value_t = 0.0, value_parser = values::from_zero, help_heading = heading::WORK)]
    pub target: f64,
    /// Left out at both ends [default: origin offset]
    ///
    /// The origin offset is about 4 millionths of the largest coordinate of the point and of its surface. A point on a surface is
    /// rounded, and without a margin its own surface hides it now and then. 0 takes the bare lines. The viewshed of a height
    /// raster is then made by rays too, instead of exactly.
    #[arg(long, value_name = "UNITS", value_parser = values::from_zero, help_heading = heading::WORK)]
    pub margin: Option<f64>,
    /// Axis that points up [default: the scene's]
    #[arg(long, value_name = "AXIS", value_parser = up_axis, help_heading = heading::WORK)]
    pub up: Option<UpAxis>,
    /// Greatest distance of sight, in plan
    #[arg(long, value_name = "UNITS", requires = "viewshed", value_parser = values::positive, help_heading = heading::WORK)]
    pub radius: Option<f64>,
    /// Round earth, and light that air bends
    ///
    /// Places d away lie lower by (1 - k) d² / (2 R), with --refraction k and the --earth-radius R.
    #[arg(long, help_heading = heading::WORK)]
    pub curvature: bool,
    /// Refraction; 0 without air
    #[arg(long, value_name = "K", default_value_t = antumbra_bake::REFRACTION, allow_negative_numbers = true, requires = "curvature", help_heading = heading::WORK)]
    pub refraction: f64,
    /// Radius of the earth
    #[arg(long, value_name = "METRES", default_value_t = antumbra_bake::EARTH_RADIUS, requires = "curvature", value_parser = values::positive, help_heading = heading::WORK)]
    pub earth_radius: f64,
    #[command(flatten, next_help_heading = heading::WORK)]
    pub units: UnitArgs,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}

impl Baking for VisibleArgs {
    fn check(&self) -> Result<(), Failure> {
        let has_cells = self.viewshed && (self.grid.is_some() || raster::is_raster(&self.scene));
        for path in &self.output {
            match Format::of_sensors(path)? {
                Format::Picture if self.grid.is_none() && !viewshed::is_of_cells(self) => {
                    let reason =
                        "a map needs --viewshed, with --grid or of the cells of a height raster";
                    return Err(Failure::name(path, reason));
                }
                Format::Raster if !has_cells => {
                    let reason =
                        "a raster needs --viewshed, with --grid or of a scene that is a raster";
                    return Err(Failure::name(path, reason));
                }
                _ => {}
            }
        }
        viewshed::check(self)?;
        self.map.check()?;
        let path = self.lines.as_deref();
        path.map_or(Ok(()), |path| lines::format(path).map(drop))
    }

    fn lines(&mut self) -> Option<&mut Option<PathBuf>> {
        Some(&mut self.lines)
    }

    fn files(&self) -> [Vec<Named<'_>>; 2] {
        let from = ("the points", Some(self.from.as_path()));
        let to = ("the points", self.to.as_deref());
        [vec![("--lines", self.lines.as_deref())], vec![from, to]]
    }

    fn tiling(&self, raster: &Indexed) -> Result<Tiling, Failure> {
        viewshed::tiling(self, raster)
    }

    fn bake(&self, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
        if viewshed::is_of_cells(self) {
            return viewshed::run(self, bake, files);
        }
        if self.show != Shown::SeenBy {
            let show = self.show.name();
            return Err(Failure::Usage(format!(
                "--show {show} is for the cells of a height raster, without --grid, --margin and --up; \
                 with --target, counts are of targets at one height"
            )));
        }
        let ground = bake.ground(&mut files, self.curvature.then_some(self))?;
        let up = ground.up(self.up)?;
        let site = asked(self).of((&ground.loaded, ground.extent()), up)?;
        let plan = Orientation::new(up, 0.0).map_err(Failure::usage)?;
        let points = Points::read(self, &ground, &plan)?;
        points.warn_of_far_ones(self, &ground.bvh.bounds(), ground.local);
        let (rows, columns) = points.eyes(self, &ground, &plan);
        let job = VisibilityJob {
            rows: &rows,
            columns: columns.as_ref(),
            margin: self.margin.map(|margin| margin as f32),
            range: self.radius.map(|radius| (radius, plan.up)),
        };
        let done = bake.compute(&job, &ground, &ground.bvh)?;
        if let Some(matrix) = &done.found {
            let _writing = interrupt::writing();
            let grid = Plan {
                ground: &ground,
                bvh: &ground.bvh,
                orientation: &plan,
                up,
                cell: self.grid.unwrap_or_default(),
                north: Some(site.map_or(0.0, |site| site.north)),
                metres: self.units.known(),
            };
            write(self, &grid, &points.unbent(&ground), matrix)?;
            if let Some(path) = &self.lines {
                let ends = Ends {
                    rows: &rows.points,
                    columns: columns.as_ref().map(|eyes| &eyes.points[..]),
                    curvature: ground.curvature,
                    local: ground.local,
                    is_viewshed: self.viewshed,
                };
                lines::write(path, &ends, matrix)?;
            }
        }
        let counts = [Some(&rows), columns.as_ref()].map(|eyes| eyes.map(|eyes| eyes.points.len()));
        let sight = Sight {
            name: &ground.loaded.scene.name,
            triangles: ground.mesh.indices.len(),
            counts,
            visible: done.found.as_ref().map(BitMatrix::count),
            seconds: [ground.loaded.seconds, ground.build_seconds],
        };
        sight.end(self, bake, &done, || ground.tell(""))
    }
}

/// Points in question, and their eyes, which are the ends of lines of sight. Places of a viewshed have the rows, since
/// there are more of them than observers.
struct Points {
    rows: Sensors,
    /// Points of columns; `None` if rows and columns have the same.
    columns: Option<Sensors>,
    is_viewshed: bool,
}

impl Points {
    fn read(args: &VisibleArgs, ground: &Ground, plan: &Orientation) -> Result<Self, Failure> {
        let from = ground::sensors(&args.from, ground, plan)?;
        let (rows, columns) = match (args.viewshed, args.grid) {
            (true, Some(spacing)) => (ground.grid(spacing, plan)?, Some(from)),
            (true, None) => {
                let mut places = Sensors::of_vertices(&ground.mesh);
                // Cells count as seen where a line ends, and not only from above the slope there.
                if ground.loaded.raster.is_some() {
                    places.normals = Vec::new();
                }
                (places, Some(from))
            }
            (false, _) => {
                let to = args.to.as_deref();
                let to = to.map(|path| ground::sensors(path, ground, plan));
                (from, to.transpose()?)
            }
        };
        Ok(Self {
            rows,
            columns,
            is_viewshed: args.viewshed,
        })
    }

    /// Warns of points of the tables that are far outside the mesh: see [`warn_of_far`].
    fn warn_of_far_ones(&self, args: &VisibleArgs, bounds: &Aabb, local: LocalOrigin) {
        let tables = match (&self.columns, self.is_viewshed) {
            (Some(observers), true) => [Some((&args.from, observers)), None],
            _ => [
                Some((&args.from, &self.rows)),
                args.to.as_ref().zip(self.columns.as_ref()),
            ],
        };
        let ends = [bounds.min, bounds.max].map(|corner| local.world(corner));
        for (path, sensors) in tables.into_iter().flatten() {
            let points = sensors.points.iter().map(|&point| local.world(point));
            warn_of_far(path, points, ("mesh", ends));
        }
    }

    /// The points as they are in the scene.
    fn unbent(&self, ground: &Ground) -> Self {
        let unbend = |sensors: &Sensors| {
            let mut sensors = sensors.clone();
            if let Some(curvature) = &ground.curvature {
                for point in &mut sensors.points {
                    *point = curvature.unbend(*point);
                }
            }
            sensors
        };
        Self {
            rows: unbend(&self.rows),
            columns: self.columns.as_ref().map(unbend),
            is_viewshed: self.is_viewshed,
        }
    }

    /// Eyes of the rows, and of the columns.
    fn eyes(
        &self,
        args: &VisibleArgs,
        ground: &Ground,
        plan: &Orientation,
    ) -> (Eyes<'_>, Option<Eyes<'_>>) {
        let [row_height, column_height] = match self.is_viewshed {
            true => [args.target, args.eye],
            false => [args.eye, args.target],
        };
        let rows = Eyes::new(&self.rows, &ground.bvh, plan.up, row_height);
        let columns = self.columns.as_ref();
        let columns =
            columns.map(|sensors| Eyes::new(sensors, &ground.bvh, plan.up, column_height));
        (rows, columns)
    }
}

/// Warns of points of a table that are farther outside a surface than the surface is long: their units, axes or origin are
/// probably others. Points and the corners of the surface are in coordinates of the world.
pub fn warn_of_far(
    path: &Path,
    points: impl ExactSizeIterator<Item = [f64; 3]>,
    (surface, [low, high]): (&str, [[f64; 3]; 2]),
) {
    let of = points.len();
    let extent = (0..3).fold(0.0, |most: f64, axis| most.max(high[axis] - low[axis]));
    let is_far = |point: &[f64; 3]| {
        (0..3).any(|axis| point[axis] < low[axis] - extent || point[axis] > high[axis] + extent)
    };
    let far = points.filter(is_far).count();
    if far > 0 {
        // Single precision has as many digits as somebody reads.
        let [low, high] = [low, high].map(|corner| corner.map(|x| x as f32));
        tell(format_args!(
            "warning: {}: {far} of {of} points are farther outside the {surface} than its extent of {}: the {surface} runs \
             from {low:?} to {high:?}; check units, axes and origin",
            path.display(),
            extent as f32,
        ));
    }
}

/// Flags that a coordinate system may answer.
pub fn asked(args: &VisibleArgs) -> Asked<'_> {
    Asked {
        crs: args.raster.crs.as_ref(),
        units: Some(&args.units),
        north: None,
    }
}

/// Writes all files but the lines of sight.
fn write(
    args: &VisibleArgs,
    plan: &Plan<'_>,
    points: &Points,
    matrix: &BitMatrix,
) -> Result<(), Failure> {
    let (ground, local) = (plan.ground, plan.ground.local);
    let counts = matrix.count_rows();
    let values: Vec<f32> = counts.iter().map(|&count| count as f32).collect();
    let name = match points.is_viewshed {
        true => Shown::SeenBy.name(),
        false => "sees",
    };
    let rows = &points.rows;
    let observers = points.columns.as_ref().unwrap_or(rows);
    args.output
        .iter()
        .try_for_each(|path| match Format::of_sensors(path)? {
            Format::Npz => {
                let places = [&rows.points[..], &observers.points];
                npz(path, (points.is_viewshed, places, local), matrix, &counts)
            }
            Format::Csv => {
                let column = Column::new(name, |row| counts[row] as f64);
                files::table(path, (rows, &[], local), &[], &[column])
            }
            Format::Raster => {
                let quantity = Quantity { name, unit: "" };
                let crs = (args.raster.crs.as_ref(), args.units.metres());
                raster::write(path, ground, (rows, &values), crs, (plan.up, quantity))
            }
            Format::Picture => {
                let words = words(args, &ground.loaded.scene.name, observers.points.len());
                let level = Orientation::new(plan.up, 0.0).map_err(Failure::usage)?;
                let place = |&point: &[f32; 3]| {
                    let [x, y, _] = level.local(local.world(point));
                    [x, y]
                };
                let sheet = map::Sheet::new(&args.map, plan, rows)?;
                let sheet = sheet.observed(observers.points.iter().map(place));
                sheet.write(path, &words, &values)
            }
            Format::Ply | Format::Glb => {
                let level = ([0.0; 3], args.map.colours());
                files::coloured(path, (name, &values), rows, (&ground.mesh, local), level)
            }
        })
}

/// Words of a map.
fn words<'a>(args: &'a VisibleArgs, scene: &str, observers: usize) -> Words<'a> {
    let lengths = args.units.known().map(unit_name).unwrap_or_default();
    let of = if lengths.is_empty() { "" } else { " " };
    let of = format!("{of}{lengths}");
    let (title, quantity, unit, none) = match args.show {
        Shown::SeenBy => (
            "Viewshed",
            "Observers that see the place",
            String::new(),
            Some("not seen"),
        ),
        Shown::Height => (
            "Height that is seen",
            "Least height above ground that an observer sees",
            lengths,
            None,
        ),
        Shown::Angle => (
            "Elevation of sight",
            "Least elevation of lines of sight",
            "degrees".to_owned(),
            None,
        ),
    };
    let plural = if observers == 1 { "" } else { "s" };
    let mut subtitle = format!(
        "{} observer{plural}, eyes {}{of}",
        count(observers as u64),
        args.eye
    );
    subtitle += &match args.show {
        Shown::Height => " above their places".to_owned(),
        _ => format!(" and targets {}{of} above their places", args.target),
    };
    if let Some(radius) = args.radius {
        subtitle += &format!(", within {radius}{of}");
    }
    Words {
        title: format!("{title}, {scene}"),
        subtitle,
        quantity,
        unit,
        none,
        files: vec![&args.scene, std::slice::from_ref(&args.from)],
    }
}

/// Writes a matrix as arrays, with the places of its rows and columns.
pub fn npz(
    path: &Path,
    (is_viewshed, [rows, columns], local): (bool, [&[[f32; 3]]; 2], LocalOrigin),
    matrix: &BitMatrix,
    counts: &[u64],
) -> Result<(), Failure> {
    let column_counts = matrix.count_columns();
    let shape = [matrix.rows() as u64, matrix.columns() as u64];
    let [row_name, column_name] = match is_viewshed {
        true => ["to", "from"],
        false => ["from", "to"],
    };
    let entries = [
        Entry::new("visible", Array::Bits(matrix)),
        Entry::new("shape", Array::Counts(&shape)),
        Entry::new("row_counts", Array::Counts(counts)),
        Entry::new("column_counts", Array::Counts(&column_counts)),
        Entry::new(row_name, Array::Places(rows, local)),
        Entry::new(column_name, Array::Places(columns, local)),
    ];
    files::npz(path, &entries)
}

/// Figures about who sees what.
pub struct Sight<'a> {
    /// Name of the scene.
    pub name: &'a str,
    pub triangles: usize,
    /// Numbers of points that have a row, and of those that have a column if these are others.
    pub counts: [Option<usize>; 2],
    /// Pairs that see each other, if they were counted.
    pub visible: Option<u64>,
    /// Seconds of loading and of building.
    pub seconds: [f64; 2],
}

impl Sight<'_> {
    /// Writes the document, and says what was done: first of the scene by `tell_scene`.
    pub fn end<T>(
        &self,
        args: &VisibleArgs,
        bake: &Bake<'_>,
        done: &Done<T>,
        tell_scene: impl Fn(),
    ) -> Result<(), Failure> {
        let [rows, columns] = [self.counts[0], self.counts[1].or(self.counts[0])];
        let [rows, columns] = [rows, columns].map(Option::unwrap_or_default);
        let [from, to] = match args.viewshed {
            true => [columns, rows],
            false => [rows, columns],
        };
        let pairs = match self.counts[1] {
            Some(_) => from as u64 * to as u64,
            // No point is paired with itself.
            None => from as u64 * (from as u64).saturating_sub(1),
        };
        let share = self.visible.filter(|_| pairs > 0);
        let share = share.map(|visible| visible as f64 / pairs as f64);
        let figures: &[Figure<'_>] = &[
            ("outputs", &bake.output_names()),
            ("lines", &args.lines.as_deref().map(text)),
            ("shard", &bake.shard()),
            ("triangles", &self.triangles),
            ("from", &from),
            ("to", &to),
            ("viewshed", &args.viewshed),
            ("show", &args.show.name()),
            ("pairs", &pairs),
            ("visible_pairs", &self.visible),
            ("visible_share", &share),
            ("load_seconds", &self.seconds[0]),
            ("build_seconds", &self.seconds[1]),
            ("trace_seconds", &done.seconds),
        ];
        if bake.document(("antumbra.visible/1", self.name), figures, (done, ""))? {
            tell_scene();
            if let Some(visible) = self.visible {
                tell(format_args!(
                    "{} of {} pairs see each other ({:.1} %)",
                    count(visible),
                    count(pairs),
                    100.0 * visible as f64 / (pairs as f64).max(1.0),
                ));
            }
            bake.end("pairs", pairs, done);
        }
        Ok(())
    }
}
