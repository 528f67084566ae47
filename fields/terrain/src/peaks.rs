//! Largest heights of squares, by which walks leave out what cannot matter.

use std::ops::Range;

use crate::{Error, HeightField, memory};

/// Cells on a side of the squares of each level.
pub(crate) const SIDES: [usize; 3] = [8, 64, 512];

/// Largest height in each square of a field, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Peaks {
    /// Cells on a side, a power of two.
    side: usize,
    size: [usize; 2],
    /// Numbers from row to row.
    stride: usize,
    peaks: Vec<f64>,
}

impl Peaks {
    /// Peaks of the squares of a field with so many cells on a side, the first of which begins at its first cell.
    ///
    /// # Errors
    /// [`Error::Range`] if the side is no power of two; [`Error::NoMemory`].
    pub fn new(field: &HeightField<'_>, side: usize) -> Result<Self, Error> {
        Self::of_squares(field, side, 0)
    }

    /// Peaks of a field of this size that [`Peaks::values`] gave, or larger ones, such as those rounded up to single precision.
    ///
    /// # Errors
    /// [`Error::Length`] if there are not as many as squares, and as of [`Peaks::new`].
    pub fn from_values(size: [usize; 2], side: usize, values: &[f64]) -> Result<Self, Error> {
        let mut all = Self::none(size, side)?;
        let [columns, rows] = all.size;
        Error::check_length("peaks", values.len(), columns * rows)?;
        let own = all.peaks.chunks_mut(all.stride);
        for (own, values) in own.zip(values.chunks(columns.max(1))) {
            own[..columns].copy_from_slice(values);
        }
        Ok(all)
    }

    /// The peak of each square, row by row; minus infinity where there is no data.
    pub fn values(&self) -> Vec<f64> {
        let rows = self.peaks.chunks(self.stride);
        rows.flat_map(|row| &row[..self.size[0]]).copied().collect()
    }

    /// No peaks yet for squares with so many cells on a side.
    fn none([width, height]: [usize; 2], side: usize) -> Result<Self, Error> {
        let wanted = "a power of two";
        Error::check_range(
            "side of squares",
            side as f64,
            side.is_power_of_two(),
            wanted,
        )?;
        let size = [width.div_ceil(side), height.div_ceil(side)];
        // No power of two from row to row, which would crowd few sets of a cache.
        let stride = size[0] | 1;
        let peaks = memory::filled("peaks", stride * size[1], f64::NEG_INFINITY)?;
        Ok(Self {
            side,
            size,
            stride,
            peaks,
        })
    }

    /// Peaks of squares with so many cells on a side, and `more` cells of the next ones.
    pub(crate) fn of_squares(
        field: &HeightField<'_>,
        side: usize,
        more: usize,
    ) -> Result<Self, Error> {
        let size @ [width, _] = field.size();
        let mut all = Self::none(size, side)?;
        for (row, heights) in field.heights().chunks_exact(width).enumerate() {
            for square in row.saturating_sub(more) / side..=row / side {
                let peaks = &mut all.peaks[square * all.stride..][..all.size[0]];
                for (index, peak) in peaks.iter_mut().enumerate() {
                    let heights = &heights[index * side..width.min((index + 1) * side + more)];
                    // NaN does not count.
                    *peak = heights.iter().fold(*peak, |peak, &height| peak.max(height));
                }
            }
        }
        Ok(all)
    }

    /// Peaks for stretches of each level, as fine as these are.
    pub(crate) fn levels(self) -> Result<[Self; 3], Error> {
        let [_, middle, large] = SIDES;
        let middle = self.coarser(middle)?;
        let large = middle.coarser(large)?;
        Ok([self, middle, large])
    }

    /// Peaks of squares with at least so many cells on a side.
    fn coarser(&self, side: usize) -> Result<Self, Error> {
        let count = side / self.side;
        if count < 2 {
            return Ok(self.clone());
        }
        let mut all = Self::none(self.size, count)?;
        all.side = side;
        for (row, peaks) in self.peaks.chunks_exact(self.stride).enumerate() {
            let coarse = &mut all.peaks[row / count * all.stride..];
            for (peaks, coarse) in peaks[..self.size[0]].chunks(count).zip(coarse) {
                *coarse = peaks.iter().fold(*coarse, |peak, &own| peak.max(own));
            }
        }
        Ok(all)
    }

    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.peaks[..])
    }

    /// Cells on a side of the squares.
    pub(crate) fn side(&self) -> usize {
        self.side
    }

    /// Numbers of columns and rows of squares.
    pub(crate) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The number of the square that has a cell, unless the cell is beside the field, and its peak.
    #[inline(always)]
    pub(crate) fn around(&self, cell: [isize; 2]) -> Option<(usize, f64)> {
        let [column, row] = cell.map(|at| (at >> self.side.trailing_zeros()) as usize);
        let is_in = column < self.size[0] && row < self.size[1];
        is_in.then(|| {
            (
                row * self.size[0] + column,
                self.peaks[row * self.stride + column],
            )
        })
    }

    /// Columns and rows of all squares that have cells of some columns and rows, as far as there are any.
    #[inline(always)]
    fn ranges(&self, cells: [Range<isize>; 2]) -> [Range<usize>; 2] {
        let shift = self.side.trailing_zeros();
        let squares = |cells: &Range<isize>, count: usize| {
            let first = (cells.start >> shift).max(0) as usize;
            let end = (((cells.end - 1) >> shift) + 1).max(0) as usize;
            first..end.min(count)
        };
        [
            squares(&cells[0], self.size[0]),
            squares(&cells[1], self.size[1]),
        ]
    }

    /// Numbers of these squares, their own columns and rows, and their peaks.
    pub(crate) fn squares(
        &self,
        cells: [Range<isize>; 2],
    ) -> impl Iterator<Item = (usize, [Range<isize>; 2], f64)> {
        let ([columns, rows], side) = (self.ranges(cells), self.side as isize);
        let cells = move |at: usize| at as isize * side..(at as isize + 1) * side;
        rows.flat_map(move |row| {
            columns.clone().map(move |column| {
                let number = row * self.size[0] + column;
                let peak = self.peaks[row * self.stride + column];
                (number, [cells(column), cells(row)], peak)
            })
        })
    }

    /// The largest of their peaks.
    #[inline(always)]
    pub(crate) fn most(&self, cells: [Range<isize>; 2]) -> f64 {
        let [columns, rows] = self.ranges(cells);
        let mut most = f64::NEG_INFINITY;
        for row in rows {
            for column in columns.clone() {
                most = most.max(self.peaks[row * self.stride + column]);
            }
        }
        most
    }
}
