//! Material `subsurface`.

use serde::Serialize;

use super::{Authored, Map, Slots, material};

material! {
    /// Dielectric body in which light is scattered. The shape must be closed. No part of a mixture.
    Subsurface {
        /// Scale of the reflection at the surface.
        kr: Color,
        /// Scale of the light that enters.
        kt: Color,
        /// Index of refraction inside over outside.
        eta: Setting,
        /// Roughness of the surface along u and v.
        roughness: Pair,
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: Switch,
        /// Inside of the body.
        interior: Inside<Interior>,
        /// Mean cosine of the scattering angle, in (-1, 1).
        asymmetry: Setting,
    }
}

/// Scattering inside of a [`Subsurface`], by the place where light enters.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(bound = "S::Color: Serialize, S::Number: Serialize")]
pub enum Interior<S: Slots = Authored> {
    /// By coefficients per scene unit of length.
    Coefficients {
        /// Absorption coefficient per scene unit, before `scale`.
        absorption: S::Color,
        /// Scattering coefficient per scene unit, before `scale`.
        scattering: S::Color,
        /// Factor of both coefficients.
        scale: f32,
    },
    /// By the look of a flat body.
    Diffuse {
        /// Share of diffuse light that comes back, of what enters.
        reflectance: S::Color,
        /// Mean free path in scene units.
        mean_free_path: S::Color,
        /// Factor of the mean free path.
        scale: f32,
    },
}

impl<S: Slots> Interior<S> {
    pub(super) fn map<'a, T: Slots>(&'a self, with: &mut impl Map<'a, S, T>) -> Interior<T> {
        match self {
            Self::Coefficients {
                absorption,
                scattering,
                scale,
            } => Interior::Coefficients {
                absorption: with.kind(0).color(absorption),
                scattering: with.color(scattering),
                scale: with.setting(*scale),
            },
            Self::Diffuse {
                reflectance,
                mean_free_path,
                scale,
            } => Interior::Diffuse {
                reflectance: with.kind(1).color(reflectance),
                mean_free_path: with.color(mean_free_path),
                scale: with.setting(*scale),
            },
        }
    }
}
