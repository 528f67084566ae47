//! AVX-512 F, VL, BW and DQ: 16 lanes, and 8 and 4 with the same mask registers.

use core::arch::x86_64::*;

use crate::lanes::{Lanes, Mask};
use crate::level::{Level, Simd, Width, WithSimd};

/// The token of [`Level::Avx512`].
#[derive(Clone, Copy)]
pub struct Avx512(());

impl Simd for Avx512 {
    const LEVEL: Level = Level::Avx512;
}

/// Runs `op` compiled for AVX-512 F, VL, BW and DQ and what AVX2 machines have.
///
/// # Safety
/// The CPU must have all of them.
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub unsafe fn run<const N: usize, Op: WithSimd<N>>(op: Op) -> Op::Output
where
    Avx512: Width<N>,
{
    op.with_simd(Avx512(()))
}

/// One register width: the vector, its mask, and the intrinsics that differ.
macro_rules! avx512_lanes {
    ($n:literal, $lanes:ident, $mask:ident, $register:ident, $bits:ident, $add:ident, $sub:ident,
     $mul:ident, $div:ident, $set1:ident, $loadu:ident, $storeu:ident, $fmsub:ident, $min:ident,
     $max:ident, $cmp:ident, $load_int:ident, $compress:ident) => {
        #[doc = concat!(stringify!($n), " floats.")]
        #[derive(Clone, Copy)]
        pub struct $lanes($register);

        impl Width<$n> for Avx512 {
            type Lanes = $lanes;
        }

        x86_operators!($lanes, $add, $sub, $mul, $div);

        impl Lanes<$n> for $lanes {
            type Token = Avx512;
            type Mask = $mask;

            #[inline(always)]
            fn splat(_: Avx512, x: f32) -> Self {
                // SAFETY: the token proves the CPU has the instruction.
                Self(unsafe { $set1(x) })
            }
            #[inline(always)]
            fn load(_: Avx512, values: &[f32; $n]) -> Self {
                // SAFETY: as for `splat`; all lanes are readable, and `loadu` needs no alignment.
                Self(unsafe { $loadu(values.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, out: &mut [f32; $n]) {
                // SAFETY: as for `load`; all lanes are writable.
                unsafe { $storeu(out.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn mul_sub(self, b: Self, c: Self) -> Self {
                // SAFETY: `self` came from the token.
                Self(unsafe { $fmsub(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn min(self, b: Self) -> Self {
                // SAFETY: `self` came from the token.
                Self(unsafe { $min(self.0, b.0) })
            }
            #[inline(always)]
            fn max(self, b: Self) -> Self {
                // SAFETY: `self` came from the token.
                Self(unsafe { $max(self.0, b.0) })
            }
            #[inline(always)]
            fn lt(self, b: Self) -> $mask {
                // SAFETY: `self` came from the token.
                $mask(unsafe { $cmp::<_CMP_LT_OQ>(self.0, b.0) })
            }
            #[inline(always)]
            fn le(self, b: Self) -> $mask {
                // SAFETY: `self` came from the token.
                $mask(unsafe { $cmp::<_CMP_LE_OQ>(self.0, b.0) })
            }
            #[inline(always)]
            fn eq(self, b: Self) -> $mask {
                // SAFETY: `self` came from the token.
                $mask(unsafe { $cmp::<_CMP_EQ_OQ>(self.0, b.0) })
            }
        }

        #[doc = concat!(stringify!($n), " truths in a mask register.")]
        #[derive(Clone, Copy)]
        pub struct $mask($bits);

        impl core::ops::BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, b: Self) -> Self {
                Self(self.0 & b.0)
            }
        }
        impl core::ops::BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, b: Self) -> Self {
                Self(self.0 | b.0)
            }
        }
        impl core::ops::Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                // Masks of 4 lanes live in 8 bits: the unused ones stay 0.
                const LANES: $bits = (u32::MAX >> (32 - $n)) as $bits;
                Self(!self.0 & LANES)
            }
        }

        impl Mask<$n> for $mask {
            #[inline(always)]
            fn bits(self) -> u32 {
                u32::from(self.0)
            }
            #[inline(always)]
            fn any(self) -> bool {
                self.0 != 0
            }
            #[inline(always)]
            fn compress(self, values: &[u32; $n], out: &mut [u32; $n]) -> usize {
                // Compressing in a register and storing that is fast everywhere; compressing straight
                // to memory is microcoded on Zen 4.
                // SAFETY: `self` came from a comparison, which came from the token; all lanes are
                // readable at `values` and writable at `out`, and nothing here needs alignment.
                unsafe {
                    let packed = $compress(self.0, $load_int(values.as_ptr().cast()));
                    core::ptr::write_unaligned(out.as_mut_ptr().cast(), packed);
                }
                self.0.count_ones() as usize
            }
        }
    };
}

avx512_lanes!(
    4,
    F32x4,
    Mask4,
    __m128,
    __mmask8,
    _mm_add_ps,
    _mm_sub_ps,
    _mm_mul_ps,
    _mm_div_ps,
    _mm_set1_ps,
    _mm_loadu_ps,
    _mm_storeu_ps,
    _mm_fmsub_ps,
    _mm_min_ps,
    _mm_max_ps,
    _mm_cmp_ps_mask,
    _mm_loadu_si128,
    _mm_maskz_compress_epi32
);
avx512_lanes!(
    8,
    F32x8,
    Mask8,
    __m256,
    __mmask8,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_set1_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    _mm256_fmsub_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    _mm256_cmp_ps_mask,
    _mm256_loadu_si256,
    _mm256_maskz_compress_epi32
);
avx512_lanes!(
    16,
    F32x16,
    Mask16,
    __m512,
    __mmask16,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_set1_ps,
    _mm512_loadu_ps,
    _mm512_storeu_ps,
    _mm512_fmsub_ps,
    _mm512_min_ps,
    _mm512_max_ps,
    _mm512_cmp_ps_mask,
    _mm512_loadu_si512,
    _mm512_maskz_compress_epi32
);
