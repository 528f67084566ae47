//! Rays towards a light, alike from all cells.

use super::Shadows;
use crate::crossing::{Crossing, Lines, is_edge};

/// Rows in front of a cell whose crossings are taken one by one.
pub const NEAR: usize = 3;

/// The ray of a direction, seen from a cell, in steps from row to row; from column to column if it is turned.
pub struct Ray<'a> {
    shadows: &'a Shadows<'a>,
    /// Whether rows are columns of the raster.
    pub is_turned: bool,
    /// Whether it goes towards the last row.
    pub is_down: bool,
    /// Columns per row.
    pub shift: f64,
    /// Height per row.
    pub climb: f64,
    slope: f64,
    crossings: Vec<Crossing>,
    taps: Vec<Tap>,
    /// The first crossing that is at least so many rows away.
    starts: Vec<usize>,
}

impl<'a> Ray<'a> {
    pub fn new(shadows: &'a Shadows<'a>, azimuth: f64, slope: f64) -> Self {
        let field = shadows.field;
        let step @ [columns, rows] = field.step(azimuth);
        let is_turned = columns.abs() > rows.abs();
        let [minor, major] = if is_turned {
            [rows, columns]
        } else {
            [columns, rows]
        };
        let length = 1.0 / major.abs();
        // Farther away nothing is high enough.
        let reach = match slope > 0.0 {
            true => shadows.relief / slope * (1.0 + 1e-9),
            false => f64::INFINITY,
        };
        let size = field.size();
        let lines = Lines::new(step, ([0; 2], size), ([0; 2], size));
        let crossings = lines.crossings(field.has_holes(), size[0], reach);
        let mut starts = vec![0];
        for (index, crossing) in crossings.iter().enumerate() {
            while crossing.distance >= starts.len() as f64 * length * (1.0 - 1e-9) {
                starts.push(index);
            }
        }
        let columns = shadows.grids[usize::from(is_turned)].stride as isize;
        let tap = |crossing: &Crossing| {
            let mut ends = crossing.ends;
            if is_turned {
                ends.iter_mut().for_each(|end| end.reverse());
            }
            Tap {
                offsets: ends.map(|[column, row]| column + row * columns),
                column: ends[0][0] as i32,
                rows: ends[0][1].abs() as i32 + 1,
                part: crossing.part as f32,
                is_edge: {
                    let [[a, b], [c, d]] = crossing.ends;
                    a == c || b == d || (a < c) == (b < d)
                },
                climb: (crossing.distance * slope) as f32,
            }
        };
        let taps = crossings.iter().map(tap).collect();
        Self {
            shadows,
            taps,
            is_turned,
            is_down: major > 0.0,
            shift: minor * length,
            climb: slope * length,
            slope,
            crossings,
            starts,
        }
    }

    /// Whether an edge of at least and at most so many rows away is in the way of a cell.
    pub fn is_hidden(&self, eye: &Eye, from: usize, to: usize) -> bool {
        let at = |rows: usize| *self.starts.get(rows).unwrap_or(&self.crossings.len());
        // At most four edges meet the ray in one place.
        let range = at(from)..(at(to) + 4).min(self.crossings.len());
        let taps = &self.taps[range.start.min(range.end)..range.end];
        let (Some(first), Some(last)) = (taps.first(), taps.last()) else {
            return false;
        };
        let grid = &self.shadows.grids[usize::from(self.is_turned)];
        let is_in = |tap: &Tap| {
            let column = eye.column as isize + tap.column as isize;
            // Crossings close to each other may be a cell apart.
            column >= 2 && column + 2 < grid.columns as isize && (tap.rows as usize) < eye.row
        };
        let is_whole = is_in(first) && is_in(last);
        taps.iter().zip(range).any(|(tap, index)| {
            if is_whole {
                let [a, b] = tap
                    .offsets
                    .map(|offset| eye.own.wrapping_add_signed(offset));
                let found =
                    grid.heights[a] + tap.part * (grid.heights[b] - grid.heights[a]) - tap.climb;
                // NaN hides nothing.
                if !(found >= eye.low) {
                    return false;
                }
                let joined = grid.joined();
                if found >= eye.high && tap.is_edge && !joined[a].is_nan() && !joined[b].is_nan() {
                    return true;
                }
            }
            self.hides(&self.crossings[index], eye)
        })
    }

    /// Whether an edge is in the way, in double precision.
    fn hides(&self, crossing: &Crossing, eye: &Eye) -> bool {
        let field = self.shadows.field;
        let [width, height] = field.size();
        let [column, row] = eye.cell;
        let ends = crossing
            .ends
            .map(|[c, r]| [column as isize + c, row as isize + r]);
        let is_in =
            |&[c, r]: &[isize; 2]| c >= 0 && r >= 0 && c < width as isize && r < height as isize;
        if !ends.iter().all(is_in) {
            return false;
        }
        let heights = ends.map(|[c, r]| field.heights()[r as usize * width + c as usize]);
        let own = field.heights()[row * width + column] + self.shadows.rise;
        let ends = ends.map(|end| end.map(|at| at as f64));
        crossing.slope(heights, own) >= self.slope && (!field.has_holes() || is_edge(field, ends))
    }
}

/// An eye.
pub struct Eye {
    /// Column and row in the raster.
    pub cell: [usize; 2],
    /// Column, and rows ahead, along the ray; and the number of the cell there.
    pub column: usize,
    pub row: usize,
    pub own: usize,
    /// Heights at the eye that surely do not hide it if they are lower, and surely do if they are higher.
    pub low: f32,
    pub high: f32,
}

/// A crossing in single precision.
struct Tap {
    /// Cells to both ends.
    offsets: [isize; 2],
    /// Columns, and rows ahead, of about the first of them.
    column: i32,
    rows: i32,
    part: f32,
    /// Whether cells that are joined to all neighbours have such an edge.
    is_edge: bool,
    /// What a ray gains up to there.
    climb: f32,
}
