//! `antumbra visible`: visibility between points, and viewsheds.

use std::path::{Path, PathBuf};

use antumbra::{Aabb, LocalOrigin};
use antumbra_bake::{
    Array, BitMatrix, Curvature, Entry, Eyes, Orientation, Sensors, VisibilityJob, ones,
};
use antumbra_image::atomic_write;
use antumbra_lab::count;
use antumbra_load::MemorySize;
use antumbra_raster::{Quantity, unit_name};
use serde::Serialize;

use super::chunks::{self, PartFile};
use super::command::{Bake, Head, text};
use super::files::{self, Format};
use super::ground::{self, Earth, Ground};
use super::map::{self, Plan, Words};
use super::site::Asked;
use super::{raster, viewshed};
use crate::args::VisibleArgs;
use crate::exit::{Failure, tell};
use crate::{interrupt, json, output};

/// The JSON document.
#[derive(Serialize)]
pub struct Document<'a> {
    #[serde(flatten)]
    pub head: Head<'a>,
    pub outputs: Vec<String>,
    pub lines: Option<String>,
    pub shard: Option<String>,
    pub triangles: usize,
    /// Points that look, and points that are looked at.
    pub from: usize,
    pub to: usize,
    pub viewshed: bool,
    pub pairs: u64,
    pub visible_pairs: Option<u64>,
    pub visible_share: Option<f64>,
    pub load_seconds: f64,
    pub build_seconds: f64,
    pub trace_seconds: f64,
}

/// Refuses outputs that cannot be made, before anything is read.
pub fn check(args: &VisibleArgs) -> Result<(), Failure> {
    for path in &args.output {
        if Format::of_sensors(path)? == Format::Picture && args.grid.is_none() {
            let path = path.display();
            let reason = format!("{path}: a map needs --viewshed with --grid");
            return Err(Failure::Usage(reason));
        }
        let has_cells = args.viewshed && (args.grid.is_some() || raster::is_raster(&args.scene));
        if Format::of_sensors(path)? == Format::Raster && !has_cells {
            let path = path.display();
            let reason = format!(
                "{path}: a raster needs --viewshed, with --grid or of a scene that is a raster"
            );
            return Err(Failure::Usage(reason));
        }
    }
    args.map.check()?;
    args.lines
        .as_deref()
        .map_or(Ok(()), |path| line_format(path).map(drop))
}

/// Format of lines of sight.
fn line_format(path: &Path) -> Result<Format, Failure> {
    Format::of(path, &["csv", "ply"], "lines are written as csv or ply")
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

/// Runs the command, or merges parts of it.
pub fn run(
    args: &VisibleArgs,
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
        earth: args.curvature.then_some(Earth {
            radius: args.earth_radius,
            units: &args.units,
            crs: args.raster.crs.as_ref(),
            refraction: args.refraction,
            up: args.up,
        }),
    };
    let from = ("the points", Some(args.from.as_path()));
    let to = ("the points", args.to.as_deref());
    let world_files = map::world_files(&args.output)?;
    let mut written = vec![("--lines", args.lines.as_deref())];
    written.extend(
        world_files
            .iter()
            .map(|path| ("the world file", Some(&**path))),
    );
    let mut files = bake.declare(&written, &[from, to])?;
    if viewshed::is_of_cells(args) {
        return viewshed::run(args, &bake, files, isa, memory);
    }
    let ground = bake.ground(isa, memory, &mut files)?;
    let up = ground.up(args.up)?;
    let site = asked(args).of(&ground.loaded, up)?;
    let plan = Orientation::new(up, 0.0).map_err(Failure::usage)?;
    let points = Points::read(args, &ground, &plan)?;
    points.warn_of_far_ones(args, &ground.bvh.bounds(), ground.local);
    let (rows, columns) = points.eyes(args, &ground, &plan);
    let job = VisibilityJob {
        rows: &rows,
        columns: columns.as_ref(),
        margin: args.margin.map(|margin| margin as f32),
        range: args.radius.map(|radius| (radius, plan.up)),
    };
    let done = bake.compute(&job, &ground, &ground.bvh)?;
    let counts = [
        rows.points.len(),
        columns.as_ref().unwrap_or(&rows).points.len(),
    ];
    let [from, to] = match args.viewshed {
        true => [counts[1], counts[0]],
        false => counts,
    };
    let mut document = Document {
        head: bake.head("antumbra.visible/1", isa, &ground.loaded.scene.name),
        outputs: bake.output_names(),
        lines: args.lines.as_deref().map(text),
        shard: bake.shard(),
        triangles: ground.mesh.indices.len(),
        from,
        to,
        viewshed: args.viewshed,
        pairs: match columns {
            Some(_) => from as u64 * to as u64,
            // No point is paired with itself.
            None => from as u64 * (from as u64).saturating_sub(1),
        },
        visible_pairs: None,
        visible_share: None,
        load_seconds: ground.loaded.seconds,
        build_seconds: ground.build_seconds,
        trace_seconds: done.seconds,
    };
    let Some(matrix) = done.found else {
        json::write(&document, args.json.as_ref())?;
        let outputs = document.outputs.join(", ");
        tell(format_args!("wrote {outputs}, for merge"));
        return Ok(());
    };
    let points = points.unbent(&ground);
    let grid = Plan {
        ground: &ground,
        bvh: &ground.bvh,
        orientation: &plan,
        up,
        cell: args.grid.unwrap_or_default(),
        north: Some(site.map_or(0.0, |site| site.north)),
        metres: args.units.known(),
    };
    write(args, &grid, &points, &matrix)?;
    if let Some(path) = &args.lines {
        let _writing = interrupt::writing();
        let ends = Ends {
            rows: &rows.points,
            columns: columns.as_ref().map(|eyes| &eyes.points[..]),
            curvature: ground.curvature,
            local: ground.local,
            is_viewshed: args.viewshed,
        };
        lines(path, &ends, &matrix)?;
    }
    document.fill(matrix.count());
    json::write(&document, args.json.as_ref())?;
    ground.tell("");
    document.tell();
    bake.tell_done("pairs", document.pairs, document.trace_seconds);
    chunks::forget(done.checkpoint.as_deref());
    Ok(())
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
    let _writing = interrupt::writing();
    let ground = plan.ground;
    let counts = matrix.count_rows();
    let values = || counts.iter().map(|&count| count as f32).collect::<Vec<_>>();
    let name = if points.is_viewshed {
        "seen_by"
    } else {
        "sees"
    };
    let (rows, local) = (&points.rows, ground.local);
    let each = |path: &PathBuf| match Format::of_sensors(path)? {
        Format::Npz => {
            let columns = points.columns.as_ref().unwrap_or(rows);
            let places = [&rows.points[..], &columns.points];
            npz(path, (points.is_viewshed, places, local), matrix, &counts)
        }
        Format::Csv => {
            let labels = (&[][..], &rows.labels[..]);
            files::table(path, (&rows.points, local), labels, (name, 40), |row| {
                vec![counts[row] as f64]
            })
        }
        Format::Raster => {
            let quantity = Quantity { name, unit: "" };
            let crs = (args.raster.crs.as_ref(), args.units.metres());
            raster::write(path, ground, (rows, &values()), crs, (plan.up, quantity))
        }
        Format::Picture => {
            let observers = points.columns.as_ref().unwrap_or(rows).points.len();
            let unit = args
                .units
                .known()
                .map(|metres| format!(" {}", unit_name(metres)));
            let unit = unit.unwrap_or_default();
            let words = Words {
                title: format!("Viewshed, {}", ground.loaded.scene.name),
                subtitle: format!(
                    "{} observers, eyes {}{unit} and targets {}{unit} above their places",
                    count(observers as u64),
                    args.eye,
                    args.target
                ),
                quantity: "Observers that see the place",
                unit: "",
                whole: true,
                files: vec![&args.scene, &args.from],
            };
            let sheet = map::Sheet::new(&args.map, plan, rows)?;
            sheet.write(path, &words, &values())
        }
        Format::Ply | Format::Glb => {
            let mesh = (&ground.mesh, local);
            let level = ([0.0; 3], args.map.colours());
            files::coloured(path, (name, &values()), rows, mesh, level)
        }
    };
    args.output.iter().try_for_each(each)
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

/// Ends of lines of sight.
pub struct Ends<'a> {
    pub rows: &'a [[f32; 3]],
    /// `None` if rows and columns have the same.
    pub columns: Option<&'a [[f32; 3]]>,
    /// How the points are bent.
    pub curvature: Option<Curvature>,
    pub local: LocalOrigin,
    pub is_viewshed: bool,
}

/// Writes the pairs that see each other; of points of one list, each pair once.
pub fn lines(path: &Path, ends: &Ends<'_>, matrix: &BitMatrix) -> Result<(), Failure> {
    let once = ends.columns.is_none();
    let (local, is_viewshed) = (ends.local, ends.is_viewshed);
    let pairs = || {
        (0..matrix.rows()).flat_map(move |row| {
            let columns = ones(matrix.row(row)).filter(move |&column| !once || column > row);
            columns.map(move |column| (row, column))
        })
    };
    let count = pairs().count() as u64;
    if line_format(path)? == Format::Csv {
        output::check_room(path, 16 * count)?;
        return Ok(atomic_write(path, |file| {
            writeln!(file, "from,to")?;
            pairs().try_for_each(|(row, column)| match is_viewshed {
                true => writeln!(file, "{column},{row}"),
                false => writeln!(file, "{row},{column}"),
            })
        })?);
    }
    let rows = ends.rows;
    let columns = ends.columns.unwrap_or_default();
    let first = if once { 0 } else { rows.len() };
    let vertices = rows.len() + columns.len();
    output::check_room(path, 24 * vertices as u64 + 8 * count)?;
    let is_local = local != LocalOrigin::default();
    let real = if is_local { "double" } else { "float" };
    Ok(atomic_write(path, |file| {
        write!(
            file,
            "ply\nformat binary_little_endian 1.0\ncomment written by antumbra\nelement vertex {vertices}\n\
             property {real} x\nproperty {real} y\nproperty {real} z\nelement edge {count}\n\
             property int vertex1\nproperty int vertex2\nend_header\n"
        )?;
        for point in rows.iter().chain(columns) {
            let unbent = ends.curvature.map(|curvature| curvature.unbend(*point));
            let point = &unbent.unwrap_or(*point);
            match is_local {
                true => file.write_all(local.world(*point).map(f64::to_le_bytes).as_flattened())?,
                false => file.write_all(point.map(f32::to_le_bytes).as_flattened())?,
            }
        }
        pairs().try_for_each(|(row, column)| {
            file.write_all(&(row as u32).to_le_bytes())?;
            file.write_all(&((first + column) as u32).to_le_bytes())
        })
    })?)
}

impl Document<'_> {
    /// Fills in figures about the matrix.
    pub fn fill(&mut self, visible: u64) {
        self.visible_pairs = Some(visible);
        self.visible_share = (self.pairs > 0).then(|| visible as f64 / self.pairs as f64);
    }

    pub fn tell(&self) {
        let visible = self.visible_pairs.unwrap_or_default();
        tell(format_args!(
            "{} of {} pairs see each other ({:.1} %)",
            count(visible),
            count(self.pairs),
            100.0 * visible as f64 / (self.pairs as f64).max(1.0),
        ));
    }
}
