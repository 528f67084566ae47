//! Plain arrays: the level that runs on every CPU and defines the results of all others.

use core::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use crate::doubles::Doubles;
use crate::lanes::{Lanes, Mask};
use crate::level::{Level, Simd, Width, WithSimd};

/// Token of [`Level::Scalar`]. Anyone can make one, since every CPU runs plain Rust.
#[derive(Clone, Copy)]
pub struct Scalar;

impl Simd for Scalar {
    const LEVEL: Level = Level::Scalar;
    const LANES: usize = 0;

    #[inline(always)]
    fn run<const N: usize, Op: WithSimd<N>>(self, op: Op) -> Op::Output
    where
        Self: Width<N>,
    {
        op.with_simd(self)
    }
}

impl<const N: usize> Width<N> for Scalar {
    type Lanes = Array<N>;
}

/// Vector of `N` floats.
#[derive(Clone, Copy)]
pub struct Array<const N: usize>([f32; N]);

impl<const N: usize> Array<N> {
    #[inline(always)]
    fn zip(self, b: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(core::array::from_fn(|i| f(self.0[i], b.0[i])))
    }

    #[inline(always)]
    fn compare(self, b: Self, f: impl Fn(f32, f32) -> bool) -> Bits<N> {
        let mut bits = 0;
        for i in 0..N {
            bits |= u32::from(f(self.0[i], b.0[i])) << i;
        }
        Bits(bits)
    }
}

impl<const N: usize> Add for Array<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.zip(b, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Array<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.zip(b, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Array<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.zip(b, |a, b| a * b)
    }
}

impl<const N: usize> Div for Array<N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.zip(b, |a, b| a / b)
    }
}

/// Vector of `N` doubles.
#[derive(Clone, Copy)]
pub struct DoubleArray<const N: usize>([f64; N]);

impl<const N: usize> DoubleArray<N> {
    #[inline(always)]
    fn zip(self, b: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(core::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
}

macro_rules! double_operators {
    ($($trait:ident $name:ident),*) => {$(
        impl<const N: usize> $trait for DoubleArray<N> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: Self) -> Self {
                self.zip(b, $trait::$name)
            }
        }
    )*};
}
double_operators!(Add add, Sub sub, Mul mul, Div div);

impl<const N: usize> Doubles for DoubleArray<N> {
    #[inline(always)]
    fn times(self, factor: f64) -> Self {
        Self(self.0.map(|x| x * factor))
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        self.zip(b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        self.zip(b, |a, b| if a > b { a } else { b })
    }
}

impl<const N: usize> Lanes<N> for Array<N> {
    type Token = Scalar;
    type Mask = Bits<N>;
    type Double = DoubleArray<N>;

    #[inline(always)]
    fn splat(_: Scalar, x: f32) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    fn load(_: Scalar, values: &[f32; N]) -> Self {
        Self(*values)
    }
    #[inline(always)]
    fn store(self, out: &mut [f32; N]) {
        *out = self.0;
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        self * b - c
    }
    #[inline(always)]
    fn widen(self) -> DoubleArray<N> {
        DoubleArray(self.0.map(f64::from))
    }
    #[inline(always)]
    fn narrow(double: DoubleArray<N>) -> Self {
        Self(double.0.map(|x| x as f32))
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        self.zip(b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        self.zip(b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.zip(sign, f32::copysign)
    }
    #[inline(always)]
    fn flip_sign(self, by: Self) -> Self {
        self.zip(by, |a, by| {
            f32::from_bits(a.to_bits() ^ by.to_bits() & 1 << 31)
        })
    }
    #[inline(always)]
    fn select(mask: Bits<N>, yes: Self, no: Self) -> Self {
        let mut lanes = no;
        for i in 0..N {
            if mask.0 >> i & 1 == 1 {
                lanes.0[i] = yes.0[i];
            }
        }
        lanes
    }
    #[inline(always)]
    fn lt(self, b: Self) -> Bits<N> {
        self.compare(b, |a, b| a < b)
    }
    #[inline(always)]
    fn le(self, b: Self) -> Bits<N> {
        self.compare(b, |a, b| a <= b)
    }
    #[inline(always)]
    fn eq(self, b: Self) -> Bits<N> {
        self.compare(b, |a, b| a == b)
    }
    #[inline(always)]
    fn words_at_least(_: Scalar, words: &[u32; N], least: u32) -> Bits<N> {
        let mut bits = 0;
        for i in 0..N {
            bits |= u32::from(words[i] >= least) << i;
        }
        Bits(bits)
    }
}

/// Mask of `N` lanes in the low bits of a word.
#[derive(Clone, Copy)]
pub struct Bits<const N: usize>(u32);

impl<const N: usize> BitAnd for Bits<N> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, b: Self) -> Self {
        Self(self.0 & b.0)
    }
}

impl<const N: usize> BitOr for Bits<N> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, b: Self) -> Self {
        Self(self.0 | b.0)
    }
}

impl<const N: usize> Not for Bits<N> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0 & (u32::MAX >> (32 - N)))
    }
}

impl<const N: usize> Mask<N> for Bits<N> {
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.0 != 0
    }
    #[inline(always)]
    fn compress(self, values: &[u32; N], out: &mut [u32; N]) -> usize {
        let mut count = 0;
        let mut bits = self.0;
        while bits != 0 {
            out[count] = values[bits.trailing_zeros() as usize];
            bits &= bits - 1;
            count += 1;
        }
        count
    }
}
