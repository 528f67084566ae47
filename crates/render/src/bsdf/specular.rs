//! Delta lobes: mirrors and smooth dielectric interfaces.

use glam::Vec3;

use super::fresnel::dielectric;
use crate::frame::refract;

/// A material that scatters into single directions only.
#[derive(Clone, Copy, Debug)]
pub enum Specular {
    /// A mirror without Fresnel effect.
    Mirror {
        /// Reflectance.
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
}

/// Where a delta lobe leads.
#[derive(Clone, Copy, Debug)]
pub struct SpecularSample {
    /// The direction, in the local frame.
    pub wi: Vec3,
    /// What the radiance from there is multiplied by: cosine and density are included.
    pub weight: Vec3,
    /// Whether it passes to the other side.
    pub transmits: bool,
}

impl Specular {
    /// One lobe, a dielectric's in proportion to its Fresnel term by `choice` in `[0, 1)`.
    pub fn sample(&self, wo: Vec3, choice: f32) -> Option<SpecularSample> {
        match *self {
            Self::Mirror { .. } => self.reflection(wo),
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

    /// The reflected lobe alone; `None` at exactly grazing angles.
    pub fn reflection(&self, wo: Vec3) -> Option<SpecularSample> {
        let weight = match *self {
            Self::Mirror { kr } => kr,
            Self::Glass { kr, eta, .. } => kr * dielectric(wo.z, eta),
        };
        (wo.z != 0.0).then_some(SpecularSample {
            wi: Vec3::new(-wo.x, -wo.y, wo.z),
            weight,
            transmits: false,
        })
    }

    /// The transmitted lobe alone; `None` for mirrors, at grazing angles and under total reflection.
    pub fn transmission(&self, wo: Vec3) -> Option<SpecularSample> {
        match *self {
            Self::Mirror { .. } => None,
            Self::Glass { .. } if wo.z == 0.0 => None,
            Self::Glass { kt, eta, .. } => {
                let ratio = entering(wo, eta);
                let normal = if wo.z < 0.0 { -Vec3::Z } else { Vec3::Z };
                let passed = 1.0 - dielectric(wo.z, eta);
                refract(wo, normal, ratio).map(|wi| SpecularSample {
                    wi,
                    // Radiance is compressed into fewer directions on the denser side.
                    weight: kt * (passed * ratio * ratio),
                    transmits: true,
                })
            }
        }
    }
}

/// Index on the side of `wo` over that on the other side.
fn entering(wo: Vec3, eta: f32) -> f32 {
    if wo.z > 0.0 { 1.0 / eta } else { eta }
}
