//! Vectors in huge pages, where the system grants them, which several threads can fill.
//!
//! A traversal reads scattered nodes of a tree of tens of megabytes. With pages of 4 KiB, nearly every read misses
//! the TLB of the CPU as well as its caches. Huge pages make most TLB misses go away.

use alloc::vec::Vec;
use core::mem::MaybeUninit;

/// Empty vector with room for `capacity` items, in huge pages if it is large enough and the system has them.
///
/// # Panics
/// If the capacity exceeds `isize::MAX` bytes, as [`Vec::with_capacity`] does.
pub fn vec_in_huge_pages<T>(capacity: usize) -> Vec<T> {
    let mut vec = Vec::with_capacity(capacity);
    prefer_huge_pages(vec.spare_capacity_mut());
    vec
}

/// Vector in huge pages whose items `write` fills in, in chunks of the given lengths.
///
/// Chunks can go to different threads, which then also share the work of clearing pages.
///
/// # Panics
/// If `write` leaves a chunk unfinished, or if the total exceeds `isize::MAX` bytes.
pub fn vec_of_chunks<T>(lens: Vec<usize>, write: &mut dyn FnMut(&mut [Slots<'_, T>])) -> Vec<T> {
    let count = lens.iter().sum();
    let mut vec = vec_in_huge_pages(count);
    let mut rest = &mut vec.spare_capacity_mut()[..count];
    let mut chunks = Vec::new();
    for len in lens {
        let (memory, others) = rest.split_at_mut(len);
        chunks.push(Slots { memory, written: 0 });
        rest = others;
    }
    write(&mut chunks);
    assert!(
        rest.is_empty()
            && chunks
                .iter()
                .all(|slots| slots.written == slots.memory.len()),
        "a chunk was not finished"
    );
    // SAFETY: the chunks cover exactly the first `count` places, and the assertion checked that all were written: only
    // `push` counts. `write` can swap chunks but not bring in foreign ones. No code outside this module can make or
    // own a `Slots`, and a `Slots` that another call lends has another lifetime.
    unsafe { vec.set_len(count) };
    vec
}

/// Chunk of an unfinished vector: places for items, written one after the other.
#[derive(Debug)]
pub struct Slots<'a, T> {
    memory: &'a mut [MaybeUninit<T>],
    written: usize,
}

impl<T> Slots<'_, T> {
    /// Writes the next item and returns a reference to its final place.
    ///
    /// # Panics
    /// If there is no place left.
    #[inline(always)]
    pub fn push(&mut self, item: T) -> &mut T {
        let item = self.memory[self.written].write(item);
        self.written += 1;
        item
    }
}

/// Requests huge pages. Call before the memory is first touched, because pages are assigned then.
#[cfg(all(feature = "std", target_os = "linux"))]
fn prefer_huge_pages<T>(memory: &mut [MaybeUninit<T>]) {
    /// Bytes below which memory hardly holds one huge page.
    const MIN_BYTES: usize = 2 << 20;
    /// Largest page size of any Linux system; its multiples are page boundaries on all of them.
    const PAGE: usize = 64 << 10;
    let range = memory.as_mut_ptr_range();
    let start = (range.start.addr()).next_multiple_of(PAGE);
    let end = range.end.addr() / PAGE * PAGE;
    if end.saturating_sub(start) >= MIN_BYTES {
        let start = range.start.with_addr(start);
        let bytes = end - start.addr();
        if cfg!(miri) {
            return; // Miri cannot call the system.
        }
        // SAFETY: the range is whole pages within memory that is borrowed exclusively, and the advice does not change
        // their contents. A refusal does no harm.
        unsafe { libc::madvise(start.cast(), bytes, libc::MADV_HUGEPAGE) };
    }
}

/// Does nothing: other systems choose page sizes themselves, and without the standard library there is no way to request them.
#[cfg(not(all(feature = "std", target_os = "linux")))]
fn prefer_huge_pages<T>(_memory: &mut [MaybeUninit<T>]) {}

#[cfg(test)]
mod tests {
    use alloc::string::String;
    use alloc::string::ToString;
    use alloc::vec;

    use super::*;

    /// Items of a large chunk; few under Miri, which is slow.
    const MANY: usize = if cfg!(miri) { 100 } else { 100_000 };

    #[test]
    #[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
    fn chunks_are_written_where_they_stand() {
        for lens in [&[][..], &[1], &[3, 0, 3, 2], &[MANY, 1, MANY]] {
            let vec = vec_of_chunks(lens.to_vec(), &mut |chunks| {
                assert_eq!(chunks.len(), lens.len());
                // In any order.
                std::thread::scope(|scope| {
                    for (index, slots) in chunks.iter_mut().enumerate().rev() {
                        let first: usize = lens[..index].iter().sum();
                        scope.spawn(move || {
                            for place in first..first + lens[index] {
                                let item = slots.push(String::new());
                                *item = place.to_string();
                            }
                        });
                    }
                });
            });
            let count = lens.iter().sum();
            assert!((0..count).eq(vec.iter().map(|item| item.parse().expect("a number"))));
        }
    }

    #[test]
    #[should_panic(expected = "a chunk was not finished")]
    fn unfinished_chunks_are_found() {
        vec_of_chunks(vec![2, 2, 1], &mut |chunks| {
            for slots in &mut chunks[..2] {
                slots.push(1);
                slots.push(2);
            }
        });
    }

    #[test]
    #[should_panic(expected = "out of bounds")]
    fn chunks_do_not_overflow() {
        vec_of_chunks(vec![2, 2], &mut |chunks| {
            for item in 0..3 {
                chunks[0].push(item);
            }
        });
    }

    #[test]
    fn it_is_an_ordinary_vector() {
        // 2.4 MB, enough to ask for huge pages. An interpreter has none, and would take minutes.
        let large = if cfg!(miri) { 3000 } else { 300_000 };
        for capacity in [0, 1, 1000, large] {
            let mut vec = vec_in_huge_pages(capacity);
            assert!(vec.capacity() >= capacity && vec.is_empty());
            let place = vec.as_ptr();
            vec.extend(0..capacity as u64);
            assert_eq!(vec.as_ptr(), place, "it was moved");
            assert!(vec.iter().copied().eq(0..capacity as u64));
        }
        // Items without size take no memory, so no advice is given.
        assert!(vec_in_huge_pages::<()>(usize::MAX).is_empty());
    }
}
