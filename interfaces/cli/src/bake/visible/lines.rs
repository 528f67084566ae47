//! Lines of sight: `visible --lines`.

use std::path::Path;

use antumbra::LocalOrigin;
use antumbra_bake::{BitMatrix, Curvature, ones};
use antumbra_image::atomic_write;

use crate::bake::files::Format;
use crate::exit::Failure;
use crate::output;

/// Format of lines of sight.
pub fn format(path: &Path) -> Result<Format, Failure> {
    Format::of(path, &["csv", "ply"], "lines are written as csv or ply")
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
pub fn write(path: &Path, ends: &Ends<'_>, matrix: &BitMatrix) -> Result<(), Failure> {
    let once = ends.columns.is_none();
    let (local, is_viewshed) = (ends.local, ends.is_viewshed);
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
