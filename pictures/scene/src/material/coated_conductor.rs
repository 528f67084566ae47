//! Material `coatedconductor`.

use super::material;

material! {
    /// Conductor under a dielectric coat, with the light that goes to and fro between them.
    CoatedConductor {
        /// Index of refraction of the conductor.
        eta: Color,
        /// Absorption coefficient of the conductor.
        k: Color,
        /// Microfacet alpha of the conductor along u and v.
        roughness: Pair,
        /// Index of refraction of the coat.
        coat_eta: Number,
        /// Microfacet alpha of the coat along u and v.
        coat_roughness: Pair,
    }
}
