//! Parameters of the material `disney` of pbrt-v3.

use serde::Serialize;

use crate::{MaterialPart, Param, Rgb};

/// Diffuse, glossy and transparent lobes with artistic parameters (Burley 2012 and 2015), as pbrt-v3 has them.
///
/// Shares are in 0..=1. Other values count as the nearest of these. White surfaces may lose or gain some light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Disney {
    /// Reflectance of the base and, for metals, at normal incidence.
    pub color: Param<Rgb>,
    /// Share of metal.
    pub metallic: Param<f32>,
    /// Index of refraction inside over outside.
    pub eta: Param<f32>,
    /// Perceptual roughness, at least 0. Its square is the microfacet alpha.
    pub roughness: Param<f32>,
    /// Share of the colour's hue in the highlight of the part that is no metal.
    pub specular_tint: Param<f32>,
    /// Anisotropy of the highlight, which is longer along u.
    pub anisotropic: Param<f32>,
    /// Weight of the light at grazing angles, as of cloth. Not limited above.
    pub sheen: Param<f32>,
    /// Share of the colour's hue in the sheen.
    pub sheen_tint: Param<f32>,
    /// Weight of a second highlight of index 1.5. Not limited above.
    pub clearcoat: Param<f32>,
    /// Gloss of the second highlight.
    pub clearcoat_gloss: Param<f32>,
    /// Share of the base that refracts light as glass does.
    pub specular_transmission: Param<f32>,
    /// Body below the surface.
    pub body: DisneyBody,
}

/// Diffuse part below the surface of a [`Disney`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum DisneyBody {
    /// Solid. The shape must be closed where the distance is not 0.
    Solid {
        /// Distance that light travels inside, in scene units. Light that is scattered inside replaces the diffuse
        /// reflection where the distance is not 0.
        scatter_distance: Param<Rgb>,
    },
    /// Sheet without a volume.
    Thin {
        /// Share of the diffuse reflection that looks like light scattered inside.
        flatness: Param<f32>,
        /// Transmitted diffuse light, 0..=2. At 2 none is reflected.
        diffuse_transmission: Param<f32>,
    },
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

    /// All parameters in a fixed order.
    pub(crate) fn parts(&self) -> Vec<MaterialPart<'_>> {
        use MaterialPart::{Color, Number, Setting};
        let numbers = [
            &self.metallic,
            &self.eta,
            &self.roughness,
            &self.specular_tint,
            &self.anisotropic,
            &self.sheen,
            &self.sheen_tint,
            &self.clearcoat,
            &self.clearcoat_gloss,
            &self.specular_transmission,
        ]
        .map(Number);
        let body = match &self.body {
            DisneyBody::Solid { scatter_distance } => vec![Setting(0.0), Color(scatter_distance)],
            DisneyBody::Thin {
                flatness,
                diffuse_transmission,
            } => vec![Setting(1.0), Number(flatness), Number(diffuse_transmission)],
        };
        [&[Color(&self.color)], &numbers[..], &body].concat()
    }
}
