//! Reflectance of microfacets by direction and roughness, tabulated.
//!
//! With Schlick's Fresnel term, the reflectance of a direction is `f0 a + f90 b`. The tables hold a and b (the split sum of
//! Karis 2013) without light that is reflected more than once. They are computed when first used.

use std::sync::LazyLock;

use glam::Vec3;

use super::microfacet::TrowbridgeReitz;
use crate::surface::reflect;

/// Entries along the square root of the cosine, and along the roughness.
const COSINES: usize = 48;
const ROUGHNESSES: usize = 33;
/// Points of a sum.
const POINTS: u32 = 2048;
/// Steps of a sequence that fills the square evenly: powers of the root of x³ = x + 1 (Roberts 2018).
const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// `(1 - cos)^5`, the part of Schlick's term that grows towards grazing angles.
pub fn schlick_part(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    (x * x) * (x * x) * x
}

struct Tables {
    /// a and b by roughness and square root of the cosine.
    by_direction: Vec<[[f32; 2]; COSINES]>,
    /// Means over the hemisphere, weighted by the cosine.
    means: Vec<[f32; 2]>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let rows = (0..ROUGHNESSES).map(|row| {
        let roughness = row as f32 / (ROUGHNESSES - 1) as f32;
        let facets = TrowbridgeReitz::new([roughness * roughness; 2], false);
        std::array::from_fn(|column| {
            let root = (column as f32 / (COSINES - 1) as f32).max(1e-2);
            integrate(facets, root * root)
        })
    });
    let by_direction: Vec<[[f32; 2]; COSINES]> = rows.collect();
    let means = by_direction.iter().map(mean).collect();
    Tables {
        by_direction,
        means,
    }
});

/// a and b of one direction, by visible normals.
///
/// A grid would be too coarse: normals beyond a certain radius send light below the surface.
fn integrate(facets: TrowbridgeReitz, cos: f32) -> [f32; 2] {
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sums = [0.0_f64; 2];
    for index in 0..POINTS {
        let u = STEPS.map(|step| (0.5 + step * f64::from(index)).fract() as f32);
        let h = facets.sample(wo, u);
        let wi = reflect(wo, h);
        if wi.z <= 0.0 || wo.dot(h) <= 0.0 {
            continue;
        }
        let seen = facets.masking_shadowing(wo, wi) / facets.masking(wo);
        let grazing = schlick_part(wo.dot(h));
        sums[0] += f64::from(seen * (1.0 - grazing));
        sums[1] += f64::from(seen * grazing);
    }
    sums.map(|sum| (sum / f64::from(POINTS)) as f32)
}

/// Mean of values between whose entries lines are drawn: `4 ∫ value(t) t³ dt` with the cosine t².
fn mean(row: &[[f32; 2]; COSINES]) -> [f32; 2] {
    let step = 1.0 / (COSINES - 1) as f64;
    let mut sums = [0.0_f64; 2];
    for column in 0..COSINES - 1 {
        // Exact for the quartic: three points of Gauss and Legendre.
        for (point, weight) in [(-0.774_596_669, 5.0), (0.0, 8.0), (0.774_596_669, 5.0)] {
            let share = 0.5 * (1.0 + point);
            let t = (column as f64 + share) * step;
            for (axis, sum) in sums.iter_mut().enumerate() {
                let (a, b) = (row[column][axis], row[column + 1][axis]);
                let value = f64::from(a) * (1.0 - share) + f64::from(b) * share;
                *sum += weight / 18.0 * step * 4.0 * value * t * t * t;
            }
        }
    }
    sums.map(|sum| sum as f32)
}

/// Reflectance of facets of one roughness.
#[derive(Clone, Copy, Debug)]
pub struct CoatAlbedo {
    /// Place between the rows of the tables.
    row: f32,
}

/// Entry below a place, and the share of the next one.
fn between(place: f32, count: usize) -> (usize, f32) {
    let index = (place as usize).min(count - 2);
    (index, place - index as f32)
}

fn lerp([a0, b0]: [f32; 2], [a1, b1]: [f32; 2], share: f32) -> [f32; 2] {
    [a0 + (a1 - a0) * share, b0 + (b1 - b0) * share]
}

impl CoatAlbedo {
    /// Facets of a perceptual roughness in 0..=1.
    pub fn of(roughness: f32) -> Self {
        Self {
            row: roughness.clamp(0.0, 1.0) * (ROUGHNESSES - 1) as f32,
        }
    }

    /// Factors a of f0 and b of f90, for a cosine in 0..=1.
    fn factors(self, cos: f32) -> [f32; 2] {
        let place = cos.clamp(0.0, 1.0).sqrt() * (COSINES - 1) as f32;
        let (row, rows) = between(self.row, ROUGHNESSES);
        let (column, columns) = between(place, COSINES);
        let at = |row: usize| {
            let entries = &TABLES.by_direction[row];
            lerp(entries[column], entries[column + 1], columns)
        };
        lerp(at(row), at(row + 1), rows)
    }

    /// Reflectance under Schlick's Fresnel term.
    pub fn of_schlick(self, cos: f32, f0: Vec3, f90: f32) -> Vec3 {
        let [a, b] = self.factors(cos);
        f0 * a + Vec3::splat(f90 * b)
    }

    /// Reflectance of white facets.
    pub fn white(self, cos: f32) -> f32 {
        let [a, b] = self.factors(cos);
        a + b
    }

    /// Means of a and b over the hemisphere, weighted by the cosine.
    pub fn means(self) -> [f32; 2] {
        let (row, rows) = between(self.row, ROUGHNESSES);
        lerp(TABLES.means[row], TABLES.means[row + 1], rows)
    }

    /// Mean reflectance of white facets, below 1.
    pub fn mean_white(self) -> f32 {
        let [a, b] = self.means();
        (a + b).min(1.0 - 1e-5)
    }
}
