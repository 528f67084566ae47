//! SIMD lanes and the choice of instruction set at run time: the only home of CPU intrinsics, and of what else
//! the kernel needs `unsafe` for.
//!
//! Code that wants vectors is written once, generic over a *token* type `S: Simd`, in functions marked
//! `#[inline(always)]`, and handed to [`Dispatch::dispatch`], which compiles it once per instruction set
//! and picks the copy that [`Isa`] names. An `Isa` can only be made for a [`Level`] that this CPU has,
//! so nothing outside this crate needs `unsafe`.
//!
//! - [`level`]: the levels, their names and detection, [`Isa`], [`Dispatch`]
//! - [`lanes`]: what a vector of floats and a mask can do: [`Lanes`], [`Mask`]
//! - [`memory`]: vectors in huge pages
//! - `arch`: one file per instruction set, plus `scalar` (the reference) and `pair` (wider than the CPU)
//!
//! Every operation returns the bits of the scalar one on every level, [`Lanes::mul_sub`] excepted.
//!
//! ```
//! use antumbra_simd::{Dispatch, Isa, Lanes, Simd, Width, WithSimd};
//!
//! struct Sum<'a>(&'a [f32; 8], &'a [f32; 8], &'a mut [f32; 8]);
//!
//! impl WithSimd<8> for Sum<'_> {
//!     type Output = ();
//!     #[inline(always)]
//!     fn with_simd<S: Simd + Width<8>>(self, simd: S) {
//!         let a = <S as Width<8>>::Lanes::load(simd, self.0);
//!         let b = <S as Width<8>>::Lanes::load(simd, self.1);
//!         (a + b).store(self.2);
//!     }
//! }
//!
//! let mut out = [0.0; 8];
//! Isa::best().dispatch(Sum(&[1.0; 8], &[2.0; 8], &mut out));
//! assert_eq!(out, [3.0; 8]);
//! ```

mod arch;
pub mod lanes;
pub mod level;
pub mod memory;

pub use arch::scalar::Scalar;
pub use lanes::{Lanes, Mask};
pub use level::{Dispatch, Isa, Level, Simd, Unavailable, UnknownLevel, Width, WithSimd};
