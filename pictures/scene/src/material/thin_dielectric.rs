//! Material `thindielectric`.

use super::material;

material! {
    /// Smooth thin pane of a dielectric: light is reflected, or goes straight on. Both count light between the two sides.
    ThinDielectric {
        /// Index of refraction of the pane over that around it.
        eta: Number,
    }
}
