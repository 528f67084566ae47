//! Horizons in any azimuth, by walks from all cells of a square at once.
//!
//! # Edges
//!
//! Along a line of sight in plan, the slope to the surface is largest where the line crosses an edge of a triangle. Edges are on lines
//! of three families: columns, rows, and the diagonals on which the difference of both is constant. Beside holes there is a fourth
//! one. So the horizon is the largest slope at the crossings with all of them.
//!
//! Seen from the centres of cells, crossings are at the same offsets for all. So they are listed once for an azimuth, and eight cells
//! side by side read their heights from runs of a row. As an offset depends on nothing but the azimuth and the shape of cells, so do
//! the bits of a slope: neither on where the raster lies nor on how it is divided.
//!
//! # Stretches that are left out
//!
//! The list is divided into stretches of 8, 64 and 512 cells, and squares of as many cells know their peaks. A stretch is left out if
//! the peak of all squares that it leads the cells to would be below their horizons so far (Tevs, Ihrke and Seidel 2008, "Maximum
//! mipmaps for fast, accurate, and scalable dynamic height field rendering"). Neighbours mostly look at the same peak, so a walk
//! begins with the stretch of the last square's horizon: then nearly all others are below it. The answer is the largest slope of all
//! crossings, whatever was left out.
//!
//! Bounds need no slack. The height at a crossing is never rounded to more than both ends of its edge have, since a crossing is
//! off both by more than rounding ([`edge_at`](crate::crossing::edge_at)). From there on, a slope and its bound are the same
//! operations, on numbers of which the bound has the larger ones, and rounding keeps their order.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};
use rayon::prelude::*;

use crate::angles::check_azimuths;
use crate::crossing::{Crossing, Lines, is_edge};
use crate::peaks::{Peaks, SIDES};
use crate::{Error, HeightField, Monitor, Progress, memory};

/// Cells on a side of the squares that are walked from together, the smallest ones that have peaks.
const SIDE: usize = SIDES[0];

/// Cells on a side of the tiles whose squares are walked from one after the other, such that they read the same heights.
const TILE: usize = 64;

/// Columns or rows between a field and those who see it, up to which distances are known to parts of a cell.
pub(crate) const FAR: u64 = 1 << 28;

/// Cells from which is looked, which may be beside the field: a tile of the same raster.
#[derive(Clone, Copy, Debug)]
pub struct Eyes<'a> {
    /// Heights of the cells, row by row; NaN where there is no eye.
    pub heights: &'a [f64],
    /// Number of columns.
    pub width: usize,
    /// Column and row of the first cell, where the first cell of the field is at 0, 0.
    pub at: [i64; 2],
}

/// Horizons of all cells of a height field in any azimuth.
pub struct March<'a> {
    field: &'a HeightField<'a>,
    rise: f64,
    drop: f64,
    levels: [Peaks; 3],
}

impl<'a> March<'a> {
    /// Walks over a field from eyes that are `rise` above their cells, and see nothing below 0. `drop` is the height that places lose
    /// per squared distance, as of [`Limits::drop`](crate::Limits); 0 on a flat earth.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn new(field: &'a HeightField<'a>, rise: f64, drop: f64) -> Result<Self, Error> {
        let levels = Peaks::of_squares(field, SIDE, 0)?.levels()?;
        Ok(Self {
            field,
            rise,
            drop,
            levels,
        })
    }

    /// What `of` makes of the horizon of each cell in an azimuth, in degrees from the north of the map (`y`) through east, row by row.
    /// Slopes and cells without data are as in [`Sweep::horizons`](crate::Sweep::horizons).
    ///
    /// # Errors
    /// [`Error::Range`] if the azimuth is not finite; [`Error::NoMemory`], [`Error::Cancelled`].
    ///
    /// ```
    /// use antumbra_terrain::{HeightField, March, degrees};
    ///
    /// // A wall in the east of a plain.
    /// let heights = [0.0, 0.0, 0.0, 2.0].repeat(2);
    /// let field = HeightField::new([4, 2], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
    /// let east = March::new(&field, 0.0, 0.0)?.horizons(90.0, degrees, &())?;
    /// assert_eq!(east[1..4], [45.0, 63.434948, -90.0]);
    /// # Ok::<(), antumbra_terrain::Error>(())
    /// ```
    pub fn horizons(
        &self,
        azimuth: f64,
        of: impl Fn(f64) -> f32 + Sync,
        monitor: &dyn Monitor,
    ) -> Result<Vec<f32>, Error> {
        let [width, height] = self.field.size();
        let eyes = Eyes {
            heights: self.field.heights(),
            width,
            at: [0; 2],
        };
        let mut found = memory::filled("horizons", width * height, f32::NAN)?;
        let start = |_: &f32| f64::NEG_INFINITY;
        self.walk((&eyes, None), azimuth, (start, of), &mut found, monitor)?;
        Ok(found)
    }

    /// Raises slopes of horizons so far, one for each eye, to what this field is as a part of their horizon.
    ///
    /// So the horizons of a tile of a larger raster have the bits that the whole raster gives if each square of four cells is in
    /// one of the fields that raise them, in any order. Fields may overlap. They are equal in the shape of cells, but where their
    /// transforms begin does not count.
    ///
    /// # Errors
    /// As of [`March::horizons`]; [`Error::Length`] if there are not as many slopes as eyes or they have no whole rows,
    /// [`Error::Range`] if they are more than 2^28 columns or rows away.
    ///
    /// ```
    /// use antumbra_terrain::{Eyes, HeightField, March, degrees};
    ///
    /// // Cells of a plain, and two columns of the tile in the east of it, of which the first one is theirs.
    /// let transform = [0.0, 1.0, 0.0, 0.0, 0.0, -1.0];
    /// let field = HeightField::new([2, 2], &[0.0, 2.0, 0.0, 2.0], transform)?;
    /// let eyes = Eyes { heights: &[0.0; 6], width: 3, at: [-2, 0] };
    /// let mut slopes = [f64::NEG_INFINITY; 6];
    /// March::new(&field, 0.0, 0.0)?.raise(&eyes, 90.0, &mut slopes, &())?;
    /// assert_eq!(slopes[1..3].iter().map(|&slope| degrees(slope)).collect::<Vec<_>>(), [45.0, 63.434948]);
    /// # Ok::<(), antumbra_terrain::Error>(())
    /// ```
    pub fn raise(
        &self,
        eyes: &Eyes<'_>,
        azimuth: f64,
        slopes: &mut [f64],
        monitor: &dyn Monitor,
    ) -> Result<(), Error> {
        eyes.check(slopes)?;
        self.raise_of((eyes, None), azimuth, slopes, monitor)
    }

    /// The same for some squares of the eyes.
    pub(crate) fn raise_of(
        &self,
        eyes: (&Eyes<'_>, Option<&Seeing>),
        azimuth: f64,
        slopes: &mut [f64],
        monitor: &dyn Monitor,
    ) -> Result<(), Error> {
        self.walk(eyes, azimuth, (|&own| own, |own| own), slopes, monitor)
    }

    fn walk<T: Send>(
        &self,
        (eyes, seeing): (&Eyes<'_>, Option<&Seeing>),
        azimuth: f64,
        ends: (impl Fn(&T) -> f64 + Sync, impl Fn(f64) -> T + Sync),
        found: &mut [T],
        monitor: &dyn Monitor,
    ) -> Result<(), Error> {
        check_azimuths(&[azimuth])?;
        let (field, size) = (self.field, self.field.size());
        let lines = eyes.lines(field.step(azimuth), ([0; 2], size));
        let look = Look {
            goal: Goal::Surface(field),
            levels: &self.levels,
            rise: self.rise,
            drop: self.drop,
            way: &Way::new(&lines, field.has_holes(), size[0]),
            eyes,
            seeing,
        };
        look.walk(ends, found, monitor)
    }
}

impl Eyes<'_> {
    /// Lines of sight along a step to so many cells from a column and row on.
    pub(crate) fn lines(&self, step: [f64; 2], cells: ([isize; 2], [usize; 2])) -> Lines {
        let eyes = [self.width, self.heights.len() / self.width];
        let at = self.at.map(|at| at as isize);
        Lines::new(step, (at, eyes), cells)
    }

    /// All squares of eyes.
    pub(crate) fn seeing(&self) -> Result<Vec<AtomicBool>, Error> {
        let rows = self.heights.len() / self.width;
        marks(self.width.div_ceil(SIDE) * rows.div_ceil(SIDE), true)
    }

    /// Marks the squares of a field whose peaks may be above one of the horizons so far, along such lines of sight to its cells,
    /// and the squares of eyes from which they are. Of each of these, only so many stretches get marks, first those whose peaks may
    /// be highest above a horizon: what they are in truth mostly hides the others.
    pub(crate) fn mark(
        &self,
        (levels, marks, most): (&[Peaks; 3], &[AtomicBool], usize),
        seeing: &Seeing,
        lines: &Lines,
        [rise, drop]: [f64; 2],
        slopes: &mut [f64],
        monitor: &dyn Monitor,
    ) -> Result<(), Error> {
        let look = Look {
            goal: Goal::Marks(marks, most),
            levels,
            rise,
            drop,
            // Beside holes there are more edges, which does not matter elsewhere.
            way: &Way::new(lines, true, 0),
            eyes: self,
            seeing: Some(seeing),
        };
        look.walk((|&own: &f64| own, |own| own), slopes, monitor)
    }

    /// Refuses slopes that are not one for each eye.
    fn check(&self, slopes: &[f64]) -> Result<(), Error> {
        let is_in = self.width > 0;
        Error::check_range("columns of eyes", self.width as f64, is_in, "at least 1")?;
        let rows = self.heights.len() / self.width;
        Error::check_length("heights of eyes", self.heights.len(), rows * self.width)?;
        Error::check_length("slopes", slopes.len(), self.heights.len())?;
        let far = self.at[0].unsigned_abs().max(self.at[1].unsigned_abs());
        let is_in = far <= FAR;
        let wanted = "at most 2^28 columns or rows between a field and those who see it";
        Error::check_range("column or row of eyes", far as f64, is_in, wanted)
    }
}

/// So many marks that are set or not.
pub(crate) fn marks(count: usize, are_set: bool) -> Result<Vec<AtomicBool>, Error> {
    let mut marks = memory::room("marks", count)?;
    marks.resize_with(count, || AtomicBool::new(are_set));
    Ok(marks)
}

/// Crossings between two distances.
struct Stretch {
    /// Crossings, or stretches of the level below.
    parts: Range<usize>,
    /// Columns and rows of all ends of edges, as the first eye sees them.
    offsets: [Range<isize>; 2],
    /// Least and largest distance, and their reciprocals.
    distances: [f64; 2],
    reciprocals: [f64; 2],
}

/// All crossings in an azimuth, from near to far.
struct Way {
    /// Whether lines pass more rows than columns.
    is_steep: bool,
    /// Columns and rows of the cells that are seen.
    cells: [Range<isize>; 2],
    crossings: Vec<Crossing>,
    /// Stretches of 8 cells, of 64 and of 512.
    stretches: [Vec<Stretch>; 3],
}

impl Way {
    fn new(lines: &Lines, has_holes: bool, width: usize) -> Self {
        let crossings = lines.crossings(has_holes, width, f64::INFINITY);
        let small = Self::small(&crossings, lines.at);
        let middle = Self::larger(&small, SIDES[1] / SIDES[0]);
        let large = Self::larger(&middle, SIDES[2] / SIDES[1]);
        let [columns, rows] = lines.step;
        Self {
            is_steep: rows.abs() > columns.abs(),
            cells: lines.cells.clone(),
            crossings,
            stretches: [small, middle, large],
        }
    }

    /// Stretches of as many columns or rows as squares have.
    fn small(crossings: &[Crossing], [column, row]: [isize; 2]) -> Vec<Stretch> {
        let piece = |crossing: &Crossing| {
            let [end, other] = crossing.ends[0];
            (end - column).abs().max((other - row).abs()) / SIDE as isize
        };
        let mut stretches = Vec::new();
        let mut first = 0;
        for pieces in crossings.chunk_by(|a, b| piece(a) == piece(b)) {
            let ends = || pieces.iter().flat_map(|crossing| crossing.ends);
            let range = |axis: usize| {
                let places = || ends().map(move |end| end[axis]);
                places().min().unwrap_or(0)..places().max().unwrap_or(0) + 1
            };
            let all = [&pieces[0], &pieces[pieces.len() - 1]];
            stretches.push(Stretch {
                parts: first..first + pieces.len(),
                offsets: [range(0), range(1)],
                distances: all.map(|crossing| crossing.distance),
                reciprocals: all.map(|crossing| crossing.reciprocal),
            });
            first += pieces.len();
        }
        stretches
    }

    /// Stretches of so many smaller ones.
    fn larger(stretches: &[Stretch], count: usize) -> Vec<Stretch> {
        let all = stretches.chunks(count).enumerate();
        let larger = all.map(|(index, parts)| {
            let range = |axis: usize| {
                let starts = parts.iter().map(|part| part.offsets[axis].start);
                let ends = parts.iter().map(|part| part.offsets[axis].end);
                starts.min().unwrap_or(0)..ends.max().unwrap_or(0)
            };
            let [first, last] = [&parts[0], &parts[parts.len() - 1]];
            Stretch {
                parts: index * count..index * count + parts.len(),
                offsets: [range(0), range(1)],
                distances: [first.distances[0], last.distances[1]],
                reciprocals: [first.reciprocals[0], last.reciprocals[1]],
            }
        });
        larger.collect()
    }
}

/// What eyes look for: the surface of a field, or marks of squares of a field of which only peaks are known, in so many stretches.
enum Goal<'a> {
    Surface(&'a HeightField<'a>),
    Marks(&'a [AtomicBool], usize),
}

/// Marks of the squares of eyes that may see something.
pub(crate) type Seeing = [AtomicBool];

/// What eyes look at.
struct Look<'a> {
    goal: Goal<'a>,
    levels: &'a [Peaks; 3],
    rise: f64,
    drop: f64,
    way: &'a Way,
    eyes: &'a Eyes<'a>,
    /// Squares of eyes that look, or those that marked something.
    seeing: Option<&'a Seeing>,
}

impl<'a> Look<'a> {
    /// Walks from all eyes with the slopes that `start` makes of what was found, and puts there what `of` makes of the slopes
    /// then.
    fn walk<T: Send>(
        &self,
        (start, of): (impl Fn(&T) -> f64 + Sync, impl Fn(f64) -> T + Sync),
        found: &mut [T],
        monitor: &dyn Monitor,
    ) -> Result<(), Error> {
        let rows = found.par_chunks_mut(TILE * self.eyes.width).enumerate();
        let progress = Progress::new(monitor, rows.len());
        rows.try_for_each(|(index, found)| {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            Isa::best().dispatch(Band {
                look: self,
                row: index * TILE,
                start: &start,
                of: &of,
                found,
            });
            progress.add(1);
            Ok(())
        })
    }

    /// The square of this column and row, whose cells have the slopes of a list that begins with the row.
    #[inline(always)]
    fn square<T>(
        &'a self,
        [column, row]: [usize; 2],
        slopes: &[T],
        of: impl Fn(&T) -> f64,
    ) -> Square<'a> {
        let mut square = Square {
            look: self,
            column,
            row,
            eyes: [[f64::NAN; SIDE]; SIDE],
            most: [[f64::NEG_INFINITY; SIDE]; SIDE],
            hint: 0,
        };
        let Eyes { heights, width, .. } = *self.eyes;
        let columns = SIDE.min(width - column);
        let rows = slopes.chunks(width).take(SIDE).enumerate();
        for (line, slopes) in rows {
            let heights = &heights[(row + line) * width + column..][..columns];
            let slopes = &slopes[column..][..columns];
            for lane in 0..columns {
                square.eyes[line][lane] = heights[lane] + self.rise;
                square.most[line][lane] = of(&slopes[lane]);
            }
        }
        square
    }
}

/// Rows of tiles, whose squares are walked from one after the other.
struct Band<'a, T, Start, Of> {
    look: &'a Look<'a>,
    /// The first row.
    row: usize,
    start: &'a Start,
    of: &'a Of,
    found: &'a mut [T],
}

impl<T, Start: Fn(&T) -> f64, Of: Fn(f64) -> T> WithSimd<SIDE> for Band<'_, T, Start, Of> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<SIDE>>(mut self, _: S) {
        let width = self.look.eyes.width;
        let rows = (self.found.len() / width).div_ceil(SIDE);
        let mut hint = 0;
        for first in (0..width).step_by(TILE) {
            let columns = TILE.min(width - first).div_ceil(SIDE);
            for index in 0..columns * rows {
                // Along the lines, as far as squares go.
                let [column, row] = match self.look.way.is_steep {
                    true => [index / rows, index % rows],
                    false => [index % columns, index / columns],
                };
                hint = self.square([first + SIDE * column, SIDE * row], hint);
            }
        }
    }
}

impl<T, Start: Fn(&T) -> f64, Of: Fn(f64) -> T> Band<'_, T, Start, Of> {
    /// Walks from the square of this column, and of this row of the band.
    #[inline(always)]
    fn square(&mut self, [column, first]: [usize; 2], hint: usize) -> usize {
        let look = self.look;
        let width = look.eyes.width;
        let index = (self.row + first) / SIDE * width.div_ceil(SIDE) + column / SIDE;
        if look
            .seeing
            .is_some_and(|seeing| !seeing[index].load(Ordering::Relaxed))
        {
            return hint;
        }
        let found = &mut self.found[first * width..];
        let mut square = look.square([column, self.row + first], found, self.start);
        square.hint = hint;
        if look.rise < 0.0 {
            square.most = [[f64::INFINITY; SIDE]; SIDE];
        } else {
            square.all();
        }
        for (row, found) in found.chunks_mut(width).take(SIDE).enumerate() {
            for (lane, found) in found[column..].iter_mut().take(SIDE).enumerate() {
                if !square.eyes[row][lane].is_nan() {
                    *found = (self.of)(square.most[row][lane]);
                }
            }
        }
        square.hint
    }
}

/// Cells of a square, and their horizons so far.
struct Square<'a> {
    look: &'a Look<'a>,
    column: usize,
    row: usize,
    /// Heights of eyes; NaN where there is none.
    eyes: [[f64; SIDE]; SIDE],
    /// Largest slopes so far.
    most: [[f64; SIDE]; SIDE],
    /// The small stretch in which a horizon rose last.
    hint: usize,
}

/// Small stretches that the lowest eye of a square sees highest.
struct Best {
    lowest: f64,
    most: usize,
    /// Slopes to the peaks of stretches, and their numbers.
    found: Vec<(f64, usize)>,
    /// Stretches of which the slope is at most this one are left out.
    least: f64,
}

impl Best {
    fn new(square: &Square<'_>) -> Self {
        let eyes = square.eyes.iter().flatten();
        Self {
            lowest: eyes.fold(f64::INFINITY, |lowest, &eye| lowest.min(eye)),
            most: match square.look.goal {
                Goal::Marks(_, most) => most,
                Goal::Surface(_) => 0,
            },
            found: Vec::new(),
            least: f64::NEG_INFINITY,
        }
    }

    #[inline(always)]
    fn slope(&self, square: &Square<'_>, level: usize, stretch: &Stretch) -> f64 {
        let up = square.look.levels[level].most(square.windows(stretch)) - self.lowest;
        up * stretch.reciprocals[usize::from(up <= 0.0)]
    }

    /// Whether a stretch of a level is left out.
    #[inline(always)]
    fn leaves(&self, square: &Square<'_>, level: usize, stretch: &Stretch) -> bool {
        self.least > f64::NEG_INFINITY && self.slope(square, level, stretch) <= self.least
    }

    fn add(&mut self, square: &Square<'_>, index: usize, stretch: &Stretch) {
        self.found.push((self.slope(square, 0, stretch), index));
        if self.found.len() > 2 * self.most {
            self.found.sort_by(|(a, _), (b, _)| b.total_cmp(a));
            self.least = self.found[self.most].0;
            self.found.truncate(self.most);
        }
    }
}

impl Square<'_> {
    #[inline(always)]
    fn all(&mut self) {
        let stretches = &self.look.way.stretches;
        if let (Goal::Surface(field), Some(stretch)) =
            (&self.look.goal, stretches[0].get(self.hint))
        {
            let rows = self.rows_below(0, stretch);
            self.take(field, self.hint, stretch, rows);
        }
        let mut best = Best::new(self);
        for large in &stretches[2] {
            if best.leaves(self, 2, large) || self.rows_below(2, large) == [false; SIDE] {
                continue;
            }
            for middle in &stretches[1][large.parts.clone()] {
                if best.leaves(self, 1, middle) || self.rows_below(1, middle) == [false; SIDE] {
                    continue;
                }
                for index in middle.parts.clone() {
                    let stretch = &stretches[0][index];
                    if best.leaves(self, 0, stretch) {
                        continue;
                    }
                    let rows = self.rows_below(0, stretch);
                    if rows == [false; SIDE] {
                        continue;
                    }
                    match self.look.goal {
                        Goal::Surface(field) => self.take(field, index, stretch, rows),
                        Goal::Marks(..) => best.add(self, index, stretch),
                    }
                }
            }
        }
        if let (Goal::Marks(marks, most), Some(seeing)) = (&self.look.goal, self.look.seeing) {
            best.found.sort_by(|(a, _), (b, _)| b.total_cmp(a));
            let found = best.found.iter();
            let marked = found.filter(|(_, index)| self.mark(marks, &stretches[0][*index]));
            let is_seeing = marked.take(*most).count() > 0 || best.least > f64::NEG_INFINITY;
            let columns = self.look.eyes.width.div_ceil(SIDE);
            let own = self.row / SIDE * columns + self.column / SIDE;
            seeing[own].store(is_seeing, Ordering::Relaxed);
        }
    }

    /// Marks squares with ends of edges that a small stretch crosses, if their peaks may be above the horizon of an eye. Whether
    /// there are any.
    fn mark(&self, marks: &[AtomicBool], stretch: &Stretch) -> bool {
        let squares = self.look.levels[0].squares(self.windows(stretch));
        let may_rise = |(square, cells, peak): &(usize, [Range<isize>; 2], f64)| {
            let rows = self.rows_of(*peak, stretch);
            rows != [false; SIDE]
                && (marks[*square].load(Ordering::Relaxed)
                    || self.crosses(stretch, rows, cells, *peak))
        };
        let highest = squares.filter(may_rise).max_by(|a, b| a.2.total_cmp(&b.2));
        if let Some((square, ..)) = highest {
            marks[square].store(true, Ordering::Relaxed);
        }
        highest.is_some()
    }

    /// Whether a crossing of a small stretch with an end in some columns and rows may be above the horizon of an eye.
    fn crosses(
        &self,
        stretch: &Stretch,
        rows: [bool; SIDE],
        cells: &[Range<isize>; 2],
        peak: f64,
    ) -> bool {
        let way = self.look.way;
        way.crossings[stretch.parts.clone()].iter().any(|crossing| {
            let far = self.look.drop * crossing.distance;
            (0..SIDE).filter(|&row| rows[row]).any(|row| {
                let at = [self.column, self.row + row].map(|at| at as isize);
                let ends = crossing.ends.map(|end| [at[0] + end[0], at[1] + end[1]]);
                ends.iter().any(|end| {
                    if !cells[1].contains(&end[1]) {
                        return false;
                    }
                    let first = (cells[0].start - end[0]).clamp(0, SIDE as isize) as usize;
                    let last = (cells[0].end - end[0]).clamp(0, SIDE as isize) as usize;
                    (first..last.max(first)).any(|lane| {
                        let slope = (peak - self.eyes[row][lane]) * crossing.reciprocal - far;
                        let is_in = |end: &[isize; 2]| {
                            way.cells[0].contains(&(end[0] + lane as isize))
                                && way.cells[1].contains(&end[1])
                        };
                        slope > self.most[row][lane] && ends.iter().all(is_in)
                    })
                })
            })
        })
    }

    /// Rows of the square in which the horizon of a cell is below what the peak of a stretch may be.
    #[inline(always)]
    fn rows_below(&self, level: usize, stretch: &Stretch) -> [bool; SIDE] {
        self.rows_of(self.look.levels[level].most(self.windows(stretch)), stretch)
    }

    /// The same for this peak.
    #[inline(always)]
    fn rows_of(&self, peak: f64, stretch: &Stretch) -> [bool; SIDE] {
        let mut rows = [false; SIDE];
        if peak == f64::NEG_INFINITY {
            return rows;
        }
        let lower = self.look.drop * stretch.distances[0];
        let [near, far] = stretch.reciprocals;
        // No closures: they would not be compiled for the CPU's vectors.
        for row in 0..SIDE {
            let (eyes, most) = (&self.eyes[row], &self.most[row]);
            let mut is_below = false;
            for lane in 0..SIDE {
                let up = peak - eyes[lane];
                let slope = if up > 0.0 { up * near } else { up * far };
                is_below |= slope - lower > most[lane];
            }
            rows[row] = is_below;
        }
        rows
    }

    /// Columns and rows to which a stretch leads the cells of the square.
    #[inline(always)]
    fn windows(&self, stretch: &Stretch) -> [Range<isize>; 2] {
        let places = [self.column, self.row].map(|at| at as isize);
        [0, 1].map(|axis| {
            let Range { start, end } = stretch.offsets[axis];
            places[axis] + start..places[axis] + end + SIDE as isize - 1
        })
    }

    /// Takes the crossings of a small stretch for some rows of the square.
    #[inline(always)]
    fn take(
        &mut self,
        field: &HeightField<'_>,
        index: usize,
        stretch: &Stretch,
        rows: [bool; SIDE],
    ) {
        let size = field.size().map(|size| size as isize);
        let windows = self.windows(stretch);
        let is_whole =
            (0..2).all(|axis| windows[axis].start >= 0 && windows[axis].end <= size[axis]);
        let crossings = &self.look.way.crossings[stretch.parts.clone()];
        for row in (0..SIDE).filter(|&row| rows[row]) {
            let before = self.most[row];
            if is_whole && !field.has_holes() {
                self.cross_all(field, row, crossings);
            } else {
                // No closure, which would not be compiled for the CPU's vectors.
                for crossing in crossings {
                    self.cross(field, row, crossing);
                }
            }
            if before != self.most[row] {
                self.hint = index;
            }
        }
    }

    /// Takes crossings for the cells of a row, none of which leads out of the raster or beside a hole.
    #[inline(always)]
    fn cross_all(&mut self, field: &HeightField<'_>, row: usize, crossings: &[Crossing]) {
        let mut most = self.most[row];
        for crossing in crossings {
            let slopes = self.slopes(field, row, crossing);
            for lane in 0..SIDE {
                most[lane] = if slopes[lane] > most[lane] {
                    slopes[lane]
                } else {
                    most[lane]
                };
            }
        }
        self.most[row] = most;
    }

    /// Slopes to a crossing from the cells of a row, none of which leads out of the raster; NaN where an end has no data.
    #[inline(always)]
    fn slopes(&self, field: &HeightField<'_>, row: usize, crossing: &Crossing) -> [f64; SIDE] {
        let heights = field.heights();
        let first = (self.row + row) * field.size()[0] + self.column;
        let [a, b] = crossing.offsets.map(|offset| {
            let first = first.wrapping_add_signed(offset);
            &heights[first..first + SIDE]
        });
        let lower = self.look.drop * crossing.distance;
        let mut slopes = [0.0; SIDE];
        for lane in 0..SIDE {
            slopes[lane] = crossing.slope([a[lane], b[lane]], self.eyes[row][lane]) - lower;
        }
        slopes
    }

    /// Takes a crossing for the cells of a row that have such an edge.
    #[inline(always)]
    fn cross(&mut self, field: &HeightField<'_>, row: usize, crossing: &Crossing) {
        let size = field.size().map(|size| size as isize);
        let first = [self.column, self.row + row].map(|at| at as isize);
        let side = SIDE as isize;
        let (mut is_beside, mut is_whole) = (false, true);
        for end in crossing.ends {
            let [column, row] = [first[0] + end[0], first[1] + end[1]];
            is_beside |= column <= -side || column >= size[0] || row < 0 || row >= size[1];
            is_whole &= column >= 0 && column + side <= size[0];
        }
        if is_beside {
            return;
        }
        let mut rises = !is_whole;
        if is_whole {
            let slopes = self.slopes(field, row, crossing);
            let (is_edge, is_known) = self.are_edges(field, row, crossing);
            let mut most = self.most[row];
            for lane in 0..SIDE {
                let is_higher = is_edge[lane] & (slopes[lane] > most[lane]);
                most[lane] = if is_higher { slopes[lane] } else { most[lane] };
                rises |= is_higher;
            }
            if is_known {
                self.most[row] = most;
                return;
            }
        }
        if rises {
            self.cross_each(field, row, crossing);
        }
    }

    /// Whether a triangle has the crossed edges with data, and whether this is known: neighbours may be wires, and corners by themselves.
    #[inline(always)]
    fn are_edges(
        &self,
        field: &HeightField<'_>,
        row: usize,
        crossing: &Crossing,
    ) -> ([bool; SIDE], bool) {
        let mut are = [true; SIDE];
        let ([[a, b], [c, d]], width) = (crossing.ends, field.size()[0]);
        if !field.has_holes() {
            return (are, true);
        }
        if a == c || b == d {
            return (are, (a != c || b != d) && field.wires().is_empty());
        }
        // The other corners of the square.
        let first = (self.row + row) * width + self.column;
        let [left, right] = [[a, d], [c, b]].map(|[column, row]| {
            let first = first.wrapping_add_signed(row * width as isize + column);
            &field.heights()[first..first + SIDE]
        });
        let is_main = (a < c) == (b < d);
        for lane in 0..SIDE {
            let [left, right] = [!left[lane].is_nan(), !right[lane].is_nan()];
            are[lane] = if is_main { left | right } else { left != right };
        }
        (are, true)
    }

    /// Takes a crossing for the cells of a row one after the other.
    #[inline(never)]
    fn cross_each(&mut self, field: &HeightField<'_>, row: usize, crossing: &Crossing) {
        let first = [self.column, self.row + row].map(|at| at as isize);
        for lane in 0..SIDE {
            let ends = crossing.ends.map(|[column, row]| {
                [first[0] + column + lane as isize, first[1] + row].map(|x| x as f64)
            });
            let [Some(a), Some(b)] = ends.map(|end| field.height_at(end)) else {
                continue;
            };
            let lower = self.look.drop * crossing.distance;
            let slope = crossing.slope([a, b], self.eyes[row][lane]) - lower;
            let is_higher = slope > self.most[row][lane];
            if is_higher && (!field.has_holes() || is_edge(field, ends)) {
                self.most[row][lane] = slope;
            }
        }
    }
}
