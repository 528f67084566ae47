//! Code shared by the x86 levels: operators, doubles, masks in registers, and tables for compression and sorting by
//! shuffle.

/// Arithmetic operators of a register newtype.
///
/// Sound because a value of the type comes only from its token, and a token only from a CPU with the instructions.
macro_rules! x86_operators {
    ($lanes:ident, $add:ident, $sub:ident, $mul:ident, $div:ident) => {
        x86_operators!(@ $lanes, Add add $add);
        x86_operators!(@ $lanes, Sub sub $sub);
        x86_operators!(@ $lanes, Mul mul $mul);
        x86_operators!(@ $lanes, Div div $div);
    };
    (@ $lanes:ident, $trait:ident $name:ident $intrinsic:ident) => {
        impl core::ops::$trait for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: Self) -> Self {
                // SAFETY: `self` came from the token, so the CPU has the instruction.
                Self(unsafe { $intrinsic(self.0, b.0) })
            }
        }
    };
}

/// Doubles in one register.
macro_rules! x86_doubles {
    ($doubles:ident, $register:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $set1:ident, $min:ident,
     $max:ident) => {
        /// Vector of doubles in one register.
        #[derive(Clone, Copy)]
        pub struct $doubles($register);

        x86_operators!($doubles, $add, $sub, $mul, $div);

        impl crate::doubles::Doubles for $doubles {
            #[inline(always)]
            fn times(self, factor: f64) -> Self {
                // SAFETY: `self` came from the token, so the CPU has the instructions.
                Self(unsafe { $mul(self.0, $set1(factor)) })
            }
            #[inline(always)]
            fn min(self, b: Self) -> Self {
                // SAFETY: as for `times`.
                Self(unsafe { $min(self.0, b.0) })
            }
            #[inline(always)]
            fn max(self, b: Self) -> Self {
                // SAFETY: as for `times`.
                Self(unsafe { $max(self.0, b.0) })
            }
        }
    };
}

/// Doubles of a level that has two in an xmm register.
macro_rules! x86_xmm_doubles {
    () => {
        x86_doubles!(
            F64x2,
            __m128d,
            _mm_add_pd,
            _mm_sub_pd,
            _mm_mul_pd,
            _mm_div_pd,
            _mm_set1_pd,
            _mm_min_pd,
            _mm_max_pd
        );
    };
}

/// The conversions of [`crate::Lanes`] for 4 floats in an xmm register.
macro_rules! x86_xmm_conversions {
    () => {
        #[inline(always)]
        fn widen(self) -> Pair<F64x2> {
            // SAFETY: `self` came from the token.
            unsafe {
                let high = _mm_movehl_ps(self.0, self.0);
                Pair::new(F64x2(_mm_cvtps_pd(self.0)), F64x2(_mm_cvtps_pd(high)))
            }
        }
        #[inline(always)]
        fn narrow(double: Pair<F64x2>) -> Self {
            let [low, high] = double.halves();
            // SAFETY: `double` came from the token.
            Self(unsafe { _mm_movelh_ps(_mm_cvtpd_ps(low.0), _mm_cvtpd_ps(high.0)) })
        }
    };
}

/// Mask operators for a mask held in a float register (before AVX-512).
macro_rules! x86_register_mask {
    ($mask:ident, $and:ident, $or:ident, $andnot:ident, $ones:expr) => {
        impl core::ops::BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, b: Self) -> Self {
                // SAFETY: `self` came from a comparison, which came from the token.
                Self(unsafe { $and(self.0, b.0) })
            }
        }
        impl core::ops::BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, b: Self) -> Self {
                // SAFETY: as for `bitand`.
                Self(unsafe { $or(self.0, b.0) })
            }
        }
        impl core::ops::Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                // SAFETY: as for `bitand`.
                Self(unsafe { $andnot(self.0, $ones) })
            }
        }
    };
}

/// Byte shuffles that move the true lanes to the front, one for every mask of 4 lanes.
pub(super) static COMPRESS_4: [[u8; 16]; 16] = {
    let mut table = [[0x80; 16]; 16];
    let mut mask = 0;
    while mask < 16 {
        let (mut lane, mut front) = (0, 0);
        while lane < 4 {
            if mask >> lane & 1 == 1 {
                let mut byte = 0;
                while byte < 4 {
                    table[mask][4 * front + byte] = (4 * lane + byte) as u8;
                    byte += 1;
                }
                front += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// Lane permutations that move the true lanes to the front, one for every mask of 8 lanes.
///
/// Stored as bytes, so that the table takes only 2 KiB of the first-level cache.
pub(super) static COMPRESS_8: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut front) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask][front] = lane as u8;
                front += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// Word permutations that sort four 64-bit numbers a, b, c, d in descending order.
///
/// The index says which of the six pairs ab, ac, ad, bc, bd, cd rise; bit 0 is ab. Entries list, place by place, the
/// two words of the number that goes there. Indices that no four numbers produce keep the order a, b, c, d.
pub(super) static SORT_4: [[u8; 8]; 64] = {
    let mut table = [[0, 1, 2, 3, 4, 5, 6, 7]; 64];
    let mut rising = 0;
    while rising < 64 {
        // The place of each number: how many are greater, and how many before it are as great.
        let mut places = [0; 4];
        let (mut pair, mut first) = (0, 0);
        while first < 4 {
            let mut second = first + 1;
            while second < 4 {
                if rising >> pair & 1 == 1 {
                    places[first] += 1;
                } else {
                    places[second] += 1;
                }
                pair += 1;
                second += 1;
            }
            first += 1;
        }
        let mut seen = 0;
        let mut number = 0;
        while number < 4 {
            seen |= 1 << places[number];
            number += 1;
        }
        let mut number = 0;
        while number < 4 && seen == 15 {
            table[rising][2 * places[number]] = 2 * number as u8;
            table[rising][2 * places[number] + 1] = 2 * number as u8 + 1;
            number += 1;
        }
        rising += 1;
    }
    table
};
