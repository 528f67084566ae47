//! AVX2 with FMA, BMI1 and BMI2: 8 lanes and 4 lanes.

use core::arch::x86_64::*;

use super::pair::Pair;
use crate::lanes::{Lanes, Mask, sort_pairs};
use crate::level::{Level, Simd, Width, WithSimd};

/// Token of [`Level::Avx2`].
#[derive(Clone, Copy)]
pub struct Avx2(());

impl Simd for Avx2 {
    const LEVEL: Level = Level::Avx2;
    const LANES: usize = 8;

    #[inline(always)]
    fn run<const N: usize, Op: WithSimd<N>>(self, op: Op) -> Op::Output
    where
        Self: Width<N>,
    {
        // SAFETY: the token proves the CPU has the instructions.
        unsafe { run(op) }
    }

    #[inline(always)]
    fn columns(self, rows: &[[f32; 8]; 16]) -> [Pair<F32x8>; 8] {
        let (halves, _) = rows.as_chunks::<8>();
        // SAFETY: the token proves the CPU has the instructions.
        let (low, high) = unsafe { (transpose_8(&halves[0]), transpose_8(&halves[1])) };
        let pair = |i: usize| Pair::new(F32x8(low[i]), F32x8(high[i]));
        [
            pair(0),
            pair(1),
            pair(2),
            pair(3),
            pair(4),
            pair(5),
            pair(6),
            pair(7),
        ]
    }

    #[inline(always)]
    fn transpose(self, rows: &[[f32; 8]; 8]) -> [F32x8; 8] {
        // SAFETY: the token proves the CPU has the instructions.
        let [a, b, c, d, e, f, g, h] = unsafe { transpose_8(rows) };
        [
            F32x8(a),
            F32x8(b),
            F32x8(c),
            F32x8(d),
            F32x8(e),
            F32x8(f),
            F32x8(g),
            F32x8(h),
        ]
    }
}

/// Transposes eight rows into eight columns.
///
/// # Safety
/// The CPU must have AVX.
#[inline(always)]
pub(super) unsafe fn transpose_8(rows: &[[f32; 8]; 8]) -> [__m256; 8] {
    // SAFETY: the caller's promise; eight floats are readable at each row.
    unsafe {
        let low = transpose_blocks([
            _mm256_loadu_ps(rows[0].as_ptr()),
            _mm256_loadu_ps(rows[1].as_ptr()),
            _mm256_loadu_ps(rows[2].as_ptr()),
            _mm256_loadu_ps(rows[3].as_ptr()),
        ]);
        let high = transpose_blocks([
            _mm256_loadu_ps(rows[4].as_ptr()),
            _mm256_loadu_ps(rows[5].as_ptr()),
            _mm256_loadu_ps(rows[6].as_ptr()),
            _mm256_loadu_ps(rows[7].as_ptr()),
        ]);
        [
            _mm256_permute2f128_ps::<0x20>(low[0], high[0]),
            _mm256_permute2f128_ps::<0x20>(low[1], high[1]),
            _mm256_permute2f128_ps::<0x20>(low[2], high[2]),
            _mm256_permute2f128_ps::<0x20>(low[3], high[3]),
            _mm256_permute2f128_ps::<0x31>(low[0], high[0]),
            _mm256_permute2f128_ps::<0x31>(low[1], high[1]),
            _mm256_permute2f128_ps::<0x31>(low[2], high[2]),
            _mm256_permute2f128_ps::<0x31>(low[3], high[3]),
        ]
    }
}

/// Transposes both 4 x 4 blocks of four registers.
///
/// # Safety
/// The CPU must have AVX.
#[inline(always)]
unsafe fn transpose_blocks([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    // SAFETY: the caller's promise.
    unsafe {
        let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0b01_00_01_00>(ab_low, cd_low),
            _mm256_shuffle_ps::<0b11_10_11_10>(ab_low, cd_low),
            _mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
            _mm256_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
        ]
    }
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

/// Vector of 4 floats.
#[derive(Clone, Copy)]
pub struct F32x4(__m128);

x86_xmm_doubles!();

x86_operators!(F32x4, _mm_add_ps, _mm_sub_ps, _mm_mul_ps, _mm_div_ps);

impl Lanes<4> for F32x4 {
    type Token = Avx2;
    type Mask = Mask4;
    type Double = Pair<F64x2>;

    #[inline(always)]
    fn splat(_: Avx2, x: f32) -> Self {
        // SAFETY: the token proves the CPU has the instruction.
        Self(unsafe { _mm_set1_ps(x) })
    }
    #[inline(always)]
    fn load(_: Avx2, values: &[f32; 4]) -> Self {
        // SAFETY: as for `splat`; four floats are readable, and `loadu` needs no alignment.
        Self(unsafe { _mm_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, out: &mut [f32; 4]) {
        // SAFETY: as for `load`; four floats are writable.
        unsafe { _mm_storeu_ps(out.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { _mm_fmsub_ps(self.0, b.0, c.0) })
    }
    x86_xmm_conversions!();
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { _mm_min_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { _mm_max_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe {
            let bit = _mm_set1_ps(-0.0);
            _mm_or_ps(_mm_and_ps(bit, sign.0), _mm_andnot_ps(bit, self.0))
        })
    }
    #[inline(always)]
    fn flip_sign(self, by: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { _mm_xor_ps(self.0, _mm_and_ps(_mm_set1_ps(-0.0), by.0)) })
    }
    #[inline(always)]
    fn select(mask: Mask4, yes: Self, no: Self) -> Self {
        // SAFETY: `yes` came from the token.
        Self(unsafe { _mm_blendv_ps(no.0, yes.0, mask.0) })
    }
    #[inline(always)]
    fn lt(self, b: Self) -> Mask4 {
        // SAFETY: `self` came from the token.
        Mask4(unsafe { _mm_cmplt_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn le(self, b: Self) -> Mask4 {
        // SAFETY: `self` came from the token.
        Mask4(unsafe { _mm_cmple_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn eq(self, b: Self) -> Mask4 {
        // SAFETY: `self` came from the token.
        Mask4(unsafe { _mm_cmpeq_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn words_at_least(_: Avx2, words: &[u32; 4], least: u32) -> Mask4 {
        // SAFETY: the token proves the CPU has the instructions; four words are readable.
        Mask4(unsafe {
            let words = _mm_loadu_si128(words.as_ptr().cast());
            let more = _mm_max_epu32(words, _mm_set1_epi32(least as i32));
            _mm_castsi128_ps(_mm_cmpeq_epi32(words, more))
        })
    }
}

/// Mask of 4 lanes; all bits of a lane are equal.
#[derive(Clone, Copy)]
pub struct Mask4(__m128);

x86_register_mask!(
    Mask4,
    _mm_and_ps,
    _mm_or_ps,
    _mm_andnot_ps,
    _mm_castsi128_ps(_mm_set1_epi32(-1))
);

impl Mask<4> for Mask4 {
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: `self` came from a comparison, which came from the token.
        unsafe { _mm_movemask_ps(self.0) as u32 }
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
    #[inline(always)]
    fn compress(self, values: &[u32; 4], out: &mut [u32; 4]) -> usize {
        let bits = self.bits();
        let shuffle = &super::x86::COMPRESS_4[(bits & 15) as usize];
        // SAFETY: as for `bits` (SSSE3 is part of AVX2); 16 bytes are readable at `shuffle`
        // and `values` and writable at `out`.
        unsafe {
            let shuffle = _mm_loadu_si128(shuffle.as_ptr().cast());
            let values = _mm_loadu_si128(values.as_ptr().cast());
            _mm_storeu_si128(out.as_mut_ptr().cast(), _mm_shuffle_epi8(values, shuffle));
        }
        bits.count_ones() as usize
    }
}

/// Vector of 8 floats.
#[derive(Clone, Copy)]
pub struct F32x8(__m256);

x86_operators!(
    F32x8,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps
);

x86_doubles!(
    F64x4,
    __m256d,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_set1_pd,
    _mm256_min_pd,
    _mm256_max_pd
);

impl Lanes<8> for F32x8 {
    type Token = Avx2;
    type Mask = Mask8;
    type Double = Pair<F64x4>;

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
    fn widen(self) -> Pair<F64x4> {
        // SAFETY: `self` came from the token.
        unsafe {
            let (low, high) = (
                _mm256_castps256_ps128(self.0),
                _mm256_extractf128_ps::<1>(self.0),
            );
            Pair::new(F64x4(_mm256_cvtps_pd(low)), F64x4(_mm256_cvtps_pd(high)))
        }
    }
    #[inline(always)]
    fn narrow(double: Pair<F64x4>) -> Self {
        let [low, high] = double.halves();
        // SAFETY: `double` came from the token.
        Self(unsafe { _mm256_set_m128(_mm256_cvtpd_ps(high.0), _mm256_cvtpd_ps(low.0)) })
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
    fn copysign(self, sign: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe {
            let bit = _mm256_set1_ps(-0.0);
            _mm256_or_ps(_mm256_and_ps(bit, sign.0), _mm256_andnot_ps(bit, self.0))
        })
    }
    #[inline(always)]
    fn flip_sign(self, by: Self) -> Self {
        // SAFETY: `self` came from the token.
        Self(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(_mm256_set1_ps(-0.0), by.0)) })
    }
    #[inline(always)]
    fn select(mask: Mask8, yes: Self, no: Self) -> Self {
        // SAFETY: `yes` came from the token.
        Self(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
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
    #[inline(always)]
    fn words_at_least(_: Avx2, words: &[u32; 8], least: u32) -> Mask8 {
        // SAFETY: the token proves the CPU has the instructions; eight words are readable.
        Mask8(unsafe {
            let words = _mm256_loadu_si256(words.as_ptr().cast());
            let more = _mm256_max_epu32(words, _mm256_set1_epi32(least as i32));
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(words, more))
        })
    }
    #[inline(always)]
    fn compress_sorted(self, mask: Mask8, values: &[u32; 8], out: &mut [u64; 8]) -> usize {
        let bits = mask.bits();
        let count = bits.count_ones() as usize;
        let permutation = &super::x86::COMPRESS_8[(bits & 255) as usize];
        // SAFETY: as for `words_at_least`; all lanes are readable at `permutation`, `values` and in the table,
        // and writable at `keys`, `chosen` and `out`.
        unsafe {
            let permutation = _mm256_cvtepu8_epi32(_mm_loadl_epi64(permutation.as_ptr().cast()));
            // `maxps` returns its second operand when both are equal: +0 replaces -0.
            let keys = _mm256_castps_si256(_mm256_max_ps(self.0, _mm256_setzero_ps()));
            let keys = _mm256_permutevar8x32_epi32(keys, permutation);
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            let chosen = _mm256_permutevar8x32_epi32(values, permutation);
            if count <= 4 {
                // Keys after the last true lane become 0, which sorts to the end.
                let place = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
                let present = _mm256_cmpgt_epi32(_mm256_set1_epi32(count as i32), place);
                let keys = _mm256_and_si256(keys, present);
                let first = _mm256_setr_epi32(0, 0, 0, 1, 1, 2, 0, 0);
                let second = _mm256_setr_epi32(1, 2, 3, 2, 3, 3, 0, 0);
                let first = _mm256_permutevar8x32_epi32(keys, first);
                let second = _mm256_permutevar8x32_epi32(keys, second);
                let rising = _mm256_cmpgt_epi32(second, first);
                let rising = _mm256_movemask_ps(_mm256_castsi256_ps(rising)) as usize;
                let order = &super::x86::SORT_4[rising & 63];
                let order = _mm256_cvtepu8_epi32(_mm_loadl_epi64(order.as_ptr().cast()));
                let low = _mm256_castsi256_si128(keys);
                let chosen = _mm256_castsi256_si128(chosen);
                let pairs = _mm256_set_m128i(
                    _mm_unpackhi_epi32(chosen, low),
                    _mm_unpacklo_epi32(chosen, low),
                );
                let sorted = _mm256_permutevar8x32_epi32(pairs, order);
                _mm256_storeu_si256(out.as_mut_ptr().cast(), sorted);
            } else {
                let (mut all_keys, mut all_chosen) = ([0; 8], [0; 8]);
                _mm256_storeu_si256(all_keys.as_mut_ptr().cast(), keys);
                _mm256_storeu_si256(all_chosen.as_mut_ptr().cast(), chosen);
                sort_pairs(&all_keys, &all_chosen, count, out);
            }
        }
        count
    }
}

/// Mask of 8 lanes; all bits of a lane are equal.
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
            let permutation = _mm256_cvtepu8_epi32(_mm_loadl_epi64(permutation.as_ptr().cast()));
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            let packed = _mm256_permutevar8x32_epi32(values, permutation);
            _mm256_storeu_si256(out.as_mut_ptr().cast(), packed);
        }
        bits.count_ones() as usize
    }
}
