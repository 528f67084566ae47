//! Directions in proportion to the luminance of an image by longitude and latitude.
//!
//! The sphere is cut into cells of one texel, or of a square of texels if the image is large. A cell is chosen
//! with the exact integral of the image's bilinear interpolation over it (sine of the polar angle included),
//! the row first, then the cell in it; within a cell all directions are alike. So the density is positive
//! wherever the interpolated image is, and a cell's density is one number.

use std::f32::consts::{PI, TAU};

use antumbra_scene::Image;
use glam::Vec3;
use rayon::prelude::*;

use super::image::{texel, texel_solid_angle};
use crate::color::luminance;

/// Most cells: their table takes 16 MiB at most, however large the image is.
const MOST: usize = 1 << 22;

/// Probabilities of the cells of a sphere.
#[derive(Clone, Debug)]
pub struct SphereDistribution {
    columns: usize,
    /// Edge of a cell over the circle, and over the way from pole to pole.
    size: [f32; 2],
    /// Probabilities of rows 0..=i added up.
    rows: Vec<f32>,
    /// Row by row, probabilities of cells 0..=i of the row added up.
    cells: Vec<f32>,
    /// Cosines of the polar angles at the edges of rows; as `f64`, since rows at the poles are flat.
    edges: Vec<f64>,
    mean: f32,
}

/// A chosen direction.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// The direction: unit length, but for rounding.
    pub direction: Vec3,
    /// Its place in the image.
    pub place: [f32; 2],
    /// Density per solid angle; 0 if there is nothing to choose from.
    pub pdf: f32,
}

impl SphereDistribution {
    /// The distribution of an image whose colours are multiplied by `scale`. Texels that are negative, infinite
    /// or NaN weigh nothing.
    pub fn new(image: &Image, scale: Vec3) -> Self {
        Self::with_cells(image, scale, MOST)
    }

    /// The same with at most this many cells.
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

    /// A direction for `u` in `[0, 1)²`.
    #[inline]
    pub fn sample(&self, [u, v]: [f32; 2]) -> Choice {
        let (row, row_probability, down) = invert(&self.rows, v);
        let (column, probability, right) = invert(self.row(row), u);
        let (left, width) = self.column_edges(column);
        let azimuth = left + right * width;
        // Uniform in the cosine, that is in area on the sphere.
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

    /// Density with which the direction at a place of the image is chosen.
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

    /// Left edge and width of a column, over the circle; the last one may be narrower.
    #[inline]
    fn column_edges(&self, column: usize) -> (f32, f32) {
        let edge = |column: usize| (column as f32 * self.size[0]).min(1.0);
        let left = edge(column);
        (left, edge(column + 1) - left)
    }
}

/// Integrals over the cells of a row, `edge` texels wide, that consists of these rows of texels.
///
/// Over a texel, linear interpolation between centres has the mean of the texel's own value by 3/4 and its
/// neighbours' by 1/8 each, in either direction.
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

/// Fills `cumulative` with the weights added up and divided by their sum, which is returned; all equal if it is
/// 0.
fn cumulate(weights: &[f64], cumulative: &mut [f32]) -> f64 {
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

/// The entry whose share of the cumulative probabilities holds `u`, its probability, and where in the share
/// `u` lies.
#[inline]
fn invert(cumulative: &[f32], u: f32) -> (usize, f32, f32) {
    let last = cumulative.len() - 1;
    let index = cumulative.partition_point(|&sum| sum <= u).min(last);
    let (start, probability) = share(cumulative, index);
    let inside = (u - start) / probability;
    // Rounding may reach 1.
    (index, probability, inside.clamp(0.0, 1.0 - f32::EPSILON))
}

/// Where the share of an entry begins, and its probability.
#[inline]
fn share(cumulative: &[f32], index: usize) -> (f32, f32) {
    let start = if index == 0 {
        0.0
    } else {
        cumulative[index - 1]
    };
    (start, cumulative[index] - start)
}
