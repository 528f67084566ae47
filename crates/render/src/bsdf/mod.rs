//! How surfaces scatter light, in the local frame whose z axis is the shading normal.
//!
//! - [`Bsdf`]: one lowered material: evaluate, sample and the specular lobes
//! - `fresnel.rs`: reflectance of a dielectric interface
//! - `microfacet.rs`: the Trowbridge-Reitz (GGX) distribution of facets
//! - `diffuse.rs`: Lambert and Oren-Nayar
//! - `glossy.rs`: reflection and transmission by microfacets
//! - `specular.rs`: perfect mirrors and smooth dielectrics
//!
//! All values are those of pbrt-v3, two of its habits included. Whether a pair of directions is reflection
//! or transmission is decided by the *geometric* normal, the value by the shading normal; a reflection may
//! therefore dip below the shading horizon, where it has a value but is never sampled. And `plastic`
//! evaluates the Fresnel term of its coat from inside, as `FresnelDielectric(1.5, 1)` does.

mod diffuse;
mod fresnel;
mod glossy;
mod microfacet;
mod specular;

use antumbra_scene::{Material, Param};
use glam::Vec3;

use crate::frame::cosine_hemisphere;
use diffuse::Diffuse;
use glossy::{GlossyReflection, GlossyTransmission};
use microfacet::TrowbridgeReitz;
pub use specular::Specular;

/// A material ready for shading.
#[derive(Clone, Debug)]
pub enum Bsdf {
    /// Absorbs everything.
    Black,
    /// Lambert or Oren-Nayar.
    Diffuse(Diffuse),
    /// Microfacet reflection alone.
    Glossy(GlossyReflection),
    /// A diffuse base and a microfacet coat, added.
    Plastic(Diffuse, GlossyReflection),
    /// A rough dielectric interface; a lobe with black scale is absent.
    RoughGlass(Option<GlossyReflection>, Option<GlossyTransmission>),
    /// A mirror or a smooth dielectric: only delta lobes.
    Specular(Specular),
}

/// Value and density of scattering between two directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// The BSDF itself, without the cosine.
    pub value: Vec3,
    /// Density with which [`Bsdf::sample`] chooses the direction, per solid angle.
    pub pdf: f32,
}

impl Bsdf {
    /// Lowers a material. Negative colours count as 0, as in pbrt.
    pub fn new(material: &Material) -> Self {
        let positive = |color: Vec3| color.max(Vec3::ZERO);
        // Until textures are evaluated per hit: values that are the same everywhere.
        fn of<T: Copy>(param: &Param<T>) -> T {
            *param.constant().expect("no textures yet")
        }
        match material {
            Material::Matte { kd, sigma } => {
                let (kd, sigma) = (positive(of(kd)), of(sigma));
                if is_black(kd) {
                    Self::Black
                } else {
                    Self::Diffuse(Diffuse::new(kd, sigma))
                }
            }
            Material::Plastic {
                kd,
                ks,
                roughness,
                remap_roughness,
            } => {
                let (kd, ks) = (positive(of(kd)), positive(of(ks)));
                let facets = TrowbridgeReitz::new([of(roughness); 2], *remap_roughness);
                // Index 1.5 on the side of the normal: the coat seen from inside, as pbrt has it.
                let coat = GlossyReflection::new(ks, facets, 1.0 / 1.5);
                match (is_black(kd), is_black(ks)) {
                    (true, true) => Self::Black,
                    (false, true) => Self::Diffuse(Diffuse::new(kd, 0.0)),
                    (true, false) => Self::Glossy(coat),
                    (false, false) => Self::Plastic(Diffuse::new(kd, 0.0), coat),
                }
            }
            Material::Mirror { kr } => {
                let kr = positive(of(kr));
                if is_black(kr) {
                    Self::Black
                } else {
                    Self::Specular(Specular::Mirror { kr })
                }
            }
            Material::Glass {
                kr,
                kt,
                eta,
                roughness,
                remap_roughness,
            } => {
                let (kr, kt) = (positive(of(kr)), positive(of(kt)));
                let (eta, roughness) = (of(eta), [of(&roughness[0]), of(&roughness[1])]);
                let remap_roughness = *remap_roughness;
                if is_black(kr) && is_black(kt) {
                    Self::Black
                } else if roughness == [0.0, 0.0] {
                    Self::Specular(Specular::Glass { kr, kt, eta })
                } else {
                    let facets = TrowbridgeReitz::new(roughness, remap_roughness);
                    Self::RoughGlass(
                        (!is_black(kr)).then(|| GlossyReflection::new(kr, facets, eta)),
                        (!is_black(kt)).then(|| GlossyTransmission::new(kt, facets, eta)),
                    )
                }
            }
            _ => todo_material(),
        }
    }

    /// Whether nothing is ever scattered.
    #[inline]
    pub fn is_black(&self) -> bool {
        matches!(self, Self::Black)
    }

    /// The delta lobes, if these are all there is; light samples are then pointless.
    #[inline]
    pub fn specular(&self) -> Option<&Specular> {
        match self {
            Self::Specular(specular) => Some(specular),
            _ => None,
        }
    }

    /// Whether light may pass to the other side.
    #[inline]
    pub fn transmits(&self) -> bool {
        matches!(
            self,
            Self::RoughGlass(_, Some(_)) | Self::Specular(Specular::Glass { .. })
        )
    }

    /// Whether the value depends on the tangent, not only on the normal.
    #[inline]
    pub fn is_anisotropic(&self) -> bool {
        match self {
            Self::RoughGlass(Some(reflection), _) => reflection.is_anisotropic(),
            Self::RoughGlass(None, Some(transmission)) => transmission.is_anisotropic(),
            _ => false,
        }
    }

    /// Index of refraction inside over outside; 1 where nothing is refracted.
    pub fn eta(&self) -> f32 {
        match self {
            Self::RoughGlass(_, Some(transmission)) => transmission.eta(),
            Self::Specular(Specular::Glass { eta, .. }) => *eta,
            _ => 1.0,
        }
    }

    /// Value and density for unit directions `wo` (towards the viewer) and `wi` (towards the light).
    ///
    /// `reflects` tells whether both lie on the same side of the geometric surface. Delta lobes are 0.
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
        }
    }

    /// A direction drawn with the density that [`Bsdf::evaluate`] reports, or `None` when the draw fails
    /// (a facet facing away, total reflection) and the path ends. Delta lobes are never drawn.
    pub fn sample(&self, wo: Vec3, lobe: f32, u: [f32; 2]) -> Option<Vec3> {
        if wo.z == 0.0 {
            return None;
        }
        match self {
            Self::Black | Self::Specular(_) => None,
            Self::Diffuse(_) => Some(cosine_side(wo, u)),
            Self::Glossy(coat) => coat.sample(wo, u),
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
        }
    }
}

fn todo_material() -> Bsdf {
    Bsdf::Black
}

/// A cosine-distributed direction on the side of `wo`.
#[inline]
fn cosine_side(wo: Vec3, u: [f32; 2]) -> Vec3 {
    let mut wi = cosine_hemisphere(u);
    if wo.z < 0.0 {
        wi.z = -wi.z;
    }
    wi
}

#[inline]
fn is_black(color: Vec3) -> bool {
    color == Vec3::ZERO
}

#[cfg(test)]
mod tests;
