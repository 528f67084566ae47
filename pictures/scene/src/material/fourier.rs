//! Material `fourier`.

use super::material;

material! {
    /// Scattering by a table, on both sides.
    Fourier {
        /// Table of the scattering.
        table: Table,
    }
}
