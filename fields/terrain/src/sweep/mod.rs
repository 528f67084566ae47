//! Horizons of all cells by sweeps along the lines of a lattice.
//!
//! # A hull for each line
//!
//! Seen along one azimuth, a horizon is the largest slope to the surface ahead. Cells of a line share what is ahead of them, so a
//! sweep walks a line from its far end towards the observers and keeps the upper hull of all that it passed: a point below the chord
//! of two others is nobody's horizon. A new point removes those points of the hull that it hides, and then the last one left is its
//! horizon. Each point is added once and removed at most once, so a cell costs the same however far it looks (Stewart 1998, "Fast
//! horizon computation at all points of a terrain with visibility and shading applications"; Timonen and Westerholm 2010, "Scalable
//! height field self-shadowing"; for evenly spaced profiles Dozier and Frew 1990, "Rapid calculation of terrain parameters for
//! radiation modeling from digital elevation data").
//!
//! # Exactness
//!
//! The surface along a line is straight between its crossings with edges of triangles, so the hull takes the crossings with rows,
//! columns and diagonals besides the cells: all that there is. Heights are multiplied by a whole number, such that crossings divide
//! edges into whole parts, and distances are whole numbers of parts of a step. So nothing depends on where the raster lies. Sums and
//! products are exact as long as their digits fit into double precision, for example for heights
//! in single precision between 256 and 4096, and then a slope is rounded once. Otherwise two points of nearly the same slope may be confused,
//! and the horizon is right to some units in its last place.
//!
//! Over a round earth places lose height with the squared distance from the observer. As each observer compares points by differences
//! of distances only, the same hull serves: see `hides` in `hulls`.
//!
//! # Tiles
//!
//! A line passes its cells and crossings in one order, and all that earlier ones leave behind is its hull. So a raster can be swept tile
//! by tile, with the same operations and hence the same bits, if a line enters a tile with the hull with which it left the last one. A
//! line is between tiles where a step leads from a cell of one to a cell of another, and is named by the former: so tiles agree on
//! lines whatever their sizes are. Four facts make that exact:
//!
//! - Points are compared by differences of distances only. These are whole numbers below 2^53, so that it does not matter from where
//!   distances count: here from the first station of a tile, and in a border from the cell.
//! - Beside the hull, a line keeps the last two points it passed: the cell, and the last crossing before it, or the cell before. Their
//!   distances follow from the step, and their heights are in the border.
//! - Ends of an edge that is crossed on the way of a step are in the rectangle between both cells. Lines cross edges along rows or
//!   columns inside of it only, so that it has the other corners of their triangles, too; a diagonal's are in its square. Whether a
//!   cell is the corner of a triangle, and each edge there, is decided by the eight around it. So a margin as wide as the step and
//!   at least 1 answers all questions as the whole does, and says whether there is a cell one step ahead or behind.
//! - What depends on all of the raster is given: its size, and whether it has holes, which adds crossings to all lines.

mod border;
mod crossing;
mod hulls;
mod lines;
mod tile;

pub use border::Border;
pub use tile::TileSweep;

use crate::{Error, HeightField, Monitor, Tile};

/// Horizons of all cells of a height field, one azimuth at a time.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// The surface.
    pub field: &'a HeightField<'a>,
    /// Height of observers above their cells. Below 0 they see nothing.
    pub rise: f64,
    /// Height that places lose per squared distance, as of [`Limits::drop`](crate::Limits); 0 on a flat earth.
    pub drop: f64,
}

impl Sweep<'_> {
    /// What `of` makes of the horizon of each cell, seen along a step of a [`Lattice`](crate::Lattice), row by row. `of` takes the
    /// slope of the horizon, the tangent of its elevation: minus infinity where no surface is ahead, and infinity for eyes below the
    /// surface. Cells without data have NaN.
    ///
    /// The memory is the result, and the hulls of 256 lines for each thread: mostly some hundred kilobytes. Bits are the same for any
    /// number of threads.
    ///
    /// # Errors
    /// [`Error::Range`] if the step has no length or its numbers a common divisor; [`Error::NoMemory`], [`Error::Cancelled`].
    ///
    /// ```
    /// use antumbra_terrain::{HeightField, Sweep, degrees};
    ///
    /// // A wall in the east of a plain.
    /// let heights = [0.0, 0.0, 0.0, 2.0].repeat(2);
    /// let field = HeightField::new([4, 2], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
    /// let sweep = Sweep { field: &field, rise: 0.0, drop: 0.0 };
    /// let east = sweep.horizons([1, 0], degrees, &())?;
    /// assert_eq!(east[1..4], [45.0, 63.434948, -90.0]);
    /// # Ok::<(), antumbra_terrain::Error>(())
    /// ```
    pub fn horizons(
        &self,
        step: [i32; 2],
        of: impl Fn(f64) -> f32 + Sync,
        monitor: &dyn Monitor,
    ) -> Result<Vec<f32>, Error> {
        // One tile, which no line enters or leaves.
        let whole = self.field.size().map(|size| size as i64);
        let whole = TileSweep {
            sweep: *self,
            at: [0; 2],
            tile: Tile::whole(whole),
            whole,
            has_holes: self.field.has_holes(),
        };
        Ok(whole.horizons(step, &[], of, monitor)?.0)
    }
}
