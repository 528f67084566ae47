//! Diffuse reflection: Lambert, and Oren and Nayar (1994) for rough surfaces.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::{Scatter, cosine_side};
use crate::surface::same_hemisphere;

/// A diffuse reflector: Lambert's, or the rough one of Oren and Nayar.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    reflectance: Vec3,
    /// A and B of Oren and Nayar's qualitative model. 1 and 0 make the model Lambert's.
    a: f32,
    b: f32,
}

impl Diffuse {
    /// Reflector with `sigma`, the standard deviation of the facet angle in degrees, clamped to 0..=90. 0 is Lambert.
    pub fn new(reflectance: Vec3, sigma: f32) -> Self {
        let sigma2 = {
            let radians = sigma.clamp(0.0, 90.0).to_radians();
            radians * radians
        };
        Self {
            reflectance,
            a: 1.0 - sigma2 / (2.0 * (sigma2 + 0.33)),
            b: 0.45 * sigma2 / (sigma2 + 0.09),
        }
    }

    /// Reflectance of a Lambert reflector. `None` for a rough one.
    #[inline]
    pub fn lambert(&self) -> Option<Vec3> {
        (self.b == 0.0).then_some(self.reflectance)
    }
}

impl Scatter for Diffuse {
    fn is_black(&self) -> bool {
        self.reflectance == Vec3::ZERO
    }

    fn scale(&mut self, by: Vec3) {
        self.reflectance *= by;
    }

    #[inline]
    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let lambert = self.reflectance * FRAC_1_PI;
        if self.b == 0.0 {
            return lambert;
        }
        let sin = |w: Vec3| (1.0 - w.z * w.z).max(0.0).sqrt();
        let (sin_i, sin_o) = (sin(wi), sin(wo));
        let cos_difference = if sin_i > 1e-4 && sin_o > 1e-4 {
            ((wi.x * wo.x + wi.y * wo.y) / (sin_i * sin_o)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let (sin_alpha, tan_beta) = if wi.z.abs() > wo.z.abs() {
            (sin_o, sin_i / wi.z.abs())
        } else {
            (sin_i, sin_o / wo.z.abs())
        };
        lambert * (self.a + self.b * cos_difference * sin_alpha * tan_beta)
    }
}

/// Lambert on the other side, with this transmittance.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseTransmission(pub Vec3);

impl Scatter for DiffuseTransmission {
    fn is_black(&self) -> bool {
        self.0 == Vec3::ZERO
    }

    fn scale(&mut self, by: Vec3) {
        self.0 *= by;
    }

    fn is_of(&self, reflects: bool) -> bool {
        !reflects
    }

    fn value(&self, _: Vec3, _: Vec3) -> Vec3 {
        self.0 * FRAC_1_PI
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if same_hemisphere(wo, wi) {
            0.0
        } else {
            wi.z.abs() * FRAC_1_PI
        }
    }

    fn sample(&self, wo: Vec3, _: f32, u: [f32; 2]) -> Option<Vec3> {
        Some(cosine_side(-wo, u))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_surfaces_are_lambertian_and_rough_ones_send_light_back() {
        let lambert = Diffuse::new(Vec3::splat(0.5), 0.0);
        let rough = Diffuse::new(Vec3::splat(0.5), 20.0);
        let wo = Vec3::new(0.8, 0.0, 0.6);
        let value = lambert.value(wo, Vec3::new(-0.6, 0.0, 0.8));
        assert!((value - Vec3::splat(0.5 * FRAC_1_PI)).length() < 1e-7);
        let (back, forth) = (
            rough.value(wo, wo),
            rough.value(wo, Vec3::new(-0.8, 0.0, 0.6)),
        );
        assert!(back.x > forth.x);
        // sigma = 20 degrees: A = 0.865168, B = 0.258823; tan(beta) sin(alpha) = 0.8 * 0.8 / 0.6.
        let expected = 0.5 * FRAC_1_PI * (0.865_168 + 0.258_823 * 0.64 / 0.6);
        assert!((back.x - expected).abs() < 1e-5, "{} {expected}", back.x);
    }
}
