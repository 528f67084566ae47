//! Formats and writers of results.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

use antumbra::LocalOrigin;
use antumbra_bake::{Entry, Label, Layout, Mesh, Sensors, ShadedMesh, npz_bytes, write_npz};
use antumbra_image::{atomic_write, heatmap};

use crate::exit::Failure;
use crate::output;

/// Formats, by extension.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Format {
    Csv,
    Glb,
    Npz,
    Picture,
    Ply,
    /// GeoTIFF, .asc or .npy.
    Raster,
}

impl Format {
    /// Format of results of sensors.
    pub fn of_sensors(path: &Path) -> Result<Self, Failure> {
        let known = [
            "csv", "ply", "png", "svg", "pdf", "npz", "tif", "tiff", "asc", "npy",
        ];
        let sentence = "results are written as csv, ply, npz, png, svg, pdf, tif, asc or npy";
        Self::of(path, &known, sentence)
    }

    /// Format of a file, by one of the known extensions. Streams have the first one.
    pub fn of(path: &Path, known: &[&str], sentence: &str) -> Result<Self, Failure> {
        let extension = path.extension().unwrap_or_default();
        let mut all = known.iter();
        let found = all.find(|known| extension.eq_ignore_ascii_case(known));
        let stream = known.first().filter(|_| output::is_stream(path));
        match found.or(stream) {
            Some(&"csv") => Ok(Self::Csv),
            Some(&"glb") => Ok(Self::Glb),
            Some(&"npz") => Ok(Self::Npz),
            Some(&"ply") => Ok(Self::Ply),
            Some(&("tif" | "tiff" | "asc" | "npy")) => Ok(Self::Raster),
            Some(_) => Ok(Self::Picture),
            None => Err(Failure::name(path, sentence)),
        }
    }
}

/// Writes arrays.
pub fn npz(path: &Path, entries: &[Entry<'_>]) -> Result<(), Failure> {
    output::check_room(path, npz_bytes(entries))?;
    Ok(atomic_write(path, |file| write_npz(entries, file))?)
}

/// Writes a mesh as .ply; `name` is the name of the value.
pub fn ply(path: &Path, name: &str, mesh: &ShadedMesh<'_>) -> Result<(), Failure> {
    output::check_room(path, mesh.bytes())?;
    Ok(atomic_write(path, |file| mesh.write(name, file))?)
}

/// Writes sensors in colours: as the mesh where they are its vertices. Sensors in free space have the normal `level`, and
/// `range` are the ends of the colours.
pub fn coloured(
    path: &Path,
    (name, values): (&str, &[f32]),
    sensors: &Sensors,
    (mesh, local): (&Mesh, LocalOrigin),
    (level, range): ([f32; 3], heatmap::Range),
) -> Result<(), Failure> {
    let options = heatmap::Options {
        legend: false,
        range,
    };
    let colours = heatmap::render(values, values.len(), 1, &options)?;
    let normals = match sensors.normals.is_empty() {
        true => &vec![level; values.len()],
        false => &sensors.normals,
    };
    let mesh = ShadedMesh {
        positions: &sensors.points,
        local,
        normals,
        values,
        colours: colours.pixels(),
        bent_normals: &[],
        indices: match sensors.layout {
            Layout::Vertices => &mesh.indices,
            Layout::List | Layout::Grid(_) => &[],
        },
    };
    ply(path, name, &mesh)
}

/// A text as a field of a .csv. What a spreadsheet would take for a formula gets an apostrophe, such as the name of an
/// object in a stranger's model.
pub fn field(text: &str) -> Cow<'_, str> {
    if text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text.parse::<f64>().is_err() {
        return Cow::Owned(field(&format!("'{text}")).into_owned());
    }
    match text.contains([',', '"', '\n', '\r']) {
        true => Cow::Owned(format!("\"{}\"", text.replace('"', "\"\""))),
        false => Cow::Borrowed(text),
    }
}

/// Decimals of coordinates that are measured from an origin.
const MICRO: f64 = 1e6;

/// A column of a table.
pub struct Column<'a> {
    name: String,
    value: Box<dyn Fn(usize) -> f64 + 'a>,
}

impl<'a> Column<'a> {
    /// A column with the value of each row.
    pub fn new(name: impl Into<String>, value: impl Fn(usize) -> f64 + 'a) -> Self {
        let (name, value) = (name.into(), Box::new(value));
        Self { name, value }
    }
}

/// Writes a table of sensors: their labels and more of them, points in the world, these normals if there are any, and columns.
pub fn table(
    path: &Path,
    (sensors, normals, local): (&Sensors, &[[f32; 3]], LocalOrigin),
    more_labels: &[Label],
    columns: &[Column<'_>],
) -> Result<(), Failure> {
    let points = &sensors.points;
    let labels = || sensors.labels.iter().chain(more_labels);
    // About 10 bytes of each number.
    output::check_room(path, 10 * (6 + columns.len() as u64) * points.len() as u64)?;
    Ok(atomic_write(path, |file| {
        let mut line = String::new();
        for label in labels() {
            line += &field(&label.column);
            line.push(',');
        }
        line += if normals.is_empty() {
            "x,y,z"
        } else {
            "x,y,z,nx,ny,nz"
        };
        for column in columns {
            line.push(',');
            line += &column.name;
        }
        writeln!(file, "{line}")?;
        for (index, point) in points.iter().enumerate() {
            line.clear();
            for label in labels() {
                line += &field(&label.values[index]);
                line.push(',');
            }
            let _ = match (local.origin, local.world(*point)) {
                ([0.0, 0.0, 0.0], _) => write!(line, "{},{},{}", point[0], point[1], point[2]),
                (_, world) => {
                    let [x, y, z] = world.map(|x| (x * MICRO).round() / MICRO);
                    write!(line, "{x},{y},{z}")
                }
            };
            for x in normals.get(index).into_iter().flatten() {
                let _ = write!(line, ",{x}");
            }
            for column in columns {
                // More digits than any ray can tell.
                let _ = write!(line, ",{}", ((column.value)(index) * 1e9).round() / 1e9);
            }
            writeln!(file, "{line}")?;
        }
        Ok(())
    })?)
}
