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

/// Brings all lines of a value into the cache, where there is an instruction for that. There may be none at this place.
#[inline(always)]
pub fn prefetch<T>(place: *const T) {
    #[cfg(target_arch = "x86_64")]
    for line in 0..size_of::<T>().div_ceil(64) {
        let start = place.cast::<i8>();
        // SAFETY: prefetching has no effect but on the cache, whatever the address is, and every x86-64 CPU
        // has SSE.
        unsafe {
            use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = place;
}
