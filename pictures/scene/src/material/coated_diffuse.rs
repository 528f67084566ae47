//! Material `coateddiffuse`.

use super::material;

material! {
    /// Diffuse base under a dielectric coat, with the light that coat and base reflect to each other.
    ///
    /// White bases lose no light. Coloured ones are more saturated than under [`Substrate`](super::Substrate).
    CoatedDiffuse {
        /// Reflectance of the base without the coat, clamped to 0..=1.
        reflectance: Color,
        /// Index of refraction of the coat, at least 1. Values below 1 count as their reciprocals.
        eta: Number,
        /// Microfacet alpha of the coat, 0..=1.
        roughness: Number,
    }
}
