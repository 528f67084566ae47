//! Operations of vectors of `N` floats ([`Lanes`]) and masks of `N` booleans ([`Mask`]).

use core::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use crate::doubles::Doubles;

/// Vector of `N` 32-bit floats.
///
/// Arithmetic rounds as IEEE 754 single precision and returns the scalar bits on every level, except
/// [`Lanes::mul_sub`]. A NaN stays a NaN, with an unspecified payload.
pub trait Lanes<const N: usize>:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Proof that the CPU has the instructions.
    type Token: Copy;
    /// Result of a comparison.
    type Mask: Mask<N>;
    /// Vector of as many lanes in double precision.
    type Double: Doubles;

    /// `N` copies of `x`.
    fn splat(token: Self::Token, x: f32) -> Self;
    /// [`Lanes::splat`] of the first three values of each row. Faster than nine splats on AVX-512.
    #[inline(always)]
    fn splat_rows(token: Self::Token, rows: &[[f32; 4]; 3]) -> [[Self; 3]; 3] {
        let [a, b, c] = rows;
        [
            [
                Self::splat(token, a[0]),
                Self::splat(token, a[1]),
                Self::splat(token, a[2]),
            ],
            [
                Self::splat(token, b[0]),
                Self::splat(token, b[1]),
                Self::splat(token, b[2]),
            ],
            [
                Self::splat(token, c[0]),
                Self::splat(token, c[1]),
                Self::splat(token, c[2]),
            ],
        ]
    }
    /// Loads `values[i]` into lane `i`. No alignment is needed.
    fn load(token: Self::Token, values: &[f32; N]) -> Self;
    /// Stores lane `i` to `out[i]`. No alignment is needed.
    fn store(self, out: &mut [f32; N]);
    /// `self * b - c` with one rounding or two, whichever is faster on the level.
    ///
    /// Results differ between levels: use the operation in conservative tests only, never where it decides an answer.
    fn mul_sub(self, b: Self, c: Self) -> Self;
    /// Converts each lane to double precision, which is exact.
    fn widen(self) -> Self::Double;
    /// Rounds to single precision: out of its range to an infinity or zero of the same sign.
    fn narrow(double: Self::Double) -> Self;
    /// Smaller value, `self < b ? self : b`: returns `b` when either is NaN or both are zeros.
    fn min(self, b: Self) -> Self;
    /// Larger value, `self > b ? self : b`: returns `b` when either is NaN or both are zeros.
    fn max(self, b: Self) -> Self;
    /// The larger magnitude of the two: unspecified when either is NaN.
    #[inline(always)]
    fn max_size(self, b: Self) -> Self {
        self.flip_sign(self).max(b.flip_sign(b))
    }
    /// Magnitude of `self` with the sign bit of `sign`. Zeros and NaNs have a sign bit too.
    fn copysign(self, sign: Self) -> Self;
    /// `self`, negated where the sign bit of `by` is set. Zeros and NaNs have a sign bit too.
    fn flip_sign(self, by: Self) -> Self;
    /// Lanes of `yes` where the mask is true, of `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// `self < b`; false when either is NaN.
    fn lt(self, b: Self) -> Self::Mask;
    /// `self <= b`; false when either is NaN.
    fn le(self, b: Self) -> Self::Mask;
    /// `self == b`; false when either is NaN, true for zeros of either sign.
    fn eq(self, b: Self) -> Self::Mask;
    /// True where a word is `least` or more.
    fn words_at_least(token: Self::Token, words: &[u32; N], least: u32) -> Self::Mask;

    /// Sorts the pairs (float, value) of the lanes that are true in `mask`, and returns their number.
    ///
    /// Pairs are written to the front of `out` by descending float, ties in ascending lane order. A pair holds the bits
    /// of the float in its upper half and the value in its lower half. Negative floats count as 0. The rest of `out` is
    /// unspecified. Callers guarantee that no lane that is true in `mask` is NaN.
    #[inline(always)]
    fn compress_sorted(self, mask: Self::Mask, values: &[u32; N], out: &mut [u64; N]) -> usize {
        let mut lanes = [0.0; N];
        self.store(&mut lanes);
        let mut bits = [0; N];
        for lane in 0..N {
            // Not `max`, which leaves the sign of a zero unspecified.
            bits[lane] = if lanes[lane] > 0.0 {
                lanes[lane].to_bits()
            } else {
                0
            };
        }
        let (mut keys, mut chosen) = ([0; N], [0; N]);
        let count = mask.compress(&bits, &mut keys);
        mask.compress(values, &mut chosen);
        sort_pairs(&keys, &chosen, count, out);
        count
    }
}

/// [`Lanes::compress_sorted`] for keys and values that are compressed already.
#[inline(always)]
pub(crate) fn sort_pairs<const N: usize>(
    keys: &[u32; N],
    values: &[u32; N],
    count: usize,
    out: &mut [u64; N],
) {
    for place in 0..count.min(N) {
        let key = keys[place];
        let mut hole = place;
        while hole > 0 && ((out[hole - 1] >> 32) as u32) < key {
            out[hole] = out[hole - 1];
            hole -= 1;
        }
        out[hole] = u64::from(key) << 32 | u64::from(values[place]);
    }
}

/// Mask of `N` booleans, one per lane.
pub trait Mask<const N: usize>:
    Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// All lanes as one word: bit `i` is lane `i`, and bits from `N` on are 0.
    fn bits(self) -> u32;
    /// Returns true if any lane is true.
    fn any(self) -> bool;
    /// Writes the values of true lanes to the front of `out` in ascending lane order, and returns their number.
    /// The rest of `out` is unspecified.
    fn compress(self, values: &[u32; N], out: &mut [u32; N]) -> usize;
}
