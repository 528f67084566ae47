//! AArch64 Advanced SIMD: 4 lanes.

use core::arch::aarch64::*;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use super::pair::Pair;
use crate::doubles::Doubles;
use crate::lanes::{Lanes, Mask};
use crate::level::{Level, Simd, Width, WithSimd};

/// Token of [`Level::Neon`].
#[derive(Clone, Copy)]
pub struct Neon(());

impl Simd for Neon {
    const LEVEL: Level = Level::Neon;
    const LANES: usize = 4;

    #[inline(always)]
    fn run<const N: usize, Op: WithSimd<N>>(self, op: Op) -> Op::Output
    where
        Self: Width<N>,
    {
        // SAFETY: the token proves the CPU has the instructions.
        unsafe { run(op) }
    }
}

impl Width<4> for Neon {
    type Lanes = F32x4;
}

impl Width<8> for Neon {
    type Lanes = Pair<F32x4>;
}

impl Width<16> for Neon {
    type Lanes = Pair<Pair<F32x4>>;
}

/// Runs `op` compiled for Advanced SIMD.
///
/// # Safety
/// The CPU must have Advanced SIMD. Every AArch64 target of this crate does.
#[target_feature(enable = "neon")]
pub unsafe fn run<const N: usize, Op: WithSimd<N>>(op: Op) -> Op::Output
where
    Neon: Width<N>,
{
    op.with_simd(Neon(()))
}

/// Vector of 4 floats.
#[derive(Clone, Copy)]
pub struct F32x4(float32x4_t);

macro_rules! operators {
    ($lanes:ident: $($trait:ident $name:ident $intrinsic:ident),*) => {$(
        impl $trait for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: Self) -> Self {
                // SAFETY: `self` came from the token, so the CPU has the instruction.
                Self(unsafe { $intrinsic(self.0, b.0) })
            }
        }
    )*};
}
operators!(F32x4: Add add vaddq_f32, Sub sub vsubq_f32, Mul mul vmulq_f32, Div div vdivq_f32);

/// Vector of 2 doubles.
#[derive(Clone, Copy)]
pub struct F64x2(float64x2_t);

operators!(F64x2: Add add vaddq_f64, Sub sub vsubq_f64, Mul mul vmulq_f64, Div div vdivq_f64);

impl Doubles for F64x2 {
    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { vmulq_n_f64(self.0, factor) })
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        // SAFETY: as for `times`.
        Self(unsafe { vbslq_f64(vcltq_f64(self.0, b.0), self.0, b.0) })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        // SAFETY: as for `times`.
        Self(unsafe { vbslq_f64(vcgtq_f64(self.0, b.0), self.0, b.0) })
    }
}

impl Lanes<4> for F32x4 {
    type Token = Neon;
    type Mask = Mask4;
    type Double = Pair<F64x2>;

    #[inline(always)]
    fn splat(_: Neon, x: f32) -> Self {
        // SAFETY: the token proves the CPU has the instruction.
        Self(unsafe { vdupq_n_f32(x) })
    }
    #[inline(always)]
    fn load(_: Neon, values: &[f32; 4]) -> Self {
        // SAFETY: as for `splat`; four floats are readable.
        Self(unsafe { vld1q_f32(values.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, out: &mut [f32; 4]) {
        // SAFETY: as for `load`; four floats are writable.
        unsafe { vst1q_f32(out.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { vfmaq_f32(vnegq_f32(c.0), self.0, b.0) })
    }
    #[inline(always)]
    fn widen(self) -> Pair<F64x2> {
        // SAFETY: `self` came from the token.
        unsafe {
            let low = vcvt_f64_f32(vget_low_f32(self.0));
            Pair::new(F64x2(low), F64x2(vcvt_high_f64_f32(self.0)))
        }
    }
    #[inline(always)]
    fn narrow(double: Pair<F64x2>) -> Self {
        let [low, high] = double.halves();
        // SAFETY: `double` came from the token.
        Self(unsafe { vcvt_high_f32_f64(vcvt_f32_f64(low.0), high.0) })
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        // Not `vminq`, which returns NaN if either operand is NaN, unlike the other levels.
        // SAFETY: `self` came from the token.
        Self(unsafe { vbslq_f32(vcltq_f32(self.0, b.0), self.0, b.0) })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { vbslq_f32(vcgtq_f32(self.0, b.0), self.0, b.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { vbslq_f32(vdupq_n_u32(1 << 31), sign.0, self.0) })
    }
    #[inline(always)]
    fn flip_sign(self, by: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe {
            let sign = vandq_u32(vreinterpretq_u32_f32(by.0), vdupq_n_u32(1 << 31));
            vreinterpretq_f32_u32(veorq_u32(vreinterpretq_u32_f32(self.0), sign))
        })
    }
    #[inline(always)]
    fn select(mask: Mask4, yes: Self, no: Self) -> Self {
        // SAFETY: `yes` came from the token.
        Self(unsafe { vbslq_f32(mask.0, yes.0, no.0) })
    }
    #[inline(always)]
    fn lt(self, b: Self) -> Mask4 {
        // SAFETY: `self` came from the token.
        Mask4(unsafe { vcltq_f32(self.0, b.0) })
    }
    #[inline(always)]
    fn le(self, b: Self) -> Mask4 {
        // SAFETY: `self` came from the token.
        Mask4(unsafe { vcleq_f32(self.0, b.0) })
    }
    #[inline(always)]
    fn eq(self, b: Self) -> Mask4 {
        // SAFETY: `self` came from the token.
        Mask4(unsafe { vceqq_f32(self.0, b.0) })
    }
    #[inline(always)]
    fn words_at_least(_: Neon, words: &[u32; 4], least: u32) -> Mask4 {
        // SAFETY: the token proves the CPU has the instructions; four words are readable.
        Mask4(unsafe { vcgeq_u32(vld1q_u32(words.as_ptr()), vdupq_n_u32(least)) })
    }
}

/// Mask of 4 lanes; all bits of a lane are equal.
#[derive(Clone, Copy)]
pub struct Mask4(uint32x4_t);

impl BitAnd for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, b: Self) -> Self {
        // SAFETY: `self` came from a comparison, which came from the token.
        Self(unsafe { vandq_u32(self.0, b.0) })
    }
}

impl BitOr for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, b: Self) -> Self {
        // SAFETY: as for `bitand`.
        Self(unsafe { vorrq_u32(self.0, b.0) })
    }
}

impl Not for Mask4 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        // SAFETY: as for `bitand`.
        Self(unsafe { vmvnq_u32(self.0) })
    }
}

impl Mask<4> for Mask4 {
    #[inline(always)]
    fn bits(self) -> u32 {
        const BIT: [u32; 4] = [1, 2, 4, 8];
        // SAFETY: as for `bitand`; four words are readable at `BIT`.
        unsafe { vaddvq_u32(vandq_u32(self.0, vld1q_u32(BIT.as_ptr()))) }
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
    #[inline(always)]
    fn compress(self, values: &[u32; 4], out: &mut [u32; 4]) -> usize {
        let mut count = 0;
        let mut bits = self.bits();
        while bits != 0 {
            out[count] = values[bits.trailing_zeros() as usize];
            bits &= bits - 1;
            count += 1;
        }
        count
    }
}
