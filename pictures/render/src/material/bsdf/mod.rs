//! How surfaces scatter light, in the local frame whose z axis is the shading normal.
//!
//! - [`Bsdf`]: how one point scatters, by any number of lobes: evaluate, sample and the delta lobes
//! - `lobe.rs`: what all lobes have in common, and their list
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
use smallvec::SmallVec;

use crate::columns::select;
use crate::sampler::warp::cosine_hemisphere;
use crate::surface::same_hemisphere;
pub use blend::Blend;
pub use diffuse::{Diffuse, DiffuseTransmission};
pub use disney::{Clearcoat, DisneyBase};
pub use fourier::Fourier;
pub use fresnel::Fresnel;
pub use glossy::{GlossyReflection, GlossyTransmission};
pub use hair::{Hair, absorption_of_color, absorption_of_melanin};
pub use lobe::{Lobe, Scatter};
pub use metallic::{Coat, Metallic};
pub use microfacet::TrowbridgeReitz;
pub use specular::{Specular, SpecularSample};
pub use subsurface::{Interface, Subsurface, albedo_of};

/// How a point of a surface scatters light: lobes that are *spread* over directions, and *delta* lobes, each of which has a
/// single direction that no other technique finds.
///
/// Values of spread lobes add up, and each is equally likely to be sampled. The share of delta lobes decides how often to
/// sample which kind.
#[derive(Clone, Debug, Default)]
pub struct Bsdf {
    /// Lobes that are not black.
    spread: SmallVec<[Lobe; 2]>,
    deltas: Vec<Specular>,
    body: Option<Box<Subsurface>>,
}

/// Value and density of scattering between two directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// Value of the BSDF, without the cosine.
    pub value: Vec3,
    /// Density of the direction in [`Bsdf::sample`], per solid angle.
    pub pdf: f32,
}

/// Index below `count`, and the rest of the number that chose it.
fn choose(choice: f32, count: usize) -> (usize, f32) {
    if count == 1 {
        return (0, choice);
    }
    let scaled = choice * count as f32;
    let index = (scaled as usize).min(count - 1);
    (index, (scaled - index as f32).min(1.0 - f32::EPSILON))
}

impl Bsdf {
    /// Absorbs everything.
    pub fn black() -> Self {
        Self::default()
    }

    /// Adds a lobe that spreads light, unless it is black.
    pub fn with(mut self, lobe: impl Into<Lobe>) -> Self {
        let lobe = lobe.into();
        if !lobe.is_black() {
            self.spread.push(lobe);
        }
        self
    }

    /// Adds a delta lobe, unless it is black.
    pub fn with_delta(mut self, lobe: Specular) -> Self {
        if !lobe.is_black() {
            self.deltas.push(lobe);
        }
        self
    }

    /// Adds a body below the surface, in which light wanders.
    pub fn above(mut self, body: Subsurface) -> Self {
        self.body = Some(Box::new(body));
        self
    }

    /// Adds the lobes of another surface, with all values multiplied by `scale`.
    pub fn with_scaled(mut self, other: Self, scale: Vec3) -> Self {
        for mut lobe in other.spread {
            lobe.scale(scale);
            self = self.with(lobe);
        }
        let deltas = other.deltas.into_iter();
        deltas.fold(self, |sum, lobe| sum.with_delta(lobe.scaled(scale)))
    }

    /// Body below the surface. All other methods are about the surface above it.
    #[inline]
    pub fn body(&self) -> Option<&Subsurface> {
        self.body.as_deref()
    }

    /// Reflectance, if this is a Lambert reflector and nothing else.
    #[inline]
    pub fn lambert(&self) -> Option<Vec3> {
        match &self.spread[..] {
            [Lobe::Diffuse(base)] if self.deltas.is_empty() => base.lambert(),
            _ => None,
        }
    }

    /// Whether nothing is ever scattered, on the surface or below it.
    #[inline]
    pub fn is_black(&self) -> bool {
        self.is_black_surface() && self.body.is_none()
    }

    /// Whether the surface scatters nothing.
    #[inline]
    pub fn is_black_surface(&self) -> bool {
        self.spread.is_empty() && self.deltas.is_empty()
    }

    /// Share of delta lobes among all, by number: the probability with which to take a delta lobe. At 1, light
    /// samples are pointless.
    #[inline]
    pub fn delta_share(&self) -> f32 {
        let count = self.spread.len() + self.deltas.len();
        self.deltas.len() as f32 / count.max(1) as f32
    }

    /// Whether light may pass to the other side. That light enters a body does not count.
    #[inline]
    pub fn transmits(&self) -> bool {
        let passes = |lobe: &Lobe| lobe.is_of(false);
        self.body.is_none()
            && (self.spread.iter().any(passes) || self.deltas.iter().any(Specular::transmits))
    }

    /// Whether the value depends on the tangent as well as on the normal.
    #[inline]
    pub fn is_anisotropic(&self) -> bool {
        self.spread.iter().any(|lobe| lobe.is_anisotropic())
    }

    /// Index of refraction inside over outside of the lobe that spreads light to the other side. 1 without one.
    pub fn eta(&self) -> f32 {
        let indices = self.spread.iter().map(|lobe| lobe.eta());
        { indices }.find(|eta| *eta != 1.0).unwrap_or(1.0)
    }

    /// Value and density for unit directions `wo` (towards the viewer) and `wi` (towards the light).
    ///
    /// `reflects` says whether both lie on the same side of the geometric surface. Delta lobes are 0.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, reflects: bool) -> Evaluation {
        let mut sum = Evaluation::default();
        if wo.z == 0.0 {
            return sum;
        }
        for lobe in &self.spread {
            let one = lobe.evaluate(wo, wi);
            sum.pdf += one.pdf;
            if lobe.is_of(reflects) {
                sum.value += one.value;
            }
        }
        sum.pdf /= self.spread.len().max(1) as f32;
        sum
    }

    /// Direction drawn with the density that [`Bsdf::evaluate`] reports. Delta lobes are never drawn.
    ///
    /// `None` if the draw fails (a facet facing away, total reflection) and the path ends.
    pub fn sample(&self, wo: Vec3, lobe: f32, u: [f32; 2]) -> Option<Vec3> {
        if wo.z == 0.0 || self.spread.is_empty() {
            return None;
        }
        let (index, rest) = choose(lobe, self.spread.len());
        self.spread[index].sample(wo, rest, u)
    }

    /// Delta lobe by `choice` in `[0, 1)`, its weight divided by the probability of the choice. `None` where there is
    /// none, or where it leads nowhere.
    pub fn sample_delta(&self, wo: Vec3, choice: f32) -> Option<SpecularSample> {
        let count = self.deltas.len();
        if count == 0 {
            return None;
        }
        let (index, rest) = choose(choice, count);
        let sample = self.deltas[index].sample(wo, rest)?;
        Some(SpecularSample {
            weight: sample.weight * count as f32,
            ..sample
        })
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
        let reflections = self.deltas.iter().filter_map(|lobe| lobe.reflection(wo));
        reflections.reduce(|sum, one| SpecularSample {
            weight: sum.weight + one.weight,
            ..sum
        })
    }

    /// Transmitting delta lobe by `choice` in `[0, 1)`, its weight divided by the probability of the choice. `None` above a body.
    pub fn delta_transmission(&self, wo: Vec3, choice: f32) -> Option<SpecularSample> {
        let transmitting = || self.deltas.iter().filter(|lobe| lobe.transmits());
        let count = transmitting().count();
        if count == 0 || self.body.is_some() {
            return None;
        }
        let (index, _) = choose(choice, count);
        let sample = transmitting().nth(index)?.transmission(wo)?;
        Some(SpecularSample {
            weight: sample.weight * count as f32,
            ..sample
        })
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
