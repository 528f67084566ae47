//! Material `matte`.

use super::{Limit, color, material, number};

material! {
    /// Diffuse surface: Lambert, or Oren and Nayar (1994) if `sigma` is not 0.
    Matte, read {
        /// Diffuse reflectance.
        kd: Color = color(&["Kd"], 0.5),
        /// Standard deviation of the facet angle in degrees, 0..=90.
        sigma: Number = number(&["sigma"], 0.0, Limit::Angle),
    }
}
