//! Properties of many points as columns, and loops over columns in vectors.
//!
//! A block holds [`BLOCK`] points, one per *lane*. A column is an array with one number per lane. A [`Stage`] is a plain
//! loop over all lanes, whose body has no branch that matters. The compiler makes vectors of it, once for every
//! instruction set. It neither reorders nor fuses operations of floats, so every lane has the bits that the same
//! expression has outside of a loop, on every instruction set.
//!
//! Lanes without a point hold leftovers, which are computed as well and never read.

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};
use glam::Vec3;

/// Number of lanes of a block. The columns of a block fit the first cache.
pub const BLOCK: usize = 64;

/// One number per lane.
pub type Column = [f32; BLOCK];

/// One flag per lane: 0 or 1.
pub type Flags = [u32; BLOCK];

/// One vector per lane, as three columns.
#[derive(Clone, Debug)]
pub struct Column3([Column; 3]);

impl Default for Column3 {
    fn default() -> Self {
        Self([[0.0; BLOCK]; 3])
    }
}

impl Column3 {
    /// Vector of a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Vec3 {
        let [x, y, z] = &self.0;
        Vec3::new(x[lane], y[lane], z[lane])
    }

    /// Sets the vector of a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, v: Vec3) {
        let [x, y, z] = &mut self.0;
        (x[lane], y[lane], z[lane]) = (v.x, v.y, v.z);
    }
}

/// Declares structs of columns, and zeros as their defaults: the standard library has none for long arrays.
macro_rules! columns {
    ($($(#[$meta:meta])* $pub:vis struct $Name:ident { $($(#[$field_meta:meta])* $field_pub:vis $field:ident: $Type:ty,)* })*) => {
        $($(#[$meta])*
        $pub struct $Name { $($(#[$field_meta])* $field_pub $field: $Type,)* }

        impl Default for $Name {
            fn default() -> Self {
                Self { $($field: $crate::columns::Zero::zero(),)* }
            }
        }

        impl $crate::columns::Zero for $Name {
            fn zero() -> Self {
                Self::default()
            }
        })*
    };
}
pub(crate) use columns;

/// Value before a block is computed.
pub trait Zero {
    /// The value.
    fn zero() -> Self;
}

impl<T: Zero, const N: usize> Zero for [T; N] {
    fn zero() -> Self {
        std::array::from_fn(|_| T::zero())
    }
}

macro_rules! zero {
    ($($Type:ty)*) => {
        $(impl $crate::columns::Zero for $Type {
            fn zero() -> Self {
                Self::default()
            }
        })*
    };
}

pub(crate) use zero;

zero!(f32 f64 u32 bool usize Column3);

impl<T> Zero for Vec<T> {
    fn zero() -> Self {
        Self::new()
    }
}

/// `a` if `first`, else `b`, without a branch.
#[inline(always)]
pub fn select(first: bool, a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(
        if first { a.x } else { b.x },
        if first { a.y } else { b.y },
        if first { a.z } else { b.z },
    )
}

/// Whether all coordinates are 0, without a branch.
#[inline(always)]
pub fn is_zero(v: Vec3) -> bool {
    (v.x == 0.0) & (v.y == 0.0) & (v.z == 0.0)
}

/// A loop over all lanes of a block. The stage itself holds what the loop reads.
pub trait Stage {
    /// Columns that are written, and perhaps read.
    type Out;

    /// Runs the loop. Mark it `#[inline(always)]`: only code that is inlined is compiled for the instruction set.
    fn run(self, out: &mut Self::Out);
}

/// Runs a stage in vectors of an instruction set.
#[inline]
pub fn run<S: Stage>(isa: Isa, stage: S, out: &mut S::Out) {
    isa.dispatch(Run { stage, out });
}

struct Run<'a, S: Stage> {
    stage: S,
    out: &'a mut S::Out,
}

impl<S: Stage> WithSimd<16> for Run<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<T: Simd + Width<16>>(self, _: T) {
        self.stage.run(self.out);
    }
}
