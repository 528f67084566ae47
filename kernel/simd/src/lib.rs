//! Vectors of floats for every instruction set, and the choice of instruction set at run time.
//!
//! Vector code is written once, generic over a *token* type `S: Simd`, in functions marked `#[inline(always)]`.
//! [`Dispatch::dispatch`] compiles the code once per instruction set and runs the copy that an [`Isa`] names.
//! An `Isa` exists only for a [`Level`] that this CPU has. Callers therefore need no `unsafe`.
//!
//! All `unsafe` code of the kernel lives in this crate: the CPU intrinsics, and memory in huge pages or on the program
//! stack.
//!
//! - [`level`]: the levels, their names and detection, [`Isa`], [`Dispatch`]
//! - [`lanes`]: the operations of vectors and masks: [`Lanes`], [`Mask`]
//! - [`fresh`](fresh()): references that the compiler takes for new ones
//! - [`memory`]: vectors in huge pages
//! - [`scratch`]: arrays on the program stack that nobody clears
//! - `arch`: one file per instruction set, besides `scalar` (the reference) and `pair` (vectors wider than the CPU's)
//!
//! Without the feature `std` (on by default) the crate needs only `alloc`. It then takes the levels for available that the
//! program is compiled for, because only the standard library queries the CPU.
//!
//! Every level returns the bits of the scalar level for every operation except [`Lanes::mul_sub`].
//!
//! # Example
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

#![no_std]

#[doc(hidden)]
pub extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod arch;
mod doubles;
mod fresh;
pub mod lanes;
pub mod level;
mod list;
pub mod memory;
pub mod scratch;

pub use arch::scalar::Scalar;
pub use doubles::Doubles;
pub use fresh::fresh;
pub use lanes::{Lanes, Mask};
pub use level::{Dispatch, Isa, Level, Simd, Unavailable, Width, WithSimd};
pub use list::{Row, UnknownName};
