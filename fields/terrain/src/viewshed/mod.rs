//! Viewsheds: the cells that an observer sees, exactly and without rays.
//!
//! - `view`: the field by rows and by columns;  `sector`: a sector of the plan, line by line;  `envelope`: the edges that were passed, as
//!   the eye sees them;  `raised`: the heights from which cells are seen

mod envelope;
mod raised;
mod sector;
mod view;

use rayon::prelude::*;

use crate::{Error, HeightField, Observer, degrees, memory};
use sector::{Run, SECTORS, Sector};
use view::{Side, Turned};

/// Number of sectors around an eye.
const ALL_SECTORS: usize = Side::ALL.len() * SECTORS;

/// What counts as seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Height of targets above the surface.
    pub target: f64,
    /// Height that places lose per squared distance, `(1 - k) / (2 R)` on an earth of radius `R` with refraction `k`; 0 on a flat
    /// earth.
    pub drop: f64,
    /// Greatest distance in plan; infinite for all cells.
    pub range: f64,
}

impl Default for Limits {
    /// The surface itself, on a flat earth, at any distance.
    fn default() -> Self {
        Self {
            target: 0.0,
            drop: 0.0,
            range: f64::INFINITY,
        }
    }
}

/// Finds viewsheds of a height field.
///
/// A cell is seen if no part of the surface is strictly above the line from the eye to the centre of the cell, raised by the height
/// of targets. A line may touch the surface: slopes of lines that differ by less than 1e-12 count as equal. Cells without data are
/// not seen. An observer sees its own cell, and nothing if its eye is below the surface.
///
/// All is computed in double precision. Bits are the same for any number of threads.
///
/// ```
/// use antumbra_terrain::{HeightField, Limits, Observer, Viewer};
///
/// // A wall between two plains, three cells wide.
/// let heights = [0.0, 0.0, 9.0, 0.0, 0.0].repeat(3);
/// let field = HeightField::new([5, 3], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
/// let eye = Observer { place: [0.0, 1.0], height: 2.0, normal: [0.0; 3] };
/// let seen = Viewer::new(&field)?.sees(&eye, &Limits::default())?;
/// let middle: Vec<u64> = (5..10).map(|cell| seen[0] >> cell & 1).collect();
/// assert_eq!(middle, [1, 1, 1, 0, 0]);
/// # Ok::<(), antumbra_terrain::Error>(())
/// ```
pub struct Viewer<'a>(Turned<'a>);

impl<'a> Viewer<'a> {
    /// A viewer of this field, with the peaks of blocks of its rows and columns: half a byte for each cell.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn new(field: &'a HeightField<'a>) -> Result<Self, Error> {
        Ok(Self(Turned::new(field)?))
    }

    /// The field.
    pub fn field(&self) -> &'a HeightField<'a> {
        self.0.field()
    }

    /// The cells that an observer sees: a bit for each cell, row by row, 64 a word from the lowest bit up. The last word has zeros
    /// behind the last cell.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn sees(&self, observer: &Observer, limits: &Limits) -> Result<Vec<u64>, Error> {
        let cells = self.field().heights().len();
        let mut seen = memory::filled("cells", cells.div_ceil(64), 0)?;
        if !observer.is_finite() || self.field().buries(observer) {
            return Ok(seen);
        }
        if let Some(cell) = self.own_cell(observer) {
            seen[cell / 64] |= 1 << (cell % 64);
        }
        let sector = |index| self.sector(observer, limits, index);
        let found: Vec<Vec<Run>> = (0..ALL_SECTORS)
            .into_par_iter()
            .map(|index| sector(index).sweep(Vec::new()))
            .collect();
        for (index, runs) in found.into_iter().enumerate() {
            let view = sector(index).view;
            for (line, range) in runs {
                for at in range {
                    let cell = view.cell(line as usize, at as usize);
                    seen[cell / 64] |= 1 << (cell % 64);
                }
            }
        }
        self.hide_behind_normal(observer, limits, &mut seen);
        Ok(seen)
    }

    /// Elevation of the line from the eye of an observer to the target over a cell, in degrees, whether it is seen or not: from -90 below
    /// the eye over 0 on its level to 90. NaN without data, and where the target is the eye.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn elevation(&self, observer: &Observer, limits: &Limits, cell: usize) -> f32 {
        let [east, north, up] = self.way(observer, limits, cell);
        degrees(up / (east * east + north * north).sqrt())
    }

    /// Way to the east, to the north and up from an eye to the target over a cell.
    fn way(&self, observer: &Observer, limits: &Limits, cell: usize) -> [f64; 3] {
        let field = self.field();
        let [width, _] = field.size();
        let [x, y] = observer.place;
        let [column, row] = [cell % width, cell / width].map(|at| at as f64);
        let [east, north] = field.along([column - x, row - y]);
        let drop = limits.drop * (east * east + north * north);
        let up = field.heights()[cell] + limits.target - drop - observer.height;
        [east, north, up]
    }

    /// One of all sectors around an eye.
    fn sector(&self, observer: &Observer, limits: &Limits, index: usize) -> Sector<'_> {
        let (side, index) = (Side::ALL[index / SECTORS], index % SECTORS);
        Sector::new(&self.0, observer, limits, side, index)
    }

    /// The cell that the observer is exactly above, if it has data.
    fn own_cell(&self, observer: &Observer) -> Option<usize> {
        let [width, height] = self.field().size();
        let [column, row] = observer.place;
        let is_centre = column.fract() == 0.0 && row.fract() == 0.0;
        let is_inside =
            (0.0..width as f64).contains(&column) && (0.0..height as f64).contains(&row);
        let cell = (is_centre && is_inside).then(|| row as usize * width + column as usize)?;
        self.field().heights()[cell].is_finite().then_some(cell)
    }

    /// Removes cells that are behind the surface of an observer.
    fn hide_behind_normal(&self, observer: &Observer, limits: &Limits, seen: &mut [u64]) {
        if observer.normal == [0.0; 3] {
            return;
        }
        for (index, word) in seen.iter_mut().enumerate() {
            let seen = *word;
            for bit in (0..64).filter(|bit| seen >> bit & 1 != 0) {
                let [east, north, up] = self.way(observer, limits, 64 * index + bit);
                let [a, b, c] = observer.normal;
                let is_apart = [east, north, up] != [0.0; 3];
                if is_apart && a * east + b * north + c * up <= 0.0 {
                    *word &= !(1 << bit);
                }
            }
        }
    }
}
