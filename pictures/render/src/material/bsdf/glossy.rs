//! Reflection by rough interfaces and refraction by rough dielectric ones (Torrance and Sparrow 1967, Walter,
//! Marschner, Li and Torrance 2007).

use glam::Vec3;

use super::Scatter;
use super::albedo::schlick_part;
use super::fresnel::{Fresnel, coated, conductor, dielectric};
use super::microfacet::TrowbridgeReitz;
use crate::surface::{reflect, refract, same_hemisphere};

/// Reflection by microfacets of a dielectric or a conductor.
#[derive(Clone, Copy, Debug)]
pub struct GlossyReflection {
    scale: Vec3,
    facets: TrowbridgeReitz,
    fresnel: Fresnel,
}

impl GlossyReflection {
    /// Facets whose reflectance is `scale` times the reflectance of an interface.
    pub fn new(scale: Vec3, facets: TrowbridgeReitz, fresnel: Fresnel) -> Self {
        Self {
            scale,
            facets,
            fresnel,
        }
    }
}

impl Scatter for GlossyReflection {
    fn is_black(&self) -> bool {
        self.scale == Vec3::ZERO
    }

    fn scale(&mut self, by: Vec3) {
        self.scale *= by;
    }

    fn is_anisotropic(&self) -> bool {
        self.facets.is_anisotropic()
    }

    /// Value of the BRDF. 0 at grazing angles, and where no facet mirrors one direction to the other.
    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let h = wo + wi;
        if wo.z == 0.0 || wi.z == 0.0 || h == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let h = h.normalize();
        // Turned to the outside, since a view from inside would otherwise see no total reflection.
        let outside = if h.z < 0.0 { -h } else { h };
        let geometry = self.facets.density(h) * self.facets.masking_shadowing(wo, wi);
        let share = 4.0 * (wo.z * wi.z).abs();
        match self.fresnel {
            Fresnel::Dielectric(eta) => {
                self.scale * (dielectric(wi.dot(outside), eta) * geometry / share)
            }
            Fresnel::Conductor { eta, k } => {
                self.scale * conductor(wi.dot(h), eta, k) * (geometry / share)
            }
            Fresnel::Disney { r0, metallic, eta } => {
                let cos = wi.dot(outside);
                let metal = r0 + (Vec3::ONE - r0) * schlick_part(cos);
                let reflected = Vec3::splat(dielectric(cos, eta)).lerp(metal, metallic);
                self.scale * reflected * (geometry / share)
            }
            Fresnel::Coat(eta) => {
                self.scale * (dielectric(wi.dot(h).abs(), eta) * geometry / share)
            }
            Fresnel::Coated { eta, k, coat } => {
                self.scale * coated(wi.dot(h), eta, k, coat) * (geometry / share)
            }
        }
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_hemisphere(wo, wi) {
            return 0.0;
        }
        let h = (wo + wi).normalize();
        self.facets.pdf(wo, h) / (4.0 * wo.dot(h))
    }

    /// Mirror direction at a visible facet. `None` if it ends below the surface.
    fn sample(&self, wo: Vec3, _: f32, u: [f32; 2]) -> Option<Vec3> {
        let h = self.facets.sample(wo, u);
        let wi = reflect(wo, h);
        (wo.dot(h) > 0.0 && same_hemisphere(wo, wi)).then_some(wi)
    }
}

/// Refraction by microfacets of a dielectric. Radiance is scaled by the squared ratio of indices.
#[derive(Clone, Copy, Debug)]
pub struct GlossyTransmission {
    scale: Vec3,
    facets: TrowbridgeReitz,
    eta: f32,
}

impl GlossyTransmission {
    /// Facets whose transmittance is `scale` times the transmittance of an interface. `eta` is the index of refraction
    /// below the normal over the index above it.
    ///
    /// An index of 1, where light goes straight on, has no facet for a pair of directions: the nearest is 0.1 % away.
    pub fn new(scale: Vec3, facets: TrowbridgeReitz, eta: f32) -> Self {
        const LEAST: f32 = 1e-3;
        let eta = match eta - 1.0 {
            off if off.abs() < LEAST => 1.0 + LEAST.copysign(off),
            _ => eta,
        };
        Self { scale, facets, eta }
    }

    /// Normal, on the upper side, of the facet that refracts one direction into the other. Beside it, the index on
    /// the side of `wi` over that on the side of `wo`. `None` where there is no such facet.
    fn facet(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
        if wo.z * wi.z >= 0.0 {
            return None;
        }
        let eta = if wo.z > 0.0 { self.eta } else { 1.0 / self.eta };
        let h = (wo + wi * eta).normalize();
        let h = if h.z < 0.0 { -h } else { h };
        // Both directions must see the front of the facet. (pbrt-v3 does not check that, and gives a density to
        // directions that it never samples.) NaN, from index 1 and opposite directions, is no facet.
        (wo.dot(h) * wo.z > 0.0 && wi.dot(h) * wi.z > 0.0).then_some((h, eta))
    }
}

impl Scatter for GlossyTransmission {
    fn is_black(&self) -> bool {
        self.scale == Vec3::ZERO
    }

    fn scale(&mut self, by: Vec3) {
        self.scale *= by;
    }

    fn is_of(&self, reflects: bool) -> bool {
        !reflects
    }

    fn is_anisotropic(&self) -> bool {
        self.facets.is_anisotropic()
    }

    fn eta(&self) -> f32 {
        self.eta
    }

    /// Value of the BTDF, for radiance.
    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some((h, eta)) = self.facet(wo, wi) else {
            return Vec3::ZERO;
        };
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        let passed = 1.0 - dielectric(cos_o, self.eta);
        let denominator = cos_o + eta * cos_i;
        let geometry = self.facets.density(h) * self.facets.masking_shadowing(wo, wi);
        // The Jacobian's eta² cancels the 1 / eta² of radiance.
        let ratio = cos_o * cos_i / (wo.z * wi.z * denominator * denominator);
        self.scale * (passed * (geometry * ratio).abs())
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some((h, eta)) = self.facet(wo, wi) else {
            return 0.0;
        };
        let denominator = wo.dot(h) + eta * wi.dot(h);
        let jacobian = (eta * eta * wi.dot(h) / (denominator * denominator)).abs();
        self.facets.pdf(wo, h) * jacobian
    }

    /// Direction refracted at a visible facet. `None` under total reflection.
    fn sample(&self, wo: Vec3, _: f32, u: [f32; 2]) -> Option<Vec3> {
        let h = self.facets.sample(wo, u);
        if wo.dot(h) <= 0.0 {
            return None;
        }
        let eta = if wo.z > 0.0 { 1.0 / self.eta } else { self.eta };
        refract(wo, h, eta).filter(|wi| wo.z * wi.z < 0.0)
    }
}
