//! Material `plastic`.

use super::{Limit, REMAP, color, material, number};

material! {
    /// Diffuse base plus a dielectric microfacet coat of index 1.5; the two are added.
    Plastic, read {
        /// Diffuse reflectance.
        kd: Color = color(&["Kd"], 0.25),
        /// Scale of the glossy reflection.
        ks: Color = color(&["Ks"], 0.25),
        /// Roughness of the coat.
        roughness: Number = number(&["roughness"], 0.1, Limit::Rough),
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: Switch = REMAP,
    }
}
