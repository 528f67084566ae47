//! Vector made of two narrower ones, for widths that the instruction set has no register for.

use core::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use crate::doubles::Doubles;
use crate::lanes::{Lanes, Mask};

/// Vector or mask in two halves: the low lanes, then the high lanes.
#[derive(Clone, Copy)]
pub struct Pair<V>(V, V);

impl<V: Copy> Pair<V> {
    #[inline(always)]
    pub fn new(low: V, high: V) -> Self {
        Self(low, high)
    }

    #[inline(always)]
    pub fn halves(self) -> [V; 2] {
        [self.0, self.1]
    }
}

macro_rules! elementwise {
    ($($op:ident $name:ident),*) => {$(
        impl<V: $op<Output = V>> $op for Pair<V> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: Self) -> Self {
                Self($op::$name(self.0, b.0), $op::$name(self.1, b.1))
            }
        }
    )*};
}
elementwise!(Add add, Sub sub, Mul mul, Div div, BitAnd bitand, BitOr bitor);

impl<V: Not<Output = V>> Not for Pair<V> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0, !self.1)
    }
}

impl<V: Doubles> Doubles for Pair<V> {
    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        Self(self.0.times(factor), self.1.times(factor))
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        Self(self.0.min(b.0), self.1.min(b.1))
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        Self(self.0.max(b.0), self.1.max(b.1))
    }
}

macro_rules! pair {
    ($n:literal = 2 * $half:literal) => {
        impl<V: Lanes<$half>> Lanes<$n> for Pair<V> {
            type Token = V::Token;
            type Mask = Pair<V::Mask>;
            type Double = Pair<V::Double>;

            #[inline(always)]
            fn splat(token: V::Token, x: f32) -> Self {
                Self(V::splat(token, x), V::splat(token, x))
            }
            #[inline(always)]
            fn load(token: V::Token, values: &[f32; $n]) -> Self {
                let (halves, _) = values.as_chunks::<$half>();
                Self(V::load(token, &halves[0]), V::load(token, &halves[1]))
            }
            #[inline(always)]
            fn store(self, out: &mut [f32; $n]) {
                let (halves, _) = out.as_chunks_mut::<$half>();
                self.0.store(&mut halves[0]);
                self.1.store(&mut halves[1]);
            }
            #[inline(always)]
            fn mul_sub(self, b: Self, c: Self) -> Self {
                Self(self.0.mul_sub(b.0, c.0), self.1.mul_sub(b.1, c.1))
            }
            #[inline(always)]
            fn widen(self) -> Self::Double {
                Pair(self.0.widen(), self.1.widen())
            }
            #[inline(always)]
            fn narrow(double: Self::Double) -> Self {
                Self(V::narrow(double.0), V::narrow(double.1))
            }
            #[inline(always)]
            fn min(self, b: Self) -> Self {
                Self(self.0.min(b.0), self.1.min(b.1))
            }
            #[inline(always)]
            fn max(self, b: Self) -> Self {
                Self(self.0.max(b.0), self.1.max(b.1))
            }
            #[inline(always)]
            fn copysign(self, sign: Self) -> Self {
                Self(self.0.copysign(sign.0), self.1.copysign(sign.1))
            }
            #[inline(always)]
            fn flip_sign(self, by: Self) -> Self {
                Self(self.0.flip_sign(by.0), self.1.flip_sign(by.1))
            }
            #[inline(always)]
            fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
                Self(
                    V::select(mask.0, yes.0, no.0),
                    V::select(mask.1, yes.1, no.1),
                )
            }
            #[inline(always)]
            fn lt(self, b: Self) -> Self::Mask {
                Pair(self.0.lt(b.0), self.1.lt(b.1))
            }
            #[inline(always)]
            fn le(self, b: Self) -> Self::Mask {
                Pair(self.0.le(b.0), self.1.le(b.1))
            }
            #[inline(always)]
            fn eq(self, b: Self) -> Self::Mask {
                Pair(self.0.eq(b.0), self.1.eq(b.1))
            }
            #[inline(always)]
            fn words_at_least(token: V::Token, words: &[u32; $n], least: u32) -> Self::Mask {
                let (halves, _) = words.as_chunks::<$half>();
                Pair(
                    V::words_at_least(token, &halves[0], least),
                    V::words_at_least(token, &halves[1], least),
                )
            }
        }

        impl<M: Mask<$half>> Mask<$n> for Pair<M> {
            #[inline(always)]
            fn bits(self) -> u32 {
                self.0.bits() | self.1.bits() << $half
            }
            #[inline(always)]
            fn any(self) -> bool {
                (self.0.bits() | self.1.bits()) != 0
            }
            #[inline(always)]
            fn compress(self, values: &[u32; $n], out: &mut [u32; $n]) -> usize {
                let (halves, _) = values.as_chunks::<$half>();
                let mut buffer = [0; $half];
                let low = self.0.compress(&halves[0], &mut buffer);
                out[..$half].copy_from_slice(&buffer);
                let high = self.1.compress(&halves[1], &mut buffer);
                // `low` is at most half the lanes, so the second half always fits after it.
                out[low..low + $half].copy_from_slice(&buffer);
                low + high
            }
        }
    };
}
pair!(8 = 2 * 4);
pair!(16 = 2 * 8);
