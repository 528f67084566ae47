//! Participating media: volumes that absorb and scatter light, and where they begin and end.

use std::sync::Arc;

use glam::Mat4;
use serde::Serialize;

use crate::Rgb;

/// Participating medium with the phase function of Henyey and Greenstein (1941).
///
/// Coefficients are per scene unit of length. All components are finite and not negative.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Medium {
    /// Absorption coefficient σ_a.
    pub absorption: Rgb,
    /// Scattering coefficient σ_s.
    pub scattering: Rgb,
    /// Mean cosine of the scattering angle, in (-1, 1): positive values scatter forward.
    pub asymmetry: f32,
    /// Density by which both coefficients are multiplied. `None` means 1 everywhere.
    pub density: Option<DensityGrid>,
}

/// Density at points of a regular grid, interpolated between them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DensityGrid {
    /// Number of cells along x, y and z, each at least 1.
    pub size: [u32; 3],
    /// Density at the middle of every cell, x fastest, then y, then z. Finite and not negative.
    #[serde(serialize_with = "raw_shared")]
    pub values: Arc<[f32]>,
    /// Grid space to world space. The grid fills the unit cube of its space; the density outside is 0.
    pub world_from_grid: Mat4,
}

fn raw_shared<S: serde::Serializer>(values: &Arc<[f32]>, serializer: S) -> Result<S::Ok, S::Error> {
    crate::raw(values, serializer)
}

/// Media on the two sides of a surface. Indices refer to [`Scene::media`](crate::Scene::media), `None` is vacuum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MediumInterface {
    /// Medium on the side from which the geometric normal points away.
    pub inside: Option<u32>,
    /// Medium on the side to which the geometric normal points.
    pub outside: Option<u32>,
}
