//! Buffers of geometries.

use super::*;

/// # Safety
/// Handles of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryBuffer(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    buffer: *const Buffer,
    offset: usize,
    stride: usize,
    count: usize,
) {
    // SAFETY: the caller's handles.
    unsafe {
        with(geometry, (), |geometry| {
            let buffer = share(buffer)?;
            if buffer.device().map(Device::id) != Some(geometry.device.id()) {
                return Err(Failure::argument("inputs are from different devices"));
            }
            let view = View::new(buffer, which, offset, stride, count)?;
            geometry.set_view(buffer_type, slot, which, view)
        })
    }
}

/// # Safety
/// A geometry of this library, or null; memory of so many items that lives as long as the geometry.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetSharedGeometryBuffer(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    memory: *const c_void,
    offset: usize,
    stride: usize,
    count: usize,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            let device = Arc::clone(&geometry.device);
            let view = View::shared(device, memory, which, offset, stride, count)?;
            geometry.set_view(buffer_type, slot, which, view)
        })
    }
}

/// # Safety
/// As [`rtcSetSharedGeometryBuffer`]. There is one memory, so `device_memory` must be null or the same.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetSharedGeometryBufferHostDevice(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    memory: *const c_void,
    device_memory: *const c_void,
    offset: usize,
    stride: usize,
    count: usize,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        if !device_memory.is_null() && device_memory != memory {
            return with(geometry, (), |_| {
                Err(Failure::argument("the device is no SYCL device: pass NULL"))
            });
        }
        rtcSetSharedGeometryBuffer(
            geometry,
            buffer_type,
            slot,
            which,
            memory,
            offset,
            stride,
            count,
        );
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetNewGeometryBuffer(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    stride: usize,
    count: usize,
) -> *mut c_void {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, std::ptr::null_mut(), |geometry| {
            if !stride.is_multiple_of(4) {
                return Err(Failure::operation("data must be 4 bytes aligned"));
            }
            let size =
                (stride.checked_mul(count)).ok_or_else(|| Failure::argument("buffer too large"))?;
            // The last item is whole, also where items overlap.
            let size = size.max(format::size(which).unwrap_or(0));
            let buffer = Buffer::new(Arc::clone(&geometry.device), size)?;
            let memory = buffer.memory();
            let view = View::new(buffer, which, 0, stride, count)?;
            geometry.set_view(buffer_type, slot, which, view)?;
            Ok(memory.cast())
        })
    }
}

/// # Safety
/// A geometry of this library, or null; places for the pointers, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetNewGeometryBufferHostDevice(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
    which: u32,
    stride: usize,
    count: usize,
    memory: *mut *mut c_void,
    device_memory: *mut *mut c_void,
) {
    // SAFETY: the caller's handle and places.
    unsafe {
        let data = rtcSetNewGeometryBuffer(geometry, buffer_type, slot, which, stride, count);
        for place in [memory, device_memory] {
            if let Some(place) = place.as_mut() {
                *place = data;
            }
        }
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryBufferData(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
) -> *mut c_void {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, std::ptr::null_mut(), |geometry| {
            Ok(geometry.state().view(buffer_type, slot)?.data().cast())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryBufferDataDevice(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
) -> *mut c_void {
    // SAFETY: as for the other.
    unsafe { rtcGetGeometryBufferData(geometry, buffer_type, slot) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcUpdateGeometryBuffer(
    geometry: *const Geometry,
    buffer_type: u32,
    slot: u32,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.state().view(buffer_type, slot)?;
            geometry.change(|_| Ok(()))
        })
    }
}
