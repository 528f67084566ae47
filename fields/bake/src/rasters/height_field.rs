//! Height fields: heights in the cells of a raster, as the surface of triangles that its mesh has.

use std::collections::HashSet;
use std::ops::Range;

use crate::{Error, memory};

/// Heights of the cells of a raster, row by row, for viewsheds without a tree.
///
/// The surface has a vertex at the centre of each cell with data. Each square between four centres is two triangles, which share
/// the diagonal from the first to the last of them. A square with three centres is one triangle, one with fewer is a hole.
///
/// Places are named by columns and rows, where the centre of the first cell is at 0, 0.
#[derive(Clone, Debug)]
pub struct HeightField<'a> {
    width: usize,
    height: usize,
    rows: &'a [f64],
    /// Heights column by column: a transposed copy of `rows`.
    columns: Vec<f64>,
    /// Tops of rows and of columns: see [`tops`].
    tops: [Vec<f64>; 2],
    transform: [f64; 6],
    wires: HashSet<Wire>,
}

/// An observer on a height field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Column and row, where the centre of the first cell is at 0, 0: see [`HeightField::place`].
    pub place: [f64; 2],
    /// Height of the eye, measured from the same zero as heights of the field.
    pub height: f64,
    /// Normal of the surface that the observer is on, in map coordinates; nothing behind it is seen. 0 for a free eye.
    pub normal: [f64; 3],
}

impl Observer {
    /// Whether the observer has a place and a height.
    pub(crate) fn is_finite(&self) -> bool {
        let [x, y] = self.place;
        [x, y, self.height].iter().all(|x| x.is_finite())
    }
}

/// Two cells that are neighbours in a row or a column, the first one first: an edge of no triangle.
type Wire = [u32; 2];

/// Cells that are turned at a time, so that rows and columns stay in the cache.
const TILE: usize = 32;

impl<'a> HeightField<'a> {
    /// Heights of `width * height` cells; NaN where there is no data. `transform` gives map coordinates of corners of cells, in the
    /// order of GDAL: `x = t[0] + c t[1] + r t[2]` and `y = t[3] + c t[4] + r t[5]`.
    ///
    /// # Errors
    /// [`Error::Length`] if there are not as many heights as cells, [`Error::Range`] if cells have no size or their number is not
    /// within 1 to 2³² - 1, [`Error::NoMemory`].
    pub fn new(
        [width, height]: [usize; 2],
        heights: &'a [f64],
        transform: [f64; 6],
    ) -> Result<Self, Error> {
        let [_, a, b, _, d, e] = transform;
        let area = (a * e - b * d).abs();
        let is_in = area > 0.0 && area.is_finite();
        Error::check_range("area of a cell", area, is_in, "a number above 0")?;
        let cells = width.saturating_mul(height);
        Error::check_length("heights", heights.len(), cells)?;
        let is_in = (1..=u32::MAX as usize).contains(&cells);
        Error::check_range("number of cells", cells as f64, is_in, "1 to 4294967295")?;
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
        let mut field = Self {
            tops,
            width,
            height,
            rows: heights,
            columns,
            transform,
            wires: HashSet::new(),
        };
        field.find_wires();
        Ok(field)
    }

    /// Finds neighbours with data that no triangle joins.
    fn find_wires(&mut self) {
        let has = |column: usize, row: usize| {
            let is_inside = column < self.width && row < self.height;
            is_inside && self.rows[row * self.width + column].is_finite()
        };
        if self.rows.iter().all(|height| height.is_finite()) {
            return;
        }
        for (cell, height) in self.rows.iter().enumerate() {
            let [column, row] = [cell % self.width, cell / self.width];
            if !height.is_finite() {
                continue;
            }
            let any = |cells: [(usize, usize); 4]| cells.into_iter().any(|(c, r)| has(c, r));
            // Behind column or row 0 there is none, as behind the last ones.
            let [before, above] = [column.wrapping_sub(1), row.wrapping_sub(1)];
            let [right, below] = [column + 1, row + 1];
            let beside_row = [
                (column, above),
                (right, above),
                (column, below),
                (right, below),
            ];
            if has(right, row) && !any(beside_row) {
                self.wires.insert([cell as u32, cell as u32 + 1]);
            }
            let beside_column = [(before, row), (before, below), (right, row), (right, below)];
            if has(column, below) && !any(beside_column) {
                self.wires.insert([cell as u32, (cell + self.width) as u32]);
            }
        }
    }

    /// Numbers of columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Heights of all cells, row by row.
    pub fn heights(&self) -> &[f64] {
        self.rows
    }

    /// Map coordinates of corners of cells, as in [`HeightField::new`].
    pub fn transform(&self) -> [f64; 6] {
        self.transform
    }

    /// Way to the east and to the north of so many columns and rows.
    pub(crate) fn along(&self, [columns, rows]: [f64; 2]) -> [f64; 2] {
        let [_, a, b, _, d, e] = self.transform;
        [a * columns + b * rows, d * columns + e * rows]
    }

    /// Whether the eye of an observer is below the surface.
    pub(crate) fn buries(&self, observer: &Observer) -> bool {
        let surface = self.surface(observer.place);
        surface.is_some_and(|surface| surface - observer.height > 1e-9 * self.unit())
    }

    /// Number of triangles of the surface.
    pub fn triangles(&self) -> usize {
        let has = |cell: usize| usize::from(self.rows[cell].is_finite());
        let squares = (1..self.height)
            .flat_map(|row| (1..self.width).map(move |column| row * self.width + column));
        let corners = squares.map(|last| {
            has(last) + has(last - 1) + has(last - self.width) + has(last - self.width - 1)
        });
        corners
            .map(|corners: usize| corners.saturating_sub(2))
            .sum()
    }

    /// Side of a square with the area of a cell.
    pub fn unit(&self) -> f64 {
        let [_, a, b, _, d, e] = self.transform;
        (a * e - b * d).abs().sqrt()
    }

    /// Column and row of a place on the map. Numbers are rounded to a millionth of a cell, so that differences are exact.
    pub fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [x0, a, b, y0, d, e] = self.transform;
        let (x, y, area) = (x - x0, y - y0, a * e - b * d);
        let place = [(e * x - b * y) / area, (a * y - d * x) / area];
        place.map(|at| ((at - 0.5) * MILLION).round() / MILLION)
    }

    /// Height of the surface at a column and row; `None` beside the surface.
    pub fn surface(&self, [column, row]: [f64; 2]) -> Option<f64> {
        let is_inside = |at: f64, size: usize| at >= 0.0 && at <= (size - 1) as f64;
        if !(is_inside(column, self.width) && is_inside(row, self.height)) {
            return None;
        }
        let square = |at: f64, size: usize| (at as usize).min(size.saturating_sub(2));
        let [left, top] = [square(column, self.width), square(row, self.height)];
        let [u, v] = [column - left as f64, row - top as f64];
        let at = |c: usize, r: usize| {
            let [column, row] = [left + c, top + r];
            let index = (column < self.width).then_some(row * self.width + column)?;
            let height = self.rows.get(index).copied();
            height.filter(|height| height.is_finite())
        };
        // A corner that does not count may be missing.
        let corners = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
        match corners {
            [Some(a), Some(b), _, Some(d)] if u >= v => Some(a + u * (b - a) + v * (d - b)),
            [Some(a), _, Some(c), Some(d)] if u <= v => Some(a + v * (c - a) + u * (d - c)),
            [Some(a), Some(b), Some(c), None] if u + v <= 1.0 => {
                Some(a + u * (b - a) + v * (c - a))
            }
            [None, Some(b), Some(c), Some(d)] if u + v >= 1.0 => {
                Some(d + (1.0 - u) * (c - d) + (1.0 - v) * (b - d))
            }
            _ => None,
        }
    }

    /// Height of a cell; `None` without data, or beside the field. Column and row are whole numbers.
    pub(crate) fn height_at(&self, [column, row]: [f64; 2]) -> Option<f64> {
        let is_inside = |at: f64, side: usize| at >= 0.0 && at < side as f64;
        if !is_inside(column, self.width) || !is_inside(row, self.height) {
            return None;
        }
        let height = self.rows[row as usize * self.width + column as usize];
        height.is_finite().then_some(height)
    }

    /// Whether an edge of a triangle is between two cells with data, which are neighbours or at two corners of a square.
    pub(crate) fn has_edge(&self, [c, r]: [f64; 2], [c2, r2]: [f64; 2]) -> bool {
        let has = |column: f64, row: f64| self.height_at([column, row]).is_some();
        let beside = (has(c2, r), has(c, r2));
        match (c != c2, r != r2) {
            (true, true) if (c < c2) == (r < r2) => beside.0 || beside.1,
            (true, true) => beside.0 != beside.1,
            _ => {
                let cell = |column: f64, row: f64| row as u32 * self.width as u32 + column as u32;
                let mut wire = [cell(c, r), cell(c2, r2)];
                wire.sort_unstable();
                !self.wires.contains(&wire)
            }
        }
    }

    /// Whether a cell with data is the corner of a triangle.
    pub(crate) fn has_triangle(&self, [c, r]: [f64; 2]) -> bool {
        let beside = [[c - 1.0, r], [c + 1.0, r], [c, r - 1.0], [c, r + 1.0]];
        let mut beside = beside.into_iter();
        beside.any(|other| self.height_at(other).is_some() && self.has_edge([c, r], other))
    }

    /// The field as it looks from a cell: along columns or rows, forwards or backwards.
    pub(crate) fn view(&self, side: Side, [column, row]: [f64; 2]) -> View<'_> {
        let [_, a, b, _, d, e] = self.transform;
        let metric = [a * a + d * d, a * b + d * e, b * b + e * e];
        let is_east_west = matches!(side, Side::East | Side::West);
        let [xx, xy, yy] = metric;
        let tops = &self.tops[usize::from(is_east_west)][..];
        let (heights, size, at, metric) = match is_east_west {
            true => (
                &self.columns[..],
                [self.width, self.height],
                [column, row],
                [xx, xy, yy],
            ),
            false => (
                self.rows,
                [self.height, self.width],
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
            wires: &self.wires,
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

/// Millionths of a cell, as a power of two.
const MILLION: f64 = (1 << 20) as f64;

/// A quarter of the plan around an eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
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
pub(crate) struct View<'a> {
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
        let mut wire = [a, b].map(|[line, at]| self.cell(line, at) as u32);
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
