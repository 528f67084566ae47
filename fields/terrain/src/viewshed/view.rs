//! A height field as it is swept for viewsheds: by rows or by columns, with the tops of blocks.

use std::collections::HashSet;
use std::ops::Range;

use crate::height_field::Wire;
use crate::{Error, HeightField, memory};

/// A field as it is looked at from all sides.
pub struct Turned<'a> {
    field: &'a HeightField<'a>,
    /// Tops of rows and of columns: see [`tops`].
    tops: [Vec<f64>; 2],
}

impl<'a> Turned<'a> {
    pub fn new(field: &'a HeightField<'a>) -> Result<Self, Error> {
        Ok(Self {
            field,
            tops: tops(field)?,
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
        let (size, steps, at, metric) = match is_east_west {
            true => (
                [width, height],
                [1, width as isize],
                [column, row],
                [xx, xy, yy],
            ),
            false => (
                [height, width],
                [width as isize, 1],
                [row, column],
                [yy, xy, xx],
            ),
        };
        let is_turned = matches!(side, Side::West | Side::North);
        let last = size.map(|size| size as f64 - 1.0);
        View {
            heights: self.field.heights(),
            first: if is_turned { width * height - 1 } else { 0 },
            steps: if is_turned {
                steps.map(|step| -step)
            } else {
                steps
            },
            lines: size[0],
            length: size[1],
            eye: match is_turned {
                true => [last[0] - at[0], last[1] - at[1]],
                false => at,
            },
            metric,
            is_turned,
            tops,
            wires: self.field.wires(),
        }
    }
}

/// Cells of a block of a line.
const BLOCK: usize = 32;

/// Cells on both sides of a block that its top counts: those that edges of the block may end at.
const MARGIN: usize = 2;

/// Largest height in each block of each row and of each column, and in the cells beside it.
fn tops(field: &HeightField<'_>) -> Result<[Vec<f64>; 2], Error> {
    let (heights, [width, height]) = (field.heights(), field.size());
    let blocks = [width, height].map(|length| length.div_ceil(BLOCK));
    let mut of_rows = memory::filled("heights", height * blocks[0], f64::NEG_INFINITY)?;
    let mut of_columns = memory::filled("heights", width * blocks[1], f64::NEG_INFINITY)?;
    let mut highest = memory::filled("heights", width, f64::NEG_INFINITY)?;
    let around = |block: usize, length: usize| {
        let first = block * BLOCK;
        first.saturating_sub(MARGIN)..(first + BLOCK + MARGIN).min(length)
    };
    for block in 0..blocks[1] {
        highest.fill(f64::NEG_INFINITY);
        for row in around(block, height) {
            let line = &heights[row * width..(row + 1) * width];
            for (highest, &height) in highest.iter_mut().zip(line) {
                *highest = larger(*highest, height);
            }
        }
        for (column, &highest) in highest.iter().enumerate() {
            of_columns[column * blocks[1] + block] = highest;
        }
    }
    for (line, tops) in heights
        .chunks_exact(width)
        .zip(of_rows.chunks_exact_mut(blocks[0]))
    {
        for (block, top) in tops.iter_mut().enumerate() {
            // Several at a time, since each waits for the one before.
            let mut highest = [f64::NEG_INFINITY; 8];
            for cells in line[around(block, width)].chunks(highest.len()) {
                for (highest, &height) in highest.iter_mut().zip(cells) {
                    *highest = larger(*highest, height);
                }
            }
            *top = highest.into_iter().fold(f64::NEG_INFINITY, larger);
        }
    }
    Ok([of_rows, of_columns])
}

/// The larger one of two heights, of which the second may be NaN, which is left out.
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
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
    /// Heights of the raster, row by row.
    heights: &'a [f64],
    /// Cell of the raster that is the first one of the first line, and steps to the next line and to the next cell.
    first: usize,
    steps: [isize; 2],
    pub lines: usize,
    pub length: usize,
    /// Line of the eye, and its place there.
    pub eye: [f64; 2],
    /// Products of the steps to the next line and to the next cell: squared lengths of plans are `xx x² + 2 xy x y + yy y²`.
    pub metric: [f64; 3],
    is_turned: bool,
    tops: &'a [f64],
    wires: &'a HashSet<Wire>,
}

impl View<'_> {
    /// Height of a cell.
    #[inline]
    pub fn height(&self, line: usize, at: usize) -> f64 {
        self.heights[self.cell(line, at)]
    }

    /// Number of a cell in the rows of the raster.
    #[inline]
    pub fn cell(&self, line: usize, at: usize) -> usize {
        let [to_line, to_cell] = self.steps;
        self.first
            .wrapping_add_signed(to_line * line as isize + to_cell * at as isize)
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
