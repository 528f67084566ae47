//! Tiles of rasters that do not fit into memory, with the bits of the whole raster.
//!
//! # Windows
//!
//! A tile is read with a margin of one cell on each side that has neighbours: its window. All squares of four centres at which
//! one of its cells is a corner are in it. Triangles depend on nothing but the corners of their square. So a window has each edge
//! of the whole of which an end is in its tile, and no edge that the whole has not: two cells that look like a wire at the rim of
//! one window are an edge in the windows of their own tiles.
//!
//! Where a line of sight crosses an edge depends on its offset from the eye only, heights are used as they were read, and a
//! horizon is the largest slope. So windows raise horizons in any order, and edges that two of them share count twice without
//! harm. A cell is lit if no window raises its horizon to the slope of the light.
//!
//! # Which squares matter
//!
//! No crossing is higher than the higher end of its edge, and a window with the cells around this end has the edge. So a square
//! whose peak is nowhere above a horizon can be left out, whatever is beside it. For horizons, see `rings`; for light, whose rays
//! climb alike wherever they are, see `light`.

mod light;
mod rings;

use std::collections::HashSet;
use std::ops::Range;

use crate::angles::check_azimuths;
use crate::march::FAR;
use crate::{Error, Eyes, HeightField, March, Monitor, Peaks, memory, monitor::Share};

/// A rectangle of cells of a raster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Column and row of its first cell in the whole raster, which may begin anywhere.
    pub at: [i64; 2],
    /// Numbers of columns and rows.
    pub size: [usize; 2],
}

impl Tile {
    /// Columns and rows behind the last ones.
    fn end(&self) -> [i64; 2] {
        let size = self
            .size
            .map(|cells| i64::try_from(cells).unwrap_or(i64::MAX));
        [0, 1].map(|axis| self.at[axis].saturating_add(size[axis]))
    }

    fn between(at: [i64; 2], end: [i64; 2]) -> Self {
        let size = [0, 1].map(|axis| end[axis].saturating_sub(at[axis]).max(0) as usize);
        Self { at, size }
    }

    /// The part that is in another tile; without columns or rows if they do not touch.
    pub fn within(&self, other: &Self) -> Self {
        let (ends, others) = (self.end(), other.end());
        let at = [0, 1].map(|axis| self.at[axis].max(other.at[axis]));
        Self::between(at, [0, 1].map(|axis| ends[axis].min(others[axis])))
    }

    /// The smallest rectangle around both.
    pub fn hull(&self, other: &Self) -> Self {
        let (ends, others) = (self.end(), other.end());
        let at = [0, 1].map(|axis| self.at[axis].min(other.at[axis]));
        Self::between(at, [0, 1].map(|axis| ends[axis].max(others[axis])))
    }

    /// Whether they have a common cell.
    pub fn touches(&self, other: &Self) -> bool {
        self.within(other).cells() > 0
    }

    /// The tile with so many columns and rows of the whole around it.
    pub fn with_margin(&self, margin: [i64; 2], whole: &Self) -> Self {
        self.wider(margin).within(whole)
    }

    /// The tile with so many columns and rows around it.
    fn wider(&self, margin: [i64; 2]) -> Self {
        let at = [0, 1].map(|axis| self.at[axis].saturating_sub(margin[axis]));
        let end = [0, 1].map(|axis| self.end()[axis].saturating_add(margin[axis]));
        Self::between(at, end)
    }

    /// Columns or rows from here to another tile, whichever are more.
    fn gap(&self, other: &Self) -> i64 {
        let (ends, others) = (self.end(), other.end());
        let ways =
            [0, 1].map(|axis| (other.at[axis] - ends[axis]).max(self.at[axis] - others[axis]));
        ways[0].max(ways[1]).max(0)
    }

    /// Number of cells.
    pub(crate) fn cells(&self) -> usize {
        self.size[0].saturating_mul(self.size[1])
    }
}

/// A raster in tiles, which are read when they are needed.
pub trait Tiles {
    /// Why a tile cannot be read.
    type Error: From<Error>;

    /// Map coordinates of corners of cells, as in [`HeightField::new`].
    fn transform(&self) -> [f64; 6];

    /// All tiles: each cell with data is in one of them, and none is beside the raster, which is the smallest rectangle around
    /// them.
    fn tiles(&self) -> &[Tile];

    /// Largest height of the cells of a tile, or more than that; minus infinity without data. It is needed for
    /// every tile, so that it should be known without reading.
    fn peak(&self, tile: usize) -> f64;

    /// Peaks of the squares of a tile, as of a field with just its cells, if they are known. Just the squares that may matter are
    /// read.
    fn peaks(&self, tile: usize) -> Result<Option<Peaks>, Self::Error> {
        let _ = tile;
        Ok(None)
    }

    /// Heights of all cells of a rectangle, row by row; NaN where there is no data. It may be any rectangle of the raster, such
    /// as a part of a tile and a cell more on each side that is not a border of the raster.
    fn read(&self, part: Tile) -> Result<Vec<f64>, Self::Error>;
}

/// Answers for a tile of a raster, with the bits that the whole raster would give. It reads other tiles only if they may matter.
///
/// ```
/// use antumbra_terrain::{Error, Pull, Tile, Tiles, degrees};
///
/// /// A plain with a wall in column 7, in two tiles.
/// struct Plain([Tile; 2]);
///
/// impl Tiles for Plain {
///     type Error = Error;
///
///     fn transform(&self) -> [f64; 6] {
///         [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]
///     }
///
///     fn tiles(&self) -> &[Tile] {
///         &self.0
///     }
///
///     fn peak(&self, tile: usize) -> f64 {
///         [0.0, 2.0][tile]
///     }
///
///     fn read(&self, part: Tile) -> Result<Vec<f64>, Error> {
///         let [columns, rows] = part.size;
///         let height = |cell: usize| if part.at[0] + (cell % columns) as i64 == 7 { 2.0 } else { 0.0 };
///         Ok((0..columns * rows).map(height).collect())
///     }
/// }
///
/// let plain = Plain([0, 4].map(|column| Tile { at: [column, 0], size: [4, 3] }));
/// let pull = Pull { tiles: &plain, rise: 0.0 };
/// let east = pull.horizons(&plain.0[0], &[90.0], 0.0, &())?;
/// assert_eq!(degrees(east.values[0][3]), 26.565052, "2 in 4 cells");
/// assert_eq!(east.read, [1]);
/// // A sun 72 degrees high is above the peak of the other tile, wherever in it that is.
/// let lit = pull.lit(&plain.0[0], &[[90.0, 3.0]], &())?;
/// assert_eq!((lit.values, lit.read), (vec![vec![0b1111; 3]], vec![]));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Pull<'a, T> {
    /// The raster.
    pub tiles: &'a T,
    /// Height of eyes above their cells. Below 0 they see nothing.
    pub rise: f64,
}

/// Answers for a tile, and what was read for them.
#[derive(Clone, Debug, PartialEq)]
pub struct Pulled<V> {
    /// The values in each direction.
    pub values: Vec<Vec<V>>,
    /// Numbers of the tiles of which something was read besides the own one, in this order.
    pub read: Vec<usize>,
    /// Cells that were read of these tiles, with margins.
    pub cells: u64,
}

/// A direction, and the slopes of horizons in it so far.
struct Way {
    azimuth: f64,
    step: [f64; 2],
    slopes: Vec<f64>,
    /// The lowest slope.
    least: f64,
}

impl Way {
    fn new(azimuth: f64, step: [f64; 2], slopes: Vec<f64>) -> Self {
        let mut way = Self {
            azimuth,
            step,
            slopes,
            least: 0.0,
        };
        way.find_least();
        way
    }

    fn find_least(&mut self) {
        let slopes = self.slopes.iter();
        self.least = slopes.fold(f64::INFINITY, |least, &slope| match slope < least {
            true => slope,
            false => least,
        });
    }
}

impl<T: Tiles> Pull<'_, T> {
    /// Slopes of the horizons of all cells of a tile, one of the raster or any other rectangle of it, row by row for each azimuth
    /// in degrees. They are as of [`March::horizons`], with NaN for cells without data.
    ///
    /// The memory is 8 bytes for each cell and azimuth, and up to 200 MB for what is read. With many azimuths at once, cells are read
    /// fewer times.
    ///
    /// # Errors
    /// [`Error::Range`] if an azimuth is not finite, the tile is not in the raster, or the raster has more than 2^28 columns or
    /// rows; [`Error::NoMemory`], [`Error::Cancelled`]; and whatever reading fails with.
    pub fn horizons(
        &self,
        tile: &Tile,
        azimuths: &[f64],
        drop: f64,
        monitor: &dyn Monitor,
    ) -> Result<Pulled<f64>, T::Error> {
        let own = Own::new(self.tiles, tile)?;
        let field = own.field(self.tiles)?;
        let march = March::new(&field, self.rise, drop)?;
        let mut ways = Vec::new();
        for (index, &azimuth) in azimuths.iter().enumerate() {
            let mut slopes = memory::room("slopes", own.heights.len())?;
            let start = |height: &f64| match height.is_nan() {
                true => f64::NAN,
                false => f64::NEG_INFINITY,
            };
            slopes.extend(own.heights.iter().map(start));
            let share = Share(&Share(monitor, [0, 2]), [index, azimuths.len()]);
            march.raise(&own.eyes(&own.window), azimuth, &mut slopes, &share)?;
            ways.push(Way::new(azimuth, field.step(azimuth), slopes));
        }
        let mut read = Read::default();
        let share = Share(monitor, [1, 2]);
        self.raise(&own, &mut ways, drop, &mut read, &share)?;
        Ok(own.pulled(ways.into_iter().map(|way| way.slopes).collect(), read))
    }

    /// Which cells of a tile, one of the raster or any other rectangle of it, get light from each direction: an azimuth in
    /// degrees and the tangent of an elevation. There is a bit for each cell, as of [`Shadows::lit`](crate::Shadows::lit).
    ///
    /// The memory is a bit for each cell and direction, and up to 24 bytes for each cell of a window of at most 12 million cells
    /// around the tile. With many directions at once it is read fewer times. Where more would be needed, as for a sun near the
    /// horizon of a large raster, the memory is 8 bytes for each cell and a part of a tile, and the time is longer.
    ///
    /// # Errors
    /// As of [`Pull::horizons`] and [`Shadows::lit`](crate::Shadows::lit).
    pub fn lit(
        &self,
        tile: &Tile,
        directions: &[[f64; 2]],
        monitor: &dyn Monitor,
    ) -> Result<Pulled<u64>, T::Error> {
        let mut order: Vec<usize> = (0..directions.len()).collect();
        for &[azimuth, slope] in directions {
            check_azimuths(&[azimuth])?;
            let wanted = "the tangent of an elevation";
            Error::check_range("slope", slope, !slope.is_nan(), wanted)?;
        }
        order.sort_by(|&a, &b| directions[a][1].total_cmp(&directions[b][1]));
        let own = Own::new(self.tiles, tile)?;
        let mut read = Read::default();
        let sorted: Vec<[f64; 2]> = order.iter().map(|&index| directions[index]).collect();
        let planes = self.light(&own, &sorted, &mut read, monitor)?;
        let mut values = vec![Vec::new(); directions.len()];
        for (index, plane) in order.into_iter().zip(planes) {
            values[index] = plane;
        }
        Ok(own.pulled(values, read))
    }

    /// Peaks of the squares of a tile.
    fn peaks_of(&self, tile: usize) -> Result<Peaks, T::Error> {
        let size = self.tiles.tiles()[tile].size;
        let peaks = match self.tiles.peaks(tile)? {
            Some(peaks) => peaks,
            None => {
                let side = size[0].max(size[1]).next_power_of_two();
                Peaks::from_values(size, side, &[self.tiles.peak(tile)])?
            }
        };
        let (found, side) = (peaks.size(), peaks.side());
        let wanted = size.map(|cells| cells.div_ceil(side));
        Error::check_length("columns of peaks of a tile", found[0], wanted[0])?;
        Error::check_length("rows of peaks of a tile", found[1], wanted[1])?;
        Ok(peaks)
    }

    /// Heights of a part.
    fn read(&self, part: &Tile, read: &mut Read) -> Result<Vec<f64>, T::Error> {
        let heights = self.tiles.read(*part)?;
        Error::check_length("heights", heights.len(), part.cells())?;
        read.cells += part.cells() as u64;
        Ok(heights)
    }
}

/// What was read: parts of which tiles, and how many cells.
#[derive(Default)]
struct Read {
    tiles: HashSet<usize>,
    cells: u64,
}

/// Heights of a part of the raster.
struct Window {
    tile: Tile,
    heights: Vec<f64>,
}

impl Window {
    /// The same height everywhere.
    fn new(tile: Tile, height: f64) -> Result<Self, Error> {
        let heights = memory::filled("heights", tile.cells(), height)?;
        Ok(Self { tile, heights })
    }

    /// Heights that a part of it has.
    fn put(&mut self, part: &Tile, heights: &[f64]) {
        let [column, row] = [0, 1].map(|axis| (part.at[axis] - self.tile.at[axis]) as usize);
        let rows = self.heights.chunks_exact_mut(self.tile.size[0]).skip(row);
        for (to, from) in rows.zip(heights.chunks_exact(part.size[0])) {
            to[column..][..part.size[0]].copy_from_slice(from);
        }
    }
}

/// Rectangles of columns and rows that have just the squares with a mark.
fn rectangles(marks: &[bool], columns: usize) -> Vec<[Range<usize>; 2]> {
    let mut found: Vec<[Range<usize>; 2]> = Vec::new();
    for (row, marks) in marks.chunks(columns).enumerate() {
        let mut end = 0;
        for run in marks.chunk_by(|a, b| a == b) {
            let own = end..end + run.len();
            end = own.end;
            if !run[0] {
                continue;
            }
            let above = found
                .iter_mut()
                .find(|[columns, rows]| *columns == own && rows.end == row);
            match above {
                Some([_, rows]) => rows.end += 1,
                None => found.push([own, row..row + 1]),
            }
        }
    }
    found
}

/// The own tile.
struct Own {
    whole: Tile,
    tile: Tile,
    heights: Vec<f64>,
    window: Tile,
    around: Vec<f64>,
    /// Height of the lowest cell.
    lowest: f64,
    /// Numbers of the other tiles, nearest ones first.
    order: Vec<usize>,
}

impl Own {
    /// Reads the tile.
    fn new<T: Tiles>(tiles: &T, tile: &Tile) -> Result<Self, T::Error> {
        /// Most columns and rows before a tile.
        const MOST: u64 = 1 << 40;
        let all = tiles.tiles();
        for Tile { at, size } in all.iter().chain([tile]) {
            let is_in = |axis: usize| {
                at[axis].unsigned_abs() <= MOST && (1..=FAR).contains(&(size[axis] as u64))
            };
            let wanted = "columns and rows up to 2^40, and from 1 to 2^28 of them";
            Error::check_range(
                "place of a tile",
                at[0] as f64,
                is_in(0) && is_in(1),
                wanted,
            )?;
        }
        let least = |axis: usize| all.iter().map(|tile| tile.at[axis]).min().unwrap_or(0);
        let most = |axis: usize| all.iter().map(|tile| tile.end()[axis]).max().unwrap_or(0);
        let whole = Tile::between([0, 1].map(least), [0, 1].map(most));
        let size = whole.size[0].max(whole.size[1]);
        let is_in = size as u64 <= FAR;
        Error::check_range("columns or rows", size as f64, is_in, "at most 2^28")?;
        let is_in = tile.within(&whole) == *tile;
        Error::check_range(
            "column of a tile",
            tile.at[0] as f64,
            is_in,
            "a tile in the raster",
        )?;
        let window = tile.with_margin([1; 2], &whole);
        let around = tiles.read(window)?;
        Error::check_length("heights", around.len(), window.cells())?;
        let mut heights = memory::room("heights", tile.cells())?;
        let [column, row] = [0, 1].map(|axis| (tile.at[axis] - window.at[axis]) as usize);
        for row in around
            .chunks(window.size[0].max(1))
            .skip(row)
            .take(tile.size[1])
        {
            heights.extend_from_slice(&row[column..][..tile.size[0]]);
        }
        let mut order: Vec<usize> = (0..all.len()).collect();
        // Windows of tiles in the own one have nothing more.
        order.retain(|&index| all[index].within(tile) != all[index]);
        order.sort_by_key(|&index| tile.gap(&all[index]));
        Ok(Self {
            whole,
            tile: *tile,
            lowest: heights.iter().copied().fold(f64::INFINITY, f64::min),
            heights,
            window,
            around,
            order,
        })
    }

    /// The window.
    fn field<T: Tiles>(&self, tiles: &T) -> Result<HeightField<'_>, Error> {
        HeightField::new(self.window.size, &self.around, tiles.transform())
    }

    /// Another tile, seen from the first cell.
    fn place(&self, other: &Tile) -> Tile {
        Tile {
            at: [0, 1].map(|axis| other.at[axis] - self.tile.at[axis]),
            size: other.size,
        }
    }

    /// Answers, and what was read for them.
    fn pulled<V>(&self, values: Vec<Vec<V>>, read: Read) -> Pulled<V> {
        let order = self.order.iter().copied();
        Pulled {
            values,
            read: order.filter(|tile| read.tiles.contains(tile)).collect(),
            cells: read.cells,
        }
    }

    /// Eyes at all cells, seen from another tile.
    fn eyes(&self, other: &Tile) -> Eyes<'_> {
        Eyes {
            heights: &self.heights,
            width: self.tile.size[0],
            at: [0, 1].map(|axis| self.tile.at[axis] - other.at[axis]),
        }
    }
}
