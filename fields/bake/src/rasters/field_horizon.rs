//! Horizon angles of height fields, exactly and without rays.
//!
//! # Edges
//!
//! Along a line of sight in plan, the slope to the surface is largest where the line crosses an edge of a triangle: see
//! [`horizon`](crate::rasters::horizon). Edges are on lines of three families: columns, rows, and the diagonals on which the difference of
//! both is constant. Beside holes there is a fourth one. So the horizon is the largest slope at the crossings with all of them.
//!
//! # Blocks that are left out
//!
//! Squares of [`BLOCK`] cells know their highest cell. A block is left out if that cell would be below the horizon so far.

use std::ops::Range;

use antumbra::Bvh;

use crate::jobs::job::in_pieces;
use crate::orientation::{check_azimuths, sin_cos_degrees};
use crate::{Answers, Error, HeightField, Job, Key, Monitor, Observer, Size, memory};

/// Cells on a side of a block.
const BLOCK: usize = 32;

/// Job of horizon angles of a height field: in each azimuth, the elevation of the highest surface as each observer sees it, in
/// degrees, `[observers, azimuths]`. Azimuths are from the north of the map (`y`) through east.
///
/// [`HeightField`] says what the surface is, and all is computed in double precision. Where no surface is in the way, the angle is
/// -90. An eye below the surface has 90 everywhere. An observer that is not finite has NaN. Normals of observers do not count.
pub struct FieldHorizonJob<'a> {
    field: &'a HeightField<'a>,
    observers: &'a [Observer],
    azimuths: &'a [f64],
    /// Height that places lose per squared distance.
    drop: f64,
    /// Steps in columns and rows to a length of 1 along each azimuth.
    steps: Vec<[f64; 2]>,
    /// Largest height in each block and one cell around it, row by row of blocks.
    peaks: Vec<f64>,
    has_holes: bool,
}

impl<'a> FieldHorizonJob<'a> {
    /// The job of these observers. `drop` is [`Curvature::factor`](crate::Curvature::factor), or 0 on a flat earth.
    ///
    /// # Errors
    /// [`Error::Range`] if an azimuth is not finite, [`Error::NoMemory`].
    pub fn new(
        field: &'a HeightField<'a>,
        observers: &'a [Observer],
        azimuths: &'a [f64],
        drop: f64,
    ) -> Result<Self, Error> {
        check_azimuths(azimuths)?;
        let [_, a, b, _, d, e] = field.transform();
        let area = a * e - b * d;
        let step = |&azimuth: &f64| {
            let (x, y) = sin_cos_degrees(azimuth);
            [(e * x - b * y) / area, (a * y - d * x) / area]
        };
        let [width, height] = field.size();
        let blocks = [width, height].map(|side| side.div_ceil(BLOCK));
        let mut peaks = memory::room("heights", blocks[0] * blocks[1])?;
        for row in 0..blocks[1] {
            for column in 0..blocks[0] {
                let range = |block: usize, side: usize| {
                    let first = block * BLOCK;
                    first.saturating_sub(1)..(first + BLOCK + 2).min(side)
                };
                let mut peak = f64::NEG_INFINITY;
                for row in range(row, height) {
                    let cells = &field.heights()[row * width..][range(column, width)];
                    // NaN does not count.
                    peak = cells.iter().fold(peak, |peak, &height| peak.max(height));
                }
                peaks.push(peak);
            }
        }
        Ok(Self {
            field,
            observers,
            azimuths,
            drop,
            steps: azimuths.iter().map(step).collect(),
            peaks,
            has_holes: field.heights().iter().any(|height| !height.is_finite()),
        })
    }

    /// Horizon of an observer in all azimuths.
    fn of(&self, observer: &Observer) -> Vec<f32> {
        if !observer.is_finite() {
            return vec![f32::NAN; self.steps.len()];
        }
        if self.field.buries(observer) {
            return vec![90.0; self.steps.len()];
        }
        let slopes = self.steps.iter().map(|&step| {
            Walk {
                job: self,
                eye: observer.place,
                height: observer.height,
                step,
                most: f64::NEG_INFINITY,
            }
            .slope()
        });
        slopes
            .map(|slope| libm::atan(slope).to_degrees() as f32)
            .collect()
    }
}

/// A walk over the field from an eye in one direction.
struct Walk<'a> {
    job: &'a FieldHorizonJob<'a>,
    /// Column and row.
    eye: [f64; 2],
    height: f64,
    step: [f64; 2],
    /// Largest slope so far.
    most: f64,
}

impl Walk<'_> {
    /// Largest slope of all edges.
    fn slope(mut self) -> f64 {
        let size = self.job.field.size();
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for axis in 0..2 {
            let last = (size[axis] - 1) as f64;
            let [a, b] = [0.0, last].map(|end| (end - self.eye[axis]) / self.step[axis]);
            match self.step[axis] == 0.0 {
                true if (0.0..=last).contains(&self.eye[axis]) => {}
                true => return self.most,
                false => (from, to) = (from.max(a.min(b)), to.min(a.max(b))),
            }
        }
        let blocks = size.map(|side| side.div_ceil(BLOCK));
        let mut at = from;
        while at <= to {
            let block = [0, 1].map(|axis| {
                let place = (self.eye[axis] + at * self.step[axis]) / BLOCK as f64;
                // On an edge between two blocks, the one ahead.
                let place = match self.step[axis] < 0.0 {
                    true => place.ceil() - 1.0,
                    false => place.floor(),
                };
                (place.max(0.0) as usize).min(blocks[axis] - 1)
            });
            let end = (0..2).fold(to, |end: f64, axis| {
                let side = block[axis] + usize::from(self.step[axis] > 0.0);
                let edge = ((side * BLOCK) as f64 - self.eye[axis]) / self.step[axis];
                if edge > at { end.min(edge) } else { end }
            });
            let peak = self.job.peaks[block[1] * blocks[0] + block[0]] - self.height;
            let nearest = if peak >= 0.0 { at } else { end };
            if peak / nearest - self.job.drop * at > self.most - 1e-12 || at == 0.0 {
                self.cross(at, end);
            }
            if end >= to {
                break;
            }
            at = end;
        }
        self.most
    }

    /// Takes the edges from one distance to another, and perhaps some beyond.
    fn cross(&mut self, from: f64, to: f64) {
        let ([column, row], [c, r]) = (self.eye, self.step);
        self.lines((column, c), [from, to], Self::at_column);
        self.lines((row, r), [from, to], Self::at_row);
        self.lines((column - row, c - r), [from, to], Self::at_diagonal);
        if self.job.has_holes {
            self.lines((column + row, c + r), [from, to], Self::at_other_diagonal);
        }
    }

    /// Takes the crossings with the lines of a family, which are at whole numbers.
    fn lines(
        &mut self,
        (place, step): (f64, f64),
        [from, to]: [f64; 2],
        edge: fn(&Self, f64, f64) -> Option<f64>,
    ) {
        if step == 0.0 {
            return;
        }
        let ends = [from, to].map(|at| place + at * step);
        let first = ends[0].min(ends[1]).floor();
        let count = (ends[0].max(ends[1]).ceil() - first) as usize;
        let least = 1e-9 * self.job.field.unit();
        for index in 0..=count {
            let line = first + index as f64;
            let at = (line - place) / step;
            if !(at > least) {
                continue;
            }
            if let Some(height) = edge(self, line, at) {
                self.most = self.most.max((height - self.height) / at);
            }
        }
    }

    /// Column and row at a distance.
    fn place(&self, at: f64) -> [f64; 2] {
        [0, 1].map(|axis| self.eye[axis] + at * self.step[axis])
    }

    fn at_column(&self, line: f64, at: f64) -> Option<f64> {
        let [_, row] = self.place(at);
        self.between([line, row.floor()], [0.0, 1.0], row - row.floor())
    }

    fn at_row(&self, line: f64, at: f64) -> Option<f64> {
        let [column, _] = self.place(at);
        let first = column.floor();
        self.between([first, line], [1.0, 0.0], column - first)
    }

    fn at_diagonal(&self, line: f64, at: f64) -> Option<f64> {
        let [column, _] = self.place(at);
        let first = column.floor();
        let (cell, part) = ([first, first - line], column - first);
        self.between(cell, [1.0, 1.0], part)
    }

    fn at_other_diagonal(&self, line: f64, at: f64) -> Option<f64> {
        let [column, _] = self.place(at);
        let first = column.floor();
        let (cell, part) = ([first, line - first], column - first);
        self.between(cell, [1.0, -1.0], part)
    }

    /// Height of a part of the edge from a cell to a neighbour, if there is such an edge.
    fn between(&self, cell: [f64; 2], to: [f64; 2], part: f64) -> Option<f64> {
        let other = [cell[0] + to[0], cell[1] + to[1]];
        let (a, b) = (self.bent(cell), self.bent(other));
        if part == 0.0 {
            // A vertex belongs to edges of all families, of which one is enough.
            return a.filter(|_| self.job.field.has_triangle(cell));
        }
        let (a, b) = (a?, b?);
        let is_edge = !self.job.has_holes || self.job.field.has_edge(cell, other);
        is_edge.then_some(a + part * (b - a))
    }

    /// Height of a cell on the round earth around the eye; `None` without data.
    fn bent(&self, [column, row]: [f64; 2]) -> Option<f64> {
        let height = self.job.field.height_at([column, row])?;
        match self.job.drop == 0.0 {
            true => Some(height),
            false => {
                let [x, y] = [column - self.eye[0], row - self.eye[1]];
                let [east, north] = self.job.field.along([x, y]);
                Some(height - self.job.drop * (east * east + north * north))
            }
        }
    }
}

impl Job for FieldHorizonJob<'_> {
    type Found = Vec<f32>;
    type Number = f32;

    const NAME: &'static str = "field-horizon/1";

    fn size(&self) -> Size {
        let azimuths = self.azimuths.len();
        Size::each(self.observers.len(), azimuths as u64, azimuths)
    }

    fn identify(&self, key: &mut Key) {
        let field = self.field;
        key.text(&format!(
            "{:?}",
            (field.size(), field.transform(), self.drop)
        ));
        key.numbers(self.azimuths);
        let numbers = |observer: &Observer| [observer.place[0], observer.place[1], observer.height];
        let numbers: Vec<f64> = self.observers.iter().flat_map(numbers).collect();
        key.numbers(&numbers);
        key.numbers(field.heights());
    }

    fn answers(&self, _: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        in_pieces(items, 1 << 10, monitor, |piece| {
            let observers = self.observers[piece].iter();
            Ok(observers.flat_map(|observer| self.of(observer)).collect())
        })
    }

    fn found(&self, angles: Vec<f32>) -> Result<Vec<f32>, Error> {
        Ok(angles)
    }
}
