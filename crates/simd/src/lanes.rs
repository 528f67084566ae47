//! What a vector of `N` floats and a mask of `N` truths can do.

use core::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

/// A vector of `N` 32-bit floats.
///
/// All arithmetic rounds as IEEE 754 single precision and gives the scalar bits on every level, except
/// [`Lanes::mul_sub`]. (A NaN stays a NaN; which payload it carries is not promised.)
pub trait Lanes<const N: usize>:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Proof that the CPU has the instructions.
    type Token: Copy;
    /// The result of a comparison.
    type Mask: Mask<N>;

    /// `N` copies of `x`.
    fn splat(token: Self::Token, x: f32) -> Self;
    /// Lane `i` is `values[i]`; no alignment is needed.
    fn load(token: Self::Token, values: &[f32; N]) -> Self;
    /// Writes lane `i` to `out[i]`.
    fn store(self, out: &mut [f32; N]);
    /// `self * b - c` with one rounding or two, whichever the level does faster: for conservative tests
    /// only, never for anything that decides an answer.
    fn mul_sub(self, b: Self, c: Self) -> Self;
    /// `self < b ? self : b`: `b` when either is NaN or both are zeros.
    fn min(self, b: Self) -> Self;
    /// `self > b ? self : b`: `b` when either is NaN or both are zeros.
    fn max(self, b: Self) -> Self;
    /// `self < b`; false when either is NaN.
    fn lt(self, b: Self) -> Self::Mask;
    /// `self <= b`; false when either is NaN.
    fn le(self, b: Self) -> Self::Mask;
    /// `self == b`; false when either is NaN, true for zeros of either sign.
    fn eq(self, b: Self) -> Self::Mask;
}

/// One truth value per lane.
pub trait Mask<const N: usize>:
    Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// Bit `i` is lane `i`; bits from `N` on are 0.
    fn bits(self) -> u32;
    /// Whether any lane is true.
    fn any(self) -> bool;
    /// Writes the values of true lanes to the front of `out`, in ascending lane order, and returns how
    /// many there are. The rest of `out` is left with unspecified values.
    fn compress(self, values: &[u32; N], out: &mut [u32; N]) -> usize;
}
