//! The index of a raster of many files, as text.

use std::io::Read;
use std::path::{Path, PathBuf};

use antumbra_files::{open, write_file};
use antumbra_terrain::{Monitor, Tile};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::peaks::BLOCK;
use crate::{Error, survey};

/// First words of an index.
const SCHEMA: &str = "antumbra.index/1";

/// A raster of many files.
///
/// Its text has a JSON object in each line, in UTF-8: first the whole with the fields below and `"schema": "antumbra.index/1"`, then
/// each file. Names of files are relative to the folder of the index if they are in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Index {
    /// Numbers of columns and rows of the whole.
    pub columns: usize,
    /// See `columns`.
    pub rows: usize,
    /// Map coordinates of corners of cells: `x = t[0] + c t[1] + r t[2]` and `y = t[3] + c t[4] + r t[5]`.
    pub transform: [f64; 6],
    /// Number of cells with data.
    pub cells: u64,
    /// Least coordinates of the centres of cells with data: x, y and height.
    pub low: [f64; 3],
    /// Largest coordinates of them. North, and the place of the sun, are as in the middle between both.
    pub high: [f64; 3],
    /// Units of the ground in a unit of the heights in files, if files say it. Heights are multiplied by it as they are read.
    pub height_factor: Option<f64>,
    /// Cells for which a file has another value than a file before it, which has the cell.
    pub differing: u64,
    /// Checksum of the file of peaks: XXH3, 64 bits, hexadecimal.
    #[serde(with = "hex")]
    pub peaks: u64,
    /// Files in the order in which they have a cell.
    #[serde(skip)]
    pub files: Vec<Listed>,
}

/// A file of a raster.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Listed {
    /// Name of the file.
    pub path: PathBuf,
    /// Column and row of its first cell in the whole.
    pub at: [usize; 2],
    /// Numbers of columns and rows.
    pub size: [usize; 2],
    /// Length in bytes.
    pub bytes: u64,
    /// Checksum of its bytes: XXH3, 64 bits, hexadecimal, as `xxhsum -H3` prints it.
    #[serde(with = "hex")]
    pub xxh3: u64,
    /// Largest height in each square of 512 x 512 cells from its first one on, row by row, of cells that no file before it has. Rounded up
    /// to single precision; `null` without data.
    pub peaks: Vec<Option<f32>>,
}

/// The first line of an index.
#[derive(Serialize, Deserialize)]
struct Head<T> {
    schema: String,
    files: usize,
    #[serde(flatten)]
    index: T,
}

/// The kind of an index.
#[derive(Deserialize)]
struct Kind {
    schema: String,
}

/// Reads an index with this schema, and its files. `check` gets the whole, a file, and the folder where names of files begin.
pub(crate) fn read_lines<T: DeserializeOwned, F: DeserializeOwned>(
    path: &Path,
    schema: &str,
    check: impl Fn(&T, &mut F, &Path) -> Result<(), &'static str>,
) -> Result<(T, Vec<F>), Error> {
    let mut text = String::new();
    let read = open(path).and_then(|mut file| file.read_to_string(&mut text));
    read.map_err(|error| Error::io(path, error))?;
    let mut lines = text.lines().enumerate();
    let bad =
        |line: usize, reason: String| Error::broken(path, format!("line {}: {reason}", line + 1));
    let (_, head) = lines.next().unwrap_or((0, ""));
    let unread = |error| bad(0, format!("wanted an index of `antumbra index`: {error}"));
    let Kind { schema: found } = serde_json::from_str(head).map_err(unread)?;
    if found != schema {
        return Err(bad(
            0,
            format!("found the schema `{found}`, wanted {schema}"),
        ));
    }
    let head: Head<T> = serde_json::from_str(head).map_err(unread)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut files = Vec::new();
    for (number, line) in lines {
        let mut file =
            serde_json::from_str(line).map_err(|error| bad(number, error.to_string()))?;
        check(&head.index, &mut file, folder).map_err(|reason| bad(number, reason.into()))?;
        files.push(file);
    }
    match files.len() == head.files {
        true => Ok((head.index, files)),
        false => {
            let (found, wanted) = (files.len(), head.files);
            let reason = format!("found {found} files, wanted {wanted}; it is cut short");
            Err(Error::broken(path, reason))
        }
    }
}

/// Writes an index, with names of files that are relative to its folder if they are in it: `named` gives a file another name.
pub(crate) fn write_lines<T: Serialize, F: Serialize>(
    path: &Path,
    (schema, index): (&str, &T),
    (files, path_of): (&[F], fn(&F) -> &PathBuf),
    named: impl Fn(&F, &Path) -> F,
) -> Result<(), Error> {
    let text = |error: serde_json::Error| Error::broken(path, error.to_string());
    let head = Head {
        schema: schema.to_owned(),
        files: files.len(),
        index,
    };
    let mut lines = serde_json::to_string(&head).map_err(text)?;
    let whole = std::path::absolute(path).map_err(|error| Error::io(path, error))?;
    let folder = whole.parent().unwrap_or(Path::new(""));
    for file in files {
        let name = path_of(file);
        let file = named(file, name.strip_prefix(folder).unwrap_or(name));
        lines.push('\n');
        lines.push_str(&serde_json::to_string(&file).map_err(text)?);
    }
    lines.push('\n');
    write_file(path, |file| file.write_all(lines.as_bytes()))
        .map_err(|error| Error::io(path, error))
}

impl Index {
    /// Makes the index of files, and writes it with its file of peaks, `path.peaks`. All cells are read once. Where several files have
    /// data in a cell, the first one has the cell.
    ///
    /// # Errors
    /// A file cannot be read, its cells do not fall on the cells of the others, heights of files have different units, or no cell has data;
    /// [`antumbra_terrain::Error::Cancelled`].
    pub fn make(files: &[PathBuf], path: &Path, monitor: &dyn Monitor) -> Result<Self, Error> {
        let index = survey::survey(files, path, monitor)?;
        index.write(path)?;
        Ok(index)
    }

    /// Reads an index.
    ///
    /// # Errors
    /// There is no such file, or it is no index.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let check = |index: &Self, file: &mut Listed, folder: &Path| {
            let [across, down] = file.size.map(|cells| cells.div_ceil(BLOCK));
            let whole = [index.columns, index.rows];
            let is_in = [0, 1].iter().all(|&axis| {
                let end = file.at[axis].checked_add(file.size[axis]);
                file.size[axis] > 0 && end.is_some_and(|end| end <= whole[axis])
            });
            file.path = folder.join(&file.path);
            match is_in && across.checked_mul(down) == Some(file.peaks.len()) {
                true => Ok(()),
                false => Err(
                    "wanted a file inside of the whole, and a peak for each square of 512 cells",
                ),
            }
        };
        let (mut index, files) = read_lines(path, SCHEMA, check)?;
        index.files = files;
        Ok(index)
    }

    /// Writes the text.
    fn write(&self, path: &Path) -> Result<(), Error> {
        let named = |file: &Listed, name: &Path| Listed {
            path: name.to_path_buf(),
            ..file.clone()
        };
        write_lines(
            path,
            (SCHEMA, self),
            (&self.files, |file| &file.path),
            named,
        )
    }

    /// All cells.
    pub fn whole(&self) -> Tile {
        Tile {
            at: [0; 2],
            size: [self.columns, self.rows],
        }
    }

    /// Whether the whole has cells without data, which decides last digits of [`TileSweep`](antumbra_terrain::TileSweep).
    pub fn has_holes(&self) -> bool {
        self.cells < self.columns as u64 * self.rows as u64
    }

    /// Transform of a raster that begins at a column and row of the whole.
    pub fn transform_at(&self, [column, row]: [i64; 2]) -> [f64; 6] {
        let [x, a, b, y, d, e] = self.transform;
        let (column, row) = (column as f64, row as f64);
        [
            x + column * a + row * b,
            a,
            b,
            y + column * d + row * e,
            d,
            e,
        ]
    }
}

impl Listed {
    /// Its cells.
    pub fn tile(&self) -> Tile {
        Tile {
            at: self.at.map(|at| at as i64),
            size: self.size,
        }
    }

    /// Squares of 512 cells, row by row.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = Tile> + '_ {
        let [columns, rows] = self.size;
        let firsts = (0..rows)
            .step_by(BLOCK)
            .flat_map(move |row| (0..columns).step_by(BLOCK).map(move |column| [column, row]));
        firsts.map(move |[column, row]| Tile {
            at: [(self.at[0] + column) as i64, (self.at[1] + row) as i64],
            size: [BLOCK.min(columns - column), BLOCK.min(rows - row)],
        })
    }
}

/// Checksums as text.
pub(crate) mod hex {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub fn serialize<S: Serializer>(number: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&format!("{number:016x}"))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        let text = String::deserialize(deserializer)?;
        u64::from_str_radix(&text, 16)
            .map_err(|_| D::Error::custom(format!("found `{text}`, wanted 16 hexadecimal digits")))
    }
}
