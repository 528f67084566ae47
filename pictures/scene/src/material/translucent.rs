//! Material `translucent`.

use super::{Limit, REMAP, color, material, number};

material! {
    /// Thin sheet: diffuse and glossy light on both sides.
    Translucent, read {
        /// Scale of the diffuse light.
        kd: Color = color(&["Kd"], 0.25),
        /// Scale of the glossy light.
        ks: Color = color(&["Ks"], 0.25),
        /// Share of the light that is reflected.
        reflect: Color = color(&["reflect"], 0.5),
        /// Share of the light that is transmitted.
        transmit: Color = color(&["transmit"], 0.5),
        /// Roughness of both sides.
        roughness: Number = number(&["roughness"], 0.1, Limit::Rough),
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: Switch = REMAP,
    }
}
