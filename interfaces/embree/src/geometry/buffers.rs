//! Buffers of geometries.

use std::ffi::c_void;
use std::sync::Arc;

use super::Geometry;
use super::buffer::{Buffer, View};
use crate::abi::format;
use crate::device::{Failure, Outcome, share_on};

impl Geometry {
    /// Makes memory for a buffer, and returns it.
    fn new_buffer(
        &self,
        buffer_type: u32,
        slot: u32,
        which: u32,
        stride: usize,
        count: usize,
    ) -> Outcome<*mut c_void> {
        if !stride.is_multiple_of(4) {
            return Err(Failure::operation("data must be 4 bytes aligned"));
        }
        let size =
            (stride.checked_mul(count)).ok_or_else(|| Failure::argument("buffer too large"))?;
        // The last item is whole, also where items overlap.
        let size = size.max(format::size(which).unwrap_or(0));
        let buffer = Buffer::new(Arc::clone(&self.device), size)?;
        let memory = buffer.memory();
        let view = View::new(buffer, which, 0, stride, count)?;
        self.set_view(buffer_type, slot, which, view)?;
        Ok(memory.cast())
    }
}

exports! {
    fn rtcSetGeometryBuffer(
        geometry: Geometry,
        buffer_type: u32,
        slot: u32,
        which: u32,
        buffer: *const Buffer,
        offset: usize,
        stride: usize,
        count: usize,
    ) {
        let buffer = share_on(&geometry.device, buffer)?;
        let view = View::new(buffer, which, offset, stride, count)?;
        geometry.set_view(buffer_type, slot, which, view)
    }

    fn rtcSetSharedGeometryBuffer(
        geometry: Geometry,
        buffer_type: u32,
        slot: u32,
        which: u32,
        memory: *const c_void,
        offset: usize,
        stride: usize,
        count: usize,
    ) {
        let device = Arc::clone(&geometry.device);
        let view = View::shared(device, memory, which, offset, stride, count)?;
        geometry.set_view(buffer_type, slot, which, view)
    }

    // There is one memory, so that of the device must be null or the same.
    fn rtcSetSharedGeometryBufferHostDevice(
        geometry: Geometry,
        buffer_type: u32,
        slot: u32,
        which: u32,
        memory: *const c_void,
        device_memory: *const c_void,
        offset: usize,
        stride: usize,
        count: usize,
    ) {
        if !device_memory.is_null() && device_memory != memory {
            return Err(Failure::argument("the device is no SYCL device: pass NULL"));
        }
        rtcSetSharedGeometryBuffer(geometry, buffer_type, slot, which, memory, offset, stride, count);
        Ok(())
    }

    fn rtcSetNewGeometryBuffer(
        geometry: Geometry,
        buffer_type: u32,
        slot: u32,
        which: u32,
        stride: usize,
        count: usize,
    ) -> *mut c_void {
        geometry.new_buffer(buffer_type, slot, which, stride, count)
    }

    // Places for the pointers may be null.
    fn rtcSetNewGeometryBufferHostDevice(
        geometry: Geometry,
        buffer_type: u32,
        slot: u32,
        which: u32,
        stride: usize,
        count: usize,
        memory: *mut *mut c_void,
        device_memory: *mut *mut c_void,
    ) {
        let made = geometry.new_buffer(buffer_type, slot, which, stride, count);
        for place in [memory, device_memory] {
            if let Some(place) = place.as_mut() {
                *place = *made.as_ref().unwrap_or(&std::ptr::null_mut());
            }
        }
        made.map(|_| ())
    }

    fn rtcGetGeometryBufferData | rtcGetGeometryBufferDataDevice(
        geometry: Geometry,
        buffer_type: u32,
        slot: u32,
    ) -> *mut c_void {
        Ok(geometry.state().view(buffer_type, slot)?.data().cast())
    }

    fn rtcUpdateGeometryBuffer(geometry: Geometry, buffer_type: u32, slot: u32) {
        geometry.state().view(buffer_type, slot).map(|_| ())
    }
}
