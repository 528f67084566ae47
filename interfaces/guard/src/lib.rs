//! A limit on the memory of a whole process: the last resort where no estimate knows what some input will need.
//!
//! # What happens at the limit
//!
//! A program that runs out of memory is killed by the system, or aborts without a word about the reason. With
//! [`Limited`] as its global allocator it says what happened and exits, with the code of a refused input. Nothing is
//! unwound: a panic would need memory, and an error could not be returned from inside a vector. Writing to the file
//! descriptor of standard error and `_exit` take neither memory nor locks, so they are sound at any allocation, on any
//! thread. Files that are replaced as a whole stay as they were.
//!
//! # Signals
//!
//! `signals.rs`: a program with this crate ignores SIGUSR1 from before `main` on, until it installs a handler.
//!
//! # What is counted
//!
//! Bytes that the program allocates are counted, which costs an addition. The count decides only when to query the system
//! for the resident size, because memory that was allocated and never touched takes no room.

mod signals;

use core::sync::atomic::{AtomicUsize, Ordering};
use std::alloc::{GlobalAlloc, Layout, System};

/// Bytes beyond the limit that a process may have: its code, its stacks, and what the system's allocator keeps.
const SLACK: usize = 48 << 20;
/// Growth beyond the limit after which the resident size is queried again.
const STEP: usize = 4 << 20;
/// Exit code at the limit: `EX_DATAERR`, as for inputs that are refused beforehand.
const TOO_LARGE: i32 = 65;
/// Exit code when the system has no memory.
const NO_MEMORY: i32 = 1;

/// Bytes that the program has allocated and not freed.
static ASKED: AtomicUsize = AtomicUsize::new(0);
/// Bytes that are allowed.
static LIMIT: AtomicUsize = AtomicUsize::new(usize::MAX);

/// Limits the memory of a process whose global allocator is [`Limited`].
pub fn set_limit(bytes: u64) {
    let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
    LIMIT.store(bytes, Ordering::Relaxed);
}

/// Memory that the process may take in bytes; `u64::MAX` without a limit.
pub fn limit() -> u64 {
    match LIMIT.load(Ordering::Relaxed) {
        usize::MAX => u64::MAX,
        bytes => bytes as u64,
    }
}

/// Bytes that the process has allocated and not freed, of which the system may have given fewer.
pub fn taken() -> u64 {
    ASKED.load(Ordering::Relaxed) as u64
}

/// The system's allocator with a limit, for `#[global_allocator]`.
///
/// The process exits with a message when its resident memory would pass the limit of [`set_limit`] by more than some
/// tens of megabytes, and when the system has no memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limited;

// SAFETY: every call goes to the system's allocator with the arguments of the caller, who keeps the contract of
// `GlobalAlloc`. The counting around it neither allocates nor unwinds.
unsafe impl GlobalAlloc for Limited {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the contract is the caller's.
        checked(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the contract is the caller's.
        checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline]
    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        ASKED.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the contract is the caller's.
        unsafe { System.dealloc(place, layout) }
    }

    #[inline]
    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        match size.checked_sub(layout.size()) {
            Some(more) => grow(more),
            None => {
                ASKED.fetch_sub(layout.size() - size, Ordering::Relaxed);
            }
        }
        // SAFETY: the contract is the caller's.
        checked(unsafe { System.realloc(place, layout, size) }, size)
    }
}

#[inline]
fn grow(bytes: usize) {
    let before = ASKED.fetch_add(bytes, Ordering::Relaxed);
    if before.saturating_add(bytes) > LIMIT.load(Ordering::Relaxed) {
        check(before, bytes);
    }
}

/// Exits if the process takes more resident memory than is allowed. Called when it has allocated more than that.
#[cold]
fn check(before: usize, bytes: usize) {
    if before / STEP == before.saturating_add(bytes) / STEP {
        return;
    }
    let allowed = LIMIT.load(Ordering::Relaxed);
    let taken = resident().unwrap_or(before).saturating_add(bytes);
    if taken > allowed.saturating_add(SLACK) {
        let text = [
            "error: the work needs ",
            " MiB of memory, more than the ",
            " MiB allowed; leave something out, or allow more with --max-memory\n",
        ];
        exit(text, [taken, allowed].map(|bytes| bytes >> 20), TOO_LARGE);
    }
}

#[inline]
fn checked(place: *mut u8, bytes: usize) -> *mut u8 {
    if place.is_null() {
        let text = [
            "error: the system has no memory for ",
            " bytes more; ",
            " MiB are in use\n",
        ];
        let taken = resident().unwrap_or(ASKED.load(Ordering::Relaxed));
        exit(text, [bytes, taken >> 20], NO_MEMORY);
    }
    place
}

/// Writes texts and numbers in turn to standard error, and ends the process.
#[cold]
fn exit([before, between, after]: [&str; 3], [first, second]: [usize; 2], code: i32) -> ! {
    let mut line = Line::default();
    line.text(before);
    line.number(first);
    line.text(between);
    line.number(second);
    line.text(after);
    line.write_and_exit(code)
}

/// A line of text that takes no memory.
struct Line {
    bytes: [u8; 256],
    len: usize,
}

impl Default for Line {
    fn default() -> Self {
        Self {
            bytes: [0; 256],
            len: 0,
        }
    }
}

impl Line {
    fn text(&mut self, text: &str) {
        for &byte in text.as_bytes() {
            if let Some(place) = self.bytes.get_mut(self.len) {
                *place = byte;
                self.len += 1;
            }
        }
    }

    fn number(&mut self, number: usize) {
        let mut digits = [0; 20];
        let mut rest = number;
        let mut first = digits.len();
        loop {
            first -= 1;
            digits[first] = b'0' + (rest % 10) as u8;
            rest /= 10;
            if rest == 0 {
                break;
            }
        }
        self.text(core::str::from_utf8(&digits[first..]).unwrap_or_default());
    }

    fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }

    #[cfg(target_os = "linux")]
    fn write_and_exit(&self, code: i32) -> ! {
        let bytes = self.as_bytes();
        // SAFETY: `write` reads the bytes of a live slice, and `_exit` takes a number.
        unsafe {
            libc::write(libc::STDERR_FILENO, bytes.as_ptr().cast(), bytes.len());
            libc::_exit(code)
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn write_and_exit(&self, code: i32) -> ! {
        use std::io::Write;
        // Standard error has no buffer.
        let _ = std::io::stderr().write_all(self.as_bytes());
        std::process::exit(code)
    }
}

/// Resident memory of the process in bytes, if the system reports it.
#[cfg(target_os = "linux")]
fn resident() -> Option<usize> {
    let mut text = [0_u8; 128];
    // SAFETY: the path ends in a zero, `read` writes at most the length of a live array, and the descriptor is closed
    // once. None of the calls allocates.
    let (len, page) = unsafe {
        let file = libc::open(
            c"/proc/self/statm".as_ptr(),
            libc::O_RDONLY | libc::O_CLOEXEC,
        );
        if file < 0 {
            return None;
        }
        let len = libc::read(file, text.as_mut_ptr().cast(), text.len());
        libc::close(file);
        (len, libc::sysconf(libc::_SC_PAGESIZE))
    };
    let text = text.get(..usize::try_from(len).ok()?)?;
    let pages = core::str::from_utf8(text).ok()?.split(' ').nth(1)?;
    Some(pages.parse::<usize>().ok()? * usize::try_from(page).ok()?)
}

#[cfg(not(target_os = "linux"))]
fn resident() -> Option<usize> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_written_without_memory() {
        let mut line = Line::default();
        line.text("a ");
        line.number(0);
        line.text(" b ");
        line.number(usize::MAX);
        assert_eq!(line.as_bytes(), format!("a 0 b {}", usize::MAX).as_bytes());
        line.text(&"x".repeat(1000));
        assert_eq!(line.as_bytes().len(), 256);
    }

    #[test]
    #[cfg(all(target_os = "linux", not(miri)))]
    fn the_resident_size_grows_with_touched_memory() {
        let before = resident().expect("a size");
        let touched = vec![1_u8; 64 << 20];
        let after = resident().expect("a size");
        assert!(after >= before + (48 << 20), "{before} to {after}");
        drop(touched);
    }

    #[test]
    fn memory_is_that_of_the_system() {
        let layout = Layout::from_size_align(1000, 64).expect("a layout");
        // SAFETY: the place is written within its size, and given back once with the layout that it has.
        unsafe {
            let place = Limited.alloc_zeroed(layout);
            assert!(place.addr().is_multiple_of(64) && *place.add(999) == 0);
            place.write(7);
            let place = Limited.realloc(place, layout, 5000);
            assert_eq!(*place, 7);
            Limited.dealloc(place, Layout::from_size_align(5000, 64).expect("a layout"));
        }
        assert_eq!(limit(), u64::MAX);
    }
}
