//! Delta lobes: mirrors, smooth dielectric interfaces, and light that goes straight on.

use glam::Vec3;

use super::Coat;
use super::fresnel::dielectric;
use crate::surface::refract;

/// A material that scatters into single directions only.
#[derive(Clone, Copy, Debug)]
pub enum Specular {
    /// A mirror without Fresnel effect.
    Mirror {
        /// Reflectance, the same for all directions.
        kr: Vec3,
    },
    /// A smooth dielectric.
    Glass {
        /// Scale of the reflection.
        kr: Vec3,
        /// Scale of the transmission.
        kt: Vec3,
        /// Index of refraction inside over outside.
        eta: f32,
    },
    /// A thin sheet under a coat: light goes straight on, but for what the coat reflects.
    Sheet {
        /// Share of the light, without the coat.
        kt: Vec3,
        /// Coat, which reflects a part of the light.
        coat: Coat,
    },
    /// A thin pane: light is reflected at both sides, to and fro, or goes straight on.
    Pane {
        /// Scale of reflection and transmission.
        scale: Vec3,
        /// Index of refraction of the pane.
        eta: f32,
    },
    /// Light that goes straight on.
    Through {
        /// Share of the light that passes.
        share: Vec3,
    },
}

/// Direction and weight of a delta lobe.
#[derive(Clone, Copy, Debug)]
pub struct SpecularSample {
    /// The direction, in the local frame.
    pub wi: Vec3,
    /// Factor of the radiance from that direction, cosine and density included.
    pub weight: Vec3,
    /// Index of refraction inside over outside, if the direction is on the other side. Otherwise 1.
    pub eta: f32,
}

impl Specular {
    /// Whether nothing is scattered.
    pub fn is_black(&self) -> bool {
        match *self {
            Self::Mirror { kr: scale }
            | Self::Through { share: scale }
            | Self::Pane { scale, .. } => scale == Vec3::ZERO,
            Self::Sheet { kt, .. } => kt == Vec3::ZERO,
            Self::Glass { kr, kt, .. } => kr == Vec3::ZERO && kt == Vec3::ZERO,
        }
    }

    /// Lobe with all values multiplied by `scale`.
    pub fn scaled(self, scale: Vec3) -> Self {
        match self {
            Self::Mirror { kr } => Self::Mirror { kr: kr * scale },
            Self::Through { share } => Self::Through {
                share: share * scale,
            },
            Self::Sheet { kt, coat } => Self::Sheet {
                kt: kt * scale,
                coat,
            },
            Self::Pane { scale: own, eta } => Self::Pane {
                scale: own * scale,
                eta,
            },
            Self::Glass { kr, kt, eta } => Self::Glass {
                kr: kr * scale,
                kt: kt * scale,
                eta,
            },
        }
    }

    /// Whether light may pass to the other side.
    pub fn transmits(&self) -> bool {
        !matches!(self, Self::Mirror { .. })
    }

    /// One lobe. If a dielectric has two, `choice` in `[0, 1)` picks one in proportion to the Fresnel term.
    pub fn sample(&self, wo: Vec3, choice: f32) -> Option<SpecularSample> {
        match *self {
            Self::Mirror { .. } => self.reflection(wo),
            Self::Through { .. } | Self::Sheet { .. } => self.transmission(wo),
            Self::Pane { scale, eta } => {
                let sample = match choice < pane(wo.z, eta) {
                    true => self.reflection(wo)?,
                    false => self.transmission(wo)?,
                };
                Some(SpecularSample {
                    weight: scale,
                    ..sample
                })
            }
            Self::Glass { kr, .. } if kr == Vec3::ZERO => self.transmission(wo),
            Self::Glass { kt, .. } if kt == Vec3::ZERO => self.reflection(wo),
            Self::Glass { kr, kt, eta } => {
                let fresnel = dielectric(wo.z, eta);
                let (sample, weight) = if choice < fresnel {
                    (self.reflection(wo)?, kr)
                } else {
                    let radiance = entering(wo, eta);
                    (self.transmission(wo)?, kt * (radiance * radiance))
                };
                Some(SpecularSample { weight, ..sample })
            }
        }
    }

    /// Reflected lobe. `None` at exactly grazing angles, and where there is none.
    pub fn reflection(&self, wo: Vec3) -> Option<SpecularSample> {
        let weight = match *self {
            Self::Mirror { kr } => kr,
            Self::Glass { kr, eta, .. } => kr * dielectric(wo.z, eta),
            Self::Pane { scale, eta } => scale * pane(wo.z, eta),
            Self::Through { .. } | Self::Sheet { .. } => return None,
        };
        (wo.z != 0.0).then_some(SpecularSample {
            wi: Vec3::new(-wo.x, -wo.y, wo.z),
            weight,
            eta: 1.0,
        })
    }

    /// Transmitted lobe. `None` for mirrors, at grazing angles and under total reflection.
    pub fn transmission(&self, wo: Vec3) -> Option<SpecularSample> {
        match *self {
            Self::Mirror { .. } => None,
            Self::Through { share } => Some(SpecularSample {
                wi: -wo,
                weight: share,
                eta: 1.0,
            }),
            Self::Sheet { kt, coat } => Some(SpecularSample {
                wi: -wo,
                weight: kt * coat.passed(wo.z),
                eta: 1.0,
            }),
            Self::Pane { scale, eta } => Some(SpecularSample {
                wi: -wo,
                weight: scale * (1.0 - pane(wo.z, eta)),
                eta: 1.0,
            }),
            Self::Glass { .. } if wo.z == 0.0 => None,
            Self::Glass { kt, eta, .. } => {
                let ratio = entering(wo, eta);
                let normal = if wo.z < 0.0 { -Vec3::Z } else { Vec3::Z };
                let passed = 1.0 - dielectric(wo.z, eta);
                refract(wo, normal, ratio).map(|wi| SpecularSample {
                    wi,
                    // On the denser side, radiance is compressed into fewer directions.
                    weight: kt * (passed * ratio * ratio),
                    eta,
                })
            }
        }
    }
}

/// Reflectance of both sides of a pane together: `R + T² R / (1 - R²)` with T = 1 - R.
fn pane(cos: f32, eta: f32) -> f32 {
    let once = dielectric(cos.abs(), eta);
    2.0 * once / (1.0 + once)
}

/// Index of refraction on the side of `wo` over that on the other side.
fn entering(wo: Vec3, eta: f32) -> f32 {
    if wo.z > 0.0 { 1.0 / eta } else { eta }
}
