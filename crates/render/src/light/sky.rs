//! A sky of one colour.
//!
//! It is sampled half by cosine, half uniformly, on the side(s) that matter. Cosine alone would be optimal for
//! a flat diffuse surface but gives unbounded weights where the shading normal leans away from the geometric
//! one.

use std::f32::consts::PI;

use glam::Vec3;

use super::{LightSample, Receiver};
use crate::surface::frame::{Frame, cosine_hemisphere, uniform_hemisphere};

/// The same radiance from every direction that leaves the scene.
#[derive(Clone, Copy, Debug)]
pub struct Sky {
    /// That radiance.
    pub radiance: Vec3,
    /// Samples per point; 0 counts as 1.
    pub samples: u32,
}

impl Sky {
    /// A direction of the sky.
    #[inline]
    pub fn sample(&self, at: &Receiver, [u, v]: [f32; 2]) -> Option<LightSample> {
        let (other_side, u) = halve(u, at.both_sides);
        let (uniform, u) = halve(u, true);
        let local = if uniform {
            uniform_hemisphere([u, v])
        } else {
            cosine_hemisphere([u, v])
        };
        let normal = if other_side { -at.normal } else { at.normal };
        let wi = Frame::around(normal).to_world(local);
        LightSample::from_outside(wi, self.radiance, self.pdf(at, wi))
    }

    /// Density of that choice per solid angle.
    #[inline]
    pub fn pdf(&self, at: &Receiver, wi: Vec3) -> f32 {
        let cos = wi.dot(at.normal);
        if at.both_sides {
            0.5 * (0.5 * cos.abs() + 0.25) / PI
        } else if cos >= 0.0 {
            (0.5 * cos + 0.25) / PI
        } else {
            0.0
        }
    }
}

/// Takes a fair bit out of `u` if `wanted`.
#[inline]
fn halve(u: f32, wanted: bool) -> (bool, f32) {
    if !wanted {
        (false, u)
    } else if u < 0.5 {
        (false, 2.0 * u)
    } else {
        (true, 2.0 * u - 1.0)
    }
}
