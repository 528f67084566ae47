//! One file per instruction set. `scalar` is the reference; `pair` makes a vector of two narrower ones
//! where the CPU has none as wide; `x86` holds what the three x86 files share.

pub(crate) mod pair;
pub(crate) mod scalar;

#[cfg(target_arch = "x86_64")]
#[macro_use]
mod x86;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx512;
#[cfg(target_arch = "x86_64")]
pub(crate) mod sse41;

#[cfg(target_arch = "aarch64")]
pub(crate) mod neon;
