//! Where a line between two cells crosses edges of triangles.

use crate::height_field::families;
use crate::lattice::divisor;

/// A crossing of a line with an edge of a triangle, on the way from one cell of the line to the next.
pub struct Crossing {
    /// Distance to the cell at the end of the way, in parts of a step.
    pub before: f64,
    /// Ends of the edge: how many columns and rows they are from that cell, and their shares of the height in parts.
    pub ends: [([isize; 2], f64); 2],
}

impl Crossing {
    /// Whether only a square with three corners can have the edge.
    pub fn is_of_holes(&self) -> bool {
        let [([c, r], _), ([c2, r2], _)] = self.ends;
        c != c2 && r != r2 && (c < c2) != (r < r2)
    }

    /// Crossings on the way of a step towards the observer, from far to near, and the number of parts of the step.
    ///
    /// On a line from the cell at the end of the way back along `[q, p]`, the lines of a family, where `a c + b r` of column `c` and
    /// row `r` is a whole number, are crossed at each part of `a q + b p` parts of the way.
    pub fn all([q, p]: [isize; 2], has_holes: bool) -> (Vec<Self>, f64) {
        let families = families(has_holes);
        let count = |[a, b]: [isize; 2]| (a * q + b * p).abs();
        let counts = families.iter().map(|(family, _)| count(*family).max(1));
        let parts = counts.fold(1, |all, one| {
            all / divisor(all as i32, one as i32) as isize * one
        });
        let mut crossings = Vec::new();
        for &(family, along) in families {
            let count = count(family);
            for index in 1..count {
                // Columns and rows from the cell, in parts of this family.
                let place = [index * q, index * p];
                let axis = usize::from(along[0] == 0);
                // How far the crossing is from the first end of the edge.
                let rest = place[axis].rem_euclid(count);
                let first = [0, 1].map(|axis| (place[axis] - rest * along[axis]) / count);
                let second = [0, 1].map(|axis| first[axis] + along[axis]);
                let of = |share: isize| (share * parts / count) as f64;
                crossings.push(Self {
                    before: of(index),
                    ends: [(first, of(count - rest)), (second, of(rest))],
                });
            }
        }
        crossings.sort_by(|a, b| b.before.total_cmp(&a.before));
        (crossings, parts as f64)
    }
}
