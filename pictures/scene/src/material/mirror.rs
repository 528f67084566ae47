//! Material `mirror`.

use super::{color, material};

material! {
    /// Perfect mirror without Fresnel effect.
    Mirror, read {
        /// Reflectance, the same for all directions.
        kr: Color = color(&["Kr"], 0.9),
    }
}
