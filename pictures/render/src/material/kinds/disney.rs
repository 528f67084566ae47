//! The material `disney`, as pbrt-v3 puts it together.

use antumbra_scene::material::{Disney, DisneyBody};
use glam::Vec3;

use super::{Here, Shade, positive};
use crate::color::luminance;
use crate::material::bsdf::{
    Bsdf, Clearcoat, DiffuseTransmission, DisneyBase, Fresnel, GlossyReflection,
    GlossyTransmission, Interface, Subsurface, TrowbridgeReitz, albedo_of,
};
use crate::medium::Coefficients;
use crate::texture::Place;

/// Alphas of clear coats without gloss, and with full gloss.
const COAT_ALPHAS: [f32; 2] = [0.1, 0.001];
/// Width of the profile of pbrt-v3 over the scatter distance.
const PROFILE_WIDTH: f32 = 0.2;
/// Shortest mean free path. Zero would let no light travel.
const SHORTEST: Vec3 = Vec3::splat(1e-8);

impl Shade for Disney<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let share = |value: f32| value.clamp(0.0, 1.0);
        let weight = |value: f32| value.max(0.0);
        let color = positive(self.color);
        let tint = match luminance(color) {
            light if light > 0.0 => color / light,
            _ => Vec3::ONE,
        };
        let (metallic, clear) = (share(self.metallic), share(self.specular_transmission));
        let (roughness, eta) = (weight(self.roughness), self.eta.max(1e-3));
        let diffuse = color * ((1.0 - metallic) * (1.0 - clear));

        let aspect = (1.0 - 0.9 * share(self.anisotropic)).sqrt();
        let alphas = |roughness: f32| {
            let alpha = roughness * roughness;
            [alpha / aspect, alpha * aspect]
        };
        let facets = TrowbridgeReitz::separable(alphas(roughness));
        let straight = (eta - 1.0) / (eta + 1.0);
        let hue = Vec3::ONE.lerp(tint, share(self.specular_tint));
        let fresnel = Fresnel::Disney {
            r0: (hue * (straight * straight)).lerp(color, metallic),
            metallic,
            eta,
        };
        let gloss = share(self.clearcoat_gloss);
        let coat_alpha = COAT_ALPHAS[0] + (COAT_ALPHAS[1] - COAT_ALPHAS[0]) * gloss;
        let sheen = Vec3::ONE.lerp(tint, share(self.sheen_tint)) * weight(self.sheen);
        let mut base = DisneyBase {
            diffuse,
            flat: Vec3::ZERO,
            retro: diffuse,
            sheen: sheen * ((1.0 - metallic) * (1.0 - clear)),
            roughness,
        };
        let mut lobes = Bsdf::black()
            .with(GlossyReflection::new(Vec3::ONE, facets, fresnel))
            .with(Clearcoat::new(weight(self.clearcoat), coat_alpha));
        // The root, since light that crosses a body is refracted twice.
        let refracted = Vec3::from(color.to_array().map(f32::sqrt)) * clear;
        let refraction = |facets| GlossyTransmission::new(refracted, facets, eta);
        match self.body {
            DisneyBody::Solid { scatter_distance } => {
                let distance = positive(scatter_distance);
                if distance != Vec3::ZERO && diffuse != Vec3::ZERO {
                    base.diffuse = Vec3::ZERO;
                    let passing = (1.0 - metallic) * (1.0 - clear);
                    return lobes.with(base).above(body(color, distance, eta, passing));
                }
                lobes = lobes.with(refraction(facets));
            }
            DisneyBody::Thin {
                flatness,
                diffuse_transmission,
            } => {
                let flat = share(flatness);
                let passed = 0.5 * diffuse_transmission.clamp(0.0, 2.0);
                base.diffuse = diffuse * ((1.0 - flat) * (1.0 - passed));
                base.flat = diffuse * (flat * (1.0 - passed));
                // Rougher for sheets of a high index (Burley 2015, figure 15).
                let scaled = (0.65 * eta - 0.35) * roughness;
                lobes = lobes
                    .with(refraction(TrowbridgeReitz::new(alphas(scaled), false)))
                    .with(DiffuseTransmission(color * passed));
            }
        }
        lobes.with(base)
    }
}

/// Mean free path of a body whose reflectance profile has the width of pbrt-v3 (Christensen and Burley 2015, equation 6).
fn mean_free_path(color: Vec3, distance: Vec3) -> Vec3 {
    let paths = |color: f32| 1.9 - color + 3.5 * (color - 0.8) * (color - 0.8);
    let paths = Vec3::from(color.to_array().map(paths));
    let paths = distance * PROFILE_WIDTH * paths;
    // Between paths that are even shorter beside the others, a walk would end by rounding.
    paths.max(SHORTEST.max(Vec3::splat(1e-4 * paths.max_element())))
}

/// Inside of a body in which light walks, where pbrt-v3 has a profile of two exponentials.
fn body(color: Vec3, distance: Vec3, eta: f32, passing: f32) -> Subsurface {
    let color = color.min(Vec3::ONE);
    let attenuation = mean_free_path(color, distance).recip();
    let scattering = attenuation * albedo_of(color, eta, 0.0);
    Subsurface {
        kt: Vec3::splat(passing),
        interface: Interface::new(eta),
        coefficients: Coefficients::new(attenuation - scattering, scattering),
        asymmetry: 0.0,
    }
}

#[cfg(test)]
mod tests;
