//! How surfaces scatter light, in the local frame whose z axis is the shading normal.
//!
//! - [`Bsdf`]: how one point scatters: evaluate, sample and the delta lobes
//! - `lobe.rs`: any number of lobes side by side
//! - `fresnel.rs`: reflectance of smooth interfaces
//! - `microfacet.rs`: the Trowbridge-Reitz (GGX) distribution of facets
//! - `diffuse.rs`: Lambert and Oren-Nayar
//! - `glossy.rs`: reflection and transmission by microfacets
//! - `blend.rs`: a coat that takes its share from the base
//! - `metallic.rs`: dielectrics and metals by glTF's model, with `albedo.rs`, what their facets reflect in all
//! - `disney.rs`: base and clear coat of the material `disney`
//! - `fourier.rs`: tables of measured or simulated scattering
//! - `hair.rs`: fibres
//! - `specular.rs`: perfect mirrors and smooth dielectrics
//! - `subsurface.rs`: bodies in which light wanders
//!
//! All values equal the values of pbrt-v3, two habits included:
//!
//! - The *geometric* normal separates reflection from transmission, the shading normal gives the value. A reflection may
//!   therefore dip below the shading horizon, where it has a value but is never sampled.
//! - `plastic` evaluates the Fresnel term of its coat from inside, as `FresnelDielectric(1.5, 1)` does.

mod albedo;
mod blend;
mod diffuse;
mod disney;
mod fourier;
mod fresnel;
mod glossy;
mod hair;
mod lobe;
mod metallic;
mod microfacet;
mod specular;
mod subsurface;

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use crate::columns::select;
use crate::sampler::warp::cosine_hemisphere;
use crate::surface::same_hemisphere;
pub use blend::Blend;
pub use diffuse::Diffuse;
pub use disney::{Clearcoat, DisneyBase};
pub use fourier::Fourier;
pub use fresnel::Fresnel;
pub use glossy::{GlossyReflection, GlossyTransmission};
pub use hair::{Hair, absorption_of_color, absorption_of_melanin};
pub use lobe::{Lobe, Lobes};
pub use metallic::{Coat, Metallic, MetallicParameters};
pub use microfacet::TrowbridgeReitz;
pub use specular::{Specular, SpecularSample};
pub use subsurface::{Interface, Subsurface, albedo_of};

/// How a point of a surface scatters light.
///
/// Lobes are *spread* over directions, or *delta*: a single direction that no other technique finds. Most materials
/// have one kind. The share of delta lobes decides how often to sample which kind.
#[derive(Clone, Debug)]
pub enum Bsdf {
    /// Absorbs everything.
    Black,
    /// Lambert or Oren-Nayar.
    Diffuse(Diffuse),
    /// Only microfacet reflection.
    Glossy(GlossyReflection),
    /// A diffuse base and a microfacet coat, added.
    Plastic(Diffuse, GlossyReflection),
    /// A rough dielectric interface. A lobe with black scale is absent.
    RoughGlass(Option<GlossyReflection>, Option<GlossyTransmission>),
    /// Coat, base and metal by glTF's model.
    Metallic(Metallic),
    /// A mirror or a smooth dielectric: only delta lobes.
    Specular(Specular),
    /// A surface above a body in which light wanders. Here only the surface counts.
    Subsurface(Box<Subsurface>),
    /// Anything else.
    Lobes(Lobes),
}

/// Value and density of scattering between two directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// Value of the BSDF, without the cosine.
    pub value: Vec3,
    /// Density of the direction in [`Bsdf::sample`], per solid angle.
    pub pdf: f32,
}

impl Bsdf {
    /// Lambert or Oren-Nayar.
    pub fn diffuse(base: Diffuse) -> Self {
        if base.is_black() {
            Self::Black
        } else {
            Self::Diffuse(base)
        }
    }

    /// A base and a coat.
    pub fn plastic(base: Diffuse, coat: GlossyReflection) -> Self {
        match (base.is_black(), coat.is_black()) {
            (_, true) => Self::diffuse(base),
            (true, false) => Self::Glossy(coat),
            (false, false) => Self::Plastic(base, coat),
        }
    }

    /// Coat, base and metal.
    pub fn metallic(lobe: Metallic) -> Self {
        if lobe.is_black() {
            Self::Black
        } else {
            Self::Metallic(lobe)
        }
    }

    /// A rough dielectric. Lobes that are black are left out.
    pub fn rough_glass(reflection: GlossyReflection, transmission: GlossyTransmission) -> Self {
        if reflection.is_black() && transmission.is_black() {
            return Self::Black;
        }
        Self::RoughGlass(
            Some(reflection).filter(|lobe| !lobe.is_black()),
            Some(transmission).filter(|lobe| !lobe.is_black()),
        )
    }

    /// Only delta lobes.
    pub fn specular(specular: Specular) -> Self {
        if specular.is_black() {
            Self::Black
        } else {
            Self::Specular(specular)
        }
    }

    /// Lobes side by side.
    pub fn lobes(lobes: Vec<Lobe>) -> Self {
        let lobes = Lobes::new(lobes);
        match lobes.as_slice() {
            [] => Self::Black,
            [Lobe::Diffuse(base)] => Self::Diffuse(*base),
            [Lobe::Glossy(coat)] => Self::Glossy(*coat),
            [Lobe::Diffuse(base), Lobe::Glossy(coat)] => Self::Plastic(*base, *coat),
            [Lobe::Metallic(metallic)] => Self::Metallic(*metallic),
            [Lobe::Specular(specular)] => Self::Specular(*specular),
            _ => Self::Lobes(lobes),
        }
    }

    /// Lobes one by one.
    pub fn into_lobes(self) -> Vec<Lobe> {
        match self {
            Self::Black => Vec::new(),
            Self::Diffuse(base) => vec![Lobe::Diffuse(base)],
            Self::Glossy(coat) => vec![Lobe::Glossy(coat)],
            Self::Plastic(base, coat) => vec![Lobe::Diffuse(base), Lobe::Glossy(coat)],
            Self::RoughGlass(reflection, transmission) => {
                let reflection = reflection.map(Lobe::Glossy);
                let transmission = transmission.map(Lobe::GlossyTransmission);
                reflection.into_iter().chain(transmission).collect()
            }
            Self::Metallic(metallic) => vec![Lobe::Metallic(metallic)],
            Self::Specular(specular) => vec![Lobe::Specular(specular)],
            Self::Subsurface(body) => body.surface.into_lobes(),
            Self::Lobes(lobes) => lobes.into_vec(),
        }
    }

    /// Reflectance, if this is a Lambert reflector and nothing else.
    #[inline]
    pub fn lambert(&self) -> Option<Vec3> {
        match self {
            Self::Diffuse(base) => base.lambert(),
            _ => None,
        }
    }

    /// Whether nothing is ever scattered.
    #[inline]
    pub fn is_black(&self) -> bool {
        matches!(self, Self::Black)
    }

    /// Share of delta lobes among all, by number: the probability with which to take a delta lobe. At 1, light
    /// samples are pointless.
    #[inline]
    pub fn delta_share(&self) -> f32 {
        match self {
            Self::Specular(_) => 1.0,
            Self::Subsurface(body) => body.surface.delta_share(),
            Self::Lobes(lobes) => lobes.delta_share(),
            _ => 0.0,
        }
    }

    /// Whether light may pass to the other side.
    #[inline]
    pub fn transmits(&self) -> bool {
        match self {
            Self::RoughGlass(_, transmission) => transmission.is_some(),
            Self::Specular(specular) => specular.transmits(),
            Self::Lobes(lobes) => lobes.transmits(),
            _ => false,
        }
    }

    /// Whether the value depends on the tangent as well as on the normal.
    #[inline]
    pub fn is_anisotropic(&self) -> bool {
        match self {
            Self::Glossy(coat) | Self::Plastic(_, coat) => coat.is_anisotropic(),
            Self::RoughGlass(Some(reflection), _) => reflection.is_anisotropic(),
            Self::RoughGlass(None, Some(transmission)) => transmission.is_anisotropic(),
            Self::Subsurface(body) => body.surface.is_anisotropic(),
            Self::Lobes(lobes) => lobes.is_anisotropic(),
            _ => false,
        }
    }

    /// Index of refraction inside over outside of the lobe that spreads light to the other side. 1 without one.
    pub fn eta(&self) -> f32 {
        match self {
            Self::RoughGlass(_, Some(transmission)) => transmission.eta(),
            Self::Lobes(lobes) => lobes.eta(),
            _ => 1.0,
        }
    }

    /// Value and density for unit directions `wo` (towards the viewer) and `wi` (towards the light).
    ///
    /// `reflects` says whether both lie on the same side of the geometric surface. Delta lobes are 0.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, reflects: bool) -> Evaluation {
        if wo.z == 0.0 {
            return Evaluation::default();
        }
        let reflected = |value: Vec3| if reflects { value } else { Vec3::ZERO };
        match self {
            Self::Black | Self::Specular(_) => Evaluation::default(),
            Self::Diffuse(base) => Evaluation {
                value: reflected(base.value(wo, wi)),
                pdf: base.pdf(wo, wi),
            },
            Self::Glossy(coat) => Evaluation {
                value: reflected(coat.value(wo, wi)),
                pdf: coat.pdf(wo, wi),
            },
            Self::Metallic(lobe) => Evaluation {
                value: reflected(lobe.value(wo, wi)),
                pdf: lobe.pdf(wo, wi),
            },
            Self::Plastic(base, coat) => Evaluation {
                value: reflected(base.value(wo, wi) + coat.value(wo, wi)),
                pdf: 0.5 * (base.pdf(wo, wi) + coat.pdf(wo, wi)),
            },
            Self::RoughGlass(reflection, transmission) => {
                let mut lobes = 0.0;
                let mut sum = Evaluation::default();
                if let Some(lobe) = reflection {
                    lobes += 1.0;
                    sum.value += reflected(lobe.value(wo, wi));
                    sum.pdf += lobe.pdf(wo, wi);
                }
                if let Some(lobe) = transmission {
                    lobes += 1.0;
                    if !reflects {
                        sum.value += lobe.value(wo, wi);
                    }
                    sum.pdf += lobe.pdf(wo, wi);
                }
                sum.pdf /= lobes;
                sum
            }
            Self::Subsurface(body) => body.surface.evaluate(wo, wi, reflects),
            Self::Lobes(lobes) => lobes.evaluate(wo, wi, reflects),
        }
    }

    /// Direction drawn with the density that [`Bsdf::evaluate`] reports. Delta lobes are never drawn.
    ///
    /// `None` if the draw fails (a facet facing away, total reflection) and the path ends.
    pub fn sample(&self, wo: Vec3, lobe: f32, u: [f32; 2]) -> Option<Vec3> {
        if wo.z == 0.0 {
            return None;
        }
        match self {
            Self::Black | Self::Specular(_) => None,
            Self::Diffuse(_) => Some(cosine_side(wo, u)),
            Self::Glossy(coat) => coat.sample(wo, u),
            Self::Metallic(metallic) => metallic.sample(wo, lobe, u),
            Self::Plastic(_, coat) => {
                if lobe < 0.5 {
                    Some(cosine_side(wo, u))
                } else {
                    coat.sample(wo, u)
                }
            }
            Self::RoughGlass(reflection, transmission) => match (reflection, transmission) {
                (Some(reflection), Some(_)) if lobe < 0.5 => reflection.sample(wo, u),
                (_, Some(transmission)) => transmission.sample(wo, u),
                (Some(reflection), None) => reflection.sample(wo, u),
                (None, None) => None,
            },
            Self::Subsurface(body) => body.surface.sample(wo, lobe, u),
            Self::Lobes(lobes) => lobes.sample(wo, lobe, u),
        }
    }

    /// Delta lobe by `choice` in `[0, 1)`, its weight divided by the probability of the choice. `None` where there is
    /// none, or where it leads nowhere.
    pub fn sample_delta(&self, wo: Vec3, choice: f32) -> Option<SpecularSample> {
        match self {
            Self::Specular(specular) => specular.sample(wo, choice),
            Self::Subsurface(body) => body.surface.sample_delta(wo, choice),
            Self::Lobes(lobes) => lobes.sample_delta(wo, choice),
            _ => None,
        }
    }

    /// Share of light from all around that leaves towards `wo`, estimated by few directions that are always the same.
    pub fn reflectance(&self, wo: Vec3) -> Vec3 {
        const SIDE: u32 = 4;
        let count = (SIDE * SIDE) as f32;
        let share = self.delta_share();
        let mut sum = Vec3::ZERO;
        for index in 0..SIDE * SIDE {
            let place = |i: u32| (i as f32 + 0.5) / SIDE as f32;
            let choice = (index as f32 + 0.5) / count;
            if share > 0.0
                && let Some(delta) = self.sample_delta(wo, choice)
            {
                sum += delta.weight;
            }
            // Lobes are chosen by another order than directions.
            let lobe = ((index * 5) % (SIDE * SIDE)) as f32 / count + 0.5 / count;
            if share < 1.0
                && let Some(wi) = self.sample(wo, lobe, [place(index % SIDE), place(index / SIDE)])
            {
                let found = self.evaluate(wo, wi, wo.z * wi.z > 0.0);
                if found.pdf > 0.0 {
                    sum += found.value * (wi.z.abs() / found.pdf);
                }
            }
        }
        sum / count
    }

    /// Sum of the reflecting delta lobes, which share one direction.
    pub fn delta_reflection(&self, wo: Vec3) -> Option<SpecularSample> {
        match self {
            Self::Specular(specular) => specular.reflection(wo),
            Self::Subsurface(body) => body.surface.delta_reflection(wo),
            Self::Lobes(lobes) => lobes.delta_reflection(wo),
            _ => None,
        }
    }

    /// Transmitting delta lobe by `choice` in `[0, 1)`, its weight divided by the probability of the choice.
    pub fn delta_transmission(&self, wo: Vec3, choice: f32) -> Option<SpecularSample> {
        match self {
            Self::Specular(specular) => specular.transmission(wo),
            Self::Lobes(lobes) => lobes.delta_transmission(wo, choice),
            _ => None,
        }
    }
}

/// [`Bsdf::evaluate`] of a Lambert reflector: value and density, without a branch.
#[inline(always)]
pub fn lambert_towards(reflectance: Vec3, wo: Vec3, wi: Vec3, reflects: bool) -> (Vec3, f32) {
    let scatters = wo.z != 0.0;
    let shines = scatters & reflects;
    let value = select(shines, reflectance * FRAC_1_PI, Vec3::ZERO);
    let pdf = wi.z.abs() * FRAC_1_PI;
    let has_density = scatters & same_hemisphere(wo, wi);
    (value, if has_density { pdf } else { 0.0 })
}

/// Cosine-distributed direction on the side of `wo`.
#[inline]
pub fn cosine_side(wo: Vec3, u: [f32; 2]) -> Vec3 {
    let mut wi = cosine_hemisphere(u);
    if wo.z < 0.0 {
        wi.z = -wi.z;
    }
    wi
}

#[cfg(test)]
mod tests;
