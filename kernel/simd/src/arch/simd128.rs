//! WebAssembly SIMD: 4 lanes.
//!
//! Every function here is compiled with `simd128`, which is a property of the whole program: nothing but memory
//! is unsafe.

use core::arch::wasm32::*;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use super::pair::Pair;
use crate::doubles::Doubles;
use crate::lanes::{Lanes, Mask};
use crate::level::{Level, Simd, Width, WithSimd};

/// Token of [`Level::Simd128`].
#[derive(Clone, Copy)]
pub struct Simd128(());

/// The token: where this file is compiled, the instructions are there.
pub const TOKEN: Simd128 = Simd128(());

impl Simd for Simd128 {
    const LEVEL: Level = Level::Simd128;
    const LANES: usize = 4;

    #[inline(always)]
    fn run<const N: usize, Op: WithSimd<N>>(self, op: Op) -> Op::Output
    where
        Self: Width<N>,
    {
        op.with_simd(self)
    }
}

impl Width<4> for Simd128 {
    type Lanes = F32x4;
}

impl Width<8> for Simd128 {
    type Lanes = Pair<F32x4>;
}

impl Width<16> for Simd128 {
    type Lanes = Pair<Pair<F32x4>>;
}

/// Vector of 4 floats.
#[derive(Clone, Copy)]
pub struct F32x4(v128);

macro_rules! operators {
    ($lanes:ident: $($trait:ident $name:ident $intrinsic:ident),*) => {$(
        impl $trait for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: Self) -> Self {
                Self($intrinsic(self.0, b.0))
            }
        }
    )*};
}
operators!(F32x4: Add add f32x4_add, Sub sub f32x4_sub, Mul mul f32x4_mul, Div div f32x4_div);

/// Vector of 2 doubles.
#[derive(Clone, Copy)]
pub struct F64x2(v128);

operators!(F64x2: Add add f64x2_add, Sub sub f64x2_sub, Mul mul f64x2_mul, Div div f64x2_div);

impl Doubles for F64x2 {
    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        Self(f64x2_mul(self.0, f64x2_splat(factor)))
    }
    // `pmin(a, b)` is `b < a ? b : a`: the operands change places.
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        Self(f64x2_pmin(b.0, self.0))
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        Self(f64x2_pmax(b.0, self.0))
    }
}

/// The sign bit of each lane.
#[inline(always)]
fn sign_bits() -> v128 {
    u32x4_splat(1 << 31)
}

impl Lanes<4> for F32x4 {
    type Token = Simd128;
    type Mask = Mask4;
    type Double = Pair<F64x2>;

    #[inline(always)]
    fn splat(_: Simd128, x: f32) -> Self {
        Self(f32x4_splat(x))
    }
    #[inline(always)]
    fn load(_: Simd128, values: &[f32; 4]) -> Self {
        // SAFETY: four floats are readable, and no alignment is needed.
        Self(unsafe { v128_load(values.as_ptr().cast()) })
    }
    #[inline(always)]
    fn store(self, out: &mut [f32; 4]) {
        // SAFETY: four floats are writable, and no alignment is needed.
        unsafe { v128_store(out.as_mut_ptr().cast(), self.0) }
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        self * b - c
    }
    #[inline(always)]
    fn widen(self) -> Pair<F64x2> {
        let high = u64x2_shuffle::<1, 1>(self.0, self.0);
        Pair::new(
            F64x2(f64x2_promote_low_f32x4(self.0)),
            F64x2(f64x2_promote_low_f32x4(high)),
        )
    }
    #[inline(always)]
    fn narrow(double: Pair<F64x2>) -> Self {
        let [low, high] = double.halves();
        let (low, high) = (
            f32x4_demote_f64x2_zero(low.0),
            f32x4_demote_f64x2_zero(high.0),
        );
        Self(u64x2_shuffle::<0, 2>(low, high))
    }
    // As for doubles.
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        Self(f32x4_pmin(b.0, self.0))
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        Self(f32x4_pmax(b.0, self.0))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self(v128_bitselect(sign.0, self.0, sign_bits()))
    }
    #[inline(always)]
    fn flip_sign(self, by: Self) -> Self {
        Self(v128_xor(self.0, v128_and(by.0, sign_bits())))
    }
    #[inline(always)]
    fn select(mask: Mask4, yes: Self, no: Self) -> Self {
        Self(v128_bitselect(yes.0, no.0, mask.0))
    }
    #[inline(always)]
    fn lt(self, b: Self) -> Mask4 {
        Mask4(f32x4_lt(self.0, b.0))
    }
    #[inline(always)]
    fn le(self, b: Self) -> Mask4 {
        Mask4(f32x4_le(self.0, b.0))
    }
    #[inline(always)]
    fn eq(self, b: Self) -> Mask4 {
        Mask4(f32x4_eq(self.0, b.0))
    }
    #[inline(always)]
    fn words_at_least(_: Simd128, words: &[u32; 4], least: u32) -> Mask4 {
        // SAFETY: four words are readable, and no alignment is needed.
        let words = unsafe { v128_load(words.as_ptr().cast()) };
        Mask4(u32x4_ge(words, u32x4_splat(least)))
    }
}

/// Mask of 4 lanes; all bits of a lane are equal.
#[derive(Clone, Copy)]
pub struct Mask4(v128);

impl BitAnd for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, b: Self) -> Self {
        Self(v128_and(self.0, b.0))
    }
}

impl BitOr for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, b: Self) -> Self {
        Self(v128_or(self.0, b.0))
    }
}

impl Not for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(v128_not(self.0))
    }
}

impl Mask<4> for Mask4 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(u32x4_bitmask(self.0))
    }
    #[inline(always)]
    fn any(self) -> bool {
        v128_any_true(self.0)
    }
    #[inline(always)]
    fn compress(self, values: &[u32; 4], out: &mut [u32; 4]) -> usize {
        let bits = self.bits();
        let mut count = 0;
        for (lane, &value) in values.iter().enumerate() {
            // Written whether it counts or not: no branch to guess.
            out[count & 3] = value;
            count += (bits >> lane & 1) as usize;
        }
        count
    }
}
