//! Lobes side by side. Values add up, and every lobe is equally likely to be sampled.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::specular::SpecularSample;
use super::{
    Blend, Clearcoat, Diffuse, DisneyBase, Evaluation, Fourier, GlossyReflection,
    GlossyTransmission, Hair, Metallic, Specular, cosine_side,
};
use crate::surface::same_hemisphere;

/// One way to scatter light.
#[derive(Clone, Debug)]
pub enum Lobe {
    /// Lambert or Oren-Nayar.
    Diffuse(Diffuse),
    /// Lambert on the other side, with this transmittance.
    DiffuseTransmission(Vec3),
    /// Reflection by microfacets.
    Glossy(GlossyReflection),
    /// Refraction by microfacets.
    GlossyTransmission(GlossyTransmission),
    /// A base, and a coat that takes its share.
    Blend(Blend),
    /// Coat, base and metal.
    Metallic(Metallic),
    /// Base of the material `disney`.
    DisneyBase(DisneyBase),
    /// Clear coat of the material `disney`.
    Clearcoat(Clearcoat),
    /// Scattering to both sides by a table.
    Fourier(Fourier),
    /// A hair.
    Hair(Hair),
    /// A delta lobe.
    Specular(Specular),
}

impl Lobe {
    /// Lobe with all values multiplied by `scale`.
    pub fn scaled(self, scale: Vec3) -> Self {
        match self {
            Self::Diffuse(lobe) => Self::Diffuse(lobe.scaled(scale)),
            Self::DiffuseTransmission(kt) => Self::DiffuseTransmission(kt * scale),
            Self::Glossy(lobe) => Self::Glossy(lobe.scaled(scale)),
            Self::GlossyTransmission(lobe) => Self::GlossyTransmission(lobe.scaled(scale)),
            Self::Blend(lobe) => Self::Blend(lobe.scaled(scale)),
            Self::Metallic(lobe) => Self::Metallic(lobe.scaled(scale)),
            Self::DisneyBase(lobe) => Self::DisneyBase(lobe.scaled(scale)),
            Self::Clearcoat(lobe) => Self::Clearcoat(lobe.scaled(scale)),
            Self::Fourier(lobe) => Self::Fourier(lobe.scaled(scale)),
            Self::Hair(lobe) => Self::Hair(lobe.scaled(scale)),
            Self::Specular(lobe) => Self::Specular(lobe.scaled(scale)),
        }
    }

    fn is_black(&self) -> bool {
        match self {
            Self::Diffuse(lobe) => lobe.is_black(),
            Self::DiffuseTransmission(kt) => *kt == Vec3::ZERO,
            Self::Glossy(lobe) => lobe.is_black(),
            Self::GlossyTransmission(lobe) => lobe.is_black(),
            Self::Blend(lobe) => lobe.is_black(),
            Self::Metallic(lobe) => lobe.is_black(),
            Self::DisneyBase(lobe) => lobe.is_black(),
            Self::Clearcoat(lobe) => lobe.is_black(),
            Self::Fourier(lobe) => lobe.is_black(),
            Self::Hair(lobe) => lobe.is_black(),
            Self::Specular(lobe) => lobe.is_black(),
        }
    }

    fn transmits(&self) -> bool {
        match self {
            Self::DiffuseTransmission(_)
            | Self::GlossyTransmission(_)
            | Self::Fourier(_)
            | Self::Hair(_) => true,
            Self::Specular(lobe) => lobe.transmits(),
            Self::Diffuse(_)
            | Self::Glossy(_)
            | Self::Blend(_)
            | Self::Metallic(_)
            | Self::DisneyBase(_)
            | Self::Clearcoat(_) => false,
        }
    }

    /// Whether the lobe has a value where light is reflected, or where it is transmitted.
    fn is_of(&self, reflects: bool) -> bool {
        matches!(self, Self::Fourier(_) | Self::Hair(_)) || self.transmits() != reflects
    }

    fn is_anisotropic(&self) -> bool {
        match self {
            Self::Glossy(lobe) => lobe.is_anisotropic(),
            Self::GlossyTransmission(lobe) => lobe.is_anisotropic(),
            Self::Blend(lobe) => lobe.is_anisotropic(),
            Self::Hair(_) => true,
            Self::Diffuse(_)
            | Self::DiffuseTransmission(_)
            | Self::Metallic(_)
            | Self::DisneyBase(_)
            | Self::Clearcoat(_)
            | Self::Fourier(_)
            | Self::Specular(_) => false,
        }
    }

    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        match self {
            Self::Diffuse(lobe) => Evaluation {
                value: lobe.value(wo, wi),
                pdf: lobe.pdf(wo, wi),
            },
            Self::DiffuseTransmission(kt) => Evaluation {
                value: *kt * FRAC_1_PI,
                pdf: if same_hemisphere(wo, wi) {
                    0.0
                } else {
                    wi.z.abs() * FRAC_1_PI
                },
            },
            Self::Glossy(lobe) => Evaluation {
                value: lobe.value(wo, wi),
                pdf: lobe.pdf(wo, wi),
            },
            Self::GlossyTransmission(lobe) => Evaluation {
                value: lobe.value(wo, wi),
                pdf: lobe.pdf(wo, wi),
            },
            Self::Blend(lobe) => Evaluation {
                value: lobe.value(wo, wi),
                pdf: lobe.pdf(wo, wi),
            },
            Self::Metallic(lobe) => Evaluation {
                value: lobe.value(wo, wi),
                pdf: lobe.pdf(wo, wi),
            },
            Self::DisneyBase(lobe) => Evaluation {
                value: lobe.value(wo, wi),
                pdf: if same_hemisphere(wo, wi) {
                    wi.z.abs() * FRAC_1_PI
                } else {
                    0.0
                },
            },
            Self::Clearcoat(lobe) => Evaluation {
                value: lobe.value(wo, wi),
                pdf: lobe.pdf(wo, wi),
            },
            Self::Fourier(lobe) => Evaluation {
                value: lobe.value(wo, wi),
                pdf: lobe.pdf(wo, wi),
            },
            Self::Hair(lobe) => lobe.evaluate(wo, wi),
            Self::Specular(_) => Evaluation::default(),
        }
    }

    fn sample(&self, wo: Vec3, choice: f32, u: [f32; 2]) -> Option<Vec3> {
        match self {
            Self::Diffuse(_) | Self::DisneyBase(_) => Some(cosine_side(wo, u)),
            Self::Clearcoat(lobe) => lobe.sample(wo, u),
            Self::DiffuseTransmission(_) => Some(cosine_side(-wo, u)),
            Self::Glossy(lobe) => lobe.sample(wo, u),
            Self::GlossyTransmission(lobe) => lobe.sample(wo, u),
            Self::Blend(lobe) => lobe.sample(wo, choice, u),
            Self::Metallic(lobe) => lobe.sample(wo, choice, u),
            Self::Fourier(lobe) => lobe.sample(wo, u),
            Self::Hair(lobe) => lobe.sample(wo, choice, u),
            Self::Specular(_) => None,
        }
    }
}

/// Lobes that are not black. Lobes that spread light come before delta lobes.
#[derive(Clone, Debug)]
pub struct Lobes {
    lobes: Vec<Lobe>,
    /// Number of lobes that spread light.
    spread: usize,
}

/// Index below `count`, and the rest of the number that chose it.
fn choose(choice: f32, count: usize) -> (usize, f32) {
    let scaled = choice * count as f32;
    let index = (scaled as usize).min(count - 1);
    (index, (scaled - index as f32).min(1.0 - f32::EPSILON))
}

impl Lobes {
    /// Lobes in any order.
    pub fn new(mut lobes: Vec<Lobe>) -> Self {
        let is_delta = |lobe: &Lobe| matches!(lobe, Lobe::Specular(_));
        lobes.retain(|lobe| !lobe.is_black());
        lobes.sort_by_key(is_delta);
        let spread = lobes.partition_point(|lobe| !is_delta(lobe));
        Self { lobes, spread }
    }

    /// All lobes, as a slice.
    pub fn as_slice(&self) -> &[Lobe] {
        &self.lobes
    }

    /// All lobes, as a vector.
    pub fn into_vec(self) -> Vec<Lobe> {
        self.lobes
    }

    /// Share of delta lobes, see [`super::Bsdf::delta_share`].
    pub fn delta_share(&self) -> f32 {
        (self.lobes.len() - self.spread) as f32 / self.lobes.len().max(1) as f32
    }

    /// Whether a lobe lets light through.
    pub fn transmits(&self) -> bool {
        self.lobes.iter().any(Lobe::transmits)
    }

    /// Whether a lobe depends on the tangent.
    pub fn is_anisotropic(&self) -> bool {
        self.lobes.iter().any(Lobe::is_anisotropic)
    }

    /// Relative index of refraction, see [`super::Bsdf::eta`].
    pub fn eta(&self) -> f32 {
        let eta = self.lobes.iter().find_map(|lobe| match lobe {
            Lobe::GlossyTransmission(lobe) => Some(lobe.eta()),
            _ => None,
        });
        eta.unwrap_or(1.0)
    }

    /// Value and density, see [`super::Bsdf::evaluate`].
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, reflects: bool) -> Evaluation {
        let mut sum = Evaluation::default();
        for lobe in &self.lobes[..self.spread] {
            let one = lobe.evaluate(wo, wi);
            sum.pdf += one.pdf;
            if lobe.is_of(reflects) {
                sum.value += one.value;
            }
        }
        sum.pdf /= self.spread.max(1) as f32;
        sum
    }

    /// Sampled direction, see [`super::Bsdf::sample`].
    pub fn sample(&self, wo: Vec3, choice: f32, u: [f32; 2]) -> Option<Vec3> {
        if self.spread == 0 {
            return None;
        }
        let (index, rest) = choose(choice, self.spread);
        self.lobes[index].sample(wo, rest, u)
    }

    fn deltas(&self) -> impl Iterator<Item = &Specular> {
        self.lobes[self.spread..]
            .iter()
            .filter_map(|lobe| match lobe {
                Lobe::Specular(specular) => Some(specular),
                _ => None,
            })
    }

    /// Sampled delta lobe, see [`super::Bsdf::sample_delta`].
    pub fn sample_delta(&self, wo: Vec3, choice: f32) -> Option<SpecularSample> {
        let count = self.lobes.len() - self.spread;
        if count == 0 {
            return None;
        }
        let (index, rest) = choose(choice, count);
        let sample = self.deltas().nth(index)?.sample(wo, rest)?;
        Some(SpecularSample {
            weight: sample.weight * count as f32,
            ..sample
        })
    }

    /// Sum of the reflecting delta lobes, see [`super::Bsdf::delta_reflection`].
    pub fn delta_reflection(&self, wo: Vec3) -> Option<SpecularSample> {
        let reflections = self.deltas().filter_map(|lobe| lobe.reflection(wo));
        reflections.reduce(|sum, one| SpecularSample {
            weight: sum.weight + one.weight,
            ..sum
        })
    }

    /// Sampled transmitting delta lobe, see [`super::Bsdf::delta_transmission`].
    pub fn delta_transmission(&self, wo: Vec3, choice: f32) -> Option<SpecularSample> {
        let count = self.deltas().filter(|lobe| lobe.transmits()).count();
        if count == 0 {
            return None;
        }
        let (index, _) = choose(choice, count);
        let lobe = self.deltas().filter(|lobe| lobe.transmits()).nth(index)?;
        let sample = lobe.transmission(wo)?;
        Some(SpecularSample {
            weight: sample.weight * count as f32,
            ..sample
        })
    }
}
