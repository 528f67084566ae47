//! Sweeps of the tiles of a raster, each by itself.

use std::sync::atomic::AtomicU32;

use antumbra_simd::Isa;

use super::Sweep;
use super::border::{Border, MOST};
use super::lines::Lines;
use crate::lattice::divisor;
use crate::{Error, Monitor, Tile, memory};

impl Tile {
    /// Indices of the tiles from which lines enter this one along a step. Their sweeps come first, and this one takes their
    /// [borders](Border).
    ///
    /// Tiles are any rectangles without a common cell. Then each has a place in some order in which all that are ahead come first,
    /// for any step, because such an order exists for convex areas of the plane that do not overlap. A tile that is narrower than the
    /// step may take lines from a tile that is not beside it.
    ///
    /// ```
    /// use antumbra_terrain::Tile;
    ///
    /// // Four tiles, the last ones smaller.
    /// let tile = |column, row, width, height| Tile { at: [column, row], size: [width, height] };
    /// let tiles = [tile(0, 0, 8, 8), tile(8, 0, 3, 8), tile(0, 8, 8, 5), tile(8, 8, 3, 5)];
    /// assert_eq!(tiles[0].ahead([2, 1], &tiles), [1, 2, 3]);
    /// assert_eq!(tiles[0].ahead([1, 0], &tiles), [1]);
    /// assert_eq!(tiles[1].ahead([2, 1], &tiles), [3]);
    /// ```
    pub fn ahead(&self, step: [i32; 2], tiles: &[Self]) -> Vec<usize> {
        let moved = self.moved(step);
        let is_ahead = |tile: &Self| tile != self && moved.within(tile).cells() > 0;
        let all = 0..tiles.len();
        all.filter(|&index| is_ahead(&tiles[index])).collect()
    }

    /// All cells of a raster.
    pub(super) fn whole(size: [i64; 2]) -> Self {
        Self {
            at: [0; 2],
            size: size.map(|cells| cells.max(0) as usize),
        }
    }

    /// Whether the step backwards from a row and column, which are in another tile, leads to a cell of this one.
    pub(super) fn follows(&self, place: [i64; 2], step: [i32; 2]) -> bool {
        self.moved(step).has(place)
    }

    pub(super) fn has(&self, [row, column]: [i64; 2]) -> bool {
        let (at, size) = ([column, row], [1; 2]);
        self.within(&Self { at, size }).cells() > 0
    }

    /// The tile one step on.
    fn moved(&self, step: [i32; 2]) -> Self {
        let at = [0, 1].map(|axis| self.at[axis].saturating_add(step[axis].into()));
        Self { at, ..*self }
    }
}

/// Horizons of the cells of a tile of a larger raster, with the bits that [`Sweep::horizons`] of the whole has.
///
/// A line of cells along the step is walked from far to near, through one tile after the other. Each tile takes the hulls with which
/// lines enter, goes on as if it had walked all the way, and gives the hulls with which they leave to the tiles behind.
#[derive(Clone, Copy, Debug)]
pub struct TileSweep<'a> {
    /// The tile with a margin of its neighbours' cells, and rise and drop of observers. On all sides where the whole goes on, the
    /// margin has as many columns and rows as the step, and at least 1. More of them change nothing, so that one field serves all
    /// steps of a [`Lattice`](crate::Lattice).
    pub sweep: Sweep<'a>,
    /// Column and row of the first cell of the field in the whole.
    pub at: [i64; 2],
    /// The tile, in columns and rows of the whole.
    pub tile: Tile,
    /// Numbers of columns and rows of the whole.
    pub whole: [i64; 2],
    /// Whether the whole [has holes](crate::HeightField::has_holes), which is so if the field of any of its tiles has. If you say so of
    /// a raster without holes, tiles agree with each other, but last digits may differ from the sweep of the whole.
    pub has_holes: bool,
}

impl TileSweep<'_> {
    /// What `of` makes of the horizon of each cell of the tile, as [`Sweep::horizons`] says, row by row of the tile, and the hulls of
    /// lines that leave it. `entering` has the borders of all tiles [ahead](Tile::ahead), or the parts of them for this tile.
    ///
    /// # Errors
    /// [`Error::Length`] if lines enter without a hull, since a border is missing. [`Error::Border`] if a border is of another step,
    /// raster or earth. [`Error::Range`] if the step has no length or its numbers a common divisor, if the margin is too narrow, or if
    /// tile, field and whole do not go together. [`Error::NoMemory`], [`Error::Cancelled`].
    ///
    /// ```
    /// use antumbra_terrain::{Border, HeightField, Sweep, Tile, TileSweep, degrees};
    ///
    /// // A wall in the east of a plain of 6 x 2 cells, as tiles of 3 x 2 cells with a margin of one column.
    /// let sweep = |first: i64, heights: &[f64], entering: &[Border]| {
    ///     let field = HeightField::new([4, 2], heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
    ///     let sweep = Sweep { field: &field, rise: 0.0, drop: 0.0 };
    ///     let at = [if first == 0 { 0 } else { first - 1 }, 0];
    ///     let tile = Tile { at: [first, 0], size: [3, 2] };
    ///     let part = TileSweep { sweep, at, tile, whole: [6, 2], has_holes: false };
    ///     part.horizons([1, 0], entering, degrees, &())
    /// };
    /// let (_, border) = sweep(3, &[0.0, 0.0, 0.0, 2.0].repeat(2), &[])?;
    /// let bytes = border.to_bytes();
    /// let (west, _) = sweep(0, &[0.0; 8], &[Border::from_bytes(&bytes)?])?;
    /// assert_eq!(west[..3], [degrees(2.0 / 5.0), degrees(2.0 / 4.0), degrees(2.0 / 3.0)]);
    /// # Ok::<(), antumbra_terrain::Error>(())
    /// ```
    pub fn horizons(
        &self,
        step: [i32; 2],
        entering: &[Border],
        of: impl Fn(f64) -> f32 + Sync,
        monitor: &dyn Monitor,
    ) -> Result<(Vec<f32>, Border), Error> {
        let wanted = "steps without a common divisor";
        let is_step = divisor(step[0], step[1]) == 1;
        Error::check_range("step in columns and rows", step[0].into(), is_step, wanted)?;
        self.check(step)?;
        let Self { tile, whole, .. } = self;
        let lines = Lines::new(self, step);
        let longest = lines.longest(*whole);
        let wanted = "at most 2^53, so that distances are exact";
        Error::check_range("parts of a line", longest, longest <= MOST, wanted)?;
        let [[q, p], [columns, rows]] = [step.map(i64::from), *whole].map(|x| x.map(|x| x as u64));
        let bend = lines.bend().to_bits();
        let key = [q, p, columns, rows, self.has_holes.into(), bend];
        let entering = Border::entering(entering, &key, (tile, step))?;
        let moved = tile.moved(step);
        let ahead = moved.within(&Tile::whole(*whole));
        let wanted = ahead.cells() - moved.within(tile).cells();
        let what = "hulls of lines that enter the tile";
        Error::check_length(what, entering.len(), wanted)?;
        let cells = tile.cells();
        let mut found = memory::room("horizons", cells)?;
        found.resize_with(cells, || AtomicU32::new(f32::NAN.to_bits()));
        let leaving = lines.walk(Isa::best(), &entering, &of, &found, monitor)?;
        let values = found.into_iter();
        let values = values.map(|bits| f32::from_bits(bits.into_inner()));
        Ok((values.collect(), Border::new(key, leaving)))
    }

    /// Refuses a field that is not the tile with its margin.
    fn check(&self, step: [i32; 2]) -> Result<(), Error> {
        let (tile, field) = (self.tile, self.sweep.field);
        let size = field.size();
        let (whole, own) = (Tile::whole(self.whole), Tile { at: self.at, size });
        let margin = step.map(|steps| i64::from(steps).abs().max(1));
        let at = [0, 1].map(|axis| tile.at[axis].saturating_sub(margin[axis]));
        let size = [0, 1].map(|axis| tile.size[axis].saturating_add(2 * margin[axis] as usize));
        let needed = whole.within(&Tile { at, size });
        let is_part =
            tile.cells() > 0 && [tile, own].iter().all(|part| whole.within(part) == *part);
        let is_in = is_part && own.within(&needed) == needed;
        let found = tile.at[0].saturating_sub(self.at[0]) as f64;
        let wanted = "a tile with a margin as wide as the step, or as the whole has there";
        Error::check_range("columns before the tile", found, is_in, wanted)?;
        let is_in = self.has_holes || !field.has_holes();
        let wanted = "1 if a field has holes";
        Error::check_range("holes of the whole", 0.0, is_in, wanted)
    }
}
