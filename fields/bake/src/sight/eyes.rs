//! The job of visibility between points.

use std::ops::Range;

use antumbra::Bvh;

use crate::sight::visibility::{SightRange, sees_points_within};
use crate::vector::{dot, less};
use crate::{Answers, BitMatrix, Error, Job, Key, Monitor, Sensors, Size, ones, sees_each_other};

/// Eyes of sensors, with the normals of their surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Eyes<'a> {
    /// Points, `[n, 3]`.
    pub points: Vec<[f32; 3]>,
    /// Normals, `[n, 3]`, or empty: points in free space.
    pub normals: &'a [[f32; 3]],
}

impl<'a> Eyes<'a> {
    /// [Eyes](Sensors::eyes) of sensors.
    pub fn new(sensors: &'a Sensors, bvh: &Bvh, up: [f64; 3], height: f64) -> Self {
        Self {
            points: sensors.eyes(bvh, up, height),
            normals: &sensors.normals,
        }
    }

    /// Whether a point lies above the surface of an eye, or at the eye.
    fn faces(&self, eye: usize, point: [f32; 3]) -> bool {
        let Some(normal) = self.normals.get(eye) else {
            return true;
        };
        let from = self.points[eye];
        let apart = less(&point, &from);
        from == point || dot(normal.map(f64::from), apart) > 0.0
    }
}

/// Job of a [`BitMatrix`]: which eyes see each other, as [`sees_points`](crate::sees_points) and [`sees_each_other`] say. Eyes with normals see
/// nothing below their surfaces.
pub struct VisibilityJob<'a> {
    /// Eyes that have a row.
    pub rows: &'a Eyes<'a>,
    /// Eyes that have a column; `None` if they are the eyes of the rows, none of which sees itself.
    pub columns: Option<&'a Eyes<'a>>,
    /// Length left out at both ends of lines of sight, as for [`SightLines`](crate::SightLines).
    pub margin: Option<f32>,
    /// Greatest distance in plan between eyes that see each other, with the direction up; `None` for any. Only where rows and
    /// columns differ.
    pub range: Option<SightRange>,
}

impl VisibilityJob<'_> {
    fn columns(&self) -> &Eyes<'_> {
        self.columns.unwrap_or(self.rows)
    }
}

impl Job for VisibilityJob<'_> {
    type Found = BitMatrix;
    type Number = u64;

    const NAME: &'static str = "visible/2";

    fn size(&self) -> Size {
        let columns = self.columns().points.len();
        let words = columns.div_ceil(64);
        Size::each(self.rows.points.len(), columns as u64, words)
    }

    fn identify(&self, key: &mut Key) {
        key.text(&format!("{:?} {}", self.margin, self.columns.is_some()));
        if let Some(range) = self.range {
            key.text(&format!("{range:?}"));
        }
        for list in [&self.rows.points, &self.columns().points, self.rows.normals] {
            key.vectors(list);
        }
    }

    fn answers(&self, bvh: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        let (rows, margin) = (&self.rows.points, self.margin);
        let seen = match self.columns {
            Some(columns) => {
                let points = (&rows[items], &columns.points[..]);
                sees_points_within(bvh, points, margin, self.range, monitor)
            }
            None => sees_each_other(bvh, rows, items, margin, monitor),
        }?;
        Ok(seen.into_words())
    }

    fn found(&self, words: Vec<u64>) -> Result<BitMatrix, Error> {
        let (rows, columns) = (self.rows, self.columns());
        let mut seen = BitMatrix::from_words(rows.points.len(), columns.points.len(), words)?;
        for row in 0..seen.rows() {
            let eye = rows.points[row];
            let hidden = |&column: &usize| {
                !rows.faces(row, columns.points[column]) || !columns.faces(column, eye)
            };
            let hidden: Vec<usize> = ones(seen.row(row)).filter(hidden).collect();
            for column in hidden {
                seen.set(row, column, false);
            }
        }
        Ok(seen)
    }
}
