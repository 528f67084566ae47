//! Material `uber`.

use super::{INDEX, REMAP, color, material, rough};

material! {
    /// Sum of diffuse, glossy and specular reflection and of specular transmission, scaled by an opacity.
    ///
    /// The rest of the light continues straight through.
    Uber, read {
        /// Diffuse reflectance.
        kd: Color = color(&["Kd"], 0.25),
        /// Scale of the glossy reflection.
        ks: Color = color(&["Ks"], 0.25),
        /// Scale of the specular reflection.
        kr: Color = color(&["Kr"], 0.0),
        /// Scale of the specular transmission.
        kt: Color = color(&["Kt"], 0.0),
        /// Roughness along u and v. In pbrt-v3 the second is that along u where it is not given, unlike for metals.
        roughness: Pair = rough(
            &["uroughness", "roughness"],
            &["vroughness", "uroughness", "roughness"],
            0.1,
        ),
        /// Share of the light that does not continue straight through.
        opacity: Color = color(&["opacity"], 1.0),
        /// Index of refraction inside over outside.
        eta: Number = INDEX,
        /// True if `roughness` is in 0..=1 and is mapped to a microfacet alpha, false if it is an alpha.
        remap_roughness: Switch = REMAP,
    }
}
