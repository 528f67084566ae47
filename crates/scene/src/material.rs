//! Materials: how a surface scatters light. Parameters and their meaning are those of pbrt-v3.

use std::sync::Arc;

use serde::Serialize;

use crate::{Param, Rgb};

/// How a surface scatters light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Material {
    /// No surface at all: paths go on as if nothing was there. It still casts a shadow, as in pbrt-v3.
    None,
    /// Diffuse: Lambert, or Oren and Nayar (1994) when `sigma` is not 0.
    Matte {
        /// Diffuse reflectance.
        kd: Param<Rgb>,
        /// Standard deviation of the facet angle in degrees, 0..=90.
        sigma: Param<f32>,
    },
    /// A diffuse base plus a dielectric (index 1.5) microfacet coat, simply added.
    Plastic {
        /// Diffuse reflectance.
        kd: Param<Rgb>,
        /// Scale of the glossy reflection.
        ks: Param<Rgb>,
        /// Roughness of the coat.
        roughness: Param<f32>,
        /// Whether `roughness` in 0..=1 is mapped to a microfacet alpha, or is one already.
        remap_roughness: bool,
    },
    /// A perfect mirror without Fresnel effect.
    Mirror {
        /// Reflectance.
        kr: Param<Rgb>,
    },
    /// A dielectric interface: smooth when both roughnesses are 0, microfacet otherwise.
    Glass {
        /// Scale of the reflection.
        kr: Param<Rgb>,
        /// Scale of the transmission.
        kt: Param<Rgb>,
        /// Index of refraction inside over outside.
        eta: Param<f32>,
        /// Roughness along u and v.
        roughness: [Param<f32>; 2],
        /// Whether roughness in 0..=1 is mapped to a microfacet alpha, or is one already.
        remap_roughness: bool,
    },
    /// A conductor with microfacets.
    Metal {
        /// Index of refraction.
        eta: Param<Rgb>,
        /// Absorption coefficient.
        k: Param<Rgb>,
        /// Roughness along u and v.
        roughness: [Param<f32>; 2],
        /// Whether roughness in 0..=1 is mapped to a microfacet alpha, or is one already.
        remap_roughness: bool,
    },
    /// Diffuse, glossy, specular reflection and transmission added, all scaled by an opacity; the rest of the
    /// light goes straight through.
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
        /// Share of light that does not go straight through.
        opacity: Param<Rgb>,
        /// Index of refraction inside over outside.
        eta: Param<f32>,
        /// Whether roughness in 0..=1 is mapped to a microfacet alpha, or is one already.
        remap_roughness: bool,
    },
    /// A diffuse base under a glossy coat that takes its share (Ashikhmin and Shirley 2000).
    Substrate {
        /// Diffuse reflectance.
        kd: Param<Rgb>,
        /// Specular reflectance at normal incidence.
        ks: Param<Rgb>,
        /// Roughness along u and v.
        roughness: [Param<f32>; 2],
        /// Whether roughness in 0..=1 is mapped to a microfacet alpha, or is one already.
        remap_roughness: bool,
    },
    /// A thin sheet: diffuse and glossy light on both sides.
    Translucent {
        /// Scale of the diffuse light.
        kd: Param<Rgb>,
        /// Scale of the glossy light.
        ks: Param<Rgb>,
        /// Share that is reflected.
        reflect: Param<Rgb>,
        /// Share that is transmitted.
        transmit: Param<Rgb>,
        /// Roughness.
        roughness: Param<f32>,
        /// Whether roughness in 0..=1 is mapped to a microfacet alpha, or is one already.
        remap_roughness: bool,
    },
    /// The lobes of two materials, scaled and added. Bump maps stand outside: neither is [`Self::Bumped`], nor
    /// [`Self::None`].
    Mix {
        /// The two.
        materials: [Arc<Material>; 2],
        /// Scale of the first; the second has 1 minus that.
        amount: Param<Rgb>,
    },
    /// Another material whose shading normals are tilted as if the surface were displaced (Blinn 1978).
    Bumped {
        /// The material; not itself bumped, nor [`Self::None`].
        material: Arc<Material>,
        /// Height above the surface.
        height: Param<f32>,
    },
}
