//! Crossings of lines of sight with edges of triangles, in any azimuth.

use crate::HeightField;
use crate::height_field::{Family, families};

/// Parts of an edge from its ends at which a line crosses a corner, more than places are rounded.
pub(crate) const CLOSE: f64 = 1e-10;

/// A crossing of a line of sight with an edge, seen from the centre of a cell.
pub(crate) struct Crossing {
    /// Columns and rows from the eye to both ends of the edge, which are one if the line crosses a corner.
    pub ends: [[isize; 2]; 2],
    /// The same as cells of the raster, row by row.
    pub offsets: [isize; 2],
    /// Part of the edge before the crossing.
    pub part: f64,
    pub distance: f64,
    /// Of the distance.
    pub reciprocal: f64,
}

impl Crossing {
    /// All crossings in an azimuth up to a distance, from near to far.
    pub fn all(field: &HeightField<'_>, azimuth: f64, reach: f64) -> Vec<Self> {
        let step = field.step(azimuth);
        let mut crossings = Vec::new();
        let most = field.size().map(|size| size as isize - 1);
        for &(family @ [u, v], along) in families(field.has_holes()) {
            let speed = u as f64 * step[0] + v as f64 * step[1];
            if speed == 0.0 {
                continue;
            }
            // The coordinate that tells places on a line of the family apart.
            let axis = usize::from(along[0] == 0);
            for line in 1.. {
                let distance = line as f64 / speed.abs();
                let line = if speed < 0.0 { -line } else { line };
                let place = distance * step[axis];
                let (ends, part) = edge_at((family, along), line, place);
                let is_in = |end: &[isize; 2]| end[0].abs() <= most[0] && end[1].abs() <= most[1];
                if distance > reach || !ends.iter().all(is_in) {
                    // Beyond all cells, as is all behind it.
                    break;
                }
                let [width, _] = field.size();
                crossings.push(Self {
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
