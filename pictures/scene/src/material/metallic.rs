//! Material `metallic`.

use super::material;

material! {
    /// Dielectric or metal with microfacets, by the metallic-roughness model of glTF 2.0.
    ///
    /// A dielectric is a diffuse or transparent base under a coat. Light that the coat does not reflect reaches the
    /// base. Metals reflect with their base colour, light between facets included. White surfaces lose no light.
    Metallic {
        /// Reflectance of the base and, for metals, at normal incidence.
        color: Color,
        /// Share of metal, 0..=1.
        metallic: Number,
        /// Perceptual roughness, 0..=1. Its square is the microfacet alpha.
        roughness: Number,
        /// Reflectance of the coat at normal incidence, as of an index of refraction. Index 1.5 has 0.04.
        coat: Color,
        /// Share of the base that is a thin transparent sheet, 0..=1. Light goes straight through.
        transmission: Number,
    }
}
