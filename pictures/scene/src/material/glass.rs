//! Material `glass`.

use super::{INDEX, REMAP, color, material, rough};

material! {
    /// Dielectric interface: smooth if both roughnesses are 0, microfacets otherwise.
    Glass, read {
        /// Scale of the reflection.
        kr: Color = color(&["Kr"], 1.0),
        /// Scale of the transmission.
        kt: Color = color(&["Kt"], 1.0),
        /// Index of refraction inside over outside.
        eta: Number = INDEX,
        /// Roughness along u and v.
        roughness: Pair = rough(&["uroughness"], &["vroughness"], 0.0),
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: Switch = REMAP,
    }
}
