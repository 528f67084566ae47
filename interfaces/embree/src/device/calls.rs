//! Functions of devices.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::Arc;

use super::config::property;
use super::failure::{Failure, last_text, take};
use super::{Callback, Device, give, guarded, lock};
use crate::abi::{ErrorFunction, MemoryFunction};

/// # Safety
/// `config` is null or a text that ends with 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcNewDevice(config: *const c_char) -> *const Device {
    guarded(None, || {
        let config = if config.is_null() {
            ""
        } else {
            // SAFETY: the caller's text.
            (unsafe { CStr::from_ptr(config) }.to_str())
                .map_err(|_| Failure::argument("the configuration is not UTF-8"))?
        };
        Ok(give(Arc::new(Device::new(config)?)))
    })
}

references! { Device: rtcRetainDevice rtcReleaseDevice }

exports! {
    fn rtcGetDeviceProperty(_device: Device, which: c_int) -> isize {
        property(which)
    }

    fn rtcSetDeviceProperty(_device: Device, _which: c_int, _value: isize) {
        Err(Failure::argument("unknown writable property"))
    }

    fn rtcSetDeviceErrorFunction(device: Device, function: Option<ErrorFunction>, user: *mut c_void) {
        *lock(&device.error) = function.map(|function| Callback { function, user });
        Ok(())
    }

    fn rtcSetDeviceMemoryMonitorFunction(device: Device, function: Option<MemoryFunction>, user: *mut c_void) {
        *lock(&device.memory) = function.map(|function| Callback { function, user });
        Ok(())
    }
}

/// Number of a device, and 0 of none.
///
/// # Safety
/// A device of this library, or null.
unsafe fn id(device: *const Device) -> u64 {
    // SAFETY: the caller's handle.
    unsafe { device.as_ref() }.map_or(0, Device::id)
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetDeviceError(device: *const Device) -> c_int {
    // SAFETY: the caller's handle.
    take(unsafe { id(device) }) as c_int
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetDeviceLastErrorMessage(device: *const Device) -> *const c_char {
    // SAFETY: the caller's handle.
    last_text(unsafe { id(device) })
}

#[unsafe(no_mangle)]
pub extern "C" fn rtcGetErrorString(code: c_int) -> *const c_char {
    match code {
        0 => c"RTC_ERROR_NONE",
        1 => c"RTC_ERROR_UNKNOWN",
        2 => c"RTC_ERROR_INVALID_ARGUMENT",
        3 => c"RTC_ERROR_INVALID_OPERATION",
        4 => c"RTC_ERROR_OUT_OF_MEMORY",
        5 => c"RTC_ERROR_UNSUPPORTED_CPU",
        6 => c"RTC_ERROR_CANCELLED",
        7 => c"RTC_ERROR_LEVEL_ZERO_RAYTRACING_SUPPORT_MISSING",
        _ => c"Invalid error code",
    }
    .as_ptr()
}
