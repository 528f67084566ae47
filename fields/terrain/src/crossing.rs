//! Crossings of lines of sight with edges of triangles, in any azimuth.

use std::ops::Range;

use crate::HeightField;
use crate::height_field::{Family, families};

/// Parts of an edge from its ends at which a line crosses a corner, more than places are rounded.
pub(crate) const CLOSE: f64 = 1e-10;

/// A crossing of a line of sight with an edge, seen from the centre of a cell.
pub(crate) struct Crossing {
    /// Columns and rows in the field of both ends of the edge as the first eye sees it: one if the line crosses a corner.
    pub ends: [[isize; 2]; 2],
    /// The same as cells, row by row.
    pub offsets: [isize; 2],
    /// Part of the edge before the crossing.
    pub part: f64,
    pub distance: f64,
    /// Of the distance.
    pub reciprocal: f64,
}

/// Lines of sight in an azimuth from the cells of a rectangle to a field.
pub(crate) struct Lines {
    /// Columns and rows of a length of 1.
    pub step: [f64; 2],
    /// Column and row of the first eye in the field.
    pub at: [isize; 2],
    /// Columns and rows of the cells that are seen.
    pub cells: [Range<isize>; 2],
    /// Least and most columns, and rows, from an eye to an end of an edge.
    offsets: [[isize; 2]; 2],
    /// Distances between which lines are in the field, and a cell more; the first is above the last if none is.
    pub distances: [f64; 2],
}

impl Lines {
    /// Lines from eyes that begin at a column and row, of so many columns and rows, to cells that begin at others.
    pub fn new(
        step: [f64; 2],
        (at, eyes): ([isize; 2], [usize; 2]),
        (first, size): ([isize; 2], [usize; 2]),
    ) -> Self {
        let offsets = [0, 1].map(|axis| {
            let [eyes, size] = [eyes, size].map(|sizes| sizes[axis] as isize - 1);
            let near = first[axis] - at[axis];
            [near - eyes, near + size]
        });
        let mut distances = [0.0, f64::INFINITY];
        for ([least, most], step) in offsets.into_iter().zip(step) {
            let ways = [least as f64 - 1.0, most as f64 + 1.0];
            match ways.map(|way| way / step) {
                _ if step == 0.0 && (ways[0] > 0.0 || ways[1] < 0.0) => distances[1] = -1.0,
                _ if step == 0.0 => {}
                [a, b] => distances = [distances[0].max(a.min(b)), distances[1].min(a.max(b))],
            }
        }
        Self {
            step,
            at,
            cells: [0, 1].map(|axis| first[axis]..first[axis] + size[axis] as isize),
            offsets,
            distances,
        }
    }

    /// A slope that no line has to a place so much higher than its eye, if places lose `drop` per squared distance.
    pub fn most(&self, up: f64, drop: f64) -> f64 {
        let [near, far] = self.distances;
        match up > 0.0 {
            _ if near > far => f64::NEG_INFINITY,
            true => up / near - drop * near,
            false => up / far - drop * near,
        }
    }

    /// Crossings up to a distance with all edges of a field of this width, from near to far.
    pub fn crossings(&self, has_holes: bool, width: usize, reach: f64) -> Vec<Crossing> {
        let Self { step, at, .. } = *self;
        let [nearest, farthest] = self.distances;
        let mut crossings = Vec::new();
        for &(family @ [u, v], along) in families(has_holes) {
            let speed = u as f64 * step[0] + v as f64 * step[1];
            if speed == 0.0 || nearest > farthest {
                continue;
            }
            // The coordinate that tells places on a line of the family apart.
            let axis = usize::from(along[0] == 0);
            for line in floor(nearest * speed.abs()).max(1).. {
                let distance = line as f64 / speed.abs();
                if distance > reach.min(farthest) {
                    break;
                }
                let line = if speed < 0.0 { -line } else { line };
                let place = distance * step[axis];
                let (ends, part) = edge_at((family, along), line, place);
                let is_in = |end: &[isize; 2]| {
                    (0..2).all(|axis| {
                        (self.offsets[axis][0]..=self.offsets[axis][1]).contains(&end[axis])
                    })
                };
                if !ends.iter().all(is_in) || is_twice(family, ends) {
                    continue;
                }
                let ends = ends.map(|end| [at[0] + end[0], at[1] + end[1]]);
                crossings.push(Crossing {
                    ends,
                    offsets: ends.map(|[column, row]| row * width as isize + column),
                    part,
                    distance,
                    reciprocal: 1.0 / distance,
                });
            }
        }
        crossings.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        crossings
    }
}

/// Whether a crossing is one with a corner that other families have as well. Only rasters with holes have the last family, whose
/// distances are rounded otherwise, so that a horizon would depend on holes elsewhere.
#[inline(always)]
pub(crate) fn is_twice([u, v]: [isize; 2], [a, b]: [[isize; 2]; 2]) -> bool {
    u == v && a == b
}

impl Crossing {
    /// Slope from an eye to the crossing of an edge with these heights at its ends, on a flat earth.
    #[inline(always)]
    pub fn slope(&self, [a, b]: [f64; 2], eye: f64) -> f64 {
        (a + self.part * (b - a) - eye) * self.reciprocal
    }
}

/// The whole number at or below a place: faster than `floor` where that is a call of the system.
#[inline(always)]
pub(crate) fn floor(place: f64) -> isize {
    let towards_zero = place as isize;
    towards_zero - isize::from(towards_zero as f64 > place)
}

/// The edge that a line of sight crosses on a line of a family, and the part of it before the crossing. `place` is the coordinate that
/// differs along the line. Both ends are one if the line of sight crosses a corner.
#[inline(always)]
pub(crate) fn edge_at((family, along): Family, line: isize, place: f64) -> ([[isize; 2]; 2], f64) {
    let low = floor(place);
    let part = place - low as f64;
    let first = match family {
        [1, 0] => [line, low],
        [0, 1] => [low, line],
        // `line` is the column less, or with, the row.
        [_, sign] => [low, sign * (line - low)],
    };
    let second = [first[0] + along[0], first[1] + along[1]];
    // Lines along cells pass through their centres, whatever rounding says.
    match part {
        part if part < CLOSE => ([first; 2], 0.0),
        part if part > 1.0 - CLOSE => ([second; 2], 0.0),
        part => ([first, second], part),
    }
}

/// Whether a triangle has the edge between two cells with data, or the corner if they are one.
pub(crate) fn is_edge(field: &HeightField<'_>, [a, b]: [[f64; 2]; 2]) -> bool {
    match a == b {
        true => field.has_triangle(a),
        false => field.has_edge(a, b),
    }
}
