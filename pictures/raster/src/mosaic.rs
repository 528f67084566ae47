//! Several files as one raster.
//!
//! All lie on one lattice: cells of one file fall on cells of the others, whole columns and rows away. Headers are read first, so
//! that a mosaic that does not fit is refused at once. Then the files follow one after the other, so no more is in memory than the
//! whole and one of them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::grid::{check_size, room_for};
use crate::parts::grid;
use crate::{EXTENSIONS, Error, Grid, Purpose, Raster};
use crate::{broken, check_lengths, companions, extension, stored, vrt};

/// Files beside a raster whose headers [`neighbours`] reads.
const MOST_BESIDE: usize = 400;

/// A raster, perhaps of several files.
#[derive(Clone, Debug)]
pub struct Mosaic {
    /// All cells, NaN where no file has data.
    pub raster: Raster,
    /// Every file that was read.
    pub inputs: Vec<PathBuf>,
    /// What there is to say about the files; `None` of a single one.
    pub tiles: Option<Tiles>,
}

/// What was found while several files became one raster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tiles {
    /// Number of files, or of windows of files in a `.vrt`.
    pub files: usize,
    /// Cells for which a file has another value than those before it.
    pub differing: u64,
    /// Whether the last file has such cells, as in a `.vrt`, and not the first.
    pub is_last_above: bool,
    /// Cells for which no file has data.
    pub empty: u64,
}

/// Whether a scene is a height raster, by its name: a file with one of [`EXTENSIONS`], or a folder.
pub fn is_raster(path: &Path) -> bool {
    EXTENSIONS.contains(&&*extension(path)) || path.is_dir()
}

/// Reads files, folders of files, or one `.vrt`, as one raster within `max_bytes` of memory.
///
/// Of a folder, the files `.tif`, `.tiff`, `.asc`, and `.npy` with a `.wld` beside it count, by their names. All files have the same
/// cells and the same coordinate system. Where several have data in a cell, the first one has it.
///
/// A `.vrt` of GDAL has windows of files in whole cells, without resampling; there the last one has a cell. Cells without a file
/// are NaN, also where GDAL has 0 because the `.vrt` names no `NoDataValue`.
///
/// ```no_run
/// # use antumbra_raster::{Purpose, read_all};
/// let hills = read_all(&["tiles".into()], 8 << 30, Purpose::Values)?;
/// println!("{:?}: {:?}", hills.raster.grid, hills.tiles);
/// # Ok::<(), antumbra_raster::Error>(())
/// ```
///
/// # Errors
/// As [`read`](crate::read), of any of the files. A folder without a raster, files whose cells do not fall on each other, and what a
/// `.vrt` has beside windows of files.
pub fn read_all(paths: &[PathBuf], max_bytes: u64, purpose: Purpose) -> Result<Mosaic, Error> {
    let files = files(paths)?;
    match &files[..] {
        [file] if extension(file) == "vrt" => vrt::read(file, max_bytes, purpose),
        [file] => {
            let raster = stored(file, max_bytes, purpose, false)?.north_up();
            check_lengths(file, &raster.grid)?;
            Ok(Mosaic {
                raster,
                inputs: with_companions(&files),
                tiles: None,
            })
        }
        _ => joined(&files, max_bytes, purpose),
    }
}

/// Files, and those beside them.
fn with_companions(files: &[PathBuf]) -> Vec<PathBuf> {
    let beside = files.iter().flat_map(|file| companions(file));
    files.iter().cloned().chain(beside).collect()
}

/// Whether a file can be one of several.
fn is_tile(path: &Path) -> bool {
    let extension = extension(path);
    extension != "vrt" && EXTENSIONS.contains(&&*extension)
}

/// Rasters of a folder, by name.
fn rasters_in(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let entries = fs::read_dir(folder).map_err(|error| broken(folder, error.to_string()))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let has_place = extension(path) != "npy" || path.with_extension("wld").is_file();
        is_tile(path) && has_place && !name.starts_with('.') && path.is_file()
    });
    files.sort();
    let reason = "it is a folder without a height raster: no .tif, no .asc, and no .npy with a .wld beside it";
    match files.is_empty() {
        true => Err(broken(folder, reason.into())),
        false => Ok(files),
    }
}

/// Rasters beside one that continue it on the same lattice, by their headers. So shadows and horizons of its cells do not see all
/// that is there. Of large folders, only some hundred files with names near its own are looked at, and unreadable ones are left out.
pub fn neighbours(path: &Path) -> Vec<PathBuf> {
    let Ok(own) = grid(path) else {
        return Vec::new();
    };
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    let mut all = rasters_in(folder.unwrap_or(Path::new("."))).unwrap_or_default();
    let is_own = |other: &PathBuf| other.file_name() == path.file_name();
    let at = all.iter().position(is_own).unwrap_or(0);
    all.drain(..at.saturating_sub(MOST_BESIDE / 2));
    all.truncate(MOST_BESIDE);
    let sizes = [own.width, own.height].map(|size| size as i64);
    all.retain(|other| {
        let other = grid(other).ok();
        let Some((place, other)) = other.and_then(|other| Some((own.place_of(&other)?, other)))
        else {
            return false;
        };
        let [columns, rows] = [other.width, other.height].map(|size| size as i64);
        let ends = [place[0] + columns, place[1] + rows];
        let touches = |axis: usize| place[axis] <= sizes[axis] && ends[axis] >= 0;
        let is_beyond = |axis: usize| place[axis] < 0 || ends[axis] > sizes[axis];
        touches(0) && touches(1) && (is_beyond(0) || is_beyond(1))
    });
    all
}

/// Files of rasters that are one, in order: of a folder, those that [`read_all`] reads.
///
/// # Errors
/// A folder cannot be read, or has no raster; a file cannot be one of several.
pub fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    for path in paths {
        match path.is_dir() {
            true => files.extend(rasters_in(path)?),
            false => files.push(path.clone()),
        }
    }
    match files.iter().find(|file| !is_tile(file)) {
        Some(file) if files.len() > 1 => {
            let reason = "several files are one raster if each is a .tif, .asc or .npy; give any other by itself";
            Err(broken(file, reason.into()))
        }
        _ => Ok(files),
    }
}

/// The cells of files that are one raster.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    /// All cells, from the north west on.
    pub whole: Grid,
    /// Cells of each file.
    pub grids: Vec<Grid>,
    /// Column and row of the first cell of each file.
    pub places: Vec<[usize; 2]>,
}

impl Lattice {
    /// Reads the headers of files.
    ///
    /// # Errors
    /// Cells of files do not fall on each other, or coordinates are no lengths.
    pub fn of(files: &[PathBuf]) -> Result<Self, Error> {
        let grids = files.iter().map(|file| grid(file));
        let grids = grids.collect::<Result<Vec<Grid>, Error>>()?;
        let [first, ..] = &grids[..] else {
            return Err(broken(Path::new(""), "no file".into()));
        };
        let mut places = Vec::with_capacity(files.len());
        for (file, grid) in files.iter().zip(&grids) {
            let texts = || [text(file, grid), text(&files[0], first)].join(", and ");
            let help = "bring both to the same cells, as with gdalwarp -t_srs and -tr with -tap";
            let place = first.place_of(grid);
            places.push(place.ok_or_else(|| broken(file, format!("{}; {help}", texts())))?);
        }
        let mut ends = [places[0]; 2];
        for (place, grid) in places.iter().zip(&grids) {
            for (axis, size) in [grid.width, grid.height].into_iter().enumerate() {
                ends[0][axis] = ends[0][axis].min(place[axis]);
                ends[1][axis] = ends[1][axis].max(place[axis] + size as i64);
            }
        }
        let [low, high] = ends;
        // The file in the north west, so that the whole begins where it does.
        let corner = (0..files.len()).min_by_key(|&index| (places[index][1], places[index][0]));
        let corner = corner.unwrap_or_default();
        let mut whole = grids[corner].clone();
        let [x, y] = whole.corner((low[0] - places[corner][0]) as f64, 0.0);
        (whole.transform[0], whole.transform[3]) = (x, y);
        [whole.width, whole.height] = [0, 1].map(|axis| (high[axis] - low[axis]) as usize);
        check_lengths(&files[0], &whole)?;
        let places = places.into_iter();
        let places = places.map(|place| [0, 1].map(|axis| (place[axis] - low[axis]) as usize));
        Ok(Self {
            whole,
            grids,
            places: places.collect(),
        })
    }
}

/// Several files, of which the first that has data in a cell has the cell.
fn joined(files: &[PathBuf], max_bytes: u64, purpose: Purpose) -> Result<Mosaic, Error> {
    let lattice = Lattice::of(files)?;
    let whole = Whole::new(lattice.whole, max_bytes, purpose);
    let mut whole = whole.map_err(|reason| broken(&files[0], reason))?;
    for ((file, grid), place) in files.iter().zip(&lattice.grids).zip(lattice.places) {
        let tile = stored(file, whole.left(max_bytes), Purpose::Values, false)?.north_up();
        if tile.grid != *grid {
            return Err(broken(file, "it was changed while it was read".into()));
        }
        let window = [0, 0, grid.width, grid.height];
        let known = |value: f64| (!value.is_nan()).then_some(value);
        let put = whole.put(&tile, window, place.map(|at| at as i64), known);
        put.map_err(|reason| broken(file, reason))?;
    }
    Ok(whole.finish(files))
}

/// Cells of a file as a clause.
fn text(file: &Path, grid: &Grid) -> String {
    let name = file.file_name().unwrap_or_default().display();
    let [x, a, b, y, d, e] = grid.transform;
    let turn = match [b, d] {
        [0.0, 0.0] => String::new(),
        _ => format!(" turned by {b} and {d}"),
    };
    let system = grid.system();
    format!(
        "{name} has cells of {a} x {}{turn} from {x} {y} on in {system}",
        -e
    )
}

/// A raster that files fill.
pub struct Whole {
    pub raster: Raster,
    pub tiles: Tiles,
}

impl Whole {
    /// Cells without data.
    pub fn new(grid: Grid, max_bytes: u64, purpose: Purpose) -> Result<Self, String> {
        check_size([grid.width, grid.height], purpose.room(max_bytes))?;
        let mut values = room_for(grid.width * grid.height)?;
        values.resize(grid.width * grid.height, f64::NAN);
        let raster = Raster {
            grid,
            values,
            height_factor: None,
        };
        let tiles = Tiles::default();
        Ok(Self { raster, tiles })
    }

    /// Bytes that are left for a file beside the whole.
    pub fn left(&self, max_bytes: u64) -> u64 {
        max_bytes.saturating_sub(size_of_val(&*self.raster.values) as u64)
    }

    /// Puts the cells `[column, row, columns, rows]` of a tile to a column and row of the whole. `value` says what a cell is;
    /// `None` leaves it to other files. Refuses heights that are not in the unit of those before.
    pub fn put(
        &mut self,
        tile: &Raster,
        [left, top, columns, rows]: [usize; 4],
        [column, row]: [i64; 2],
        mut value: impl FnMut(f64) -> Option<f64>,
    ) -> Result<(), String> {
        let known = &mut self.raster.height_factor;
        let [own, before] = [tile.height_factor, *known].map(|factor| factor.unwrap_or(1.0));
        if self.tiles.files > 0 && own != before {
            return Err(format!(
                "a unit of its heights is {own} of the ground, and in files before it {before}; bring all to one unit"
            ));
        }
        *known = known.or(tile.height_factor);
        self.tiles.files += 1;
        let (width, height) = (self.raster.grid.width, self.raster.grid.height);
        // Cells beyond the border are left out.
        let inside = |at: i64, number: usize, size: usize| {
            (-at).max(0)..(number as i64).min(size as i64 - at)
        };
        for y in inside(row, rows, height) {
            for x in inside(column, columns, width) {
                let from = (top + y as usize) * tile.grid.width + left + x as usize;
                let Some(found) = value(tile.values[from]) else {
                    continue;
                };
                let cell = (row + y) as usize * width + (column + x) as usize;
                let cell = &mut self.raster.values[cell];
                let is_other = !cell.is_nan() && !found.is_nan() && *cell != found;
                self.tiles.differing += u64::from(is_other);
                if self.tiles.is_last_above || cell.is_nan() {
                    *cell = found;
                }
            }
        }
        Ok(())
    }

    /// The raster of these files.
    pub fn finish(self, files: &[PathBuf]) -> Mosaic {
        let Self { raster, mut tiles } = self;
        let empty = raster.values.iter().filter(|value| value.is_nan());
        tiles.empty = empty.count() as u64;
        Mosaic {
            raster: raster.north_up(),
            inputs: with_companions(files),
            tiles: Some(tiles),
        }
    }
}
