//! Handles: pointers with a count of references, as C sees them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::device::Device;
use crate::failure::{Failure, Outcome};

/// What a handle points to.
pub trait Handle {
    /// The device to which failures are reported.
    fn device(&self) -> Option<&Device>;
}

/// Hands a reference out.
pub fn give<T>(value: Arc<T>) -> *const T {
    Arc::into_raw(value)
}

/// The value behind a handle.
///
/// # Safety
/// The pointer is null or a handle that lives as long as the reference is used.
#[inline]
pub unsafe fn look<'a, T>(handle: *const T) -> Outcome<&'a T> {
    // SAFETY: the caller vouches for handles that are not null.
    unsafe { handle.as_ref() }.ok_or_else(|| Failure::argument("a handle is null"))
}

/// Memory of the client.
///
/// # Safety
/// The pointer is null or to memory that only this thread uses during the call.
#[inline]
pub unsafe fn look_mut<'a, T>(memory: *mut T) -> Outcome<&'a mut T> {
    // SAFETY: the caller vouches for memory that is not null.
    unsafe { memory.as_mut() }.ok_or_else(|| Failure::argument("a pointer is null"))
}

/// One more reference to the value behind a handle.
///
/// # Safety
/// As [`look`].
pub unsafe fn share<T>(handle: *const T) -> Outcome<Arc<T>> {
    // SAFETY: as the caller vouches; handles come from `give`.
    unsafe {
        look(handle)?;
        Arc::increment_strong_count(handle);
        Ok(Arc::from_raw(handle))
    }
}

/// Counts one reference more.
///
/// # Safety
/// As [`look`].
pub unsafe fn retain<T>(handle: *const T) -> Outcome {
    // SAFETY: as the caller vouches.
    std::mem::forget(unsafe { share(handle)? });
    Ok(())
}

/// Gives one reference back. The value goes with the last one.
///
/// # Safety
/// As [`look`]; the handle has a reference to give back.
pub unsafe fn release<T>(handle: *const T) -> Outcome {
    // SAFETY: as the caller vouches.
    unsafe {
        look(handle)?;
        drop(Arc::from_raw(handle));
    }
    Ok(())
}

/// The device of a handle, to report to.
///
/// # Safety
/// As [`look`].
#[inline]
pub unsafe fn device_of<'a, T: Handle + 'a>(handle: *const T) -> Option<&'a Device> {
    // SAFETY: as the caller vouches.
    unsafe { handle.as_ref() }.and_then(Handle::device)
}

/// Locks, also after a panic of another thread: values behind locks are replaced as a whole.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
