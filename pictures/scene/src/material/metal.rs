//! Material `metal`.

use super::{REMAP, material, rough, spectrum};

/// Copper: index of refraction and absorption from the tables of pbrt-v3, as linear RGB.
const COPPER: [[f32; 3]; 2] = [
    [0.200438, 0.924033, 1.102212],
    [3.912949, 2.452848, 2.142188],
];

material! {
    /// Conductor with microfacets.
    Metal, read {
        /// Index of refraction.
        eta: Color = spectrum(&["eta"], COPPER[0]),
        /// Absorption coefficient.
        k: Color = spectrum(&["k"], COPPER[1]),
        /// Roughness along u and v.
        roughness: Pair = rough(&["uroughness", "roughness"], &["vroughness", "roughness"], 0.01),
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: Switch = REMAP,
    }
}
