//! Typed values in buffers. Offsets and counts of a file are believed only after they were checked
//! against the buffers, before anything is allocated.

use std::borrow::Cow;

use super::document::{Accessor, Document};

const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

/// The accessors of a file with their buffers.
pub(super) struct Accessors<'a> {
    document: &'a Document,
    buffers: &'a [Cow<'a, [u8]>],
}

/// The bytes of an accessor's elements.
struct Elements<'a> {
    bytes: &'a [u8],
    count: usize,
    size: usize,
    stride: usize,
}

impl<'a> Elements<'a> {
    /// Each element in turn.
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        let (bytes, size, stride) = (self.bytes, self.size, self.stride);
        (0..self.count).map(move |i| &bytes[i * stride..][..size])
    }
}

impl<'a> Accessors<'a> {
    pub fn new(document: &'a Document, buffers: &'a [Cow<'a, [u8]>]) -> Self {
        Self { document, buffers }
    }

    /// Vectors of three floats.
    pub fn vectors(&self, index: usize) -> Result<Vec<[f32; 3]>, String> {
        let accessor = self.accessor(index, "VEC3")?;
        if accessor.component_type != FLOAT {
            let kind = accessor.component_type;
            return Err(format!(
                "accessor {index} has component type {kind}; floats ({FLOAT}) are supported"
            ));
        }
        let elements = self.elements(index, accessor, 12)?;
        let float = |bytes: &[u8; 4]| f32::from_le_bytes(*bytes);
        let vector = |element: &[u8]| {
            let mut vector = [0.0; 3];
            for (value, bytes) in vector.iter_mut().zip(element.as_chunks::<4>().0) {
                *value = float(bytes);
            }
            vector
        };
        Ok(elements.iter().map(vector).collect())
    }

    /// Unsigned integers of any size.
    pub fn indices(&self, index: usize) -> Result<Vec<u32>, String> {
        let accessor = self.accessor(index, "SCALAR")?;
        let size = match accessor.component_type {
            UNSIGNED_BYTE => 1,
            UNSIGNED_SHORT => 2,
            UNSIGNED_INT => 4,
            kind => {
                return Err(format!(
                    "accessor {index} has component type {kind}, which indices cannot have"
                ));
            }
        };
        let elements = self.elements(index, accessor, size)?;
        let value = |element: &[u8]| {
            let mut bytes = [0; 4];
            bytes[..element.len()].copy_from_slice(element);
            u32::from_le_bytes(bytes)
        };
        Ok(elements.iter().map(value).collect())
    }

    fn accessor(&self, index: usize, shape: &str) -> Result<&'a Accessor, String> {
        let all = &self.document.accessors;
        let accessor = all
            .get(index)
            .ok_or_else(|| format!("accessor {index} is used, but there are {}", all.len()))?;
        if accessor.shape != shape {
            let found = &accessor.shape;
            return Err(format!("accessor {index} holds {found}, not {shape}"));
        }
        if accessor.sparse.is_some() {
            return Err(format!(
                "accessor {index} is sparse, which is not supported"
            ));
        }
        Ok(accessor)
    }

    /// Finds the elements of `size` bytes.
    fn elements(
        &self,
        index: usize,
        accessor: &Accessor,
        size: usize,
    ) -> Result<Elements<'a>, String> {
        let view_index = accessor
            .buffer_view
            .ok_or_else(|| format!("accessor {index} has no bufferView"))?;
        let views = &self.document.buffer_views;
        let view = views.get(view_index).ok_or_else(|| {
            format!(
                "bufferView {view_index} is used, but there are {}",
                views.len()
            )
        })?;
        let buffers = self.buffers.len();
        let buffer = self
            .buffers
            .get(view.buffer)
            .ok_or_else(|| format!("buffer {} is used, but there are {buffers}", view.buffer))?;
        let window = view
            .byte_offset
            .checked_add(view.byte_length)
            .and_then(|end| buffer.get(view.byte_offset..end))
            .ok_or_else(|| {
                let (offset, length) = (view.byte_offset, view.byte_length);
                let held = buffer.len();
                format!("bufferView {view_index} is {length} bytes from byte {offset}, but its buffer holds {held}")
            })?;
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size {
            return Err(format!(
                "bufferView {view_index} has a stride of {stride} for elements of {size} bytes"
            ));
        }
        let count = accessor.count;
        let needed = match count.checked_sub(1) {
            None => Some(0),
            Some(last) => last
                .checked_mul(stride)
                .and_then(|start| start.checked_add(size)),
        };
        let bytes = window
            .get(accessor.byte_offset..)
            .filter(|bytes| needed.is_some_and(|needed| needed <= bytes.len()))
            .ok_or_else(|| {
                let held = window.len();
                format!("accessor {index} has {count} elements, more than the {held} bytes of its bufferView hold")
            })?;
        Ok(Elements {
            bytes,
            count,
            size,
            stride,
        })
    }
}
