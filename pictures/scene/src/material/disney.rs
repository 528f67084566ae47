//! Material `disney`.

use serde::Serialize;

use super::{Authored, Limit, Map, Slots, color, material, number};
use crate::Rgb;

material! {
    /// Diffuse, glossy and transparent lobes with artistic parameters (Burley 2012 and 2015), as pbrt-v3 has them.
    ///
    /// With light inside, it is no part of a mixture. Shares are in 0..=1. Other values count as the nearest of these. White
    /// surfaces may lose or gain some light.
    Disney, read {
        /// Reflectance of the base and, for metals, at normal incidence.
        color: Color = color(&["color"], 0.5),
        /// Share of metal.
        metallic: Number = number(&["metallic"], 0.0, Limit::SHARE),
        /// Index of refraction inside over outside.
        eta: Number = number(&["eta"], 1.5, Limit::Index),
        /// Perceptual roughness, at least 0. Its square is the microfacet alpha.
        roughness: Number = number(&["roughness"], 0.5, Limit::Rough),
        /// Share of the colour's hue in the highlight of the part that is no metal.
        specular_tint: Number = number(&["speculartint"], 0.0, Limit::SHARE),
        /// Anisotropy of the highlight, which is longer along u.
        anisotropic: Number = number(&["anisotropic"], 0.0, Limit::SHARE),
        /// Weight of the light at grazing angles, as of cloth. Not limited above.
        sheen: Number = number(&["sheen"], 0.0, Limit::None),
        /// Share of the colour's hue in the sheen.
        sheen_tint: Number = number(&["sheentint"], 0.5, Limit::SHARE),
        /// Weight of a second highlight of index 1.5. Not limited above.
        clearcoat: Number = number(&["clearcoat"], 0.0, Limit::None),
        /// Gloss of the second highlight.
        clearcoat_gloss: Number = number(&["clearcoatgloss"], 1.0, Limit::SHARE),
        /// Share of the base that refracts light as glass does.
        specular_transmission: Number = number(&["spectrans"], 0.0, Limit::SHARE),
        /// Body below the surface.
        body: Inside<DisneyBody>,
    }
}

/// Diffuse part below the surface of a [`Disney`].
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(bound = "S::Color: Serialize, S::Number: Serialize")]
pub enum DisneyBody<S: Slots = Authored> {
    /// Solid. The shape must be closed where the distance is not 0.
    Solid {
        /// Distance that light travels inside, in scene units. Light that is scattered inside replaces the diffuse
        /// reflection where the distance is not 0.
        scatter_distance: S::Color,
    },
    /// Sheet without a volume.
    Thin {
        /// Share of the diffuse reflection that looks like light scattered inside.
        flatness: S::Number,
        /// Transmitted diffuse light, 0..=2. At 2 none is reflected.
        diffuse_transmission: S::Number,
    },
}

impl Default for DisneyBody {
    /// Solid without light inside.
    fn default() -> Self {
        Self::Solid {
            scatter_distance: Rgb::ZERO.into(),
        }
    }
}

impl<S: Slots> DisneyBody<S> {
    pub(super) fn map<'a, T: Slots>(&'a self, with: &mut impl Map<'a, S, T>) -> DisneyBody<T> {
        match self {
            Self::Solid { scatter_distance } => DisneyBody::Solid {
                scatter_distance: with.kind(0).color(scatter_distance),
            },
            Self::Thin {
                flatness,
                diffuse_transmission,
            } => DisneyBody::Thin {
                flatness: with.kind(1).number(flatness),
                diffuse_transmission: with.number(diffuse_transmission),
            },
        }
    }
}

impl Disney {
    /// Whether light may be scattered inside.
    pub fn scatters_inside(&self) -> bool {
        match &self.body {
            DisneyBody::Solid { scatter_distance } => {
                scatter_distance.constant() != Some(&Rgb::ZERO)
            }
            DisneyBody::Thin { .. } => false,
        }
    }
}
