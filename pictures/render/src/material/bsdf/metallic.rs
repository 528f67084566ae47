//! Dielectrics and metals by the metallic-roughness model of glTF 2.0.
//!
//! # Energy
//!
//! The specification adds a diffuse base under a Schlick coat and leaves the exact balance to the renderer. Here the base
//! gets what the coat does not reflect: its value is `base (1 - E(o)) (1 - E(i)) / (π (1 - mean E))`, where E is the
//! reflectance of the coat by direction (Kelemen and Szirmay-Kalos 2001). Metals get the light that is reflected more than
//! once between facets, in the same form (Kulla and Conty 2017). White bases and white metals then reflect all light,
//! whatever the roughness, and the value is reciprocal.

use std::f32::consts::FRAC_1_PI;

use antumbra_scene::material;
use glam::Vec3;

use super::albedo::{CoatAlbedo, schlick_part};
use super::microfacet::TrowbridgeReitz;
use super::{Scatter, cosine_side};
use crate::color::luminance;
use crate::surface::{reflect, same_hemisphere};

type Parameters = material::Metallic<crate::material::Here>;

/// Coat, base and metal in one lobe.
#[derive(Clone, Copy, Debug)]
pub struct Metallic {
    /// Factor of everything.
    scale: Vec3,
    /// Reflectance at normal incidence, of coat and metal together.
    f0: Vec3,
    /// Reflectance at grazing incidence, of coat and metal together, and of the coat.
    f90: [f32; 2],
    coat: Vec3,
    base: Vec3,
    /// Light reflected several times between the facets of the metal.
    again: Vec3,
    facets: TrowbridgeReitz,
    albedo: CoatAlbedo,
}

/// Reflectance at grazing incidence of a coat. Coats weaker than water's are taken as shadowed (Lagarde 2011).
fn grazing(coat: Vec3) -> f32 {
    (coat.max_element() * 50.0).clamp(0.0, 1.0)
}

impl Metallic {
    /// The lobe, and the share of light that goes straight on through the base, still to be multiplied by what the coat
    /// lets pass. Parameters are clamped to 0..=1.
    pub fn new(parameters: &Parameters) -> (Self, Vec3) {
        let color = parameters.color.clamp(Vec3::ZERO, Vec3::ONE);
        let coat = parameters.coat.clamp(Vec3::ZERO, Vec3::ONE);
        let share = |value: f32| value.clamp(0.0, 1.0);
        let (metallic, roughness) = (share(parameters.metallic), share(parameters.roughness));
        let transparent = share(parameters.transmission);
        let dielectric = color * (1.0 - metallic);
        let albedo = CoatAlbedo::of(roughness);
        let alpha = roughness * roughness;
        let lobe = Self {
            scale: Vec3::ONE,
            f0: coat.lerp(color, metallic),
            f90: [grazing(coat) * (1.0 - metallic) + metallic, grazing(coat)],
            coat,
            base: dielectric * (1.0 - transparent),
            again: metallic * several(color, albedo),
            facets: TrowbridgeReitz::new([alpha; 2], false),
            albedo,
        };
        (lobe, dielectric * transparent)
    }

    /// Diffuse base of reflectance `base` below a coat of facets of this alpha, with the light that the two reflect to each
    /// other.
    ///
    /// Of the light that leaves the base, the coat sends back `R = 1 - T / eta²`, where T is the mean of what passes from
    /// outside. The sum over all returns makes `base (1 - R) / (1 - base R)` of the reflectance of the base.
    pub fn coated(base: Vec3, eta: f32, alpha: f32) -> Self {
        let eta = if eta >= 1.0 { eta } else { 1.0 / eta.max(1e-3) };
        let straight = (eta - 1.0) / (eta + 1.0);
        let (mut lobe, _) = Self::new(&Parameters {
            color: base,
            metallic: 0.0,
            roughness: alpha.max(0.0).sqrt(),
            coat: Vec3::splat(straight * straight),
            transmission: 0.0,
        });
        let out = lobe.coat().mean_passed() / (eta * eta);
        lobe.base = lobe.base * out / (Vec3::ONE - lobe.base * (Vec3::ONE - out));
        lobe
    }

    /// Only the coat of the dielectric, for light that goes straight on.
    pub fn coat(&self) -> Coat {
        Coat {
            f0: self.coat,
            f90: self.f90[1],
            albedo: self.albedo,
        }
    }

    /// Base and light between facets, for cosines to the normal: the part without highlight.
    fn spread(&self, cos_o: f32, cos_i: f32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        if self.base != Vec3::ZERO {
            let coat = self.coat();
            let passed = coat.passed(cos_o) * coat.passed(cos_i);
            sum += self.base * passed / coat.mean_passed();
        }
        if self.again != Vec3::ZERO {
            let white = |cos| 1.0 - self.albedo.white(cos);
            sum += self.again * (white(cos_o) * white(cos_i) / (1.0 - self.albedo.mean_white()));
        }
        sum * FRAC_1_PI
    }

    /// Probability of sampling the highlight, by the light that each part reflects.
    fn highlight_share(&self, wo: Vec3) -> f32 {
        let cos = wo.z.abs();
        let highlight = luminance(self.albedo.of_schlick(cos, self.f0, self.f90[0]));
        let white = 1.0 - self.albedo.white(cos);
        let coat = self.coat();
        let spread = luminance(self.base * coat.passed(cos)) + luminance(self.again) * white;
        if !(spread > 0.0) {
            return 1.0;
        }
        if !(highlight > 0.0) {
            return 0.0;
        }
        (highlight / (highlight + spread)).clamp(0.1, 0.9)
    }
}

impl Scatter for Metallic {
    fn is_black(&self) -> bool {
        self.scale == Vec3::ZERO
            || (self.f0 == Vec3::ZERO && self.f90[0] == 0.0 && self.base == Vec3::ZERO)
    }

    fn scale(&mut self, by: Vec3) {
        self.scale *= by;
    }

    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let h = wo + wi;
        if wo.z == 0.0 || wi.z == 0.0 || h == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let spread = self.spread(wo.z.abs(), wi.z.abs());
        let h = h.normalize();
        let grazing = schlick_part(wi.dot(h).abs());
        let fresnel = self.f0 + (Vec3::splat(self.f90[0]) - self.f0) * grazing;
        let geometry = self.facets.density(h) * self.facets.masking_shadowing(wo, wi);
        let highlight = fresnel * (geometry / (4.0 * (wo.z * wi.z).abs()));
        self.scale * (spread + highlight)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_hemisphere(wo, wi) {
            return 0.0;
        }
        let share = self.highlight_share(wo);
        let h = (wo + wi).normalize();
        let highlight = self.facets.pdf(wo, h) / (4.0 * wo.dot(h));
        let highlight = if share > 0.0 { share * highlight } else { 0.0 };
        highlight + (1.0 - share) * wi.z.abs() * FRAC_1_PI
    }

    /// Direction for the highlight or for the rest, by `choice` in `[0, 1)`.
    fn sample(&self, wo: Vec3, choice: f32, u: [f32; 2]) -> Option<Vec3> {
        if choice >= self.highlight_share(wo) {
            return Some(cosine_side(wo, u));
        }
        let h = self.facets.sample(wo, u);
        let wi = reflect(wo, h);
        (wo.dot(h) > 0.0 && same_hemisphere(wo, wi)).then_some(wi)
    }
}

/// Reflectance of light that hits facets of a metal more than once (Kulla and Conty 2017; Fdez-Agüera 2019).
fn several(color: Vec3, albedo: CoatAlbedo) -> Vec3 {
    let mean = color + (Vec3::ONE - color) * (1.0 / 21.0);
    let once = albedo.mean_white();
    mean * mean * once / (Vec3::ONE - mean * (1.0 - once))
}

/// Coat of a dielectric, for light that passes.
#[derive(Clone, Copy, Debug)]
pub struct Coat {
    f0: Vec3,
    f90: f32,
    albedo: CoatAlbedo,
}

impl Coat {
    /// Share of light that is not reflected, from a direction with this cosine to the normal.
    pub fn passed(&self, cos: f32) -> Vec3 {
        Vec3::ONE - self.albedo.of_schlick(cos.abs(), self.f0, self.f90)
    }

    fn mean_passed(&self) -> Vec3 {
        let [a, b] = self.albedo.means();
        (Vec3::ONE - self.f0 * a - Vec3::splat(self.f90 * b)).max(Vec3::splat(1e-6))
    }
}
