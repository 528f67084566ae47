//! Height fields: heights in the cells of a raster, as the surface of triangles that its mesh has.

use std::collections::HashSet;

use crate::angles::sin_cos_degrees;
use crate::{Error, memory};

/// Heights of the cells of a raster, row by row.
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
    transform: [f64; 6],
    /// Whether a cell and all eight around it have data; empty in a field without holes.
    surrounded: Vec<bool>,
    wires: HashSet<Wire>,
    has_holes: bool,
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
    pub fn is_finite(&self) -> bool {
        let [x, y] = self.place;
        [x, y, self.height].iter().all(|x| x.is_finite())
    }

    /// The same observer, but so much higher.
    pub fn raised(self, by: f64) -> Self {
        let height = self.height + by;
        Self { height, ..self }
    }
}

/// Two cells that are neighbours in a row or a column, the first one first: an edge of no triangle.
pub(crate) type Wire = [usize; 2];

impl<'a> HeightField<'a> {
    /// Heights of `width * height` cells; NaN where there is no data. `transform` gives map coordinates of corners of cells, in the
    /// order of GDAL: `x = t[0] + c t[1] + r t[2]` and `y = t[3] + c t[4] + r t[5]`.
    ///
    /// # Errors
    /// [`Error::Length`] if there are not as many heights as cells, [`Error::Range`] if there are no cells, they have no size, or a
    /// height is infinite.
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
        Error::check_range("number of cells", cells as f64, cells > 0, "at least 1")?;
        // Part by part, since a search cell by cell waits for each.
        let has_all = |part: &[f64]| {
            part.iter()
                .fold(true, |all, height| all & height.is_finite())
        };
        let is_whole = heights.chunks(4096).all(has_all);
        let mut endless = heights.iter().filter(|_| !is_whole);
        let endless = endless.find(|height| height.is_infinite());
        let wanted = "finite heights, or NaN where there is no data";
        let height_found = endless.copied().unwrap_or_default();
        Error::check_range("height", height_found, endless.is_none(), wanted)?;
        let mut field = Self {
            width,
            height,
            rows: heights,
            transform,
            surrounded: Vec::new(),
            wires: HashSet::new(),
            // A single row has no triangle, so that none of its edges counts.
            has_holes: width < 2 || height < 2 || !is_whole,
        };
        if field.has_holes {
            field.surrounded = memory::filled("cells without holes around", cells, false)?;
            field.find_surrounded();
            field.find_wires();
        }
        Ok(field)
    }

    /// Parts of a raster without holes; NaN where it is not known. Only for walks, which pass over NaN.
    pub(crate) fn of_parts(
        [width, height]: [usize; 2],
        rows: &'a [f64],
        transform: [f64; 6],
    ) -> Self {
        Self {
            width,
            height,
            rows,
            transform,
            surrounded: Vec::new(),
            wires: HashSet::new(),
            has_holes: false,
        }
    }

    /// Finds cells that have data on all sides.
    fn find_surrounded(&mut self) {
        let width = self.width;
        if width < 3 {
            return;
        }
        // Rows of three in each row, then three rows.
        let mut beside = [(); 3].map(|()| vec![false; width]);
        for (row, heights) in self.rows.chunks_exact(width).enumerate() {
            beside.rotate_left(1);
            let triples = heights.windows(3);
            let found = triples.map(|cells| cells.iter().fold(true, |all, x| all & !x.is_nan()));
            beside[2][1..width - 1]
                .iter_mut()
                .zip(found)
                .for_each(|(own, found)| *own = found);
            if row >= 2 {
                let cells = &mut self.surrounded[(row - 1) * width..][..width];
                for (column, cell) in cells.iter_mut().enumerate() {
                    *cell = beside[0][column] & beside[1][column] & beside[2][column];
                }
            }
        }
    }

    /// Finds neighbours with data that no triangle joins.
    fn find_wires(&mut self) {
        let has = |column: usize, row: usize| {
            let is_inside = column < self.width && row < self.height;
            is_inside && self.rows[row * self.width + column].is_finite()
        };
        for (cell, height) in self.rows.iter().enumerate() {
            if !height.is_finite() || self.surrounded[cell] {
                continue;
            }
            let [column, row] = [cell % self.width, cell / self.width];
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
                self.wires.insert([cell, cell + 1]);
            }
            let beside_column = [(before, row), (before, below), (right, row), (right, below)];
            if has(column, below) && !any(beside_column) {
                self.wires.insert([cell, cell + self.width]);
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

    /// Whether cells have no data, or belong to no triangle.
    pub fn has_holes(&self) -> bool {
        self.has_holes
    }

    /// Neighbours with data that belong to no triangle, the first one first.
    pub(crate) fn wires(&self) -> &HashSet<Wire> {
        &self.wires
    }

    /// Way to the east and to the north of so many columns and rows.
    pub fn along(&self, [columns, rows]: [f64; 2]) -> [f64; 2] {
        let [_, a, b, _, d, e] = self.transform;
        [a * columns + b * rows, d * columns + e * rows]
    }

    /// Columns and rows of a length of 1 in an azimuth, in degrees from the north of the map (`y`) through east.
    pub(crate) fn step(&self, azimuth: f64) -> [f64; 2] {
        let [_, a, b, _, d, e] = self.transform;
        let area = a * e - b * d;
        let (x, y) = sin_cos_degrees(azimuth);
        [(e * x - b * y) / area, (a * y - d * x) / area]
    }

    /// Normal of the surface at a cell in map coordinates, of length 1 and upwards: the mean of the triangles around it, weighted by
    /// area. `None` for a cell without a triangle.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn normal(&self, [column, row]: [usize; 2]) -> Option<[f64; 3]> {
        // All triangles are as large in plan, so that their gradients have the same weight.
        let (mut sum, mut count) = ([0.0; 2], 0.0);
        let mut add = |columns: f64, rows: f64| {
            sum = [sum[0] + columns, sum[1] + rows];
            count += 1.0;
        };
        for corner in 0..4 {
            let [left, top] = [(column, corner & 1), (row, corner >> 1)]
                .map(|(at, before)| at as f64 - before as f64);
            let at = |c: f64, r: f64| self.height_at([left + c, top + r]);
            let corners = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)];
            if corners[corner].is_none() {
                continue;
            }
            match corners {
                [Some(a), right, below, Some(d)] => {
                    // Of both triangles, those that have the cell.
                    if let (Some(b), true) = (right, corner != 2) {
                        add(b - a, d - b);
                    }
                    if let (Some(c), true) = (below, corner != 1) {
                        add(d - c, c - a);
                    }
                }
                [Some(a), Some(b), Some(c), None] => add(b - a, c - a),
                [None, Some(b), Some(c), Some(d)] => add(d - c, d - b),
                _ => {}
            }
        }
        let [_, a, b, _, d, e] = self.transform;
        let area = (a * e - b * d) * count;
        let [columns, rows] = sum;
        let normal = [
            (d * rows - e * columns) / area,
            (b * columns - a * rows) / area,
            1.0,
        ];
        let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        (count > 0.0).then(|| normal.map(|x| x / length))
    }

    /// A free eye at a point of the map, or on the surface if its height is NaN; `None` beside the surface then.
    pub fn observer(&self, [x, y, z]: [f64; 3]) -> Option<Observer> {
        let place = self.place([x, y]);
        let ground = if z.is_nan() {
            self.surface(place)
        } else {
            Some(z)
        };
        Some(Observer {
            place,
            height: ground?,
            normal: [0.0; 3],
        })
    }

    /// Whether the eye of an observer is below the surface.
    pub fn buries(&self, observer: &Observer) -> bool {
        let surface = self.surface(observer.place);
        surface.is_some_and(|surface| surface - observer.height > 1e-9 * self.unit())
    }

    /// Number of triangles of the surface.
    pub fn triangles(&self) -> usize {
        if !self.has_holes {
            return 2 * (self.width - 1) * (self.height - 1);
        }
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
        if self.is_surrounded([c, r]) {
            // Whole squares have one diagonal.
            return c == c2 || r == r2 || (c < c2) == (r < r2);
        }
        let has = |column: f64, row: f64| self.height_at([column, row]).is_some();
        let beside = (has(c2, r), has(c, r2));
        match (c != c2, r != r2) {
            (true, true) if (c < c2) == (r < r2) => beside.0 || beside.1,
            (true, true) => beside.0 != beside.1,
            _ => {
                let cell = |column: f64, row: f64| row as usize * self.width + column as usize;
                let mut wire = [cell(c, r), cell(c2, r2)];
                wire.sort_unstable();
                !self.wires.contains(&wire)
            }
        }
    }

    /// Which cells of a field with holes have data, as all around them.
    pub(crate) fn surrounded(&self) -> &[bool] {
        &self.surrounded
    }

    fn is_surrounded(&self, [column, row]: [f64; 2]) -> bool {
        let cell = row as usize * self.width + column as usize;
        self.surrounded.get(cell).is_some_and(|found| *found)
    }

    /// Whether a cell with data is the corner of a triangle.
    pub(crate) fn has_triangle(&self, [c, r]: [f64; 2]) -> bool {
        if self.is_surrounded([c, r]) {
            return true;
        }
        let beside = [[c - 1.0, r], [c + 1.0, r], [c, r - 1.0], [c, r + 1.0]];
        let mut beside = beside.into_iter();
        beside.any(|other| self.height_at(other).is_some() && self.has_edge([c, r], other))
    }
}

/// Numbers `a`, `b` of a family of lines, on which `a c + b r` of column `c` and row `r` is a whole number, and the step from cell to
/// cell of such a line.
pub(crate) type Family = ([isize; 2], [isize; 2]);

/// Families of lines that have all edges: columns, rows, diagonals of squares, and the other ones, which only squares with three
/// corners have.
pub(crate) fn families(has_holes: bool) -> &'static [Family] {
    const ALL: [Family; 4] = [
        ([1, 0], [0, 1]),
        ([0, 1], [1, 0]),
        ([1, -1], [1, 1]),
        ([1, 1], [1, -1]),
    ];
    &ALL[..if has_holes { 4 } else { 3 }]
}

/// Millionths of a cell, as a power of two.
const MILLION: f64 = (1 << 20) as f64;
