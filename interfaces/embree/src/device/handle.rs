//! Handles: pointers with a count of references, as C sees them, and how functions that take them are declared.

use std::ffi::c_int;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use super::failure::{Failure, Outcome, record};
use super::{Device, INVALID};

/// What a handle points to.
pub trait Handle {
    /// The device to which failures are reported.
    fn device(&self) -> &Device;
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

/// As [`share`], of a value that must belong to this device.
///
/// # Safety
/// As [`look`].
pub unsafe fn share_on<T: Handle>(device: &Device, handle: *const T) -> Outcome<Arc<T>> {
    // SAFETY: as the caller vouches.
    let shared = unsafe { share(handle)? };
    if shared.device().id() == device.id() {
        Ok(shared)
    } else {
        Err(Failure::argument("inputs are from different devices"))
    }
}

/// Reports a failure: to the thread, and to the error function of the device if there is one.
#[cold]
pub fn report(device: Option<&Device>, failure: &Failure) {
    let text = record(device.map_or(0, Device::id), failure);
    if let Some(device) = device {
        device.call_error_function(failure.code as c_int, &text);
    }
}

/// What a function of the interface returns if it fails.
pub trait Otherwise {
    const OTHERWISE: Self;
}

macro_rules! otherwise {
    ($([$($parameter:ident)?] $type:ty: $value:expr;)*) => {$(
        impl$(<$parameter>)? Otherwise for $type {
            const OTHERWISE: Self = $value;
        }
    )*};
}

otherwise! {
    []  (): ();
    []  bool: false;
    []  c_int: 0;
    []  isize: 0;
    []  u32: INVALID;
    [T] *const T: std::ptr::null();
    [T] *mut T: std::ptr::null_mut();
}

/// Runs a call for a device. A failure or a panic is reported.
#[inline]
pub fn guarded<T: Otherwise>(device: Option<&Device>, call: impl FnOnce() -> Outcome<T>) -> T {
    // What a call holds when it panics is dropped, and locks that are poisoned are opened.
    let failure = match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(value)) => return value,
        Ok(Err(failure)) => failure,
        Err(panic) => Failure::from(panic.as_ref()),
    };
    report(device, &failure);
    T::OTHERWISE
}

/// Runs a call on a handle, and reports failures to its device.
///
/// # Safety
/// As [`look`].
#[inline]
pub unsafe fn with<H: Handle, T: Otherwise>(
    handle: *const H,
    call: impl FnOnce(&H) -> Outcome<T>,
) -> T {
    // SAFETY: as the caller vouches.
    unsafe { guarded(handle.as_ref().map(Handle::device), || call(look(handle)?)) }
}

/// Declares functions of the interface by what they do with the value behind their first argument. Names with a `|`
/// between them are the same function.
macro_rules! exports {
    () => {};
    (
        fn $name:ident($handle:ident: $type:ty $(, $argument:ident: $of:ty)* $(,)?) $(-> $answer:ty)? $call:block
        $($rest:tt)*
    ) => {
        /// # Safety
        /// Handles of this library, or null; memory and functions of the client as Embree documents them.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($handle: *const $type $(, $argument: $of)*) $(-> $answer)? {
            // SAFETY: the caller's handles and memory.
            unsafe { $crate::device::with($handle, |$handle| $call) }
        }
        exports! { $($rest)* }
    };
    (
        fn $name:ident | $($same:ident)|+ $arguments:tt $(-> $answer:ty)? $call:block
        $($rest:tt)*
    ) => {
        exports! { fn $name $arguments $(-> $answer)? $call }
        exports! { fn $($same)|+ $arguments $(-> $answer)? $call }
        exports! { $($rest)* }
    };
}

/// Declares a type of handles whose values have a field `device`.
macro_rules! handle {
    ($type:ty: $retain:ident $release:ident) => {
        impl $crate::device::Handle for $type {
            fn device(&self) -> &Device {
                &self.device
            }
        }

        references! { $type: $retain $release }
    };
}

/// Declares the functions that count references to handles of one type.
macro_rules! references {
    ($type:ty: $retain:ident $release:ident) => {
        exports! {
            fn $retain(handle: $type) {
                $crate::device::share(handle).map(std::mem::forget)
            }
        }

        /// # Safety
        /// A handle of this library with a reference to give back, or null.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $release(handle: *const $type) {
            $crate::device::guarded(None, || {
                // SAFETY: the caller's handle. The value goes with the last reference.
                unsafe {
                    $crate::device::look(handle)?;
                    drop(std::sync::Arc::from_raw(handle));
                }
                Ok(())
            })
        }
    };
}
