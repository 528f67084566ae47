//! Bodies below a dielectric interface in which light wanders: the interface, and what is inside.
//!
//! Light enters by refraction, is scattered as in a homogeneous medium, is reflected at the interface from inside by
//! Fresnel's formulas, and leaves with the separable angular profile of pbrt-v3, `S_w`. So the walk takes the place of
//! the tabulated profile of pbrt-v3, which approximates the walk in a half-space by beams of photons (Habel, Christensen
//! and Jarosz 2013).

use std::f32::consts::PI;

use glam::Vec3;

use super::fresnel::dielectric;
use crate::medium::Coefficients;
use crate::surface::refract;

/// Number of intervals of the integral over the cosine.
const INTERVALS: u32 = 64;

/// A body that scatters light below its surface.
#[derive(Clone, Debug)]
pub struct Subsurface {
    /// Scale of the light that enters.
    pub kt: Vec3,
    /// Interface between outside and inside.
    pub interface: Interface,
    /// Absorption and scattering inside.
    pub coefficients: Coefficients,
    /// Mean cosine of the scattering angle.
    pub asymmetry: f32,
}

impl Subsurface {
    /// Probability with which light that is seen at this cosine to the normal comes from inside.
    ///
    /// `reflects` says whether the surface scatters anything.
    pub fn chance_to_enter(&self, cos: f32, reflects: bool) -> f32 {
        let entering = (1.0 - self.interface.reflectance(cos)) * self.kt.max_element();
        if !reflects {
            1.0
        } else if entering <= 0.0 {
            0.0
        } else {
            entering.clamp(0.1, 0.9)
        }
    }
}

/// Smooth interface of a body.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// Index of refraction inside over outside.
    eta: f32,
    /// Share of diffuse light from outside that enters.
    entering: f32,
}

impl Interface {
    /// Interface by its index of refraction, inside over outside.
    pub fn new(eta: f32) -> Self {
        Self {
            eta,
            entering: diffuse_share(eta),
        }
    }

    /// Share of light along a direction of this cosine to the normal that is reflected from outside.
    pub fn reflectance(&self, cos: f32) -> f32 {
        dielectric(cos.abs(), self.eta)
    }

    /// Share of light along a direction of this cosine to the normal that is reflected from inside.
    pub fn reflectance_inside(&self, cos: f32) -> f32 {
        dielectric(cos.abs(), 1.0 / self.eta)
    }

    /// Refracted direction of light that is seen from outside along `wo`, in the frame of the surface.
    pub fn refracted(&self, wo: Vec3) -> Option<Vec3> {
        let normal = if wo.z < 0.0 { -Vec3::Z } else { Vec3::Z };
        refract(wo, normal, 1.0 / self.eta)
    }

    /// BSDF of light that leaves the body along a direction of this cosine: `S_w` of pbrt-v3. With the cosine it
    /// integrates to 1.
    pub fn leaving(&self, cos: f32) -> f32 {
        (1.0 - self.reflectance(cos)) / (self.entering * PI)
    }
}

/// Share of diffuse light that a smooth interface lets in: `2 ∫ (1 - F(μ)) μ dμ`, by Simpson's rule.
fn diffuse_share(eta: f32) -> f32 {
    let step = 1.0 / INTERVALS as f32;
    let term = |index: u32| {
        let cos = index as f32 * step;
        let weight = match index {
            0 | INTERVALS => 1.0,
            _ if index % 2 == 1 => 4.0,
            _ => 2.0,
        };
        weight * (1.0 - dielectric(cos, eta)) * cos
    };
    2.0 * step / 3.0 * (0..=INTERVALS).map(term).sum::<f32>()
}

/// Single scattering albedo of a body of this diffuse reflectance, by colour.
///
/// Inverts the diffuse reflectance of a half-space (Jensen, Marschner, Levoy and Hanrahan 2001, section 2.4), by
/// bisection. `eta` is the index of refraction inside over outside.
pub fn albedo_of(reflectance: Vec3, eta: f32, asymmetry: f32) -> Vec3 {
    let passing = diffuse_share(eta) / (eta * eta);
    let mismatch = (2.0 - passing) / passing;
    let reflected = |albedo: f32| {
        let root = (3.0 * (1.0 - albedo)).max(0.0).sqrt();
        let inside = 1.0 + libm::expf(-4.0 / 3.0 * mismatch * root);
        0.5 * albedo * inside * libm::expf(-root)
    };
    Vec3::from(reflectance.to_array().map(|wanted| {
        let wanted = wanted.clamp(0.0, 1.0);
        let [mut low, mut high] = [0.0_f32, 1.0];
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if reflected(middle) < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        // The reduced albedo counts less scattering than there is.
        high / (1.0 - asymmetry + asymmetry * high)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_leaves_with_a_density() {
        for eta in [1.0, 1.33, 2.0, 0.8] {
            let interface = Interface::new(eta);
            let count = 20_000;
            let sum: f64 = (0..count)
                .map(|index| {
                    let cos = (index as f64 + 0.5) / count as f64;
                    f64::from(interface.leaving(cos as f32)) * cos
                })
                .sum();
            let whole = 2.0 * std::f64::consts::PI * sum / count as f64;
            assert!((whole - 1.0).abs() < 3e-3, "{eta}: {whole}");
        }
        assert!((diffuse_share(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn albedos_give_the_reflectance_back() {
        let found = albedo_of(Vec3::new(0.0, 0.5, 1.0), 1.33, 0.0);
        assert!(found.x < 1e-5 && found.z > 0.9999, "{found}");
        // Multiple scattering: half of the light needs nearly all of the albedo.
        assert!(found.y > 0.9 && found.y < 0.99, "{found}");
        let forward = albedo_of(Vec3::splat(0.5), 1.33, 0.8);
        assert!(forward.x > found.y, "{forward}");
    }
}
