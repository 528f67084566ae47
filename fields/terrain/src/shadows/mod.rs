//! Shadows: the cells that light from far away reaches, in any direction.
//!
//! # Strips
//!
//! All rays towards a light are parallel. In plan, lines along them that are one column apart at a row are one column apart at every row,
//! and divide the raster into strips. Each place has a *key*: its height plus as much as a ray climbs on the way from it to the side of
//! the light. So places on a ray have one key, and a cell is in shadow if the surface ahead of it has a larger one.
//!
//! A sweep walks from the light from row to row (columns where rays are nearer to these) and keeps two keys for each strip. The highest key
//! of everything in the strip is at the crossings of both lines with edges of triangles or at a cell between them, since the surface
//! is straight elsewhere. No ray of the strip can reach a higher one. And no ray can pass below the lowest key that the surface has across
//! the whole strip at any row. A cell above the first key is lit and one below the second key is dark, which decides nine cells of ten
//! for a few vector operations however far it looks. Crossings with the nearest rows are at the same offsets for all cells of a row, and
//! are taken one by one instead, because next to a cell a strip is as wide as what it distinguishes.
//!
//! # Exactness
//!
//! Bounds are in single precision and know by how much they may be rounded. Cells between them are decided by the crossings of their own
//! ray in double precision, in those blocks of eight rows that are high enough to matter. So the answer is the one that
//! [`March`](crate::March) gives: a cell is lit if the slope of the light is above the slope of its horizon in that azimuth.
//!
//! Beside cells without data, squares with three corners have the other diagonal, and edges may be missing. Then both diagonals count for
//! the first key, and only cells that are joined to all neighbours for the second one.

mod planes;
mod ray;
mod strips;

use std::ops::Range;

use antumbra_simd::{Dispatch, Isa};
use rayon::prelude::*;

use crate::angles::check_azimuths;
use crate::{Error, HeightField, Monitor, Progress, memory};
pub use planes::per_cell;
use planes::{moved, turn};
use ray::{NEAR, Ray};
use strips::{LANES, Strips};

/// Which cells of a height field get light from far away, such as from the sun or from a part of the sky.
pub struct Shadows<'a> {
    field: &'a HeightField<'a>,
    rise: f64,
    /// Difference of the highest and the lowest cell.
    relief: f64,
    /// Heights by rows, and by columns.
    grids: [Grid; 2],
}

impl<'a> Shadows<'a> {
    /// Shadows at eyes that are `rise` above their cells. Below 0 they get no light.
    ///
    /// The memory is 8 bytes for each cell, and twice as much where edges between cells with data are missing.
    ///
    /// # Errors
    /// [`Error::NoMemory`]; [`Error::Range`] if heights differ by more than 1e30, such as from a mark of missing data that is taken for a
    /// height.
    pub fn new(field: &'a HeightField<'a>, rise: f64) -> Result<Self, Error> {
        let ends = [f64::INFINITY, f64::NEG_INFINITY];
        // NaN counts for nothing.
        let [lowest, highest] = field.heights().iter().fold(ends, |[low, high], &height| {
            let (is_lower, is_higher) = (height < low, height > high);
            [
                if is_lower { height } else { low },
                if is_higher { height } else { high },
            ]
        });
        let relief = (highest - lowest).max(0.0);
        let wanted = "at most 1e30; a height that marks missing data is to be named as such, as with gdal_translate -a_nodata";
        Error::check_range("difference of heights", relief, relief <= 1e30, wanted)?;
        let loose = loose(field);
        let grid = |by_columns| Grid::new(field, lowest, &loose, by_columns);
        Ok(Self {
            field,
            rise,
            relief,
            grids: [grid(false)?, grid(true)?],
        })
    }

    /// The cells that see a point infinitely far away. `azimuth` is in degrees from the north of the map (`y`) through east, and `slope` is
    /// the tangent of its elevation: infinite at the zenith.
    ///
    /// The result has a bit for each cell, row by row, 64 a word from the lowest bit up. Each row begins with a new word. Cells without
    /// data have 0. A light exactly on the horizon of a cell is hidden.
    ///
    /// # Errors
    /// [`Error::Range`] if the azimuth is not finite or the slope NaN; [`Error::NoMemory`].
    ///
    /// ```
    /// use antumbra_terrain::{HeightField, Shadows};
    ///
    /// // A wall of 2 m in the east of a plain, and a sun 30 degrees high behind it: its shadow is 3.46 m long.
    /// let heights = [0.0, 0.0, 0.0, 0.0, 0.0, 2.0].repeat(2);
    /// let field = HeightField::new([6, 2], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
    /// let lit = Shadows::new(&field, 0.0)?.lit(90.0, 30f64.to_radians().tan())?;
    /// assert_eq!(lit, [0b100011, 0b100011]);
    /// # Ok::<(), antumbra_terrain::Error>(())
    /// ```
    pub fn lit(&self, azimuth: f64, slope: f64) -> Result<Vec<u64>, Error> {
        self.lit_in([azimuth, slope], &self.field.size().map(|size| 0..size), 0)
    }

    /// The same for the cells of some columns and rows, as a plane of these. The others may only hide them, up to so many rows (or
    /// columns, if rays pass more of these) towards the light.
    fn lit_in(
        &self,
        [azimuth, slope]: [f64; 2],
        part: &[Range<usize>; 2],
        far: usize,
    ) -> Result<Vec<u64>, Error> {
        check_azimuths(&[azimuth])?;
        let wanted = "the tangent of an elevation";
        Error::check_range("slope", slope, !slope.is_nan(), wanted)?;
        let ray = Ray::new(self, azimuth, slope.clamp(-STEEP, STEEP));
        let mut part = part.clone();
        if ray.is_turned {
            part.reverse();
        }
        let [columns, rows] = &part;
        let words = columns.start / 64..columns.end.div_ceil(64);
        let mut plane = memory::filled("words", rows.len() * words.len(), 0)?;
        if self.rise >= 0.0 && slope > f64::NEG_INFINITY {
            Isa::best().dispatch(Strips::new(self, &ray, (&part, far), &mut plane)?);
        }
        let plane = moved(plane, words.len(), columns.start % 64, columns.len())?;
        match ray.is_turned {
            true => turn(&plane, [columns.len(), rows.len()]),
            false => Ok(plane),
        }
    }

    /// [`Shadows::lit`] for many directions, each an azimuth and a slope, with all threads. See [`per_cell`] for what each cell sees.
    ///
    /// # Errors
    /// As of [`Shadows::lit`], and [`Error::Cancelled`].
    pub fn all_lit(
        &self,
        directions: &[[f64; 2]],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<u64>>, Error> {
        let part = self.field.size().map(|size| 0..size);
        self.all_lit_in(directions, &part, &vec![0; directions.len()], monitor)
    }

    /// The same for the cells of some columns and rows, which others hide up to so many rows away in each direction.
    pub(crate) fn all_lit_in(
        &self,
        directions: &[[f64; 2]],
        part: &[Range<usize>; 2],
        far: &[usize],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<u64>>, Error> {
        let progress = Progress::new(monitor, directions.len());
        let planes = directions.par_iter().zip(far).map(|(&direction, &far)| {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            let plane = self.lit_in(direction, part, far);
            progress.add(1);
            plane
        });
        planes.collect()
    }
}

/// A slope that is as good as infinite, and whose keys are finite in single precision.
pub(crate) const STEEP: f64 = 1e20;

/// Numbers before the first column, which no crossing near a cell exceeds.
const PAD: usize = 8;

/// Heights above the lowest one in single precision.
struct Grid {
    columns: usize,
    rows: usize,
    /// Numbers from row to row. Before and behind each row is NaN.
    stride: usize,
    heights: Vec<f32>,
    /// The same, but NaN for cells that are not joined to all neighbours with data; empty if there are none.
    joined: Vec<f32>,
    /// For each row, whether some columns at a time are near a cell without data; empty if all have data.
    gaps: Vec<bool>,
}

impl Grid {
    /// The grid of a field whose lowest height and loose cells are known.
    fn new(
        field: &HeightField<'_>,
        lowest: f64,
        loose: &[usize],
        by_columns: bool,
    ) -> Result<Self, Error> {
        let [width, height] = field.size();
        let turned = |[a, b]: [usize; 2]| if by_columns { [b, a] } else { [a, b] };
        let [columns, rows] = turned([width, height]);
        let stride = PAD + columns.next_multiple_of(LANES) + 2 * LANES;
        let mut heights = memory::filled("heights", rows * stride, f32::NAN)?;
        let above = |height: &f64| (height - lowest) as f32;
        let own = field.heights().chunks_exact(width).enumerate();
        if by_columns {
            // Few columns at a time, so that what is written stays near.
            for first in (0..width).step_by(16) {
                for (row, own) in own.clone() {
                    let own = &own[first..width.min(first + 16)];
                    let places = heights[first * stride + PAD + row..].iter_mut();
                    let places = places.step_by(stride).zip(own);
                    places.for_each(|(place, height)| *place = above(height));
                }
            }
        } else {
            for (row, own) in own {
                let places = heights[row * stride + PAD..].iter_mut().zip(own);
                places.for_each(|(place, height)| *place = above(height));
            }
        }
        let mut joined = Vec::new();
        if !loose.is_empty() {
            memory::grow(&mut joined, "heights", heights.len())?;
            joined.extend_from_slice(&heights);
            for cell in loose {
                let [column, row] = turned([cell % width, cell / width]);
                joined[row * stride + PAD + column] = f32::NAN;
            }
        }
        let mut gaps = Vec::new();
        if field.has_holes() {
            let chunks = columns.div_ceil(LANES);
            // A single row has no data around it, which is no cell without data.
            let known = if joined.is_empty() { &heights } else { &joined };
            gaps = memory::filled("gaps", rows * chunks, false)?;
            for row in 0..rows {
                for index in 0..chunks {
                    let own = &known[row * stride + PAD + LANES * index..];
                    let count = LANES.min(columns - LANES * index);
                    if own[..count].iter().any(|height| height.is_nan()) {
                        // Crossings near a cell are at most so many rows and columns away.
                        for row in row.saturating_sub(NEAR)..(row + NEAR + 1).min(rows) {
                            let near = index.saturating_sub(1)..(index + 2).min(chunks);
                            gaps[row * chunks..][near].fill(true);
                        }
                    }
                }
            }
        }
        Ok(Self {
            columns,
            rows,
            stride,
            heights,
            joined,
            gaps,
        })
    }

    /// Whether one of so many columns of a row is near a cell without data.
    fn has_gap(&self, row: usize, index: usize) -> bool {
        !self.gaps.is_empty() && self.gaps[row * self.columns.div_ceil(LANES) + index]
    }

    /// Heights of cells that are joined to all neighbours with data.
    fn joined(&self) -> &[f32] {
        match self.joined.is_empty() {
            true => &self.heights,
            false => &self.joined,
        }
    }
}

/// Cells with data that have neighbours in a row, a column or a diagonal to which no triangle joins them, or no neighbours.
fn loose(field: &HeightField<'_>) -> Vec<usize> {
    let mut loose: Vec<usize> = field.wires().iter().flatten().copied().collect();
    let [width, height] = field.size();
    let has = |cell: usize| field.heights()[cell].is_finite();
    if field.has_holes() {
        let is_single = |&cell: &usize| {
            let (column, row) = (cell % width, cell / width);
            has(cell)
                && !(column > 0 && has(cell - 1) || column + 1 < width && has(cell + 1))
                && !(row > 0 && has(cell - width) || row + 1 < height && has(cell + width))
        };
        loose.extend((0..width * height).filter(is_single));
        for row in 1..height {
            for last in row * width + 1..(row + 1) * width {
                let first = last - width - 1;
                if has(first) && has(last) && !has(last - width) && !has(last - 1) {
                    loose.extend([first, last]);
                }
            }
        }
    }
    loose
}
