//! A sky of one colour.
//!
//! Half of the samples are cosine-weighted, half uniform, on the sides that count. Purely cosine-weighted samples
//! would be optimal for a flat diffuse surface. But their weights are unbounded where the shading normal leans
//! away from the geometric normal.

use std::f32::consts::PI;

use glam::Vec3;

use super::{LightSample, Receiver};
use crate::sampler::warp::{cosine_hemisphere, uniform_hemisphere};
use crate::surface::Frame;

/// Uniform radiance from every direction that leaves the scene.
#[derive(Clone, Copy, Debug)]
pub struct Sky {
    /// Radiance of every direction.
    pub radiance: Vec3,
    /// Samples per point. 0 counts as 1.
    pub samples: u32,
}

impl Sky {
    /// Sample of a direction, cosine-weighted or uniform over the hemispheres that count.
    #[inline]
    pub fn sample(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        let draw = draw(at.both_sides, u);
        let local = if draw.uniform {
            uniform_hemisphere(draw.u)
        } else {
            cosine_hemisphere(draw.u)
        };
        let normal = if draw.other_side {
            -at.normal
        } else {
            at.normal
        };
        let wi = Frame::around(normal).to_world(local);
        LightSample::from_outside(wi, self.radiance, self.pdf(at, wi))
    }

    /// Density of [`Self::sample`] per solid angle.
    #[inline]
    pub fn pdf(&self, at: &Receiver, wi: Vec3) -> f32 {
        density(at.normal, at.both_sides, wi)
    }
}

/// Density of samples per solid angle, around `normal`.
#[inline]
pub(super) fn density(normal: Vec3, both_sides: bool, wi: Vec3) -> f32 {
    let cos = wi.dot(normal);
    if both_sides {
        0.5 * (0.5 * cos.abs() + 0.25) / PI
    } else if cos >= 0.0 {
        (0.5 * cos + 0.25) / PI
    } else {
        0.0
    }
}

/// Way in which a direction is drawn.
pub(super) struct Draw {
    /// Whether the direction lies on the other side of the receiver.
    pub other_side: bool,
    /// Whether it is uniform on its side. Otherwise it is cosine-weighted.
    pub uniform: bool,
    /// Place on the hemisphere.
    pub u: [f32; 2],
}

/// Way in which a direction is drawn by `u` in `[0, 1)²`.
#[inline]
pub(super) fn draw(both_sides: bool, [u, v]: [f32; 2]) -> Draw {
    let (other_side, u) = halve(u, both_sides);
    let (uniform, u) = halve(u, true);
    Draw {
        other_side,
        uniform,
        u: [u, v],
    }
}

/// Fair bit taken out of `u` if `wanted`, and the rest of `u`.
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
