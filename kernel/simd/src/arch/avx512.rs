//! AVX-512 F, VL, BW and DQ: 16, 8 and 4 lanes, with masks in mask registers.

use core::arch::x86_64::*;

use super::avx2::transpose_8;
use super::pair::Pair;
use crate::lanes::{Lanes, Mask, sort_pairs};
use crate::level::{Level, Simd, Width, WithSimd};

/// Token of [`Level::Avx512`].
#[derive(Clone, Copy)]
pub struct Avx512(());

impl Simd for Avx512 {
    const LEVEL: Level = Level::Avx512;
    const LANES: usize = 16;

    #[inline(always)]
    fn run<const N: usize, Op: WithSimd<N>>(self, op: Op) -> Op::Output
    where
        Self: Width<N>,
    {
        // SAFETY: the token proves the CPU has the instructions.
        unsafe { run(op) }
    }

    #[inline(always)]
    fn compress_within(
        self,
        words: &[u64; 8],
        limit: u32,
        count: usize,
        out: &mut [u64; 8],
    ) -> usize {
        // SAFETY: the token proves the CPU has the instructions; 64 bytes are readable at `words` and
        // writable at `out`.
        unsafe {
            let limit = _mm512_set1_epi64((u64::from(limit) << 32 | 0xffff_ffff) as i64);
            let words = _mm512_loadu_si512(words.as_ptr().cast());
            let first = (0xff_u32 >> (8 - count.min(8))) as u8;
            let kept = _mm512_mask_cmple_epu64_mask(first, words, limit);
            let packed = _mm512_maskz_compress_epi64(kept, words);
            _mm512_storeu_si512(out.as_mut_ptr().cast(), packed);
            kept.count_ones() as usize
        }
    }

    #[inline(always)]
    fn columns(self, rows: &[[f32; 8]; 16]) -> [F32x16; 8] {
        // SAFETY: the token proves the CPU has the instructions.
        unsafe {
            // Each register takes two rows that are four apart. The last step then only picks blocks of 16 bytes.
            let low = transpose_blocks([
                two_rows(&rows[0], &rows[4]),
                two_rows(&rows[1], &rows[5]),
                two_rows(&rows[2], &rows[6]),
                two_rows(&rows[3], &rows[7]),
            ]);
            let high = transpose_blocks([
                two_rows(&rows[8], &rows[12]),
                two_rows(&rows[9], &rows[13]),
                two_rows(&rows[10], &rows[14]),
                two_rows(&rows[11], &rows[15]),
            ]);
            [
                F32x16(_mm512_shuffle_f32x4::<0b10_00_10_00>(low[0], high[0])),
                F32x16(_mm512_shuffle_f32x4::<0b10_00_10_00>(low[1], high[1])),
                F32x16(_mm512_shuffle_f32x4::<0b10_00_10_00>(low[2], high[2])),
                F32x16(_mm512_shuffle_f32x4::<0b10_00_10_00>(low[3], high[3])),
                F32x16(_mm512_shuffle_f32x4::<0b11_01_11_01>(low[0], high[0])),
                F32x16(_mm512_shuffle_f32x4::<0b11_01_11_01>(low[1], high[1])),
                F32x16(_mm512_shuffle_f32x4::<0b11_01_11_01>(low[2], high[2])),
                F32x16(_mm512_shuffle_f32x4::<0b11_01_11_01>(low[3], high[3])),
            ]
        }
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

/// Loads two rows into one register.
///
/// # Safety
/// The CPU must have AVX-512 F and DQ.
#[inline(always)]
unsafe fn two_rows(low: &[f32; 8], high: &[f32; 8]) -> __m512 {
    // SAFETY: the caller's promise; eight floats are readable at both places.
    unsafe {
        let low = _mm512_castps256_ps512(_mm256_loadu_ps(low.as_ptr()));
        _mm512_insertf32x8::<1>(low, _mm256_loadu_ps(high.as_ptr()))
    }
}

/// Transposes all four 4 x 4 blocks of four registers.
///
/// # Safety
/// The CPU must have AVX-512 F.
#[inline(always)]
unsafe fn transpose_blocks([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    // SAFETY: the caller's promise.
    unsafe {
        let (ab_low, ab_high) = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
        let (cd_low, cd_high) = (_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
        [
            _mm512_shuffle_ps::<0b01_00_01_00>(ab_low, cd_low),
            _mm512_shuffle_ps::<0b11_10_11_10>(ab_low, cd_low),
            _mm512_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
            _mm512_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
        ]
    }
}

/// Sorts four pairs (key, value) by descending key; see [`Lanes::compress_sorted`].
///
/// # Safety
/// The CPU must have AVX-512 F and VL.
#[inline(always)]
unsafe fn sort_4(keys: __m128i, values: __m128i) -> __m256i {
    // SAFETY: the caller's promise; eight bytes are readable in the table.
    unsafe {
        let keys_twice = _mm256_castsi128_si256(keys);
        let first = _mm256_setr_epi32(0, 0, 0, 1, 1, 2, 0, 0);
        let second = _mm256_setr_epi32(1, 2, 3, 2, 3, 3, 0, 0);
        let first = _mm256_permutexvar_epi32(first, keys_twice);
        let second = _mm256_permutexvar_epi32(second, keys_twice);
        let rising = _mm256_cmplt_epu32_mask(first, second);
        let order = &super::x86::SORT_4[usize::from(rising & 63)];
        let order = _mm256_cvtepu8_epi32(_mm_loadl_epi64(order.as_ptr().cast()));
        let pairs = _mm256_set_m128i(
            _mm_unpackhi_epi32(values, keys),
            _mm_unpacklo_epi32(values, keys),
        );
        _mm256_permutexvar_epi32(order, pairs)
    }
}

/// Runs `op` compiled for AVX-512 F, VL, BW and DQ and for the instructions of [`Level::Avx2`].
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

/// Lowest four words of a register of four.
#[inline(always)]
fn identity(words: __m128i) -> __m128i {
    words
}

/// Stores compressed words.
///
/// # Safety
/// `P` is a vector of `N` words.
#[inline(always)]
unsafe fn store_packed<P, const N: usize>(packed: P, _count: usize, out: &mut [u32; N]) {
    // SAFETY: the caller's promise; all lanes are writable, and no alignment is needed.
    unsafe { core::ptr::write_unaligned(out.as_mut_ptr().cast(), packed) }
}

/// Stores 16 compressed words.
///
/// The upper half is written only if needed. More than eight words are rare, and a store of 64 bytes that crosses
/// a cache line is slow.
///
/// # Safety
/// The CPU must have AVX-512 F.
#[inline(always)]
unsafe fn store_packed_16(packed: __m512i, count: usize, out: &mut [u32; 16]) {
    // SAFETY: the caller's promise; 32 bytes are writable at both places.
    unsafe {
        let out = out.as_mut_ptr();
        _mm256_storeu_si256(out.cast(), _mm512_castsi512_si256(packed));
        if count > 8 {
            _mm256_storeu_si256(out.add(8).cast(), _mm512_extracti64x4_epi64::<1>(packed));
        }
    }
}

/// Loads three rows, each repeated in every 16 bytes of a register.
///
/// Written in assembly because compilers turn such a load and the shuffles after it into one load per splat.
///
/// # Safety
/// The CPU must have AVX-512 F.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn repeat_rows(rows: &[[f32; 4]; 3]) -> [__m512; 3] {
    let (a, b, c);
    // SAFETY: the caller's promise; 48 bytes are readable.
    unsafe {
        core::arch::asm!(
            "vbroadcastf32x4 {a}, [{rows}]",
            "vbroadcastf32x4 {b}, [{rows} + 16]",
            "vbroadcastf32x4 {c}, [{rows} + 32]",
            a = out(zmm_reg) a,
            b = out(zmm_reg) b,
            c = lateout(zmm_reg) c,
            rows = in(reg) rows,
            options(pure, readonly, nostack, preserves_flags)
        );
    }
    [a, b, c]
}

/// Implementation of [`Lanes::splat_rows`] for 16 lanes; the narrower widths use the default.
macro_rules! splat_rows {
    (4) => {};
    (8) => {};
    // Zen 4 loads one register of 64 bytes per cycle, broadcast or not, so nine loads take nine cycles.
    // Shuffles within 16 bytes run on units that are idle here.
    (16) => {
        #[inline(always)]
        fn splat_rows(_: Avx512, rows: &[[f32; 4]; 3]) -> [[Self; 3]; 3] {
            // SAFETY: the token proves the CPU has the instructions.
            unsafe {
                let [a, b, c] = repeat_rows(rows);
                [
                    [
                        Self(_mm512_permute_ps::<0b00_00_00_00>(a)),
                        Self(_mm512_permute_ps::<0b01_01_01_01>(a)),
                        Self(_mm512_permute_ps::<0b10_10_10_10>(a)),
                    ],
                    [
                        Self(_mm512_permute_ps::<0b00_00_00_00>(b)),
                        Self(_mm512_permute_ps::<0b01_01_01_01>(b)),
                        Self(_mm512_permute_ps::<0b10_10_10_10>(b)),
                    ],
                    [
                        Self(_mm512_permute_ps::<0b00_00_00_00>(c)),
                        Self(_mm512_permute_ps::<0b01_01_01_01>(c)),
                        Self(_mm512_permute_ps::<0b10_10_10_10>(c)),
                    ],
                ]
            }
        }
    };
}

x86_xmm_doubles!();

x86_doubles!(
    F64x8,
    __m512d,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_set1_pd,
    _mm512_min_pd,
    _mm512_max_pd
);

/// Doubles of a register width, and the way there and back.
macro_rules! conversions {
    (4) => {
        type Double = Pair<F64x2>;

        x86_xmm_conversions!();
    };
    (8) => {
        type Double = F64x8;

        #[inline(always)]
        fn widen(self) -> F64x8 {
            // SAFETY: `self` came from the token.
            F64x8(unsafe { _mm512_cvtps_pd(self.0) })
        }
        #[inline(always)]
        fn narrow(double: F64x8) -> Self {
            // SAFETY: `double` came from the token.
            Self(unsafe { _mm512_cvtpd_ps(double.0) })
        }
    };
    (16) => {
        type Double = Pair<F64x8>;

        #[inline(always)]
        fn widen(self) -> Pair<F64x8> {
            // SAFETY: `self` came from the token.
            unsafe {
                let (low, high) = (
                    _mm512_castps512_ps256(self.0),
                    _mm512_extractf32x8_ps::<1>(self.0),
                );
                Pair::new(F64x8(_mm512_cvtps_pd(low)), F64x8(_mm512_cvtps_pd(high)))
            }
        }
        #[inline(always)]
        fn narrow(double: Pair<F64x8>) -> Self {
            let [low, high] = double.halves();
            // SAFETY: `double` came from the token.
            Self(unsafe {
                let low = _mm512_castps256_ps512(_mm512_cvtpd_ps(low.0));
                _mm512_insertf32x8::<1>(low, _mm512_cvtpd_ps(high.0))
            })
        }
    };
}

/// Vector and mask of one register width, given the intrinsics that differ between widths.
macro_rules! avx512_lanes {
    ($n:tt, $lanes:ident, $mask:ident, $register:ident, $bits:ident, $add:ident, $sub:ident,
     $mul:ident, $div:ident, $set1:ident, $loadu:ident, $storeu:ident, $fmsub:ident, $min:ident,
     $max:ident, $cmp:ident, $load_int:ident, $compress:ident,
     $at_least:ident, $set1_int:ident, $cast_int:ident, $low:ident, $store_packed:ident,
     $and:ident, $andnot:ident, $or:ident, $xor:ident, $range:ident, $blend:ident) => {
        #[doc = concat!("Vector of ", stringify!($n), " floats.")]
        #[derive(Clone, Copy)]
        pub struct $lanes($register);

        impl Width<$n> for Avx512 {
            type Lanes = $lanes;
        }

        x86_operators!($lanes, $add, $sub, $mul, $div);

        impl Lanes<$n> for $lanes {
            type Token = Avx512;
            type Mask = $mask;
            conversions!($n);

            #[inline(always)]
            fn splat(_: Avx512, x: f32) -> Self {
                // SAFETY: the token proves the CPU has the instruction.
                Self(unsafe { $set1(x) })
            }
            splat_rows!($n);
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
            fn max_size(self, b: Self) -> Self {
                /// The larger magnitude, its sign bit cleared.
                const LARGEST_SIZE: i32 = 0b1011;
                // SAFETY: `self` came from the token.
                Self(unsafe { $range::<LARGEST_SIZE>(self.0, b.0) })
            }
            #[inline(always)]
            fn copysign(self, sign: Self) -> Self {
                // SAFETY: `self` came from the token.
                Self(unsafe {
                    let bit = $set1(-0.0);
                    $or($and(bit, sign.0), $andnot(bit, self.0))
                })
            }
            #[inline(always)]
            fn flip_sign(self, by: Self) -> Self {
                // SAFETY: `self` came from the token.
                Self(unsafe { $xor(self.0, $and($set1(-0.0), by.0)) })
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                // SAFETY: `yes` came from the token.
                Self(unsafe { $blend(mask.0, no.0, yes.0) })
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
            #[inline(always)]
            fn words_at_least(_: Avx512, words: &[u32; $n], least: u32) -> $mask {
                // SAFETY: the token proves the CPU has the instructions; all lanes are readable.
                $mask(unsafe {
                    $at_least($load_int(words.as_ptr().cast()), $set1_int(least as i32))
                })
            }
            #[inline(always)]
            fn compress_sorted(
                self,
                mask: $mask,
                values: &[u32; $n],
                out: &mut [u64; $n],
            ) -> usize {
                let count = mask.0.count_ones() as usize;
                // SAFETY: as for `words_at_least`; all lanes are writable at `all_keys`, `all_values` and `out`.
                unsafe {
                    // `maxps` returns its second operand when both are equal: +0 replaces -0.
                    let keys = $cast_int($max(self.0, $set1(0.0)));
                    let keys = $compress(mask.0, keys);
                    let values = $compress(mask.0, $load_int(values.as_ptr().cast()));
                    // Compression fills the rest with 0, which sorts to the end.
                    if count <= 4 {
                        let sorted = sort_4($low(keys), $low(values));
                        core::ptr::write_unaligned(out.as_mut_ptr().cast(), sorted);
                    } else {
                        let (mut all_keys, mut all_values) = ([0; $n], [0; $n]);
                        core::ptr::write_unaligned(all_keys.as_mut_ptr().cast(), keys);
                        core::ptr::write_unaligned(all_values.as_mut_ptr().cast(), values);
                        sort_pairs(&all_keys, &all_values, count, out);
                    }
                }
                count
            }
        }

        #[doc = concat!("Mask of ", stringify!($n), " lanes in a mask register.")]
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
                // Masks of 4 lanes live in 8 bits; the unused bits stay 0.
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
                let count = self.0.count_ones() as usize;
                // Compressing in a register and storing the result is fast everywhere. Compressing
                // straight to memory is microcoded on Zen 4.
                // SAFETY: `self` came from a comparison, which came from the token; all lanes are
                // readable at `values` and writable at `out`, and nothing here needs alignment.
                unsafe {
                    let packed = $compress(self.0, $load_int(values.as_ptr().cast()));
                    $store_packed(packed, count, out);
                }
                count
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
    _mm_maskz_compress_epi32,
    _mm_cmpge_epu32_mask,
    _mm_set1_epi32,
    _mm_castps_si128,
    identity,
    store_packed,
    _mm_and_ps,
    _mm_andnot_ps,
    _mm_or_ps,
    _mm_xor_ps,
    _mm_range_ps,
    _mm_mask_blend_ps
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
    _mm256_maskz_compress_epi32,
    _mm256_cmpge_epu32_mask,
    _mm256_set1_epi32,
    _mm256_castps_si256,
    _mm256_castsi256_si128,
    store_packed,
    _mm256_and_ps,
    _mm256_andnot_ps,
    _mm256_or_ps,
    _mm256_xor_ps,
    _mm256_range_ps,
    _mm256_mask_blend_ps
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
    _mm512_maskz_compress_epi32,
    _mm512_cmpge_epu32_mask,
    _mm512_set1_epi32,
    _mm512_castps_si512,
    _mm512_castsi512_si128,
    store_packed_16,
    _mm512_and_ps,
    _mm512_andnot_ps,
    _mm512_or_ps,
    _mm512_xor_ps,
    _mm512_range_ps,
    _mm512_mask_blend_ps
);
