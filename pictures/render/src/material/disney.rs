//! The material `disney`, as pbrt-v3 puts it together.

use antumbra_scene::Rgb;
use glam::Vec3;

use super::bsdf::{
    Bsdf, Clearcoat, DisneyBase, Fresnel, GlossyReflection, GlossyTransmission, Interface, Lobe,
    Subsurface, TrowbridgeReitz, albedo_of,
};
use super::parameters::Lowering;
use crate::color::luminance;
use crate::medium::Coefficients;
use crate::texture::{Input, Place};

/// Lowered parameters of an [`antumbra_scene::Disney`].
#[derive(Clone, Debug)]
pub struct Disney {
    color: Input<Rgb>,
    metallic: Input<f32>,
    eta: Input<f32>,
    roughness: Input<f32>,
    specular_tint: Input<f32>,
    anisotropic: Input<f32>,
    sheen: Input<f32>,
    sheen_tint: Input<f32>,
    clearcoat: Input<f32>,
    clearcoat_gloss: Input<f32>,
    specular_transmission: Input<f32>,
    body: Body,
}

#[derive(Clone, Debug)]
enum Body {
    Solid {
        scatter_distance: Input<Rgb>,
    },
    Thin {
        flatness: Input<f32>,
        diffuse_transmission: Input<f32>,
    },
}

/// Alphas of clear coats without gloss, and with full gloss.
const COAT_ALPHAS: [f32; 2] = [0.1, 0.001];
/// Width of the profile of pbrt-v3 over the scatter distance.
const PROFILE_WIDTH: f32 = 0.2;
/// Shortest mean free path. Zero would let no light travel.
const SHORTEST: Vec3 = Vec3::splat(1e-8);

impl Disney {
    /// Lowers parameters.
    pub fn new(scene: &antumbra_scene::Disney, lowering: &mut Lowering) -> Self {
        Self {
            color: lowering.input(&scene.color),
            metallic: lowering.input(&scene.metallic),
            eta: lowering.input(&scene.eta),
            roughness: lowering.input(&scene.roughness),
            specular_tint: lowering.input(&scene.specular_tint),
            anisotropic: lowering.input(&scene.anisotropic),
            sheen: lowering.input(&scene.sheen),
            sheen_tint: lowering.input(&scene.sheen_tint),
            clearcoat: lowering.input(&scene.clearcoat),
            clearcoat_gloss: lowering.input(&scene.clearcoat_gloss),
            specular_transmission: lowering.input(&scene.specular_transmission),
            body: match &scene.body {
                antumbra_scene::DisneyBody::Solid { scatter_distance } => Body::Solid {
                    scatter_distance: lowering.input(scatter_distance),
                },
                antumbra_scene::DisneyBody::Thin {
                    flatness,
                    diffuse_transmission,
                } => Body::Thin {
                    flatness: lowering.input(flatness),
                    diffuse_transmission: lowering.input(diffuse_transmission),
                },
            },
        }
    }

    /// BSDF at a place.
    pub fn bsdf(&self, place: &Place) -> Bsdf {
        let share = |input: &Input<f32>| input.at(place).clamp(0.0, 1.0);
        let weight = |input: &Input<f32>| input.at(place).max(0.0);
        let color = self.color.at(place).max(Vec3::ZERO);
        let tint = match luminance(color) {
            light if light > 0.0 => color / light,
            _ => Vec3::ONE,
        };
        let (metallic, clear) = (share(&self.metallic), share(&self.specular_transmission));
        let (roughness, eta) = (weight(&self.roughness), self.eta.at(place).max(1e-3));
        let diffuse = color * ((1.0 - metallic) * (1.0 - clear));

        let aspect = (1.0 - 0.9 * share(&self.anisotropic)).sqrt();
        let alphas = |roughness: f32| {
            let alpha = roughness * roughness;
            [alpha / aspect, alpha * aspect]
        };
        let facets = TrowbridgeReitz::separable(alphas(roughness));
        let straight = (eta - 1.0) / (eta + 1.0);
        let hue = Vec3::ONE.lerp(tint, share(&self.specular_tint));
        let fresnel = Fresnel::Disney {
            r0: (hue * (straight * straight)).lerp(color, metallic),
            metallic,
            eta,
        };
        let gloss = share(&self.clearcoat_gloss);
        let coat_alpha = COAT_ALPHAS[0] + (COAT_ALPHAS[1] - COAT_ALPHAS[0]) * gloss;
        let sheen = Vec3::ONE.lerp(tint, share(&self.sheen_tint)) * weight(&self.sheen);
        let mut base = DisneyBase {
            diffuse,
            flat: Vec3::ZERO,
            retro: diffuse,
            sheen: sheen * ((1.0 - metallic) * (1.0 - clear)),
            roughness,
        };
        let mut lobes = vec![
            Lobe::Glossy(GlossyReflection::new(Vec3::ONE, facets, fresnel)),
            Lobe::Clearcoat(Clearcoat::new(weight(&self.clearcoat), coat_alpha)),
        ];
        // The root, since light that crosses a body is refracted twice.
        let refracted = Vec3::from(color.to_array().map(f32::sqrt)) * clear;
        let refraction =
            |facets| Lobe::GlossyTransmission(GlossyTransmission::new(refracted, facets, eta));
        match &self.body {
            Body::Solid { scatter_distance } => {
                let distance = scatter_distance.at(place).max(Vec3::ZERO);
                if distance != Vec3::ZERO && diffuse != Vec3::ZERO {
                    base.diffuse = Vec3::ZERO;
                    lobes.push(Lobe::DisneyBase(base));
                    let passing = (1.0 - metallic) * (1.0 - clear);
                    return body(Bsdf::lobes(lobes), color, distance, eta, passing);
                }
                lobes.push(refraction(facets));
            }
            Body::Thin {
                flatness,
                diffuse_transmission,
            } => {
                let flat = share(flatness);
                let passed = 0.5 * diffuse_transmission.at(place).clamp(0.0, 2.0);
                base.diffuse = diffuse * ((1.0 - flat) * (1.0 - passed));
                base.flat = diffuse * (flat * (1.0 - passed));
                // Rougher for sheets of a high index (Burley 2015, figure 15).
                let scaled = (0.65 * eta - 0.35) * roughness;
                lobes.push(refraction(TrowbridgeReitz::new(alphas(scaled), false)));
                lobes.push(Lobe::DiffuseTransmission(color * passed));
            }
        }
        lobes.push(Lobe::DisneyBase(base));
        Bsdf::lobes(lobes)
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

/// Surface above a body in which light walks, where pbrt-v3 has a profile of two exponentials.
fn body(surface: Bsdf, color: Vec3, distance: Vec3, eta: f32, passing: f32) -> Bsdf {
    let color = color.min(Vec3::ONE);
    let attenuation = mean_free_path(color, distance).recip();
    let scattering = attenuation * albedo_of(color, eta, 0.0);
    Bsdf::Subsurface(Box::new(Subsurface {
        surface,
        kt: Vec3::splat(passing),
        interface: Interface::new(eta),
        coefficients: Coefficients::new(attenuation - scattering, scattering),
        asymmetry: 0.0,
    }))
}

#[cfg(test)]
mod tests;
