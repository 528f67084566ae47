//! Materials: how surfaces scatter light. Parameters have the meaning of pbrt-v3.

use std::sync::Arc;

use serde::Serialize;

use crate::{Disney, FourierTable, Param, Rgb};

/// Material of a surface: how it scatters light.
///
/// Roughness is mapped to a microfacet alpha where `remap_roughness` is true.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Material {
    /// No surface: paths continue straight through. Shadow rays are blocked nevertheless, as in pbrt-v3.
    None,
    /// Diffuse surface: Lambert, or Oren and Nayar (1994) if `sigma` is not 0.
    Matte {
        /// Diffuse reflectance.
        kd: Param<Rgb>,
        /// Standard deviation of the facet angle in degrees, 0..=90.
        sigma: Param<f32>,
    },
    /// Diffuse base plus a dielectric microfacet coat of index 1.5; the two are added.
    Plastic {
        /// Diffuse reflectance.
        kd: Param<Rgb>,
        /// Scale of the glossy reflection.
        ks: Param<Rgb>,
        /// Roughness of the coat.
        roughness: Param<f32>,
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: bool,
    },
    /// Perfect mirror without Fresnel effect.
    Mirror {
        /// Reflectance, the same for all directions.
        kr: Param<Rgb>,
    },
    /// Dielectric interface: smooth if both roughnesses are 0, microfacets otherwise.
    Glass {
        /// Scale of the reflection.
        kr: Param<Rgb>,
        /// Scale of the transmission.
        kt: Param<Rgb>,
        /// Index of refraction inside over outside.
        eta: Param<f32>,
        /// Roughness along u and v.
        roughness: [Param<f32>; 2],
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: bool,
    },
    /// Conductor with microfacets.
    Metal {
        /// Index of refraction.
        eta: Param<Rgb>,
        /// Absorption coefficient.
        k: Param<Rgb>,
        /// Roughness along u and v.
        roughness: [Param<f32>; 2],
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: bool,
    },
    /// Sum of diffuse, glossy and specular reflection and of specular transmission, scaled by an opacity.
    ///
    /// The rest of the light continues straight through.
    Uber {
        /// Diffuse reflectance.
        kd: Param<Rgb>,
        /// Scale of the glossy reflection.
        ks: Param<Rgb>,
        /// Scale of the specular reflection.
        kr: Param<Rgb>,
        /// Scale of the specular transmission.
        kt: Param<Rgb>,
        /// Roughness along u and v.
        roughness: [Param<f32>; 2],
        /// Share of the light that does not continue straight through.
        opacity: Param<Rgb>,
        /// Index of refraction inside over outside.
        eta: Param<f32>,
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: bool,
    },
    /// Diffuse base under a glossy coat that takes its share of the light (Ashikhmin and Shirley 2000).
    Substrate {
        /// Diffuse reflectance.
        kd: Param<Rgb>,
        /// Specular reflectance at normal incidence.
        ks: Param<Rgb>,
        /// Roughness along u and v.
        roughness: [Param<f32>; 2],
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: bool,
    },
    /// Dielectric or metal with microfacets, by the metallic-roughness model of glTF 2.0.
    ///
    /// A dielectric is a diffuse or transparent base under a coat. Light that the coat does not reflect reaches the
    /// base. Metals reflect with their base colour, light between facets included. White surfaces lose no light.
    Metallic {
        /// Reflectance of the base and, for metals, at normal incidence.
        color: Param<Rgb>,
        /// Share of metal, 0..=1.
        metallic: Param<f32>,
        /// Perceptual roughness, 0..=1. Its square is the microfacet alpha.
        roughness: Param<f32>,
        /// Reflectance of the coat at normal incidence, as of an index of refraction. Index 1.5 has 0.04.
        coat: Param<Rgb>,
        /// Share of the base that is a thin transparent sheet, 0..=1. Light goes straight through.
        transmission: Param<f32>,
    },
    /// Lobes with artistic parameters. With light inside, no part of a mixture.
    Disney(Box<Disney>),
    /// Diffuse base under a dielectric coat, with the light that coat and base reflect to each other.
    ///
    /// White bases lose no light. Coloured ones are more saturated than under [`Self::Substrate`].
    CoatedDiffuse {
        /// Reflectance of the base without the coat, clamped to 0..=1.
        reflectance: Param<Rgb>,
        /// Index of refraction of the coat, at least 1. Values below 1 count as their reciprocals.
        eta: Param<f32>,
        /// Microfacet alpha of the coat, 0..=1.
        roughness: Param<f32>,
    },
    /// Conductor under a dielectric coat, with the light that goes to and fro between them.
    CoatedConductor {
        /// Index of refraction of the conductor.
        eta: Param<Rgb>,
        /// Absorption coefficient of the conductor.
        k: Param<Rgb>,
        /// Microfacet alpha of the conductor along u and v.
        roughness: [Param<f32>; 2],
        /// Index of refraction of the coat.
        coat_eta: Param<f32>,
        /// Microfacet alpha of the coat along u and v.
        coat_roughness: [Param<f32>; 2],
    },
    /// Smooth thin pane of a dielectric: light is reflected, or goes straight on. Both count light between the two sides.
    ThinDielectric {
        /// Index of refraction of the pane over that around it.
        eta: Param<f32>,
    },
    /// Thin sheet: diffuse and glossy light on both sides.
    Translucent {
        /// Scale of the diffuse light.
        kd: Param<Rgb>,
        /// Scale of the glossy light.
        ks: Param<Rgb>,
        /// Share of the light that is reflected.
        reflect: Param<Rgb>,
        /// Share of the light that is transmitted.
        transmit: Param<Rgb>,
        /// Roughness of both sides.
        roughness: Param<f32>,
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: bool,
    },
    /// Dielectric body in which light is scattered. The shape must be closed. No part of a mixture.
    Subsurface {
        /// Scale of the reflection at the surface.
        kr: Param<Rgb>,
        /// Scale of the light that enters.
        kt: Param<Rgb>,
        /// Index of refraction inside over outside.
        eta: f32,
        /// Roughness of the surface along u and v.
        roughness: [Param<f32>; 2],
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: bool,
        /// Inside of the body.
        interior: Interior,
        /// Mean cosine of the scattering angle, in (-1, 1).
        asymmetry: f32,
    },
    /// Hair (Chiang, Bitterli, Tappan and Burley 2016), for curves: the texture coordinate v goes from 0 to 1 across it.
    Hair {
        /// Absorption inside.
        pigment: Pigment,
        /// Index of refraction.
        eta: Param<f32>,
        /// Roughness along the hair and around it, 0..=1.
        roughness: [Param<f32>; 2],
        /// Tilt of the scales in degrees.
        tilt: Param<f32>,
    },
    /// Scattering by a table, on both sides.
    Fourier(Arc<FourierTable>),
    /// Lobes of two materials, scaled and added. Neither is [`Self::Bumped`] or [`Self::None`]: bump maps apply to the
    /// whole mixture.
    Mix {
        /// First and second material.
        materials: [Arc<Material>; 2],
        /// Scale of the first material. The scale of the second is 1 minus `amount`.
        amount: Param<Rgb>,
    },
    /// Material with a bump map: shading normals are tilted as if the surface were displaced (Blinn 1978).
    Bumped {
        /// Material, neither [`Self::Bumped`] nor [`Self::None`].
        material: Arc<Material>,
        /// Height above the surface in scene units.
        height: Param<f32>,
    },
    /// Material with a normal map: shading normals are read from an image, relative to the surface.
    NormalMapped {
        /// Material, neither [`Self::Bumped`], [`Self::NormalMapped`] nor [`Self::None`].
        material: Arc<Material>,
        /// Normal as a colour from 0 to 1: red along u, green along v, blue along the surface's normal. 1/2 is 0.
        normal: Param<Rgb>,
        /// Factor of the normal's parts along u and v.
        scale: f32,
    },
}

/// Absorption inside of a [`Material::Hair`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Pigment {
    /// Absorption coefficient per radius of the hair.
    Absorption(Param<Rgb>),
    /// Colour of many hairs together.
    Color(Param<Rgb>),
    /// Concentrations of eumelanin and pheomelanin.
    Melanin([Param<f32>; 2]),
}

/// Scattering inside of a [`Material::Subsurface`], by the place where light enters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Interior {
    /// By coefficients per scene unit of length.
    Coefficients {
        /// Absorption coefficient per scene unit, before `scale`.
        absorption: Param<Rgb>,
        /// Scattering coefficient per scene unit, before `scale`.
        scattering: Param<Rgb>,
        /// Factor of both coefficients.
        scale: f32,
    },
    /// By the look of a flat body.
    Diffuse {
        /// Share of diffuse light that comes back, of what enters.
        reflectance: Param<Rgb>,
        /// Mean free path in scene units.
        mean_free_path: Param<Rgb>,
        /// Factor of the mean free path.
        scale: f32,
    },
}

/// Part of a material.
#[derive(Clone, Copy, Debug)]
pub enum MaterialPart<'a> {
    /// Parameter with colours.
    Color(&'a Param<Rgb>),
    /// Parameter with numbers.
    Number(&'a Param<f32>),
    /// Number that is equal everywhere; a switch is 0 or 1.
    Setting(f32),
    /// Table of scattering.
    Table(&'a Arc<FourierTable>),
    /// Material inside.
    Material(&'a Material),
}

impl Material {
    /// All parts of the material in a fixed order, except the parts of materials inside.
    pub fn parts(&self) -> Vec<MaterialPart<'_>> {
        use MaterialPart::{Color, Material, Number, Setting, Table};
        let switch = |on: &bool| Setting((*on).into());
        match self {
            Self::None => Vec::new(),
            Self::Matte { kd, sigma } => vec![Color(kd), Number(sigma)],
            Self::Mirror { kr } => vec![Color(kr)],
            Self::Plastic {
                kd,
                ks,
                roughness,
                remap_roughness: remap,
            } => vec![Color(kd), Color(ks), Number(roughness), switch(remap)],
            Self::Glass {
                kr,
                kt,
                eta,
                roughness: [u, v],
                remap_roughness: remap,
            } => {
                let numbers = [eta, u, v].map(Number);
                [&[Color(kr), Color(kt)], &numbers[..], &[switch(remap)]].concat()
            }
            Self::Metal {
                eta: a,
                k: b,
                roughness: [u, v],
                remap_roughness: remap,
            }
            | Self::Substrate {
                kd: a,
                ks: b,
                roughness: [u, v],
                remap_roughness: remap,
            } => vec![Color(a), Color(b), Number(u), Number(v), switch(remap)],
            Self::Uber {
                kd,
                ks,
                kr,
                kt,
                roughness: [u, v],
                opacity,
                eta,
                remap_roughness: remap,
            } => {
                let colors = [kd, ks, kr, kt, opacity].map(Color);
                let numbers = [u, v, eta].map(Number);
                [&colors[..], &numbers[..], &[switch(remap)]].concat()
            }
            Self::Translucent {
                kd,
                ks,
                reflect,
                transmit,
                roughness,
                remap_roughness: remap,
            } => {
                let colors = [kd, ks, reflect, transmit].map(Color);
                [&colors[..], &[Number(roughness), switch(remap)]].concat()
            }
            Self::Metallic {
                color,
                metallic,
                roughness,
                coat,
                transmission,
            } => {
                let numbers = [metallic, roughness, transmission].map(Number);
                [&[Color(color), Color(coat)], &numbers[..]].concat()
            }
            Self::Subsurface {
                kr,
                kt,
                eta,
                roughness: [u, v],
                remap_roughness: remap,
                interior,
                asymmetry,
            } => {
                let (kind, [a, b], scale) = match interior {
                    Interior::Coefficients {
                        absorption,
                        scattering,
                        scale,
                    } => (0.0, [absorption, scattering], scale),
                    Interior::Diffuse {
                        reflectance,
                        mean_free_path,
                        scale,
                    } => (1.0, [reflectance, mean_free_path], scale),
                };
                let colors = [kr, kt, a, b].map(Color);
                let numbers = [Number(u), Number(v), switch(remap)];
                let settings = [*eta, *asymmetry, *scale, kind].map(Setting);
                [&colors[..], &numbers, &settings].concat()
            }
            Self::Hair {
                pigment,
                eta,
                roughness: [m, n],
                tilt,
            } => {
                let inside = match pigment {
                    Pigment::Absorption(color) => vec![Setting(0.0), Color(color)],
                    Pigment::Color(color) => vec![Setting(1.0), Color(color)],
                    Pigment::Melanin([eu, pheo]) => vec![Setting(2.0), Number(eu), Number(pheo)],
                };
                [&inside[..], &[eta, m, n, tilt].map(Number)].concat()
            }
            Self::CoatedDiffuse {
                reflectance,
                eta,
                roughness,
            } => vec![Color(reflectance), Number(eta), Number(roughness)],
            Self::CoatedConductor {
                eta,
                k,
                roughness: [u, v],
                coat_eta,
                coat_roughness: [coat_u, coat_v],
            } => {
                let numbers = [u, v, coat_eta, coat_u, coat_v].map(Number);
                [&[Color(eta), Color(k)], &numbers[..]].concat()
            }
            Self::Disney(disney) => disney.parts(),
            Self::ThinDielectric { eta } => vec![Number(eta)],
            Self::Fourier(table) => vec![Table(table)],
            Self::Mix {
                materials: [a, b],
                amount,
            } => vec![Material(a), Material(b), Color(amount)],
            Self::Bumped { material, height } => vec![Material(material), Number(height)],
            Self::NormalMapped {
                material,
                normal,
                scale,
            } => vec![Material(material), Color(normal), Setting(*scale)],
        }
    }
}
