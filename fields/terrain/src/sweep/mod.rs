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

mod crossing;
mod hulls;
mod lines;

use std::sync::atomic::AtomicU32;

use antumbra_simd::Isa;

use crate::lattice::divisor;
use crate::{Error, HeightField, Monitor, memory};
use lines::Lines;

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
        let [q, p] = step;
        let wanted = "steps without a common divisor";
        let is_step = divisor(q, p) == 1;
        Error::check_range("step in columns and rows", q.into(), is_step, wanted)?;
        let cells = self.field.heights().len();
        let mut found = memory::room("horizons", cells)?;
        found.resize_with(cells, || AtomicU32::new(f32::NAN.to_bits()));
        Lines::new(self, step).walk(Isa::best(), &of, &found, monitor)?;
        let values = found.into_iter();
        Ok(values
            .map(|bits| f32::from_bits(bits.into_inner()))
            .collect())
    }
}
