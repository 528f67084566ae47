//! Windows of one file, without reading the rest of it.

use std::fs::File;
use std::path::{Path, PathBuf};

use crate::geotiff::Band;
use crate::grid::check_size;
use crate::npy::Array;
use crate::{Error, Grid, Purpose, SMALL, State, asc, first_bytes, mirror, open_within, vrt};
use crate::{beside_mask, broken, check_lengths, extension, system_beside, world_file};

/// A raster file of which windows are read, since a worker that computes one tile of a country needs only some cells of some
/// files.
///
/// Heights have the bits that [`read`](crate::read) has there. The file is open only during a call, so thousands of `Parts` need
/// no handles, and many threads may read from one of them.
///
/// | format | what a window reads |
/// |---|---|
/// | `.tif`, `.tiff` | the strips and tiles that it touches, of those without compression only the rows, and as much of a mask |
/// | `.npy` | its cells, row by row; column by column if the array is in the order of Fortran |
/// | `.asc` | the whole text in each call |
///
/// A `.vrt` is refused, since its cells are in other files.
///
/// # Example
/// ```
/// use antumbra_raster::{Grid, Parts, Quantity, write};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("hills.tif");
/// let grid = Grid::north_up([600, 600], [600_000.0, 5_340_000.0], 10.0);
/// let heights: Vec<f32> = (0..600 * 600).map(|cell| (cell % 600) as f32).collect();
/// std::fs::write(&path, write(&path, &grid, &heights, &[Quantity { name: "height", unit: "m" }])?)?;
///
/// let hills = Parts::open(&path)?;
/// assert_eq!(hills.grid(), &grid);
/// assert_eq!(hills.chunk(), [512, 512]);
/// assert_eq!(hills.read([510, 20, 3, 2])?, [510.0, 511.0, 512.0, 510.0, 511.0, 512.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Parts {
    path: PathBuf,
    state: State,
    grid: Grid,
    /// The cells in the order of the file.
    pub(crate) stored: Grid,
    format: Format,
}

#[derive(Debug)]
enum Format {
    /// With the state of the file of the mask.
    Tiff(Box<Band>, Option<State>),
    Npy(Array),
    /// Whether numbers stay as they are stored.
    Asc(bool),
}

/// As much memory as is needed.
const ANY: (u64, Purpose) = (u64::MAX, Purpose::Values);

/// Where the cells of a file are, by its header, in rows from north to south and columns from west to east.
pub fn grid(path: &Path) -> Result<Grid, Error> {
    Parts::with_header(path, ANY, false).map(|parts| parts.grid)
}

/// A `.vrt` that is no whole scene, or a source of another.
const VRT: [&str; 2] = ["a part", "another .vrt"];

const CHANGED: &str = "it was changed after its header was read";

/// Opens a file again. Places of cells in another file would be wrong.
fn reopen(path: &Path, known: State) -> Result<File, Error> {
    match open_within(path, u64::MAX)? {
        (file, state) if state == known => Ok(file),
        _ => Err(broken(path, CHANGED.into())),
    }
}

impl Parts {
    /// Reads the header of a file, and what lies beside it, as [`read`](crate::read) does.
    ///
    /// # Errors
    /// As [`read`](crate::read), for what the header says; also of a `.vrt`.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let parts = Self::with_header(path, ANY, false)?;
        check_lengths(path, &parts.grid)?;
        Ok(parts)
    }

    /// Reads the header of a file whose lengths may not be those on the ground. The whole has to fit into memory for a purpose.
    pub(crate) fn with_header(
        path: &Path,
        (max_bytes, purpose): (u64, Purpose),
        is_raw: bool,
    ) -> Result<Self, Error> {
        let (mut file, state) = open_within(path, max_bytes)?;
        let room = purpose.room(max_bytes - state.0);
        let check = |size| check_size(size, room);
        let text = |error: Error| error.to_string();
        let read = || match extension(path).as_str() {
            "tif" | "tiff" => {
                let world_file = || world_file(path, &["tfw", "wld"]);
                let (mut band, grid) = Band::new(&mut file, &world_file, is_raw, check)?;
                let (beside, mut state) = (beside_mask(path), None);
                if !is_raw && band.mask.is_none() && beside.is_file() {
                    let (mut outer, now) = open_within(&beside, u64::MAX).map_err(text)?;
                    band.take_mask(&mut outer, check)?;
                    state = Some(now);
                }
                Ok((grid, Format::Tiff(Box::new(band), state)))
            }
            "npy" => {
                let bytes = first_bytes(path, file, SMALL).map_err(text)?;
                let array = Array::new(&bytes, state.0, &|| world_file(path, &["wld"]))?;
                check([array.grid.width, array.grid.height])?;
                Ok((array.grid.clone(), Format::Npy(array)))
            }
            "asc" => {
                let bytes = first_bytes(path, file, SMALL).map_err(text)?;
                let mut seen = None;
                let read = asc::read(&bytes, is_raw, |grid| {
                    seen = Some(grid.clone());
                    Err(String::new())
                });
                let grid = seen.map_or(read.map(|raster| raster.grid), Ok)?;
                check([grid.width, grid.height])?;
                Ok((grid, Format::Asc(is_raw)))
            }
            "vrt" => Err(vrt::not_read(VRT[usize::from(is_raw)])),
            other => Err(format!("`{other}` is no extension of a raster")),
        };
        let (mut stored, format) = read().map_err(|reason| broken(path, reason))?;
        if stored.crs.is_none() {
            stored.crs = system_beside(path);
        }
        Ok(Self {
            path: path.to_path_buf(),
            state,
            grid: stored.clone().upright(),
            stored,
            format,
        })
    }

    /// Where the cells are: the grid that [`read`](crate::read) gives.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// What heights are multiplied by, as [`Raster::height_factor`](crate::Raster::height_factor).
    pub fn height_factor(&self) -> Option<f64> {
        match &self.format {
            Format::Tiff(band, _) => band.height_factor,
            _ => None,
        }
    }

    /// Columns and rows of cells that are read at once, such as a tile of the file. Windows that begin and end at multiples of
    /// them read nothing twice. In a file that is stored from the south or the east, they are counted from its last row or column.
    pub fn chunk(&self) -> [usize; 2] {
        match &self.format {
            Format::Tiff(band, _) => band.page.chunk(),
            Format::Npy(array) => array.chunk(),
            Format::Asc(_) => [self.grid.width, self.grid.height],
        }
    }

    /// Heights of the cells `[column, row, columns, rows]`, row by row, with the bits of [`read`](crate::read); NaN without data.
    /// A window without cells has none. Memory for the window is needed twice, and for a [`chunk`](Self::chunk).
    ///
    /// # Errors
    /// Windows that are not inside of the [`grid`](Self::grid). Pixels that are damaged or not read, of the strips and tiles that
    /// the window touches. A file that is not the one that was opened, by its length and its time of change.
    pub fn read(&self, window: [usize; 4]) -> Result<Vec<f64>, Error> {
        let Grid { width, height, .. } = self.grid;
        let [left, top, columns, rows] = window;
        let [right, bottom] = [left.saturating_add(columns), top.saturating_add(rows)];
        if right > width || bottom > height {
            let reason =
                format!("the window {window:?} is not inside of its {width} x {height} cells");
            return Err(broken(&self.path, reason));
        }
        if columns == 0 || rows == 0 {
            return Ok(Vec::new());
        }
        let turned = self.stored.mirrored();
        let left = if turned[0] { width - right } else { left };
        let top = if turned[1] { height - bottom } else { top };
        let mut values = self.values([left, top, columns, rows])?;
        mirror(&mut values, columns, turned);
        Ok(values)
    }

    /// Heights of cells, of which there is one or more, in the order of the file.
    pub(crate) fn values(&self, window: [usize; 4]) -> Result<Vec<f64>, Error> {
        let mut file = reopen(&self.path, self.state)?;
        let values = match &self.format {
            Format::Tiff(band, mask) => {
                let mask = mask.map(|state| reopen(&beside_mask(&self.path), state));
                band.values(&mut file, mask.transpose()?.as_mut(), window)
            }
            Format::Npy(array) => array.values(&mut file, window),
            Format::Asc(is_raw) => {
                let [left, top, columns, rows] = window;
                let Grid { width, height, .. } = self.stored;
                let text = first_bytes(&self.path, file, u64::MAX)?;
                let read = asc::read(&text, *is_raw, |grid| {
                    let is_same = [grid.width, grid.height] == [width, height];
                    is_same.then_some(()).ok_or(CHANGED.into())
                });
                read.map(|raster| {
                    let lines = raster.values.chunks(width).skip(top).take(rows);
                    let lines: Vec<_> = lines.map(|line| &line[left..][..columns]).collect();
                    lines.concat()
                })
            }
        };
        values.map_err(|reason| broken(&self.path, reason))
    }
}
