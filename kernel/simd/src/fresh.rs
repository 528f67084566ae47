//! References that the compiler takes for new ones.

/// The reference itself, taken for another one by the compiler: what was loaded through it before is loaded again.
///
/// A loop that keeps more vectors than the CPU has registers spills them, and the compiler moves everything that does not
/// change out of a loop. Where the source is in the first cache, loading again takes no longer than a spilled vector does
/// and spares the spills.
#[cfg(all(any(target_arch = "x86_64", target_arch = "aarch64"), not(miri)))]
#[allow(clippy::pointers_in_nomem_asm_block)]
#[inline(always)]
pub fn fresh<T>(reference: &T) -> &T {
    let mut pointer: *const T = reference;
    // SAFETY: no instruction at all, so no memory is touched and the pointer is what it was. To the compiler it is whatever the
    // block returns.
    unsafe {
        core::arch::asm!("/* {0} */", inout(reg) pointer, options(nomem, nostack, preserves_flags));
        &*pointer
    }
}

/// The reference itself: assembly is not stable on other targets, and Miri has none.
#[cfg(not(all(any(target_arch = "x86_64", target_arch = "aarch64"), not(miri))))]
#[inline(always)]
pub fn fresh<T>(reference: &T) -> &T {
    reference
}

#[cfg(test)]
mod tests {
    use super::fresh;

    #[test]
    fn the_reference_stays_what_it_is() {
        let values = [1.0, 2.0, 3.0];
        let sum: f64 = (0..3).map(|place| fresh(&values)[place]).sum();
        assert_eq!(sum, 6.0);
        assert!(core::ptr::eq(fresh(&values), &values));
    }
}
