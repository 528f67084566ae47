//! A height field as it is swept for viewsheds: by rows and by columns, with the tops of blocks.

use std::collections::HashSet;
use std::ops::Range;

use crate::height_field::Wire;
use crate::{Error, HeightField, memory};

/// Cells that are turned at a time, so that rows and columns stay in the cache.
const TILE: usize = 32;

/// A field in both orders.
pub struct Turned<'a> {
    field: &'a HeightField<'a>,
    /// Heights column by column: a transposed copy.
    columns: Vec<f64>,
    /// Tops of rows and of columns: see [`tops`].
    tops: [Vec<f64>; 2],
}

impl<'a> Turned<'a> {
    pub fn new(field: &'a HeightField<'a>) -> Result<Self, Error> {
        let [width, height] = field.size();
        let heights = field.heights();
        let mut columns = memory::filled("heights", heights.len(), 0.0)?;
        for top in (0..height).step_by(TILE) {
            for left in (0..width).step_by(TILE) {
                for column in left..(left + TILE).min(width) {
                    for row in top..(top + TILE).min(height) {
                        columns[column * height + row] = heights[row * width + column];
                    }
                }
            }
        }
        let tops = [tops(heights, width)?, tops(&columns, height)?];
        Ok(Self {
            field,
            columns,
            tops,
        })
    }

    pub fn field(&self) -> &'a HeightField<'a> {
        self.field
    }

    /// The field as it looks from a cell: along columns or rows, forwards or backwards.
    pub fn view(&self, side: Side, [column, row]: [f64; 2]) -> View<'_> {
        let [_, a, b, _, d, e] = self.field.transform();
        let [width, height] = self.field.size();
        let metric = [a * a + d * d, a * b + d * e, b * b + e * e];
        let is_east_west = matches!(side, Side::East | Side::West);
        let [xx, xy, yy] = metric;
        let tops = &self.tops[usize::from(is_east_west)][..];
        let (heights, size, at, metric) = match is_east_west {
            true => (
                &self.columns[..],
                [width, height],
                [column, row],
                [xx, xy, yy],
            ),
            false => (
                self.field.heights(),
                [height, width],
                [row, column],
                [yy, xy, xx],
            ),
        };
        let is_turned = matches!(side, Side::West | Side::North);
        let last = size.map(|size| size as f64 - 1.0);
        View {
            heights,
            lines: size[0],
            length: size[1],
            eye: match is_turned {
                true => [last[0] - at[0], last[1] - at[1]],
                false => at,
            },
            metric,
            is_turned,
            is_east_west,
            tops,
            wires: self.field.wires(),
        }
    }
}

/// Cells of a block of a line.
const BLOCK: usize = 32;

/// Cells on both sides of a block that its top counts: those that edges of the block may end at.
const MARGIN: usize = 2;

/// Largest height in each block of each line, and in the cells beside it.
fn tops(heights: &[f64], length: usize) -> Result<Vec<f64>, Error> {
    let mut tops = Vec::new();
    for line in heights.chunks_exact(length) {
        memory::grow(&mut tops, "heights", length.div_ceil(BLOCK))?;
        tops.extend((0..length).step_by(BLOCK).map(|first| {
            let cells = first.saturating_sub(MARGIN)..(first + BLOCK + MARGIN).min(length);
            let known = line[cells]
                .iter()
                .copied()
                .filter(|height| height.is_finite());
            known.fold(f64::NEG_INFINITY, f64::max)
        }));
    }
    Ok(tops)
}

/// A quarter of the plan around an eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    East,
    South,
    West,
    North,
}

impl Side {
    pub const ALL: [Self; 4] = [Self::East, Self::South, Self::West, Self::North];
}

/// A field that an eye looks along: lines are ahead one behind another, and the cells of each line from side to side. Diagonals go
/// from a cell to the next one of the next line.
pub struct View<'a> {
    heights: &'a [f64],
    pub lines: usize,
    pub length: usize,
    /// Line of the eye, and its place there.
    pub eye: [f64; 2],
    /// Products of the steps to the next line and to the next cell: squared lengths of plans are `xx x² + 2 xy x y + yy y²`.
    pub metric: [f64; 3],
    is_turned: bool,
    is_east_west: bool,
    tops: &'a [f64],
    wires: &'a HashSet<Wire>,
}

impl View<'_> {
    /// Height of a cell.
    #[inline]
    pub fn height(&self, line: usize, at: usize) -> f64 {
        self.heights[self.index(line, at)]
    }

    #[inline]
    fn index(&self, line: usize, at: usize) -> usize {
        let index = line * self.length + at;
        match self.is_turned {
            true => self.heights.len() - 1 - index,
            false => index,
        }
    }

    /// Number of blocks of a line.
    fn blocks(&self) -> usize {
        self.length.div_ceil(BLOCK)
    }

    /// Place of the first block, which may be before the first cell.
    fn first_block(&self) -> isize {
        match self.is_turned {
            true => self.length as isize - (BLOCK * self.blocks()) as isize,
            false => 0,
        }
    }

    /// Block of a cell of a line.
    pub fn block(&self, at: usize) -> usize {
        (at as isize - self.first_block()) as usize / BLOCK
    }

    /// Cells of a block.
    pub fn cells(&self, block: usize) -> Range<usize> {
        let first = (BLOCK * block) as isize + self.first_block();
        first.max(0) as usize..((first + BLOCK as isize) as usize).min(self.length)
    }

    /// Largest height in a block of a line, and in the two cells on both sides of it.
    pub fn top(&self, line: usize, block: usize) -> f64 {
        let index = line * self.blocks() + block;
        match self.is_turned {
            true => self.tops[self.tops.len() - 1 - index],
            false => self.tops[index],
        }
    }

    /// Number of a cell in the rows of the raster.
    #[inline]
    pub fn cell(&self, line: usize, at: usize) -> usize {
        let index = self.index(line, at);
        match self.is_east_west {
            true => index % self.length * self.lines + index / self.length,
            false => index,
        }
    }

    /// Whether two neighbours with data belong to a triangle.
    #[inline]
    pub fn is_joined(&self, a: [usize; 2], b: [usize; 2]) -> bool {
        if self.wires.is_empty() {
            return true;
        }
        let mut wire = [a, b].map(|[line, at]| self.cell(line, at));
        wire.sort_unstable();
        !self.wires.contains(&wire)
    }

    /// Squared length in plan from the eye.
    #[inline]
    pub fn squared(&self, x: f64, y: f64) -> f64 {
        let [xx, xy, yy] = self.metric;
        xx * x * x + 2.0 * xy * x * y + yy * y * y
    }

    /// Least squared length in plan to a place so many lines ahead.
    pub fn least_squared(&self, x: f64) -> f64 {
        let [xx, xy, yy] = self.metric;
        x * x * (xx - xy * xy / yy)
    }

    /// Distance ahead, in lines, from which on all places are farther than a length in plan.
    pub fn most_lines(&self, length: f64) -> f64 {
        let [xx, xy, yy] = self.metric;
        length * (yy / (xx * yy - xy * xy)).sqrt()
    }
}
