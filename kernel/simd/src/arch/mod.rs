//! One file per instruction set.
//!
//! - `scalar`: plain arrays, the reference for all other files
//! - `avx2`, `avx512`: x86-64; `x86` holds the code and tables they share
//! - `neon`: AArch64
//! - `simd128`: WebAssembly
//! - `pair`: a vector made of two narrower ones, for widths that the CPU has no register for

#[cfg(any(
    target_arch = "x86_64",
    target_arch = "aarch64",
    all(target_arch = "wasm32", target_feature = "simd128")
))]
pub(crate) mod pair;
pub(crate) mod scalar;

#[cfg(target_arch = "x86_64")]
#[macro_use]
mod x86;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx512;

#[cfg(target_arch = "aarch64")]
pub(crate) mod neon;

#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub(crate) mod simd128;

/// Prefetches the cache lines of a `T` at any address, valid or not, on CPUs with a prefetch instruction.
#[inline(always)]
pub fn prefetch<T>(place: *const T) {
    #[cfg(target_arch = "x86_64")]
    for line in 0..size_of::<T>().div_ceil(64) {
        let start = place.cast::<i8>();
        // SAFETY: prefetching affects nothing but the cache, whatever the address, and every x86-64 CPU has SSE.
        unsafe {
            use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = place;
}
