//! Height rasters as triangle meshes, and rasters of results with the same georeference.
//!
//! A digital elevation model (DEM) has a height in every cell. [`read`] reads a GeoTIFF, an ESRI ASCII grid (`.asc`) or a
//! `.npy` with a world file, [`read_all`] many of them as one raster: a folder, or a virtual raster of GDAL (`.vrt`).
//! [`Raster::mesh`] joins the centres of the cells to triangles. [`write`](fn@write) writes values of the same cells, where the
//! input was.
//!
//! ```
//! use antumbra_raster::{Grid, Raster};
//!
//! let text = "ncols 2\nnrows 2\nxllcorner 600000\nyllcorner 5340000\ncellsize 10\n1 2\n3 4\n";
//! let raster = Raster::from_asc(text)?;
//! let mesh = raster.mesh([600_000.0, 5_340_000.0, 0.0]);
//! assert_eq!(mesh.positions[0], [5.0, 15.0, 1.0], "the first cell is in the north west");
//! assert_eq!(mesh.indices.len(), 2);
//! # Ok::<(), String>(())
//! ```
//!
//! - `grid`: where the cells are;  `mesh`: cells as triangles
//! - `mosaic`: several files as one raster;  `vrt`: those that a .vrt names;  `parts`: windows of a file
//! - `geotiff`, `asc`, `npy`: one format each;  `pixels`: strips and tiles of a TIFF;  `cog`: GeoTIFFs that are written
//! - `crs`: coordinate systems as GeoTIFF describes them
#![forbid(unsafe_code)]

mod asc;
mod cog;
mod crs;
mod geotiff;
mod grid;
mod mesh;
mod mosaic;
mod npy;
mod parts;
mod pixels;
mod vrt;

use std::borrow::Cow;
use std::fs::{self, File};
use std::io::{self, Cursor, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use cog::Cog;
pub use crs::{Crs, Site, unit_name};
use geotiff::Band;
pub use grid::{Grid, RasterCells};
pub use mesh::RasterMesh;
pub use mosaic::{Lattice, Mosaic, Tiles, files, is_raster, neighbours, read_all};
pub use parts::Parts;
pub use vrt::{VrtTile, vrt_text};

/// Extensions of files that [`read`] reads.
pub const EXTENSIONS: [&str; 5] = ["tif", "tiff", "asc", "npy", "vrt"];

/// Reason why a raster was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file cannot be read, is not a regular file, or is larger than the memory allowed.
    #[error("error: {}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system, or the reason for the refusal.
        source: io::Error,
    },
    /// The contents of the file are wrong, or of a kind that is not read.
    #[error("{}: error: {reason}", path.display())]
    Broken {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Values cannot be written in the format.
    #[error("{}: {reason}", path.display())]
    Unwritable {
        /// Path of the file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
}

/// A raster of one value in each cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Where the cells are.
    pub grid: Grid,
    /// Values, `[height, width]`, the first row first. NaN where the file has no data.
    pub values: Vec<f64>,
    /// What the heights of the file were multiplied by, so that they have the unit of map coordinates; `None` if the file says
    /// nothing of their unit.
    pub height_factor: Option<f64>,
}

/// What a raster is read for, which says how much memory its cells take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Its values, of 8 bytes, and as much for what is made of them.
    Values,
    /// Its mesh besides: vertices, normals and two triangles for each cell. At most 2³² - 1 cells, since vertices are numbered by 32
    /// bits.
    Mesh,
}

impl Purpose {
    /// Cells that so many bytes have room for.
    fn room(self, bytes: u64) -> u64 {
        match self {
            Self::Values => bytes / (8 + 8),
            Self::Mesh => (bytes / (8 + 12 + 12 + 24 + 8)).min(u32::MAX.into()),
        }
    }
}

/// Reads a raster by its extension, within `max_bytes` of memory for the file and for what is made of its cells.
///
/// | format | values | georeference |
/// |---|---|---|
/// | `.tif`, `.tiff` | one band of numbers; the nodata value, scale and offset that GDAL notes; a mask in the file or beside it (`.tif.msk`) | tags of GeoTIFF, or a world file (`.tfw` or `.wld`) |
/// | `.asc` | numbers, `NODATA_value` | header |
/// | `.npy` | two dimensions of numbers; NaN is no data | a world file (`.wld`) |
///
/// A folder, or a `.vrt` of GDAL, is read as [`read_all`] does. [`Parts`] reads windows of files that are larger than the memory.
///
/// Rows come back from north to south and columns from west to east, unless the raster is turned or sheared.
///
/// A `.prj` file beside an `.asc`, a `.npy` or a plain `.tif` is its coordinate system.
///
/// # Errors
/// [`Error::Io`], or [`Error::Broken`] with the reason. Rasters in degrees are refused, since their cells have no length, and so are
/// those in systems such as Web Mercator, whose lengths at the middle of the raster are not those on the ground: see [`Site::stretch`].
pub fn read(path: &Path, max_bytes: u64, purpose: Purpose) -> Result<Raster, Error> {
    read_all(&[path.to_path_buf()], max_bytes, purpose).map(|mosaic| mosaic.raster)
}

/// Reads the numbers of one file as they are stored: no unit of heights, scale or mark of missing data changes them. So a result comes
/// back as it was written, for example hours of sun in a coordinate system whose heights are in feet.
///
/// # Errors
/// As [`read`], but for coordinates of any kind.
pub fn read_numbers(path: &Path, max_bytes: u64) -> Result<Raster, Error> {
    stored(path, max_bytes, Purpose::Values, true).map(Raster::north_up)
}

/// Reads one file as it is stored: rows and columns in its own order, and numbers without a meaning if it is to be `is_raw`.
fn stored(path: &Path, max_bytes: u64, purpose: Purpose, is_raw: bool) -> Result<Raster, Error> {
    let parts = Parts::with_header(path, (max_bytes, purpose), is_raw)?;
    let all = [0, 0, parts.stored.width, parts.stored.height];
    Ok(Raster {
        values: parts.values(all)?,
        height_factor: parts.height_factor(),
        grid: parts.stored,
    })
}

/// Refuses coordinates in which lengths are not those on the ground.
fn check_lengths(path: &Path, grid: &Grid) -> Result<(), Error> {
    let broken = |reason: String| broken(path, reason);
    let middle = grid.corner(0.5 * grid.width as f64, 0.5 * grid.height as f64);
    let Some(crs) = &grid.crs else {
        return Ok(());
    };
    if crs.is_geographic() {
        let utm = crs::utm(middle[1], middle[0]);
        return Err(broken(format!(
            "its coordinates are degrees, in which cells have no length; project it to metres first, as with \
             gdalwarp -t_srs {utm} in.tif out.tif"
        )));
    }
    let site = crs.site(middle);
    if let Some((site, scale)) = site.and_then(|site| Some((site, site.stretch()?))) {
        return Err(broken(format!(
            "lengths in {} are {scale:.3} times as long as on the ground at {:.2} degrees of latitude; project it first, as with \
             gdalwarp -t_srs {} in.tif out.tif",
            crs.name(),
            site.latitude,
            site.utm()
        )));
    }
    Ok(())
}

/// A file whose contents are wrong.
fn broken(path: &Path, reason: String) -> Error {
    Error::Broken {
        path: path.to_path_buf(),
        reason,
    }
}

/// Files beside a raster that [`read`] looks at, if they exist.
pub fn companions(path: &Path) -> Vec<PathBuf> {
    let beside = ["tfw", "wld", "prj"].map(|extension| path.with_extension(extension));
    let beside = beside.into_iter().chain([beside_mask(path)]);
    beside.filter(|path| path.is_file()).collect()
}

/// A named quantity with its unit, as a file describes it.
#[derive(Clone, Copy, Debug)]
pub struct Quantity<'a> {
    /// Name, such as `hours`.
    pub name: &'a str,
    /// Unit, such as `h`; empty if it has none.
    pub unit: &'a str,
}

/// Writes planes of values of all cells one after the other, so that only one is in memory: a band each of a `.tif`, or a `.npy`,
/// `[planes, height, width]`. The file is written from its start on. NaN is no data, and `bands` has a name and a unit for each plane.
///
/// # Errors
/// All of the file, and of `plane`, which makes each of them; other formats, and grids and bands that the format cannot hold.
///
/// # Panics
/// If a plane has not as many values as there are cells.
///
/// # Example
/// ```
/// use std::borrow::Cow;
/// use std::io::Cursor;
///
/// use antumbra_raster::{Grid, Quantity, Raster, write_planes};
///
/// let grid = Grid::north_up([600, 400], [600_000.0, 5_340_000.0], 10.0);
/// let band = |name| Quantity { name, unit: "degrees" };
/// let mut file = Cursor::new(Vec::new());
/// let bands = [band("horizon_000"), band("horizon_090")];
/// write_planes("angles.tif".as_ref(), &mut file, &grid, &bands, &mut |plane| {
///     Ok(Cow::Owned(vec![plane as f32; 600 * 400]))
/// })?;
/// assert_eq!(file.get_ref()[..4], *b"II\x2a\0");
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn write_planes<'a>(
    path: &Path,
    file: &mut (impl Write + Seek + ?Sized),
    grid: &Grid,
    bands: &[Quantity<'_>],
    plane: &mut dyn FnMut(usize) -> io::Result<Cow<'a, [f32]>>,
) -> io::Result<()> {
    match extension(path).as_str() {
        "npy" => npy::write(file, grid, bands.len(), plane),
        "tif" | "tiff" => Cog::new(grid, bands)?.write(file, plane),
        other => {
            let reason = format!("`{other}` is no extension of a raster of several planes");
            Err(io::Error::new(io::ErrorKind::InvalidInput, reason))
        }
    }
}

/// Values of the cells of a grid as the bytes of a file; NaN is no data. Where cells have several values, they come plane by plane,
/// and `bands` has a name and a unit for each plane.
///
/// | format | holds |
/// |---|---|
/// | `.tif`, `.tiff` | a cloud optimised GeoTIFF: a band of 32-bit floats for each plane in deflated tiles, the georeference, names and units, and overviews by halves, whose cells are means of the cells with data |
/// | `.asc` | an ESRI ASCII grid of one plane; cells must be squares with rows from north to south |
/// | `.npy` | `[height, width]` of 32-bit floats, or `[planes, height, width]`, without a georeference |
///
/// A `.tif` of more than 4 GB is a BigTIFF.
///
/// # Errors
/// [`Error::Unwritable`] if the format cannot hold the grid.
///
/// # Panics
/// If there are not as many values as cells for each band.
pub fn write(
    path: &Path,
    grid: &Grid,
    values: &[f32],
    bands: &[Quantity<'_>],
) -> Result<Vec<u8>, Error> {
    let cells = grid.width * grid.height;
    assert_eq!(values.len(), bands.len() * cells, "values for each cell");
    let written = match extension(path).as_str() {
        "asc" if bands.len() > 1 => {
            Err("it has one value for each cell; .tif and .npy have several".into())
        }
        "asc" => asc::write(grid, values),
        "npy" | "tif" | "tiff" => {
            let mut plane = |band: usize| Ok(Cow::Borrowed(&values[band * cells..][..cells]));
            let mut file = Memory::new(Vec::new());
            let written = write_planes(path, &mut file, grid, bands, &mut plane);
            let bytes = written.map(|()| file.into_inner());
            bytes.map_err(|error| error.to_string())
        }
        other => Err(format!("`{other}` is no extension of a raster")),
    };
    written.map_err(|reason| Error::Unwritable {
        path: path.to_path_buf(),
        reason,
    })
}

impl Raster {
    /// The same raster with its rows from north to south and its columns from west to east, if it has any: squares are cut along
    /// the same diagonal however a file stores them. Turned and sheared rasters stay as they are.
    fn north_up(mut self) -> Self {
        mirror(&mut self.values, self.grid.width, self.grid.mirrored());
        self.grid = self.grid.upright();
        self
    }

    /// Reads the text of an ESRI ASCII grid.
    ///
    /// # Errors
    /// What is wrong, with its line.
    pub fn from_asc(text: &str) -> Result<Self, String> {
        asc::read(text.as_bytes(), false, |_| Ok(()))
    }

    /// Reads the bytes of a GeoTIFF.
    ///
    /// # Errors
    /// What is wrong.
    pub fn from_geotiff(bytes: &[u8]) -> Result<Self, String> {
        let mut file = Cursor::new(bytes);
        let (band, grid) = Band::new(&mut file, &|| Ok(None), false, |_| Ok(()))?;
        let all = [0, 0, grid.width, grid.height];
        let raster = Self {
            values: band.values(&mut file, None, all)?,
            grid,
            height_factor: band.height_factor,
        };
        Ok(raster.north_up())
    }
}

/// Reverses the columns of rows of values, and their rows, or one of them.
fn mirror(values: &mut [f64], width: usize, [columns, rows]: [bool; 2]) {
    if rows {
        // All rows, and then the columns of each row back again.
        values.reverse();
    }
    if rows != columns {
        let lines = values.chunks_mut(width);
        lines.for_each(<[f64]>::reverse);
    }
}

/// Extension in small letters.
fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

/// Opens a regular file.
fn open(path: &Path) -> io::Result<File> {
    // Checked before opening, because opening a pipe waits for its writer.
    match fs::metadata(path)?.is_file() {
        true => File::open(path),
        false => Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "not a regular file",
        )),
    }
}

fn unread(path: &Path, source: io::Error) -> Error {
    Error::Io {
        path: path.to_path_buf(),
        source,
    }
}

/// Length of a file, and when it was changed.
type State = (u64, Option<SystemTime>);

/// Opens a regular file of at most so many bytes.
fn open_within(path: &Path, limit: u64) -> Result<(File, State), Error> {
    let io = |source| unread(path, source);
    let file = open(path).map_err(io)?;
    let data = file.metadata().map_err(io)?;
    let length = data.len();
    if length > limit {
        let reason =
            format!("the file has {length} bytes, but only {limit} bytes of memory are allowed");
        return Err(io(io::Error::new(io::ErrorKind::InvalidInput, reason)));
    }
    Ok((file, (length, data.modified().ok())))
}

/// Reads a regular file of at most so many bytes.
fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    let (file, (length, _)) = open_within(path, limit)?;
    first_bytes(path, file, length)
}

/// The first bytes of a file, at most so many.
fn first_bytes(path: &Path, file: File, most: u64) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    let read = file.take(most).read_to_end(&mut bytes);
    read.map_err(|source| unread(path, source))?;
    Ok(bytes)
}

/// Most bytes of a world file or of a description of a coordinate system.
const SMALL: u64 = 1 << 16;

/// Transform of the world file beside a raster.
fn world_file(path: &Path, extensions: &[&str]) -> Result<Option<[f64; 6]>, String> {
    for extension in extensions {
        let beside = path.with_extension(extension);
        if beside.is_file() {
            let bytes = read_file(&beside, SMALL).map_err(|error| error.to_string())?;
            let text = String::from_utf8_lossy(&bytes);
            let found = grid::world_file(&text);
            let place = |reason| format!("{}: {reason}", beside.display());
            return found.map(Some).map_err(place);
        }
    }
    Ok(None)
}

/// Name of the mask beside a raster, as GDAL names it.
fn beside_mask(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".msk");
    name.into()
}

/// Coordinate system of the .prj file beside a raster.
fn system_beside(path: &Path) -> Option<Crs> {
    let bytes = read_file(&path.with_extension("prj"), SMALL).ok()?;
    Crs::from_wkt(&String::from_utf8_lossy(&bytes))
}

/// Bytes in memory as a file that can be read and written anywhere.
type Memory<T> = Cursor<T>;
