//! Numbers in buffers: plain, normalized, quantized, sparse, or all zero.

use std::borrow::Cow;

use gltf::accessor::sparse::IndexType;
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::View;
use gltf::{Accessor, Semantic};

/// Kinds of numbers that an attribute may have, and what integers mean.
#[derive(Clone, Copy)]
pub(super) enum Numbers {
    /// Lengths and directions: floats, or integers of `KHR_mesh_quantization`, which may be normalized.
    Quantized,
    /// Fractions of 1. Integers are normalized.
    Fractions,
    /// Whole numbers.
    Whole,
    /// Floats.
    Floats,
}

impl Numbers {
    fn types(self) -> &'static [DataType] {
        use DataType::{F32, I8, I16, U8, U16, U32};
        match self {
            Self::Quantized => &[I8, U8, I16, U16, F32],
            Self::Fractions => &[U8, U16, F32],
            Self::Whole => &[U8, U16, U32],
            Self::Floats => &[F32],
        }
    }

    /// Kind of the numbers of an attribute.
    pub fn of(name: &Semantic, is_quantized: bool) -> Self {
        match name {
            Semantic::TexCoords(_) if !is_quantized => Self::Fractions,
            Semantic::Colors(_) | Semantic::Weights(_) => Self::Fractions,
            Semantic::Joints(_) => Self::Whole,
            _ => Self::Quantized,
        }
    }
}

/// Value of a number in a buffer, as it is.
fn plain(kind: DataType, bytes: &[u8]) -> f64 {
    fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
        bytes.first_chunk().copied().unwrap_or([0; N])
    }
    match kind {
        DataType::I8 => i8::from_le_bytes(first(bytes)).into(),
        DataType::U8 => u8::from_le_bytes(first(bytes)).into(),
        DataType::I16 => i16::from_le_bytes(first(bytes)).into(),
        DataType::U16 => u16::from_le_bytes(first(bytes)).into(),
        DataType::U32 => u32::from_le_bytes(first(bytes)).into(),
        DataType::F32 => f32::from_le_bytes(first(bytes)).into(),
    }
}

/// Largest value of an integer, which is 1 where it is normalized.
fn largest(kind: DataType) -> f64 {
    match kind {
        DataType::I8 => i8::MAX.into(),
        DataType::U8 => u8::MAX.into(),
        DataType::I16 => i16::MAX.into(),
        DataType::U16 => u16::MAX.into(),
        DataType::U32 | DataType::F32 => 1.0,
    }
}

/// Reads the elements of an accessor, of `N` numbers each. What neither a view nor a sparse list gives is 0.
///
/// The crate checks neither kinds nor ends, and reads no accessor without a view.
pub(super) fn read<const N: usize, T>(
    buffers: &[Cow<'_, [u8]>],
    accessor: &Accessor,
    dimensions: Dimensions,
    numbers: Numbers,
    make: impl Fn([f64; N]) -> T,
) -> Result<Vec<T>, String> {
    let index = accessor.index();
    let (found, kind) = (accessor.dimensions(), accessor.data_type());
    if found != dimensions || !numbers.types().contains(&kind) {
        let types = numbers.types();
        return Err(format!(
            "accessor {index} holds {found:?} of {kind:?}, not {dimensions:?} of {types:?}"
        ));
    }
    let is_fraction = match numbers {
        Numbers::Quantized => accessor.normalized(),
        Numbers::Fractions => true,
        Numbers::Whole | Numbers::Floats => false,
    };
    let one = if is_fraction { largest(kind) } else { 1.0 };
    let element = |bytes: &[u8]| {
        let mut values = bytes.chunks_exact(kind.size());
        make([(); N].map(|()| {
            let value = values.next().map_or(0.0, |bytes| plain(kind, bytes));
            (value / one).max(if is_fraction { -1.0 } else { f64::NEG_INFINITY })
        }))
    };
    let (size, count) = (accessor.size(), accessor.count());
    // Checked before the elements are read.
    let changes = changes(buffers, accessor)?;
    let mut elements: Vec<T> = match accessor.view() {
        Some(view) => {
            let place = (accessor.offset(), count, size);
            let rows = rows(buffers, &view, index, place, None)?;
            rows.map(element).collect()
        }
        None => {
            let mut zeros = Vec::new();
            let room = zeros.try_reserve_exact(count);
            room.map_err(|error| format!("accessor {index} has {count} elements: {error}"))?;
            zeros.extend((0..count).map(|_| element(&[])));
            zeros
        }
    };
    for (place, value) in changes.into_iter().flatten() {
        let slot = elements.get_mut(place).ok_or_else(|| {
            format!(
                "accessor {index} has {count} elements, but its sparse list changes element {place}"
            )
        })?;
        *slot = element(value);
    }
    Ok(elements)
}

/// Elements that the sparse list of an accessor changes, with their bytes.
fn changes<'a>(
    buffers: &'a [Cow<'_, [u8]>],
    accessor: &Accessor,
) -> Result<Option<impl Iterator<Item = (usize, &'a [u8])> + use<'a>>, String> {
    let Some(sparse) = accessor.sparse() else {
        return Ok(None);
    };
    let (from, to) = (sparse.indices(), sparse.values());
    let kind = match from.index_type() {
        IndexType::U8 => DataType::U8,
        IndexType::U16 => DataType::U16,
        IndexType::U32 => DataType::U32,
    };
    let list = [
        (from.view(), from.offset(), kind.size()),
        (to.view(), to.offset(), accessor.size()),
    ];
    let [places, values] = list.map(|(view, offset, size)| {
        let place = (offset, sparse.count(), size);
        rows(buffers, &view, accessor.index(), place, Some(size))
    });
    let places = places?.map(move |place| plain(kind, place) as usize);
    Ok(Some(places.zip(values?)))
}

/// Rows of a view for an accessor, all within their buffer: from an offset, so many, of so many bytes. `stride` is the
/// distance of rows, if it is not the view's own.
fn rows<'a>(
    buffers: &'a [Cow<'_, [u8]>],
    view: &View,
    accessor: usize,
    (start, count, size): (usize, usize, usize),
    stride: Option<usize>,
) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, String> {
    let (index, offset, length) = (view.index(), view.offset(), view.length());
    let buffer = buffers.get(view.buffer().index()).map_or(&[][..], |b| b);
    let held = buffer.len();
    let end = offset.checked_add(length);
    let bytes = end.and_then(|end| buffer.get(offset..end)).ok_or_else(|| {
        format!("bufferView {index} has {length} bytes from byte {offset}, but its buffer has only {held}")
    })?;
    let stride = stride.or(view.stride()).unwrap_or(size);
    if stride < size {
        return Err(format!(
            "bufferView {index} has a stride of {stride} bytes, less than its elements of {size} bytes"
        ));
    }
    let end = count.checked_sub(1).map_or(Some(0), |last| {
        let last = last.checked_mul(stride)?;
        last.checked_add(start)?.checked_add(size)
    });
    if end.is_none_or(|end| end > length) {
        return Err(format!(
            "accessor {accessor} has {count} elements, more than fit in the {length} bytes of its bufferView"
        ));
    }
    let bytes = bytes.get(start..).unwrap_or_default();
    Ok((0..count).map(move |row| &bytes[row * stride..][..size]))
}
