//! Arrays on the program stack that nobody clears.
//!
//! A traversal stack is written before it is read, but only its owner knows that. Clearing four kilobytes would take a
//! tenth of the time of a query.

use core::mem::MaybeUninit;

/// A number of which every pattern of bits is a value.
pub trait Bits: Copy + sealed::Sealed {}

impl Bits for u32 {}
impl Bits for u64 {}

mod sealed {
    pub trait Sealed {}
    impl Sealed for u32 {}
    impl Sealed for u64 {}
}

/// Runs `work` with an array on the program stack that holds any numbers: what the memory happened to hold, or zeros.
#[inline(always)]
pub fn with_scratch<T: Bits, const N: usize, R>(work: impl FnOnce(&mut [T; N]) -> R) -> R {
    let mut memory = MaybeUninit::<[T; N]>::uninit();
    fix(&mut memory);
    // SAFETY: `fix` has given every byte a value, and `Bits` says that any value will do.
    work(unsafe { memory.assume_init_mut() })
}

/// Gives every byte some value.
#[cfg(all(any(target_arch = "x86_64", target_arch = "aarch64"), not(miri)))]
#[inline(always)]
fn fix<T>(memory: &mut MaybeUninit<T>) {
    // SAFETY: no instruction at all. To the compiler the block may have written to the memory that it is given the address
    // of, so the memory has fixed values from here on.
    unsafe {
        core::arch::asm!("/* {0} */", in(reg) memory.as_mut_ptr(), options(nostack, preserves_flags));
    }
}

/// Gives every byte the value 0: assembly is not stable on other targets, and Miri has none.
#[cfg(not(all(any(target_arch = "x86_64", target_arch = "aarch64"), not(miri))))]
#[inline(always)]
fn fix<T>(memory: &mut MaybeUninit<T>) {
    *memory = MaybeUninit::zeroed();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_can_be_read() {
        let sum = with_scratch(|items: &mut [u64; 100]| {
            for (index, item) in items.iter_mut().enumerate() {
                *item = index as u64;
            }
            // Another array does not lie in the same place.
            with_scratch(|others: &mut [u32; 100]| others.fill(u32::MAX));
            items.iter().sum::<u64>()
        });
        assert_eq!(sum, 4950);
    }

    #[test]
    fn values_stay_as_they_are() {
        with_scratch(|items: &mut [u32; 64]| {
            let before = *items;
            assert!(before.iter().zip(items).all(|(before, now)| before == now));
        });
    }
}
