//! Operations of vectors in double precision ([`Doubles`]), for what single precision cannot decide.

use core::ops::{Add, Div, Mul, Sub};

/// Vector of 64-bit floats, as many as the [`crate::Lanes`] that were widened to it.
///
/// Arithmetic rounds as IEEE 754 double precision and returns the scalar bits on every level. A NaN stays a NaN, with an
/// unspecified payload. Nothing is compared: what decides is brought back to single precision first.
pub trait Doubles:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Every lane times `factor`.
    fn times(self, factor: f64) -> Self;
    /// Smaller value, `self < b ? self : b`: returns `b` when either is NaN or both are zeros.
    fn min(self, b: Self) -> Self;
    /// Larger value, `self > b ? self : b`: returns `b` when either is NaN or both are zeros.
    fn max(self, b: Self) -> Self;
}
