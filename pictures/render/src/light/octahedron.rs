//! Environments on an octahedron of equal areas, unfolded to a square (Clarberg 2008, *Fast Equal-Area Mapping of the
//! (Hemi)Sphere using SIMD*).
//!
//! Every texel has the same solid angle and one colour, so texels are chosen in proportion to their luminance, and directions
//! in a texel are equally likely. Cells are texels, or squares of texels if the image is large.

use std::f32::consts::{FRAC_PI_4, PI};

use antumbra_scene::Image;
use glam::Vec3;

use super::distribution::{Choice, MOST, cumulate, invert, share};
use super::image::texel;
use crate::color::luminance;

/// Solid angle of the whole sphere.
const SPHERE: f32 = 4.0 * PI;

/// Direction of a place in the square. The length is 1, but for rounding.
pub fn direction([s, t]: [f32; 2]) -> Vec3 {
    let (u, v) = (2.0 * s - 1.0, 2.0 * t - 1.0);
    let (x, y) = (u.abs(), v.abs());
    // Positive on the upper half, which is the inner diamond.
    let height = 1.0 - (x + y);
    let radius = 1.0 - height.abs();
    let angle = if radius == 0.0 {
        FRAC_PI_4
    } else {
        ((y - x) / radius + 1.0) * FRAC_PI_4
    };
    let (sin, cos) = libm::sincosf(angle);
    let across = radius * (2.0 - radius * radius).max(0.0).sqrt();
    Vec3::new(
        (cos * across).copysign(u),
        (sin * across).copysign(v),
        (1.0 - radius * radius).copysign(height),
    )
}

/// Place in the square of a direction of any length, in `[0, 1]`.
pub fn place(dir: Vec3) -> [f32; 2] {
    let dir = dir.normalize_or_zero();
    let (x, y) = (dir.x.abs(), dir.y.abs());
    // Small at the poles, where 1 - |z| would cancel.
    let flat = x * x + y * y;
    let radius = (flat / (1.0 + dir.z.abs())).sqrt();
    let angle = libm::atan2f(y, x) / FRAC_PI_4 * 0.5;
    let (mut v, mut u) = (radius * angle, radius * (1.0 - angle));
    if dir.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    [u.copysign(dir.x), v.copysign(dir.y)].map(|w| (0.5 * (w + 1.0)).clamp(0.0, 1.0))
}

/// Place in the square of a place a little outside: an edge is folded at its middle.
pub fn wrap([s, t]: [f32; 2]) -> [f32; 2] {
    let fold = |inside: f32, other: f32| match inside {
        w if w < 0.0 => (-w, 1.0 - other),
        w if w > 1.0 => (2.0 - w, 1.0 - other),
        w => (w, other),
    };
    let (s, t) = fold(s, t);
    let (t, s) = fold(t, s);
    [s, t]
}

/// Colour at a place of the square.
pub fn lookup(image: &Image, [s, t]: [f32; 2]) -> Vec3 {
    // NaN becomes 0.
    let index = |place: f32, count: u32| ((place * count as f32) as u32).min(count.max(1) - 1);
    texel(image, index(s, image.width), index(t, image.height))
}

/// Probabilities of the cells of a square.
#[derive(Clone, Debug)]
pub struct SquareDistribution {
    columns: usize,
    /// Edge of a cell, as a fraction of the square.
    size: [f32; 2],
    rows: Vec<f32>,
    cells: Vec<f32>,
    mean: f32,
}

impl SquareDistribution {
    /// Distribution of an image whose colours are multiplied by `scale`. Texels that are negative, infinite or NaN weigh
    /// nothing.
    pub fn new(image: &Image, scale: Vec3) -> Self {
        Self::with_cells(image, scale, MOST)
    }

    fn with_cells(image: &Image, scale: Vec3, most: usize) -> Self {
        let [width, height] = [image.width.max(1), image.height.max(1)].map(|n| n as usize);
        let mut edge = 1;
        while width.div_ceil(edge) * height.div_ceil(edge) > most {
            edge += 1;
        }
        let (columns, rows) = (width.div_ceil(edge), height.div_ceil(edge));
        let mut weights = vec![0.0_f64; columns * rows];
        for y in 0..height {
            for x in 0..width {
                let value = luminance(texel(image, x as u32, y as u32) * scale);
                if value > 0.0 && value.is_finite() {
                    weights[y / edge * columns + x / edge] += f64::from(value);
                }
            }
        }
        let mut cells = vec![0.0; columns * rows];
        let sums: Vec<f64> = weights
            .chunks(columns)
            .zip(cells.chunks_mut(columns))
            .map(|(weights, cells)| cumulate(weights, cells))
            .collect();
        let mut cumulative = vec![0.0; rows];
        let total = cumulate(&sums, &mut cumulative);
        Self {
            columns,
            size: [width, height].map(|count| edge as f32 / count as f32),
            rows: cumulative,
            cells,
            mean: (total / (width * height) as f64) as f32,
        }
    }

    /// Mean luminance over all directions.
    pub fn mean(&self) -> f32 {
        self.mean
    }

    /// Direction for `u` in `[0, 1)²`.
    pub fn sample(&self, [u, v]: [f32; 2]) -> Choice {
        let (row, of_row, down) = invert(&self.rows, v);
        let (column, of_cell, right) = invert(self.row(row), u);
        let ([left, top], [width, height]) = self.cell(column, row);
        let place = [left + right * width, top + down * height];
        Choice {
            direction: direction(place),
            place,
            pdf: of_row * of_cell / (SPHERE * width * height),
        }
    }

    /// Density of the direction at a place of the square.
    pub fn pdf(&self, place: [f32; 2]) -> f32 {
        let [column, row] = [0, 1].map(|axis| (place[axis] / self.size[axis]) as usize);
        let (column, row) = (column.min(self.columns - 1), row.min(self.rows.len() - 1));
        let (_, [width, height]) = self.cell(column, row);
        let ((_, of_row), (_, of_cell)) = (share(&self.rows, row), share(self.row(row), column));
        of_row * of_cell / (SPHERE * width * height)
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.cells[row * self.columns..][..self.columns]
    }

    /// Corner and size of a cell. The last cells may be smaller.
    fn cell(&self, column: usize, row: usize) -> ([f32; 2], [f32; 2]) {
        let edge = |index: usize, axis: usize| (index as f32 * self.size[axis]).min(1.0);
        let corner = [edge(column, 0), edge(row, 1)];
        let size = [
            edge(column + 1, 0) - corner[0],
            edge(row + 1, 1) - corner[1],
        ];
        (corner, size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::Pixels;

    #[test]
    fn places_and_directions_are_inverse() {
        for i in 0..64 {
            for j in 0..64 {
                let at = [(i as f32 + 0.5) / 64.0, (j as f32 + 0.5) / 64.0];
                let dir = direction(at);
                assert!((dir.length() - 1.0).abs() < 1e-5, "{at:?}");
                let back = place(dir);
                for axis in 0..2 {
                    assert!((back[axis] - at[axis]).abs() < 1e-4, "{at:?} {back:?}");
                }
            }
        }
        for (dir, at) in [
            (Vec3::Z, [0.5, 0.5]),
            (Vec3::X, [1.0, 0.5]),
            (Vec3::Y, [0.5, 1.0]),
            (-Vec3::X, [0.0, 0.5]),
            // Every corner is the opposite pole. Signs of zeros choose one.
            (Vec3::new(0.0, 0.0, -1.0), [1.0, 1.0]),
            (Vec3::new(-0.0, 0.0, -1.0), [0.0, 1.0]),
        ] {
            let found = place(dir);
            assert!(
                (found[0] - at[0]).abs() < 1e-5 && (found[1] - at[1]).abs() < 1e-5,
                "{dir}"
            );
        }
    }

    /// Equal squares have equal solid angles, so directions have the moments of the sphere.
    #[test]
    fn areas_are_equal() {
        let side = 400;
        let (mut first, mut second) = (Vec3::ZERO.as_dvec3(), Vec3::ZERO.as_dvec3());
        for i in 0..side {
            for j in 0..side {
                let at = [i, j].map(|k| (k as f32 + 0.5) / side as f32);
                let dir = direction(at).as_dvec3();
                first += dir;
                second += dir * dir;
            }
        }
        let count = f64::from(side * side);
        assert!((first / count).length() < 1e-5);
        assert!((second / count - 1.0 / 3.0).abs().max_element() < 1e-4);
        // The polar angle is uniform in its cosine: half of the square is above 30 degrees of elevation, twice.
        let cap = (0..side * side)
            .filter(|k| {
                let at = [k % side, k / side].map(|k| (k as f32 + 0.5) / side as f32);
                direction(at).z > 0.5
            })
            .count();
        assert!((cap as f64 / count - 0.25).abs() < 2e-3);
    }

    #[test]
    fn samples_follow_the_texels() {
        let image = Image {
            name: "sky".into(),
            width: 5,
            height: 3,
            pixels: Pixels::Rgb32((0..15).map(|i| [(i % 4) as f32; 3]).collect()),
        };
        for most in [100, 4] {
            let distribution = SquareDistribution::with_cells(&image, Vec3::ONE, most);
            let mut sum = 0.0;
            let side = 200;
            for i in 0..side * side {
                let u = [i % side, i / side].map(|k| (k as f32 + 0.5) / side as f32);
                let choice = distribution.sample(u);
                let seen = distribution.pdf(place(choice.direction));
                assert!(choice.pdf > 0.0);
                // A place on an edge may round to the neighbour.
                if (seen - choice.pdf).abs() < 1e-4 * choice.pdf {
                    sum += f64::from(luminance(lookup(&image, choice.place)) / choice.pdf);
                } else {
                    sum += f64::from(distribution.mean() * SPHERE);
                }
            }
            let mean = sum / f64::from(side * side) / f64::from(SPHERE);
            let expected = (0..15).map(|i| f64::from(i % 4)).sum::<f64>() / 15.0;
            assert!(
                (mean - expected).abs() < 0.01 * expected,
                "{most}: {mean} {expected}"
            );
        }
    }
}
