//! Buffers: memory of the library or of the client, and views of items in it.

use std::alloc::{Layout, alloc_zeroed, dealloc};
use std::ffi::c_void;
use std::sync::Arc;

use crate::abi::{ErrorCode, format};
use crate::device::{Device, Failure, Outcome, give, share};

/// Alignment of memory of the library.
const ALIGN: usize = 64;
/// Bytes behind the end, which clients may read with vectors.
const PADDING: usize = 16;

/// `RTCBuffer`.
pub struct Buffer {
    device: Arc<Device>,
    memory: *mut u8,
    size: usize,
    /// Of memory that belongs to the library.
    layout: Option<Layout>,
}

// SAFETY: the memory is only read, and written by the client, who must not write while others read.
unsafe impl Send for Buffer {}
// SAFETY: as above.
unsafe impl Sync for Buffer {}

impl Buffer {
    /// New memory, filled with zeros.
    pub fn new(device: Arc<Device>, size: usize) -> Outcome<Arc<Self>> {
        let out_of_memory = || Failure::new(ErrorCode::OutOfMemory, "a buffer is too large");
        let bytes = size.checked_add(PADDING).ok_or_else(out_of_memory)?;
        let layout = Layout::from_size_align(bytes, ALIGN).map_err(|_| out_of_memory())?;
        device.count_memory(bytes as isize)?;
        // SAFETY: the layout is not empty.
        let memory = unsafe { alloc_zeroed(layout) };
        if memory.is_null() {
            device.count_memory(-(bytes as isize))?;
            return Err(out_of_memory());
        }
        Ok(Arc::new(Self {
            device,
            memory,
            size,
            layout: Some(layout),
        }))
    }

    /// Memory of the client, who keeps it for as long as the buffer is used.
    pub fn shared(device: Arc<Device>, memory: *const c_void, size: usize) -> Arc<Self> {
        Arc::new(Self {
            device,
            memory: memory.cast_mut().cast(),
            size,
            layout: None,
        })
    }

    pub fn memory(&self) -> *mut u8 {
        self.memory
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if let Some(layout) = self.layout {
            // SAFETY: the memory was allocated with this layout.
            unsafe { dealloc(self.memory, layout) };
            // A monitor cannot refuse what goes.
            let _ = self.device.count_memory(-(layout.size() as isize));
        }
    }
}

/// Items in a buffer.
#[derive(Clone)]
pub struct View {
    buffer: Arc<Buffer>,
    pub format: u32,
    offset: usize,
    stride: usize,
    pub count: usize,
}

impl View {
    /// A view whose items are all inside the buffer and can be read as numbers of 4 bytes.
    pub fn new(
        buffer: Arc<Buffer>,
        format: u32,
        offset: usize,
        stride: usize,
        count: usize,
    ) -> Outcome<Self> {
        let size = format::size(format)
            .ok_or_else(|| Failure::operation(format!("format {format:#x} is not supported")))?;
        if !(buffer.memory.addr().wrapping_add(offset)).is_multiple_of(4)
            || !stride.is_multiple_of(4)
        {
            return Err(Failure::operation("data must be 4 bytes aligned"));
        }
        if count > u32::MAX as usize - 1 {
            return Err(Failure::argument("buffer too large"));
        }
        if stride > u32::MAX as usize {
            return Err(Failure::argument("stride too large"));
        }
        let end = count.checked_sub(1).map_or(Some(0), |last| {
            (last.checked_mul(stride)?.checked_add(offset)?).checked_add(size)
        });
        if end.is_none_or(|end| end > buffer.size) {
            return Err(Failure::argument(format!(
                "{count} items of {size} bytes at stride {stride} and offset {offset} do not fit into {} bytes",
                buffer.size
            )));
        }
        if buffer.memory.is_null() && count > 0 {
            return Err(Failure::argument("a buffer is null"));
        }
        Ok(Self {
            buffer,
            format,
            offset,
            stride,
            count,
        })
    }

    /// A view of memory of the client.
    pub fn shared(
        device: Arc<Device>,
        memory: *const c_void,
        format: u32,
        offset: usize,
        stride: usize,
        count: usize,
    ) -> Outcome<Self> {
        let size = format::size(format).unwrap_or(0);
        let all = offset.saturating_add(stride.saturating_mul(count).saturating_add(size));
        Self::new(
            Buffer::shared(device, memory, all),
            format,
            offset,
            stride,
            count,
        )
    }

    /// Start of the items.
    pub fn data(&self) -> *mut u8 {
        self.buffer.memory.wrapping_add(self.offset)
    }

    /// The first `N` numbers of an item, which has as many.
    #[inline]
    pub fn read<const N: usize, T: Number>(&self, index: usize) -> [T; N] {
        assert!(index < self.count, "item {index} of {}", self.count);
        debug_assert!(format::size(self.format).is_some_and(|size| size >= 4 * N));
        let place = self.data().wrapping_add(index * self.stride);
        // SAFETY: `new` has checked that the whole item lies in the buffer; any bits are a number.
        unsafe { place.cast::<[T; N]>().read_unaligned() }
    }

    /// Numbers of an item, as many as the format has.
    pub fn numbers(&self, index: usize) -> impl Iterator<Item = f32> + '_ {
        assert!(index < self.count, "item {index} of {}", self.count);
        let place = self.data().wrapping_add(index * self.stride).cast::<f32>();
        let count = format::size(self.format).unwrap_or(0) / 4;
        // SAFETY: as in `read`.
        (0..count).map(move |number| unsafe { place.wrapping_add(number).read_unaligned() })
    }
}

/// Numbers of 4 bytes.
pub trait Number: Copy {}
impl Number for f32 {}
impl Number for u32 {}

exports! {
    // There is one memory, for the host and the device.
    fn rtcNewBuffer | rtcNewBufferHostDevice(device: Device, size: usize) -> *const Buffer {
        Ok(give(Buffer::new(share(device)?, size)?))
    }

    fn rtcNewSharedBuffer | rtcNewSharedBufferHostDevice(device: Device, memory: *mut c_void, size: usize) -> *const Buffer {
        Ok(give(Buffer::shared(share(device)?, memory, size)))
    }

    fn rtcCommitBuffer(_buffer: Buffer) {
        Ok(())
    }

    fn rtcGetBufferData | rtcGetBufferDataDevice(buffer: Buffer) -> *mut c_void {
        Ok(buffer.memory.cast())
    }
}

handle! { Buffer: rtcRetainBuffer rtcReleaseBuffer }
