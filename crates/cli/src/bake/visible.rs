//! `antumbra visible`: who sees whom, and viewsheds.

use std::path::Path;
use std::time::Instant;

use antumbra::Aabb;
use antumbra_bake::{
    Array, BitMatrix, Entry, Orientation, ShadedMesh, npz_bytes, ones, sees_each_other,
    sees_points, write_npz,
};
use antumbra_image::{atomic_write, heatmap};
use antumbra_lab::{Machine, count};
use antumbra_load::MemorySize;
use serde::Serialize;

use super::chunks::{self, Part, Work};
use super::hash::Key;
use super::mesh::Ground;
use super::sensors::{Layout, Sensors};
use super::sun::up_axis;
use crate::args::VisibleArgs;
use crate::exit::{Failure, tell};
use crate::output::{self, Files};
use crate::progress::Progress;
use crate::{json, version};

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    #[serde(flatten)]
    machine: Machine,
    scene: &'a str,
    outputs: Vec<String>,
    lines: Option<String>,
    shard: Option<String>,
    triangles: usize,
    /// Points that look, and points that are looked at.
    from: usize,
    to: usize,
    viewshed: bool,
    pairs: u64,
    visible_pairs: Option<u64>,
    visible_share: Option<f64>,
    load_seconds: f64,
    build_seconds: f64,
    trace_seconds: f64,
}

/// Formats, by extension.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Npz,
    Csv,
    Ply,
    Png,
}

fn format(path: &Path) -> Result<Format, Failure> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    match extension.to_str() {
        Some("npz") => Ok(Format::Npz),
        Some("csv") => Ok(Format::Csv),
        Some("ply") => Ok(Format::Ply),
        Some("png") => Ok(Format::Png),
        _ if output::is_stream(path) => Ok(Format::Csv),
        _ => Err(Failure::Usage(format!(
            "{}: results are written as npz, csv, ply or png",
            path.display()
        ))),
    }
}

/// Refuses outputs that cannot be made, before anything is read.
fn check(args: &VisibleArgs) -> Result<(), Failure> {
    for path in &args.output {
        if format(path)? == Format::Png && args.grid.is_none() {
            let path = path.display();
            let reason = format!("{path}: a map needs --viewshed with --grid");
            return Err(Failure::Usage(reason));
        }
    }
    if let Some(path) = &args.lines
        && !matches!(format(path)?, Format::Csv | Format::Ply)
    {
        let path = path.display();
        return Err(Failure::Usage(format!(
            "{path}: lines are written as csv or ply"
        )));
    }
    Ok(())
}

/// Points in question. Rows of the matrix are those of which there are more in a viewshed: the places.
struct Points {
    /// Points that have a row, and where their counts belong.
    rows: Sensors,
    /// Points of columns; `None` if they are the rows.
    columns: Option<Sensors>,
    /// Where lines begin and end.
    row_eyes: Vec<[f32; 3]>,
    column_eyes: Vec<[f32; 3]>,
}

impl Points {
    fn new(args: &VisibleArgs, ground: &Ground, plan: &Orientation) -> Result<Self, Failure> {
        let from = Sensors::from_csv(&args.from)?;
        let bounds = ground.bvh.bounds();
        let from_eyes = eyes(&from, &bounds, plan, args.eye);
        if args.viewshed {
            let places = match args.grid {
                Some(spacing) => Sensors::on_grid(&ground.bvh, spacing, plan)?,
                None => Sensors::of_vertices(&ground.vertices),
            };
            let row_eyes = eyes(&places, &bounds, plan, args.target);
            return Ok(Self {
                rows: places,
                columns: Some(from),
                row_eyes,
                column_eyes: from_eyes,
            });
        }
        let columns = args.to.as_deref().map(Sensors::from_csv).transpose()?;
        let column_eyes = match &columns {
            Some(to) => eyes(to, &bounds, plan, args.target),
            None => Vec::new(),
        };
        Ok(Self {
            rows: from,
            columns,
            row_eyes: from_eyes,
            column_eyes,
        })
    }

    fn columns(&self) -> &[[f32; 3]] {
        match &self.columns {
            Some(_) => &self.column_eyes,
            None => &self.row_eyes,
        }
    }
}

/// Where points look from: an origin offset above their surface, if they have one, and so much higher.
fn eyes(sensors: &Sensors, bounds: &Aabb, plan: &Orientation, height: f64) -> Vec<[f32; 3]> {
    let eye = |(index, point): (usize, &[f32; 3])| {
        let around = bounds.union(&Aabb::around(&[*point]));
        let offset = f64::from(around.origin_offset());
        let normal = sensors
            .normals
            .get(index)
            .copied()
            .unwrap_or_default()
            .map(f64::from);
        let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        let along = if length > 0.0 { offset / length } else { 0.0 };
        std::array::from_fn(|axis| {
            let raised = f64::from(point[axis]) + along * normal[axis] + height * plan.up[axis];
            raised as f32
        })
    };
    sensors.points.iter().enumerate().map(eye).collect()
}

/// Takes out pairs where a point lies behind the surface of the other.
fn face(matrix: &mut BitMatrix, points: &Points) {
    let columns = points.columns.as_ref().unwrap_or(&points.rows);
    let faces = |normal: Option<&[f32; 3]>, from: [f32; 3], to: [f32; 3]| {
        let Some(normal) = normal else { return true };
        let product =
            |axis: usize| f64::from(normal[axis]) * (f64::from(to[axis]) - f64::from(from[axis]));
        from == to || (0..3).map(product).sum::<f64>() > 0.0
    };
    for row in 0..matrix.rows() {
        let seen: Vec<usize> = ones(matrix.row(row)).collect();
        let (row_normal, row_eye) = (points.rows.normals.get(row), points.row_eyes[row]);
        for column in seen {
            let (normal, eye) = (columns.normals.get(column), points.columns()[column]);
            if !faces(row_normal, row_eye, eye) || !faces(normal, eye, row_eye) {
                matrix.set(row, column, false);
            }
        }
    }
}

/// Runs the command, or merges parts of it.
pub fn run(args: &VisibleArgs, memory: MemorySize, parts: Option<&[Part]>) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    if args.chunks.shard.is_none() {
        check(args)?;
    }
    let mut files = Files::default();
    chunks::declare(&args.output, args.chunks.shard, &mut files)?;
    if let Some(lines) = &args.lines {
        files.writes("--lines", lines)?;
    }
    if let Some(json) = &args.json {
        files.writes("--json", json.path())?;
    }
    chunks::reads(parts, &mut files)?;
    files.reads("the scene", &args.scene)?;
    files.reads("the points", &args.from)?;
    if let Some(to) = &args.to {
        files.reads("the points", to)?;
    }
    files.check()?;
    args.machine.start_threads()?;
    let ground = Ground::load(&args.scene, isa, memory, &mut files)?;
    let up = up_axis(args.up, &args.scene);
    let plan = Orientation::new(up, 0.0).map_err(Failure::usage)?;
    let points = Points::new(args, &ground, &plan)?;
    let (rows, columns) = (&points.row_eyes, points.columns());
    let margin = args.margin as f32;

    let mut key = Key::new("visible/1", &ground.loaded.scene)?;
    key.text(&format!("{margin:?} {}", points.columns.is_some()));
    for list in [&rows[..], columns, &points.rows.normals] {
        key.floats(list.as_flattened());
    }
    let work = Work {
        key: key.value(),
        items: rows.len(),
        rays_per_item: columns.len() as u64,
        shard: args.chunks.shard,
        output: &args.output[0],
        restart: args.chunks.restart,
        parts,
    };
    let start = Instant::now();
    let progress = Progress::new(&ground.loaded.scene.name);
    let chunks = work.run(&progress, |range, monitor| {
        let seen = match &points.columns {
            Some(_) => sees_points(&ground.bvh, &rows[range], columns, margin, monitor)?,
            None => sees_each_other(&ground.bvh, rows, range, margin, monitor)?,
        };
        Ok(seen
            .words()
            .iter()
            .flat_map(|word| word.to_le_bytes())
            .collect())
    })?;
    progress.finish();
    let mut document = Document {
        schema: "antumbra.visible/1",
        machine: version::machine(isa),
        scene: &ground.loaded.scene.name,
        outputs: args
            .output
            .iter()
            .map(|path| path.to_string_lossy().into_owned())
            .collect(),
        lines: args
            .lines
            .as_ref()
            .map(|path| path.to_string_lossy().into_owned()),
        shard: args.chunks.shard.map(|shard| shard.to_string()),
        triangles: ground.vertices.indices.len(),
        from: if args.viewshed {
            columns.len()
        } else {
            rows.len()
        },
        to: if args.viewshed {
            rows.len()
        } else {
            columns.len()
        },
        viewshed: args.viewshed,
        pairs: rows.len() as u64 * columns.len() as u64,
        visible_pairs: None,
        visible_share: None,
        load_seconds: ground.loaded.seconds,
        build_seconds: ground.build_seconds,
        trace_seconds: start.elapsed().as_secs_f64(),
    };
    let Some(found) = chunks else {
        json::write(&document, args.json.as_ref())?;
        tell(format_args!(
            "wrote {}, for merge",
            document.outputs.join(", ")
        ));
        return Ok(());
    };
    let words = found.iter().flat_map(|bytes| bytes.as_chunks::<8>().0);
    let words = words.map(|word| u64::from_le_bytes(*word)).collect();
    drop(found);
    let matrix = BitMatrix::from_words(rows.len(), columns.len(), words);
    let mut matrix =
        matrix.map_err(|_| Failure::Data("the chunks of an earlier run do not fit".into()))?;
    face(&mut matrix, &points);
    for path in &args.output {
        write(path, args, &ground, &points, &matrix)?;
    }
    if let Some(path) = &args.lines {
        lines(path, args.viewshed, &points, &matrix)?;
    }
    let visible = matrix.count();
    document.visible_pairs = Some(visible);
    document.visible_share = (document.pairs > 0).then(|| visible as f64 / document.pairs as f64);
    json::write(&document, args.json.as_ref())?;
    summarise(&document, visible, parts);
    Ok(())
}

fn write(
    path: &Path,
    args: &VisibleArgs,
    ground: &Ground,
    points: &Points,
    matrix: &BitMatrix,
) -> Result<(), Failure> {
    let _writing = crate::interrupt::writing();
    let counts = matrix.count_rows();
    let rows = &points.rows;
    match format(path)? {
        Format::Npz => {
            let column_counts = matrix.count_columns();
            let shape = [matrix.rows() as u64, matrix.columns() as u64];
            let columns = points.columns.as_ref().unwrap_or(rows);
            let [row_name, column_name] = match args.viewshed {
                true => ["to", "from"],
                false => ["from", "to"],
            };
            let entries = [
                Entry::new("visible", Array::Bits(matrix)),
                Entry::new("shape", Array::Counts(&shape)),
                Entry::new("row_counts", Array::Counts(&counts)),
                Entry::new("column_counts", Array::Counts(&column_counts)),
                Entry::new(row_name, Array::Points(&rows.points)),
                Entry::new(column_name, Array::Points(&columns.points)),
            ];
            output::check_room(path, npz_bytes(&entries))?;
            atomic_write(path, |file| write_npz(&entries, file))?;
        }
        Format::Csv => {
            output::check_room(path, 40 * rows.points.len() as u64)?;
            atomic_write(path, |file| {
                let name = if args.viewshed { "seen_by" } else { "sees" };
                writeln!(file, "x,y,z,{name}")?;
                for ([x, y, z], count) in rows.points.iter().zip(&counts) {
                    writeln!(file, "{x},{y},{z},{count}")?;
                }
                Ok(())
            })?;
        }
        Format::Ply => {
            let values: Vec<f32> = counts.iter().map(|&count| count as f32).collect();
            let options = heatmap::Options {
                legend: false,
                ..heatmap::Options::default()
            };
            let colours = heatmap::render(&values, values.len(), 1, &options)?;
            let level = vec![
                [0.0; 3];
                if rows.normals.is_empty() {
                    values.len()
                } else {
                    0
                }
            ];
            let mesh = ShadedMesh {
                positions: &rows.points,
                normals: if level.is_empty() {
                    &rows.normals
                } else {
                    &level
                },
                values: &values,
                colours: colours.pixels(),
                bent_normals: &[],
                indices: match rows.layout {
                    Layout::Vertices => &ground.vertices.indices,
                    Layout::List | Layout::Grid(_) => &[],
                },
            };
            output::check_room(path, mesh.bytes())?;
            let name = if args.viewshed { "seen_by" } else { "sees" };
            atomic_write(path, |file| mesh.write(name, file))?;
        }
        Format::Png => {
            let Layout::Grid(grid) = &rows.layout else {
                return Err(Failure::Usage("a map needs --grid".into()));
            };
            let values: Vec<f32> = counts.iter().map(|&count| count as f32).collect();
            let field = grid.picture(&values);
            let options = heatmap::Options::default();
            heatmap::render(&field, grid.width, grid.height, &options)?.write(path)?;
        }
    }
    Ok(())
}

/// Writes the pairs that see each other; of points of one list, each pair once.
fn lines(path: &Path, viewshed: bool, points: &Points, matrix: &BitMatrix) -> Result<(), Failure> {
    let _writing = crate::interrupt::writing();
    let once = points.columns.is_none();
    let pairs = || {
        (0..matrix.rows()).flat_map(move |row| {
            let columns = ones(matrix.row(row)).filter(move |&column| !once || column > row);
            columns.map(move |column| (row, column))
        })
    };
    let count = pairs().count() as u64;
    if format(path)? == Format::Csv {
        output::check_room(path, 16 * count)?;
        return Ok(atomic_write(path, |file| {
            writeln!(file, "from,to")?;
            pairs().try_for_each(|(row, column)| match viewshed {
                true => writeln!(file, "{column},{row}"),
                false => writeln!(file, "{row},{column}"),
            })
        })?);
    }
    let columns = if once { &[][..] } else { points.columns() };
    let first = if once { 0 } else { points.row_eyes.len() };
    let vertices = points.row_eyes.len() + columns.len();
    output::check_room(path, 12 * vertices as u64 + 8 * count)?;
    Ok(atomic_write(path, |file| {
        write!(
            file,
            "ply\nformat binary_little_endian 1.0\ncomment written by antumbra\nelement vertex {vertices}\n\
             property float x\nproperty float y\nproperty float z\nelement edge {count}\n\
             property int vertex1\nproperty int vertex2\nend_header\n"
        )?;
        for x in points.row_eyes.iter().chain(columns).flatten() {
            file.write_all(&x.to_le_bytes())?;
        }
        pairs().try_for_each(|(row, column)| {
            file.write_all(&(row as u32).to_le_bytes())?;
            file.write_all(&((first + column) as u32).to_le_bytes())
        })
    })?)
}

fn summarise(document: &Document<'_>, visible: u64, parts: Option<&[Part]>) {
    tell(format_args!(
        "{}: {} triangles, loaded in {:.2} s, tree built in {:.2} s",
        document.scene,
        count(document.triangles as u64),
        document.load_seconds,
        document.build_seconds,
    ));
    tell(format_args!(
        "{} of {} pairs see each other ({:.1} %)",
        count(visible),
        count(document.pairs),
        100.0 * visible as f64 / (document.pairs as f64).max(1.0),
    ));
    tell(format_args!(
        "{}; wrote {}",
        chunks::work_done("pairs", document.pairs, document.trace_seconds, parts),
        document.outputs.join(", "),
    ));
}
