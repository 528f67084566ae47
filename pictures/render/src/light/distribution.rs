//! Directions in proportion to the luminance of an image by longitude and latitude.
//!
//! The sphere is cut into cells of one texel, or of a square of texels if the image is large. First a row is chosen,
//! then a cell in it, in proportion to the integral of the bilinearly interpolated image over the cell. The integral
//! is exact, sine of the polar angle included. Within a cell all directions are equally likely. The density is thus
//! one number per cell, and positive wherever the interpolated image is.

use std::f32::consts::{PI, TAU};

use antumbra_scene::Image;
use glam::Vec3;
use rayon::prelude::*;

use super::image::{texel, texel_solid_angle};
use crate::color::luminance;

/// Largest number of cells, so that their table takes at most 16 MiB.
pub(super) const MOST: usize = 1 << 22;

/// Probabilities of the cells of a sphere.
#[derive(Clone, Debug)]
pub struct SphereDistribution {
    columns: usize,
    /// Edge of a cell, as a fraction of the circle and of the way from pole to pole.
    size: [f32; 2],
    /// Cumulative probabilities of the rows.
    rows: Vec<f32>,
    /// Cumulative probabilities of the cells of a row, row by row.
    cells: Vec<f32>,
    /// Cosines of the polar angles at the edges of rows. `f64`, since rows at the poles are flat.
    edges: Vec<f64>,
    mean: f32,
}

/// A chosen direction.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Direction of unit length, but for rounding.
    pub direction: Vec3,
    /// Place in the image: fractions of its width and of its height, row 0 first.
    pub place: [f32; 2],
    /// Density per solid angle. 0 if the image is black.
    pub pdf: f32,
}

impl SphereDistribution {
    /// Distribution of an image whose colours are multiplied by `scale`. Texels that are negative, infinite or NaN
    /// weigh nothing.
    pub fn new(image: &Image, scale: Vec3) -> Self {
        Self::with_cells(image, scale, MOST)
    }

    /// Distribution with at most `most` cells.
    pub fn with_cells(image: &Image, scale: Vec3, most: usize) -> Self {
        let [width, height] = [image.width.max(1), image.height.max(1)].map(|n| n as usize);
        let cells_of = |edge: usize| width.div_ceil(edge) * height.div_ceil(edge);
        let mut edge = 1;
        while cells_of(edge) > most {
            edge += 1;
        }
        let (columns, rows) = (width.div_ceil(edge), height.div_ceil(edge));
        let mut cells = vec![0.0; columns * rows];
        let sums: Vec<f64> = cells
            .par_chunks_mut(columns)
            .enumerate()
            .map(|(row, cells)| {
                let texels = row * edge..height.min((row + 1) * edge);
                cumulate(&integrate(image, scale, texels, edge), cells)
            })
            .collect();
        let mut cumulative_rows = vec![0.0; rows];
        let total = cumulate(&sums, &mut cumulative_rows);
        let angle = |row: usize| (row * edge).min(height) as f64 / height as f64;
        Self {
            columns,
            size: [width, height].map(|count| edge as f32 / count as f32),
            rows: cumulative_rows,
            cells,
            edges: (0..=rows)
                .map(|row| libm::cos(angle(row) * std::f64::consts::PI))
                .collect(),
            mean: (total / (4.0 * std::f64::consts::PI)) as f32,
        }
    }

    /// Mean luminance over all directions.
    pub fn mean(&self) -> f32 {
        self.mean
    }

    /// Direction for `u` in `[0, 1)²`.
    #[inline]
    pub fn sample(&self, [u, v]: [f32; 2]) -> Choice {
        let (row, row_probability, down) = invert(&self.rows, v);
        let (column, probability, right) = invert(self.row(row), u);
        let (left, width) = self.column_edges(column);
        let azimuth = left + right * width;
        // Uniform in the cosine is uniform in area on the sphere.
        let (top, bottom) = (self.edges[row], self.edges[row + 1]);
        let cos = top + f64::from(down) * (bottom - top);
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let (sin, cos) = (sin as f32, cos as f32);
        let (y, x) = libm::sincosf(TAU * azimuth);
        let solid_angle = TAU * width * (top - bottom) as f32;
        Choice {
            direction: Vec3::new(sin * x, sin * y, cos),
            place: [azimuth, libm::atan2f(sin, cos) * (1.0 / PI)],
            pdf: row_probability * probability / solid_angle,
        }
    }

    /// Density of the direction at a place of the image.
    #[inline]
    pub fn pdf(&self, place: [f32; 2]) -> f32 {
        // NaN becomes 0.
        let [column, row] = [0, 1].map(|axis| (place[axis] / self.size[axis]) as usize);
        let row = row.min(self.rows.len() - 1);
        let column = column.min(self.columns - 1);
        let (_, width) = self.column_edges(column);
        let solid_angle = TAU * width * (self.edges[row] - self.edges[row + 1]) as f32;
        let ((_, row), (_, cell)) = (share(&self.rows, row), share(self.row(row), column));
        row * cell / solid_angle
    }

    #[inline]
    fn row(&self, row: usize) -> &[f32] {
        &self.cells[row * self.columns..][..self.columns]
    }

    /// Left edge and width of a column, as fractions of the circle. The last column may be narrower.
    #[inline]
    fn column_edges(&self, column: usize) -> (f32, f32) {
        let edge = |column: usize| (column as f32 * self.size[0]).min(1.0);
        let left = edge(column);
        (left, edge(column + 1) - left)
    }
}

/// Integrals over the cells of a row. Cells are `edge` texels wide, and the row consists of these rows of texels.
///
/// In either direction, the mean of the interpolation over a texel is 3/4 of the texel's own value and 1/8 of each
/// neighbour's.
fn integrate(image: &Image, scale: Vec3, texels: std::ops::Range<usize>, edge: usize) -> Vec<f64> {
    let (width, height) = (image.width as usize, image.height as usize);
    let weigh = |before: f64, own: f64, after: f64| (before + after) * 0.125 + own * 0.75;
    let row = |y: usize| -> Vec<f64> {
        let values: Vec<f64> = (0..width)
            .map(|x| {
                let value = luminance(texel(image, x as u32, y as u32) * scale);
                if value > 0.0 && value.is_finite() {
                    f64::from(value)
                } else {
                    0.0
                }
            })
            .collect();
        (0..width)
            .map(|x| {
                let before = values[(x + width - 1) % width];
                weigh(before, values[x], values[(x + 1) % width])
            })
            .collect()
    };
    let mut sums = vec![0.0; width.div_ceil(edge).max(1)];
    if width == 0 || height == 0 {
        return sums;
    }
    let mut rows = [
        row((texels.start + height - 1) % height),
        row(texels.start % height),
        row((texels.start + 1) % height),
    ];
    for y in texels {
        let solid_angle = texel_solid_angle(image, y as u32);
        for x in 0..width {
            sums[x / edge] += weigh(rows[0][x], rows[1][x], rows[2][x]) * solid_angle;
        }
        rows.rotate_left(1);
        rows[2] = row((y + 2) % height);
    }
    sums
}

/// Fills `cumulative` with cumulative weights over their sum, and returns the sum. Uniform if the sum is 0.
pub(super) fn cumulate(weights: &[f64], cumulative: &mut [f32]) -> f64 {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    let count = weights.len() as f64;
    for (index, (weight, cumulative)) in weights.iter().zip(cumulative).enumerate() {
        sum += weight;
        *cumulative = if total > 0.0 {
            (sum / total) as f32
        } else {
            ((index + 1) as f64 / count) as f32
        };
    }
    total
}

/// Entry whose share of the cumulative probabilities holds `u`, its probability, and the place of `u` in the share.
#[inline]
pub(super) fn invert(cumulative: &[f32], u: f32) -> (usize, f32, f32) {
    let last = cumulative.len() - 1;
    let index = cumulative.partition_point(|&sum| sum <= u).min(last);
    let (start, probability) = share(cumulative, index);
    let inside = (u - start) / probability;
    // Rounding could reach 1.
    (index, probability, inside.clamp(0.0, 1.0 - f32::EPSILON))
}

/// Start of the share of an entry, and its probability.
#[inline]
pub(super) fn share(cumulative: &[f32], index: usize) -> (f32, f32) {
    let start = if index == 0 {
        0.0
    } else {
        cumulative[index - 1]
    };
    (start, cumulative[index] - start)
}
