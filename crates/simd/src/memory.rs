//! Memory in huge pages, where the system grants them.
//!
//! A traversal jumps about in tens of megabytes; with pages of 4 KiB nearly every jump misses the address
//! cache of the CPU, too. On Zen 4 under Linux 6.1, occlusion batches on the built-in city ran 1.12 times as
//! fast in huge pages at a million triangles and 1.10 times at four million; sponza (4 MB) did not notice.

use core::mem::MaybeUninit;

/// An empty vector with room for `capacity` items, in huge pages if there is much of it and the system has any.
pub fn vec_in_huge_pages<T>(capacity: usize) -> Vec<T> {
    let mut vec = Vec::with_capacity(capacity);
    prefer_huge_pages(vec.spare_capacity_mut());
    vec
}

/// Asks for huge pages before the memory is first touched, which is when it gets its pages.
#[cfg(target_os = "linux")]
fn prefer_huge_pages<T>(memory: &mut [MaybeUninit<T>]) {
    /// Less would hardly hold one.
    const MIN_BYTES: usize = 4 << 20;
    /// No page of any Linux system is larger, so this suits them all.
    const PAGE: usize = 64 << 10;
    let range = memory.as_mut_ptr_range();
    let start = (range.start.addr()).next_multiple_of(PAGE);
    let end = range.end.addr() / PAGE * PAGE;
    if end.saturating_sub(start) >= MIN_BYTES {
        let start = range.start.with_addr(start);
        let bytes = end - start.addr();
        // SAFETY: whole pages within memory that is ours alone, and the advice changes nothing of what they
        // hold. Whether it is taken does not matter.
        unsafe { libc::madvise(start.cast(), bytes, libc::MADV_HUGEPAGE) };
    }
}

/// Other systems decide for themselves.
#[cfg(not(target_os = "linux"))]
fn prefer_huge_pages<T>(_memory: &mut [MaybeUninit<T>]) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_an_ordinary_vector() {
        for capacity in [0, 1, 1000, 3_000_000] {
            let mut vec = vec_in_huge_pages(capacity);
            assert!(vec.capacity() >= capacity && vec.is_empty());
            let place = vec.as_ptr();
            vec.extend(0..capacity as u64);
            assert_eq!(vec.as_ptr(), place, "it was moved");
            assert!(vec.iter().copied().eq(0..capacity as u64));
        }
        // Nothing to advise for what takes no memory.
        assert!(vec_in_huge_pages::<()>(1 << 40).is_empty());
    }
}
