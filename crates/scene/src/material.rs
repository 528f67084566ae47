//! Materials: how a surface scatters light. Parameters and their meaning are those of pbrt-v3.

use crate::Rgb;

/// How a surface scatters light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// Diffuse: Lambert, or Oren and Nayar (1994) when `sigma` is not 0.
    Matte {
        /// Diffuse reflectance.
        kd: Rgb,
        /// Standard deviation of the facet angle in degrees, 0..=90.
        sigma: f32,
    },
    /// A diffuse base plus a dielectric (index 1.5) microfacet coat, simply added.
    Plastic {
        /// Diffuse reflectance.
        kd: Rgb,
        /// Scale of the glossy reflection.
        ks: Rgb,
        /// Roughness of the coat.
        roughness: f32,
        /// Whether `roughness` in 0..=1 is mapped to a microfacet alpha, or is one already.
        remap_roughness: bool,
    },
    /// A perfect mirror without Fresnel effect.
    Mirror {
        /// Reflectance.
        kr: Rgb,
    },
    /// A dielectric interface: smooth when both roughnesses are 0, microfacet otherwise.
    Glass {
        /// Scale of the reflection.
        kr: Rgb,
        /// Scale of the transmission.
        kt: Rgb,
        /// Index of refraction inside over outside.
        eta: f32,
        /// Roughness along u and v.
        roughness: [f32; 2],
        /// Whether roughness in 0..=1 is mapped to a microfacet alpha, or is one already.
        remap_roughness: bool,
    },
}
