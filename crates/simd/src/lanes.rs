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
    /// [`Lanes::splat`] of the first three of each row: in one go, which is faster where that would take a wide
    /// load each.
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
    /// The magnitude of `self` with the sign of `sign`, of zeros and NaNs as well.
    fn copysign(self, sign: Self) -> Self;
    /// `self` with the opposite sign where the sign bit of `by` is set, of zeros and NaNs as well.
    fn flip_sign(self, by: Self) -> Self;
    /// Whether the sign bits of the three are not all equal, those of zeros and NaNs included.
    fn signs_differ(self, b: Self, c: Self) -> Self::Mask;
    /// `self < b`; false when either is NaN.
    fn lt(self, b: Self) -> Self::Mask;
    /// `self <= b`; false when either is NaN.
    fn le(self, b: Self) -> Self::Mask;
    /// `self == b`; false when either is NaN, true for zeros of either sign.
    fn eq(self, b: Self) -> Self::Mask;
    /// Whether each word is `least` or more.
    fn words_at_least(token: Self::Token, words: &[u32; N], least: u32) -> Self::Mask;

    /// Pairs the lanes that are true in `mask` with `values`, writes them to the front of `out` by falling
    /// lane, equal ones in ascending lane order, and returns how many there are. Negative lanes count as 0;
    /// true lanes are not NaN. A pair holds the bits of the float in its upper half and the value in its
    /// lower half. The rest of `out` is left with unspecified values.
    #[inline(always)]
    fn compress_sorted(self, mask: Self::Mask, values: &[u32; N], out: &mut [u64; N]) -> usize {
        let mut lanes = [0.0; N];
        self.store(&mut lanes);
        let mut bits = [0; N];
        for lane in 0..N {
            // Not `max`, which leaves the sign of a zero open.
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

/// [`Lanes::compress_sorted`] for what is compressed already.
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
