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

use std::ops::Range;

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};
use rayon::prelude::*;

use crate::angles::check_azimuths;
use crate::crossing::{Crossing, is_edge};
use crate::{Error, HeightField, Monitor, Progress, memory};

/// Cells on a side of the squares of each level. Cells of one of the smallest are walked from together.
pub(crate) const SIDES: [usize; 3] = [SIDE, 64, 512];
const SIDE: usize = 8;

/// Cells on a side of the tiles whose squares are walked from one after the other, such that they read the same heights.
const TILE: usize = 64;

/// Slopes by which a stretch must be below the horizon: more than its bound is rounded.
const SLACK: f64 = 1e-12;

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
        let [small, middle, large] = SIDES.map(|side| Peaks::new(field, side, 0));
        Ok(Self {
            field,
            rise,
            drop,
            levels: [small?, middle?, large?],
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
        check_azimuths(&[azimuth])?;
        let [width, height] = self.field.size();
        let way = Way::new(self, azimuth);
        let mut found = memory::filled("horizons", width * height, f32::NAN)?;
        let rows = found.par_chunks_mut(TILE * width).enumerate();
        let progress = Progress::new(monitor, height.div_ceil(TILE));
        rows.try_for_each(|(index, found)| {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            Isa::best().dispatch(Band {
                march: self,
                way: &way,
                row: index * TILE,
                of: &of,
                found,
            });
            progress.add(1);
            Ok(())
        })?;
        Ok(found)
    }
}

/// Largest height in each square of a level, row by row.
pub(crate) struct Peaks {
    columns: usize,
    rows: usize,
    peaks: Vec<f64>,
}

impl Peaks {
    /// Peaks of squares with so many cells on a side, and `more` cells of the next ones.
    pub fn new(field: &HeightField<'_>, side: usize, more: usize) -> Result<Self, Error> {
        let [width, height] = field.size();
        // No power of two from row to row, which would crowd few sets of a cache.
        let columns = width.div_ceil(side) | 1;
        let rows = height.div_ceil(side);
        let mut peaks = memory::filled("peaks", columns * rows, f64::NEG_INFINITY)?;
        for (row, heights) in field.heights().chunks_exact(width).enumerate() {
            for square in row.saturating_sub(more) / side..=row / side {
                let peaks = &mut peaks[square * columns..][..columns];
                for (index, peak) in peaks.iter_mut().take(width.div_ceil(side)).enumerate() {
                    let heights = &heights[index * side..width.min((index + 1) * side + more)];
                    // NaN does not count.
                    *peak = heights.iter().fold(*peak, |peak, &height| peak.max(height));
                }
            }
        }
        Ok(Self {
            columns,
            rows,
            peaks,
        })
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.peaks[..])
    }

    /// The peak of all squares that have cells of some columns and rows, as far as there are any.
    #[inline(always)]
    pub fn most(&self, side: usize, [columns, rows]: [Range<isize>; 2]) -> f64 {
        // Sides are powers of two.
        let shift = side.trailing_zeros();
        let squares = |cells: Range<isize>, count: usize| {
            let first = (cells.start >> shift).max(0) as usize;
            let end = (((cells.end - 1) >> shift) + 1).max(0) as usize;
            first..end.min(count)
        };
        let columns = squares(columns, self.columns);
        let mut most = f64::NEG_INFINITY;
        for row in squares(rows, self.rows) {
            for column in columns.clone() {
                most = most.max(self.peaks[row * self.columns + column]);
            }
        }
        most
    }
}

/// Crossings between two distances.
struct Stretch {
    /// Crossings, or stretches of the level below.
    parts: Range<usize>,
    /// Columns and rows from the eye to all ends of edges.
    offsets: [Range<isize>; 2],
    /// Least and largest distance, and their reciprocals.
    distances: [f64; 2],
    reciprocals: [f64; 2],
}

/// All crossings in an azimuth, from near to far.
struct Way {
    /// Whether lines pass more rows than columns.
    is_steep: bool,
    crossings: Vec<Crossing>,
    /// Stretches of 8 cells, of 64 and of 512.
    stretches: [Vec<Stretch>; 3],
}

impl Way {
    fn new(march: &March<'_>, azimuth: f64) -> Self {
        let crossings = Crossing::all(march.field, azimuth, f64::INFINITY);
        let small = Self::small(&crossings);
        let middle = Self::larger(&small, SIDES[1] / SIDES[0]);
        let large = Self::larger(&middle, SIDES[2] / SIDES[1]);
        let [columns, rows] = march.field.step(azimuth);
        Self {
            is_steep: rows.abs() > columns.abs(),
            crossings,
            stretches: [small, middle, large],
        }
    }

    /// Stretches of as many columns or rows as squares have.
    fn small(crossings: &[Crossing]) -> Vec<Stretch> {
        let piece = |crossing: &Crossing| {
            let [column, row] = crossing.ends[0];
            column.abs().max(row.abs()) / SIDE as isize
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

/// Rows of tiles, whose squares are walked from one after the other.
struct Band<'a, Of> {
    march: &'a March<'a>,
    way: &'a Way,
    /// The first row.
    row: usize,
    of: &'a Of,
    found: &'a mut [f32],
}

impl<Of: Fn(f64) -> f32> WithSimd<SIDE> for Band<'_, Of> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<SIDE>>(mut self, _: S) {
        let [width, _] = self.march.field.size();
        let rows = (self.found.len() / width).div_ceil(SIDE);
        let mut hint = 0;
        for first in (0..width).step_by(TILE) {
            let columns = TILE.min(width - first).div_ceil(SIDE);
            for index in 0..columns * rows {
                // Along the lines, as far as squares go.
                let [column, row] = match self.way.is_steep {
                    true => [index / rows, index % rows],
                    false => [index % columns, index / columns],
                };
                hint = self.square([first + SIDE * column, SIDE * row], hint);
            }
        }
    }
}

impl<Of: Fn(f64) -> f32> Band<'_, Of> {
    /// Walks from the square of this column, and of this row of the band.
    #[inline(always)]
    fn square(&mut self, [column, first]: [usize; 2], hint: usize) -> usize {
        let field = self.march.field;
        let [width, _] = field.size();
        let mut square = Square {
            march: self.march,
            way: self.way,
            column,
            row: self.row + first,
            eyes: [[f64::NAN; SIDE]; SIDE],
            most: [[f64::NEG_INFINITY; SIDE]; SIDE],
            hint,
        };
        let columns = SIDE.min(width - column);
        let rows = SIDE.min(self.found.len() / width - first);
        for row in 0..rows {
            let heights = &field.heights()[(square.row + row) * width + column..][..columns];
            for (eye, height) in square.eyes[row].iter_mut().zip(heights) {
                *eye = height + self.march.rise;
            }
        }
        if self.march.rise < 0.0 {
            square.most = [[f64::INFINITY; SIDE]; SIDE];
        } else {
            square.all();
        }
        for row in 0..rows {
            for lane in 0..columns {
                if !square.eyes[row][lane].is_nan() {
                    self.found[(first + row) * width + column + lane] =
                        (self.of)(square.most[row][lane]);
                }
            }
        }
        square.hint
    }
}

/// Cells of a square, and their horizons so far.
struct Square<'a> {
    march: &'a March<'a>,
    way: &'a Way,
    column: usize,
    row: usize,
    /// Heights of eyes; NaN where there is none.
    eyes: [[f64; SIDE]; SIDE],
    /// Largest slopes so far.
    most: [[f64; SIDE]; SIDE],
    /// The small stretch in which a horizon rose last.
    hint: usize,
}

impl Square<'_> {
    #[inline(always)]
    fn all(&mut self) {
        if let Some(stretch) = self.way.stretches[0].get(self.hint) {
            self.take(self.hint, stretch, [true; SIDE]);
        }
        for large in &self.way.stretches[2] {
            if self.rows_below(2, large) == [false; SIDE] {
                continue;
            }
            for middle in &self.way.stretches[1][large.parts.clone()] {
                if self.rows_below(1, middle) == [false; SIDE] {
                    continue;
                }
                for index in middle.parts.clone() {
                    let stretch = &self.way.stretches[0][index];
                    let rows = self.rows_below(0, stretch);
                    if rows != [false; SIDE] {
                        self.take(index, stretch, rows);
                    }
                }
            }
        }
    }

    /// Rows of the square in which the horizon of a cell is below what the peak of a stretch may be.
    #[inline(always)]
    fn rows_below(&self, level: usize, stretch: &Stretch) -> [bool; SIDE] {
        let peak = self.march.levels[level].most(SIDES[level], self.windows(stretch));
        let lower = self.march.drop * stretch.distances[0] - SLACK;
        let [near, far] = stretch.reciprocals;
        // No closures: they would not be compiled for the CPU's vectors.
        let mut rows = [false; SIDE];
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
    fn take(&mut self, index: usize, stretch: &Stretch, rows: [bool; SIDE]) {
        let field = self.march.field;
        let size = field.size().map(|size| size as isize);
        let windows = self.windows(stretch);
        let is_whole =
            (0..2).all(|axis| windows[axis].start >= 0 && windows[axis].end <= size[axis]);
        let crossings = &self.way.crossings[stretch.parts.clone()];
        for row in (0..SIDE).filter(|&row| rows[row]) {
            let before = self.most[row];
            if is_whole && !field.has_holes() {
                self.cross_all(row, crossings);
            } else {
                // No closure, which would not be compiled for the CPU's vectors.
                for crossing in crossings {
                    self.cross(row, crossing);
                }
            }
            if before != self.most[row] {
                self.hint = index;
            }
        }
    }

    /// Takes crossings for the cells of a row, none of which leads out of the raster or beside a hole.
    #[inline(always)]
    fn cross_all(&mut self, row: usize, crossings: &[Crossing]) {
        let mut most = self.most[row];
        for crossing in crossings {
            let slopes = self.slopes(row, crossing);
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
    fn slopes(&self, row: usize, crossing: &Crossing) -> [f64; SIDE] {
        let heights = self.march.field.heights();
        let first = (self.row + row) * self.march.field.size()[0] + self.column;
        let [a, b] = crossing.offsets.map(|offset| {
            let first = first.wrapping_add_signed(offset);
            &heights[first..first + SIDE]
        });
        let lower = self.march.drop * crossing.distance;
        let mut slopes = [0.0; SIDE];
        for lane in 0..SIDE {
            slopes[lane] = crossing.slope([a[lane], b[lane]], self.eyes[row][lane]) - lower;
        }
        slopes
    }

    /// Takes a crossing for the cells of a row that have such an edge.
    #[inline(always)]
    fn cross(&mut self, row: usize, crossing: &Crossing) {
        let size = self.march.field.size().map(|size| size as isize);
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
            let slopes = self.slopes(row, crossing);
            let (is_edge, is_known) = self.are_edges(row, crossing);
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
            self.cross_each(row, crossing);
        }
    }

    /// Whether a triangle has the crossed edges with data, and whether this is known: neighbours may be wires, and corners by themselves.
    #[inline(always)]
    fn are_edges(&self, row: usize, crossing: &Crossing) -> ([bool; SIDE], bool) {
        let (field, mut are) = (self.march.field, [true; SIDE]);
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
    fn cross_each(&mut self, row: usize, crossing: &Crossing) {
        let field = self.march.field;
        let first = [self.column, self.row + row].map(|at| at as isize);
        for lane in 0..SIDE {
            let ends = crossing.ends.map(|[column, row]| {
                [first[0] + column + lane as isize, first[1] + row].map(|x| x as f64)
            });
            let [Some(a), Some(b)] = ends.map(|end| field.height_at(end)) else {
                continue;
            };
            let lower = self.march.drop * crossing.distance;
            let slope = crossing.slope([a, b], self.eyes[row][lane]) - lower;
            let is_higher = slope > self.most[row][lane];
            if is_higher && (!field.has_holes() || is_edge(field, ends)) {
                self.most[row][lane] = slope;
            }
        }
    }
}
