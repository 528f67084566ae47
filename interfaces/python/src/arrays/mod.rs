//! Arrays of callers, read where they lie: any leading shape, any stride, any kind of real number.
//!
//! - here: arrays;  `broadcast`: their leading shapes;  `memory`: lists that may not fit

pub mod broadcast;
pub mod memory;

use numpy::ndarray::{Array, IxDyn};
use numpy::{
    Element, PyArray, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyReadwriteArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice, PyTuple};

use broadcast::Operand;

use crate::errors::wrong;

/// Numbers of an argument, one after the other in memory, with the shape that the caller gave them.
pub struct Numbers<'py> {
    name: &'static str,
    memory: Memory<'py>,
    shape: Vec<usize>,
    /// Shape of the items in memory: 1 along axes along which the caller broadcast the array.
    held: Vec<usize>,
}

enum Memory<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>),
    F64(PyReadonlyArrayDyn<'py, f64>),
}

/// Numbers in memory.
#[derive(Clone, Copy)]
pub enum Values<'a> {
    F32(&'a [f32]),
    F64(&'a [f64]),
}

impl<'py> Numbers<'py> {
    /// Reads an argument of which every item has so many numbers: 3 for vectors, 1 for numbers, for which `item` is not an
    /// axis of its own.
    pub fn read(object: &Bound<'py, PyAny>, name: &'static str, item: usize) -> PyResult<Self> {
        let array = as_array(object, name)?;
        let mut shape = array.shape().to_vec();
        let item_axes = usize::from(item > 1);
        // An empty list.
        if item > 1 && shape == [0] {
            shape.push(item);
        }
        if item > 1 && shape.last() != Some(&item) {
            return Err(wrong_shape(name, &shape, &format!("(..., {item})")));
        }
        let lead = shape.len() - item_axes;
        let strides = array.strides();
        let is_repeated = |axis: usize| strides[axis] == 0 && shape[axis] > 1;
        let py = object.py();
        let array = if !array.is_empty() && (0..lead).any(is_repeated) {
            let first = |axis| match is_repeated(axis) {
                true => PySlice::new(py, 0, 1, 1),
                false => PySlice::full(py),
            };
            let held = PyTuple::new(py, (0..lead).map(first))?;
            as_array(&array.get_item(held)?, name)?
        } else {
            array
        };
        Ok(Self {
            name,
            held: array.shape()[..lead.min(array.shape().len())].to_vec(),
            memory: Memory::of(array, name)?,
            shape,
        })
    }

    /// Reads an argument of whole numbers, of any shape.
    pub fn whole(object: &Bound<'py, PyAny>, name: &'static str) -> PyResult<Self> {
        let array = as_array(object, name)?;
        if !matches!(array.dtype().kind(), b'i' | b'u') && !array.is_empty() {
            return Err(wrong_type(name, &array, "integers"));
        }
        Self::read(array.as_any(), name, 1)
    }

    pub fn values(&self) -> Values<'_> {
        match &self.memory {
            Memory::F32(array) => Values::F32(array.as_slice().unwrap_or_default()),
            Memory::F64(array) => Values::F64(array.as_slice().unwrap_or_default()),
        }
    }

    /// Shape without the axis of the item.
    pub fn lead(&self, item: usize) -> &[usize] {
        &self.shape[..self.shape.len() - usize::from(item > 1)]
    }

    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    pub fn is_f64(&self) -> bool {
        matches!(self.memory, Memory::F64(_))
    }

    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Shape of the items in memory, without the axis of the item: 1 along axes on which all items are one.
    pub fn held(&self) -> &[usize] {
        &self.held
    }

    /// One number for each of `count` things: of shape (count,), or one for all.
    pub fn each(&self, count: usize) -> PyResult<Vec<f64>> {
        if !self.shape.is_empty() && self.shape != [count] {
            let wanted = format!("() or ({count},)");
            return Err(wrong_shape(self.name, &self.shape, &wanted));
        }
        let operand = Operand::new(self, 1, &[count]);
        let all = (0..count).map(|place| operand.number(place));
        memory::collected(all, count, self.name)
    }

    /// The vectors, broadcast to a shape, in single precision.
    pub fn vectors(&self, shape: &[usize]) -> PyResult<Vec<[f32; 3]>> {
        let operand = Operand::new(self, 3, shape);
        let count = shape.iter().product();
        let vectors = (0..count).map(|place| operand.vector(place).map(|x| x as f32));
        memory::collected(vectors, count, self.name)
    }

    /// A grid of numbers in single precision, its height and its width. `what` names them where there is no memory.
    pub fn grid(&self, what: &str) -> PyResult<(Vec<f32>, usize, usize)> {
        let [height, width] = self.shape[..] else {
            return Err(wrong_shape(self.name, &self.shape, "(height, width)"));
        };
        let operand = Operand::new(self, 1, &self.shape);
        let values = (0..height * width).map(|place| operand.number(place) as f32);
        Ok((
            memory::collected(values, height * width, what)?,
            height,
            width,
        ))
    }

    /// Rows of an array of shape (n, 3).
    pub fn rows(&self) -> PyResult<usize> {
        match self.shape[..] {
            [rows, 3] => Ok(rows),
            _ => Err(wrong_shape(self.name, &self.shape, "(n, 3)")),
        }
    }
}

impl<'py> Memory<'py> {
    /// Brings numbers into order, and to one of two types.
    fn of(array: Bound<'py, PyUntypedArray>, name: &str) -> PyResult<Self> {
        let dtype = array.dtype();
        let (kind, size) = (dtype.kind(), dtype.itemsize());
        if !matches!(kind, b'f' | b'i' | b'u' | b'b') {
            return Err(wrong_type(name, &array, "real numbers"));
        }
        let to = if (kind, size) == (b'f', 4) {
            "f4"
        } else {
            "f8"
        };
        let array = in_order(array, to, kind == b'f' && matches!(size, 4 | 8))?;
        Ok(match to {
            "f4" => Self::F32(readonly(&array)?),
            _ => Self::F64(readonly(&array)?),
        })
    }
}

/// An array in C order and of a type: the same one if it is that already, as `is_of_type` says but for the order of bytes.
fn in_order<'py>(
    array: Bound<'py, PyUntypedArray>,
    to: &str,
    is_of_type: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let is_native = is_of_type && array.dtype().is_native_byteorder() != Some(false);
    if is_native && array.is_c_contiguous() && array.is_aligned() {
        return Ok(array.into_any());
    }
    let py = array.py();
    let options = PyDict::new(py);
    options.set_item("dtype", to)?;
    options.set_item("requirements", ("C", "A"))?;
    py.import("numpy")?
        .call_method("require", (array,), Some(&options))
}

/// Error about a type.
fn wrong_type(name: &str, array: &Bound<'_, PyUntypedArray>, wanted: &str) -> PyErr {
    match array.dtype().str() {
        Ok(found) => PyTypeError::new_err(format!("{name}: found dtype {found}, wanted {wanted}")),
        Err(error) => error,
    }
}

fn readonly<'py, T: Element>(array: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let array = array.cast::<PyArrayDyn<T>>()?;
    array.try_readonly().map_err(wrong)
}

/// The array that an argument is, or that numpy makes of it.
pub fn as_array<'py>(
    object: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let numpy = object.py().import("numpy")?;
    // What is masked is no number, whatever lies below.
    if object.hasattr("fill_value")? {
        let masked = numpy
            .getattr("ma")?
            .call_method1("count_masked", (object,))?;
        let masked: usize = masked.extract()?;
        if masked > 0 {
            return Err(PyValueError::new_err(format!(
                "{name}: {masked} numbers are masked; leave their rows out, or give .filled(numpy.nan)"
            )));
        }
    }
    if let Ok(array) = object.cast::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let known = ["__array__", "__array_interface__", "__array_struct__"];
    let mut is_known = false;
    for name in known {
        is_known |= object.hasattr(name)?;
    }
    // Tensors of some libraries are sequences of sequences to numpy, which takes them number by number.
    let made = match !is_known && object.hasattr("__dlpack__")? {
        true => numpy.call_method1("from_dlpack", (object,)),
        false => numpy.call_method1("asarray", (object,)),
    };
    let made = made.map_err(|error| {
        PyTypeError::new_err(format!("{name}: no array can be made of it: {error}"))
    })?;
    Ok(made.cast_into::<PyUntypedArray>()?)
}

/// A mask of 32 bits.
pub fn mask(number: f64) -> PyResult<u32> {
    match (0.0..=f64::from(u32::MAX)).contains(&number) {
        true => Ok(number as u32),
        false => Err(PyValueError::new_err(format!(
            "mask: found {number}, wanted 0 to {}",
            u32::MAX
        ))),
    }
}

/// Masks of so many things: none, one for all, or one for each.
pub fn masks(
    object: Option<&Bound<'_, PyAny>>,
    name: &'static str,
    count: usize,
) -> PyResult<Vec<u32>> {
    let Some(object) = object else {
        return Ok(Vec::new());
    };
    let numbers = Numbers::whole(object, name)?.each(count)?;
    numbers.into_iter().map(mask).collect()
}

/// Place of an index of Python, which counts from the end below 0; `None` beyond `len` items.
pub fn from_start(index: isize, len: usize) -> Option<usize> {
    let place = match index < 0 {
        true => index.saturating_add_unsigned(len),
        false => index,
    };
    usize::try_from(place).ok().filter(|&place| place < len)
}

/// Error about a shape.
pub fn wrong_shape(name: &str, found: &[usize], wanted: &str) -> PyErr {
    let found = shape_text(found);
    PyValueError::new_err(format!("{name}: found shape {found}, wanted {wanted}"))
}

/// A shape as Python writes it.
pub fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => {
            let axes: Vec<_> = shape.iter().map(usize::to_string).collect();
            format!("({})", axes.join(", "))
        }
    }
}

/// Triangles of a mesh: integers of shape (m, 3), each the number of one of `vertices` vertices.
pub fn read_faces(
    object: &Bound<'_, PyAny>,
    name: &'static str,
    vertices: usize,
) -> PyResult<Vec<[u32; 3]>> {
    let array = as_array(object, name)?;
    let dtype = array.dtype();
    let shape = array.shape().to_vec();
    // An empty list has the type of no number.
    if array.is_empty() && shape.last().is_none_or(|last| matches!(last, 0 | 3)) {
        return Ok(Vec::new());
    }
    if !matches!(dtype.kind(), b'i' | b'u') {
        return Err(wrong_type(name, &array, "integers"));
    }
    if !matches!(shape[..], [_, 3]) {
        return Err(wrong_shape(name, &shape, "(m, 3)"));
    }
    let to = match (dtype.kind(), dtype.itemsize()) {
        (b'i', 4) => "i4",
        (b'u', 4) => "u4",
        (b'u', 8) => "u8",
        _ => "i8",
    };
    let is_native = matches!(dtype.itemsize(), 4 | 8);
    let array = in_order(array, to, is_native)?;
    match to {
        "i4" => corners::<i32>(&array, name, vertices),
        "u4" => corners::<u32>(&array, name, vertices),
        "u8" => corners::<u64>(&array, name, vertices),
        _ => corners::<i64>(&array, name, vertices),
    }
}

fn corners<T: Element + Copy + TryInto<u32> + std::fmt::Display>(
    array: &Bound<'_, PyAny>,
    name: &str,
    vertices: usize,
) -> PyResult<Vec<[u32; 3]>> {
    let array = readonly::<T>(array)?;
    let numbers = array.as_slice().unwrap_or_default();
    let mut faces = memory::room(numbers.len() / 3, name)?;
    for (row, corners) in numbers.chunks_exact(3).enumerate() {
        let mut face = [0; 3];
        for (to, &from) in face.iter_mut().zip(corners) {
            *to = match from.try_into() {
                Ok(index) if (index as usize) < vertices => index,
                _ => {
                    return Err(pyo3::exceptions::PyIndexError::new_err(format!(
                        "{name}: row {row} names vertex {from}, but there are {vertices} vertices"
                    )));
                }
            };
        }
        faces.push(face);
    }
    Ok(faces)
}

/// Array of a shape that has as many items.
pub fn shaped<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let array = Array::from_shape_vec(IxDyn(shape), values);
    Ok(PyArray::from_owned_array(py, array.map_err(wrong)?))
}

/// The array that a caller wants answers in: of this type and shape, in C order.
pub fn output<'py, T: Element>(
    object: &Bound<'py, PyAny>,
    shape: &[usize],
    dtype: &str,
) -> PyResult<PyReadwriteArrayDyn<'py, T>> {
    let unfit = |found: String| {
        let wanted = shape_text(shape);
        PyValueError::new_err(format!(
            "out: found {found}, wanted a writeable array of {dtype} of shape {wanted}, in C order"
        ))
    };
    let Ok(array) = object.cast::<PyArrayDyn<T>>() else {
        let found = match object.cast::<PyUntypedArray>() {
            Ok(array) => format!("dtype {}", array.dtype().str()?),
            Err(_) => object.get_type().name()?.to_string(),
        };
        return Err(unfit(found));
    };
    if array.shape() != shape {
        return Err(unfit(format!("shape {}", shape_text(array.shape()))));
    }
    if !array.is_c_contiguous() {
        return Err(unfit("another order".to_owned()));
    }
    (array.try_readwrite()).map_err(|error| unfit(error.to_string()))
}
