//! Material `substrate`.

use super::{REMAP, color, material, rough};

material! {
    /// Diffuse base under a glossy coat that takes its share of the light (Ashikhmin and Shirley 2000).
    Substrate, read {
        /// Diffuse reflectance.
        kd: Color = color(&["Kd"], 0.5),
        /// Specular reflectance at normal incidence.
        ks: Color = color(&["Ks"], 0.5),
        /// Roughness along u and v.
        roughness: Pair = rough(&["uroughness"], &["vroughness"], 0.1),
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: Switch = REMAP,
    }
}
