//! AVX2 with FMA, BMI1 and BMI2: 8 lanes, and 4.

use core::arch::x86_64::*;

use super::pair::Pair;
use crate::lanes::{Lanes, Mask};
use crate::level::{Level, Simd, Width, WithSimd};

/// The token of [`Level::Avx2`].
#[derive(Clone, Copy)]
pub struct Avx2(());

impl Simd for Avx2 {
    const LEVEL: Level = Level::Avx2;
}

impl Width<4> for Avx2 {
    type Lanes = F32x4;
}

impl Width<8> for Avx2 {
    type Lanes = F32x8;
}

impl Width<16> for Avx2 {
    type Lanes = Pair<F32x8>;
}

/// Runs `op` compiled for AVX2, FMA, BMI1, BMI2, LZCNT and POPCNT.
///
/// # Safety
/// The CPU must have all of them.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub unsafe fn run<const N: usize, Op: WithSimd<N>>(op: Op) -> Op::Output
where
    Avx2: Width<N>,
{
    op.with_simd(Avx2(()))
}

x86_xmm_lanes!(Avx2, _mm_fmsub_ps);

/// 8 floats.
#[derive(Clone, Copy)]
pub struct F32x8(__m256);

x86_operators!(
    F32x8,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps
);

impl Lanes<8> for F32x8 {
    type Token = Avx2;
    type Mask = Mask8;

    #[inline(always)]
    fn splat(_: Avx2, x: f32) -> Self {
        // SAFETY: the token proves the CPU has the instruction.
        Self(unsafe { _mm256_set1_ps(x) })
    }
    #[inline(always)]
    fn load(_: Avx2, values: &[f32; 8]) -> Self {
        // SAFETY: as for `splat`; eight floats are readable, and `loadu` needs no alignment.
        Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, out: &mut [f32; 8]) {
        // SAFETY: as for `load`; eight floats are writable.
        unsafe { _mm256_storeu_ps(out.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { _mm256_fmsub_ps(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { _mm256_min_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { _mm256_max_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn lt(self, b: Self) -> Mask8 {
        // SAFETY: `self` came from the token.
        Mask8(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, b.0) })
    }
    #[inline(always)]
    fn le(self, b: Self) -> Mask8 {
        // SAFETY: `self` came from the token.
        Mask8(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, b.0) })
    }
    #[inline(always)]
    fn eq(self, b: Self) -> Mask8 {
        // SAFETY: `self` came from the token.
        Mask8(unsafe { _mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, b.0) })
    }
}

/// 8 truths, all bits of a lane alike.
#[derive(Clone, Copy)]
pub struct Mask8(__m256);

x86_register_mask!(
    Mask8,
    _mm256_and_ps,
    _mm256_or_ps,
    _mm256_andnot_ps,
    _mm256_castsi256_ps(_mm256_set1_epi32(-1))
);

impl Mask<8> for Mask8 {
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: `self` came from a comparison, which came from the token.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
    #[inline(always)]
    fn compress(self, values: &[u32; 8], out: &mut [u32; 8]) -> usize {
        let bits = self.bits();
        let permutation = &super::x86::COMPRESS_8[(bits & 255) as usize];
        // SAFETY: as for `bits`; 32 bytes are readable at `permutation` and `values` and writable at
        // `out`, and no instruction here needs alignment.
        unsafe {
            let permutation = _mm256_loadu_si256(permutation.as_ptr().cast());
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            let packed = _mm256_permutevar8x32_epi32(values, permutation);
            _mm256_storeu_si256(out.as_mut_ptr().cast(), packed);
        }
        bits.count_ones() as usize
    }
}
