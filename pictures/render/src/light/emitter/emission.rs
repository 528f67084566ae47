//! Emission that varies over a mesh, by a texture.

use std::sync::Arc;

use antumbra_scene::TriangleMesh;
use glam::{Vec2, Vec3};

use crate::color::luminance;
use crate::surface::{DEFAULT_UV, corners, vertex_color};
use crate::texture::{Input, Place};

/// Points along an edge at which a triangle's mean emission is estimated.
const POINTS: u32 = 6;
/// Least weight of a triangle relative to the mean, so that light that the estimate misses is found, too.
const LEAST: f64 = 0.02;

/// Factor of a mesh's radiance.
#[derive(Clone, Debug)]
pub struct Emission {
    mesh: Arc<TriangleMesh>,
    texture: Input<Vec3>,
    areas: Vec<f32>,
    mean: Vec3,
}

impl Emission {
    /// Emission of a mesh whose `cumulative` areas become areas times luminance. `None` if all is black.
    ///
    /// The luminance of a triangle is estimated at a few points, and raised to a share of the mean. Samples are
    /// therefore more or less frequent, but not wrong.
    pub fn new(
        mesh: &Arc<TriangleMesh>,
        texture: Input<Vec3>,
        cumulative: &mut [f64],
    ) -> Option<Self> {
        let mut areas = Vec::with_capacity(cumulative.len());
        let mut before = 0.0;
        for &sum in &*cumulative {
            areas.push((sum - before) as f32);
            before = sum;
        }
        let mut emission = Self {
            mesh: Arc::clone(mesh),
            texture,
            areas,
            mean: Vec3::ZERO,
        };
        let means: Vec<Vec3> = (0..cumulative.len())
            .map(|element| emission.estimate(element as u32))
            .collect();
        let parts = means.iter().zip(&emission.areas);
        let sum: Vec3 = parts.map(|(&mean, &area)| mean * area).sum();
        emission.mean = sum / before as f32;
        let bright = f64::from(luminance(emission.mean));
        if !(bright > 0.0 && bright.is_finite()) {
            return None;
        }
        let mut sum = 0.0;
        for ((sums, mean), &area) in cumulative.iter_mut().zip(&means).zip(&emission.areas) {
            sum += f64::from(area) * f64::from(luminance(*mean)).max(LEAST * bright);
            *sums = sum;
        }
        Some(emission)
    }

    /// Mean of a triangle, at the middles of small triangles.
    fn estimate(&self, element: u32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let mut count = 0.0;
        let part = 1.0 / POINTS as f32;
        for row in 0..POINTS {
            for column in 0..POINTS - row {
                let (u, v) = (row as f32 * part, column as f32 * part);
                let mut add = |offset: f32| {
                    let (u, v) = (u + offset * part, v + offset * part);
                    sum += self.at(element, [1.0 - u - v, u, v]);
                    count += 1.0;
                };
                add(1.0 / 3.0);
                if row + column + 1 < POINTS {
                    add(2.0 / 3.0);
                }
            }
        }
        sum / count
    }

    /// Factor at barycentric weights of a triangle. Negative factors count as 0.
    pub fn at(&self, element: u32, weights: [f32; 3]) -> Vec3 {
        let uvs = if self.mesh.uvs.is_empty() {
            DEFAULT_UV
        } else {
            self.mesh.indices[element as usize].map(|i| self.mesh.uvs[i as usize])
        };
        let [a, b, c] = weights;
        let [p0, p1, p2] = corners(&self.mesh, element);
        let uv: Vec2 = uvs[0] * a + uvs[1] * b + uvs[2] * c;
        let place = Place {
            point: p0 * a + p1 * b + p2 * c,
            uv,
            color: vertex_color(&self.mesh, element, weights),
            ..Place::default()
        };
        self.texture.at(&place).max(Vec3::ZERO)
    }

    /// Factor at a point of a triangle.
    pub fn at_point(&self, element: u32, point: Vec3) -> Vec3 {
        let [p0, p1, p2] = corners(&self.mesh, element);
        let normal = (p1 - p0).cross(p2 - p0);
        let whole = normal.length_squared();
        let share = |a: Vec3, b: Vec3| (a - point).cross(b - point).dot(normal) / whole;
        let (u, v) = (share(p2, p0), share(p0, p1));
        self.at(element, [1.0 - u - v, u, v])
    }

    /// Area of a triangle in squared scene units.
    pub fn area(&self, element: usize) -> f32 {
        self.areas[element]
    }

    /// Mean factor over the mesh.
    pub fn mean(&self) -> Vec3 {
        self.mean
    }
}
