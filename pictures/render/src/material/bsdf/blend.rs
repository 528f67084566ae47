//! A diffuse base under a glossy coat that takes its share of the light (Ashikhmin and Shirley 2000, *An Anisotropic
//! Phong BRDF Model*). As in pbrt-v3, microfacets replace the Phong lobe.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use super::microfacet::TrowbridgeReitz;
use super::{Scatter, cosine_side};
use crate::surface::{reflect, same_hemisphere};

/// Base and coat in one lobe, since each takes from the other.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    /// Factor of everything.
    scale: Vec3,
    base: Vec3,
    coat: Vec3,
    facets: TrowbridgeReitz,
}

fn pow5(x: f32) -> f32 {
    (x * x) * (x * x) * x
}

impl Blend {
    /// BRDF of a diffuse reflectance of the base, a reflectance of the coat seen straight on, and a roughness.
    pub fn new(base: Vec3, coat: Vec3, facets: TrowbridgeReitz) -> Self {
        Self {
            scale: Vec3::ONE,
            base,
            coat,
            facets,
        }
    }
}

impl Scatter for Blend {
    fn is_black(&self) -> bool {
        self.scale == Vec3::ZERO
    }

    fn scale(&mut self, by: Vec3) {
        self.scale *= by;
    }

    fn is_anisotropic(&self) -> bool {
        self.facets.is_anisotropic()
    }

    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
        let h = wo + wi;
        if h == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let h = h.normalize();
        let passed = |cos: f32| 1.0 - pow5(1.0 - 0.5 * cos);
        let base = self.base
            * (Vec3::ONE - self.coat)
            * (28.0 / (23.0 * PI) * passed(cos_i) * passed(cos_o));
        let cos_h = wi.dot(h);
        let schlick = self.coat + (Vec3::ONE - self.coat) * pow5(1.0 - cos_h);
        let coat = schlick * (self.facets.density(h) / (4.0 * cos_h.abs() * cos_i.max(cos_o)));
        self.scale * (base + coat)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_hemisphere(wo, wi) {
            return 0.0;
        }
        let h = (wo + wi).normalize();
        let coat = self.facets.pdf(wo, h) / (4.0 * wo.dot(h));
        0.5 * (wi.z.abs() * FRAC_1_PI + coat)
    }

    /// Direction for the base or for the coat, by `choice` in `[0, 1)`.
    fn sample(&self, wo: Vec3, choice: f32, u: [f32; 2]) -> Option<Vec3> {
        if choice < 0.5 {
            return Some(cosine_side(wo, u));
        }
        let h = self.facets.sample(wo, u);
        let wi = reflect(wo, h);
        (wo.dot(h) > 0.0 && same_hemisphere(wo, wi)).then_some(wi)
    }
}
