//! The class `BitMatrix`.

use antumbra_bake::BitMatrix as Bits;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayDyn, PyReadonlyArray2};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PySlice, PyTuple};

use crate::arrays::{Numbers, from_start, memory, shape_text, shaped, wrong_shape};
use crate::errors::{failed, wrong};
use crate::html::{self, percent};
use crate::scene::saved::Reduced;

/// Answers of yes and no about every pair of two lists, one bit each.
///
/// An index selects answers as in a bool array of numpy, and returns them as one: ``matrix[i, j]`` is one answer, ``matrix[i]`` a row,
/// ``matrix[:, j]`` a column. ``np.asarray(matrix)`` has all of them. ``&``, ``|``, ``^`` and ``~`` combine matrices of one shape.
///
/// Parameters
/// ----------
/// words : array (rows, ceil(columns / 64)) of uint64
///     Bits: column ``j`` is bit ``j % 64`` of word ``j // 64`` of its row.
/// columns : int
///     Number of columns.
///
/// Raises
/// ------
/// ValueError
///     An argument is outside its range, or has another shape.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> import numpy as np
/// >>> bits = am.BitMatrix(np.array([[0b011], [0b110]], np.uint64), 3)
/// >>> np.asarray(bits)
/// array([[ True,  True, False],
///        [False,  True,  True]])
/// >>> bits[:, 0], bits[1, 2]
/// (array([ True, False]), True)
#[pyclass(frozen, weakref, module = "antumbra")]
pub struct BitMatrix {
    bits: Bits,
}

impl From<Bits> for BitMatrix {
    fn from(bits: Bits) -> Self {
        Self { bits }
    }
}

impl BitMatrix {
    fn unpacked(&self, rows: impl ExactSizeIterator<Item = usize>) -> PyResult<Vec<bool>> {
        let columns = self.bits.columns();
        let answers = rows.len().saturating_mul(columns);
        let bits = rows.flat_map(|row| {
            let words = self.bits.row(row);
            (0..columns).map(move |column| words[column / 64] >> (column % 64) & 1 == 1)
        });
        memory::collected(bits, answers, "answers")
    }

    /// Answers of one column.
    fn column(
        &self,
        rows: impl ExactSizeIterator<Item = usize>,
        column: usize,
    ) -> PyResult<Vec<bool>> {
        let len = rows.len();
        memory::collected(rows.map(|row| self.bits.get(row, column)), len, "answers")
    }

    /// A matrix of the same shape, of words that `of` makes of the words of both.
    fn combined(
        slf: &Bound<'_, Self>,
        other: &Bound<'_, PyAny>,
        sign: &str,
        of: impl Fn(u64, u64) -> u64 + Send,
    ) -> PyResult<Py<PyAny>> {
        let py = slf.py();
        let Ok(other) = other.cast::<Self>() else {
            // Numpy combines bool arrays with what becomes one.
            return Ok(py.NotImplemented());
        };
        let (a, b) = (&slf.get().bits, &other.get().bits);
        if (a.rows(), a.columns()) != (b.rows(), b.columns()) {
            let shape = |bits: &Bits| shape_text(&[bits.rows(), bits.columns()]);
            return Err(PyValueError::new_err(format!(
                "{sign}: found matrices of shapes {} and {}, wanted one shape",
                shape(a),
                shape(b)
            )));
        }
        let words = a.words().iter().zip(b.words());
        let words = words.map(|(&a, &b)| of(a, b));
        let made = Self::made(a.rows(), a.columns(), words)?;
        Ok(Bound::new(py, made)?.into_any().unbind())
    }

    /// A matrix of words, whose bits behind the last column become 0.
    fn made(rows: usize, columns: usize, words: impl Iterator<Item = u64>) -> PyResult<Self> {
        let per_row = columns.div_ceil(64);
        let last = match columns % 64 {
            0 => u64::MAX,
            used => (1 << used) - 1,
        };
        let words = words
            .enumerate()
            .map(|(place, word)| match (place + 1) % per_row {
                0 => word & last,
                _ => word,
            });
        let words = memory::collected(words, rows * per_row, "words")?;
        Ok(Bits::from_words(rows, columns, words)
            .map_err(failed)?
            .into())
    }

    /// Share of ones, from 0 to 1; NaN without answers.
    fn share(&self) -> f64 {
        let (rows, columns) = (self.bits.rows() as f64, self.bits.columns() as f64);
        self.bits.count() as f64 / (rows * columns)
    }

    /// An index as Python has it: negative ones count from the end.
    fn index(index: isize, len: usize, what: &str) -> PyResult<usize> {
        from_start(index, len).ok_or_else(|| {
            PyIndexError::new_err(format!("{what} {index} of a matrix with {len} {what}s"))
        })
    }
}

#[pymethods]
impl BitMatrix {
    #[new]
    fn new(words: PyReadonlyArray2<'_, u64>, columns: usize) -> PyResult<Self> {
        let words = words.as_array();
        let (rows, per_row) = words.dim();
        if per_row != columns.div_ceil(64) {
            let wanted = format!("(n, {}) for {columns} columns", columns.div_ceil(64));
            return Err(wrong_shape("words", &[rows, per_row], &wanted));
        }
        let words = memory::collected(words.iter().copied(), words.len(), "words")?;
        Ok(Bits::from_words(rows, columns, words)
            .map_err(failed)?
            .into())
    }

    /// Rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.bits.rows(), self.bits.columns())
    }

    /// A copy of the bits: uint64 of shape (rows, ceil(columns / 64)). Column ``j`` is bit ``j % 64`` of word ``j // 64``.
    #[getter]
    fn words<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u64>>> {
        let shape = (self.bits.rows(), self.bits.words_per_row());
        let words = self.bits.words();
        let words = memory::collected(words.iter().copied(), words.len(), "words")?;
        let words = Array2::from_shape_vec(shape, words);
        Ok(words.map_err(wrong)?.into_pyarray(py))
    }

    /// Number of ones.
    ///
    /// Parameters
    /// ----------
    /// axis : 0, 1 or None
    ///     Of each column, of each row, or of all.
    ///
    /// Returns
    /// -------
    /// int or array of int64
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     The axis is another one.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> bits = am.BitMatrix(np.array([[0b011], [0b110]], np.uint64), 3)
    /// >>> bits.count(), bits.count(axis=0)
    /// (4, array([1, 2, 1]))
    #[pyo3(signature = (axis=None))]
    fn count<'py>(&self, py: Python<'py>, axis: Option<isize>) -> PyResult<Bound<'py, PyAny>> {
        let as_array = |counts: Vec<u64>| {
            let counts = counts.into_iter().map(|count| count as i64);
            PyArray1::from_vec(py, counts.collect()).into_any()
        };
        let check = |counts| memory::check(counts, size_of::<u64>(), "counts");
        match axis {
            None => Ok(self.bits.count().into_pyobject(py)?.into_any()),
            Some(0 | -2) => check(self.bits.columns())
                .map(|()| as_array(py.detach(|| self.bits.count_columns()))),
            Some(1 | -1) => {
                check(self.bits.rows()).map(|()| as_array(py.detach(|| self.bits.count_rows())))
            }
            Some(axis) => Err(PyValueError::new_err(format!(
                "axis: found {axis}, wanted 0, 1 or None"
            ))),
        }
    }

    /// Sum of the weights of the ones of each row.
    ///
    /// Parameters
    /// ----------
    /// weights : array (columns,)
    ///     One weight for each column.
    ///
    /// Returns
    /// -------
    /// array (rows,) of float64
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     An argument is outside its range, or has another shape.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> bits = am.BitMatrix(np.array([[0b011], [0b110]], np.uint64), 3)
    /// >>> bits.sums([1, 10, 100])
    /// array([ 11., 110.])
    fn sums<'py>(
        &self,
        py: Python<'py>,
        weights: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let columns = self.bits.columns();
        let numbers = Numbers::read(weights, "weights", 1)?;
        if numbers.shape() != [columns] {
            let wanted = shape_text(&[columns]);
            return Err(wrong_shape("weights", numbers.shape(), &wanted));
        }
        let weights = numbers.each(columns)?;
        memory::check(self.bits.rows(), size_of::<f64>(), "sums")?;
        let sums = py.detach(|| self.bits.weighted_sums(&weights));
        Ok(PyArray1::from_vec(py, sums.map_err(failed)?))
    }

    /// All answers, or the answers of some rows.
    ///
    /// Parameters
    /// ----------
    /// rows : slice, optional
    ///     Rows that are wanted: all.
    ///
    /// Returns
    /// -------
    /// array (rows, columns) of bool
    ///     One byte each.
    ///
    /// Raises
    /// ------
    /// MemoryError
    ///     There is no memory for them.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> bits = am.BitMatrix(np.array([[0b011], [0b110]], np.uint64), 3)
    /// >>> bits.unpack(slice(1, 2))
    /// array([[False,  True,  True]])
    #[pyo3(signature = (rows=None))]
    fn unpack<'py>(
        &self,
        py: Python<'py>,
        rows: Option<&Bound<'py, PySlice>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        let (all, columns) = self.shape();
        let (first, step, count) = match rows {
            None => (0, 1, all),
            Some(rows) => {
                let found = rows.indices(all as isize)?;
                (found.start, found.step, found.slicelength)
            }
        };
        let place = |index: usize| (first + index as isize * step) as usize;
        let answers = py.detach(|| self.unpacked((0..count).map(place)))?;
        shaped(py, answers, &[count, columns])
    }

    /// All answers.
    ///
    /// Returns
    /// -------
    /// array (rows, columns) of bool
    ///     One byte each.
    ///
    /// Raises
    /// ------
    /// MemoryError
    ///     There is no memory for them.
    ///
    /// Examples
    /// --------
    /// >>> import antumbra as am
    /// >>> import numpy as np
    /// >>> bits = am.BitMatrix(np.array([[0b011], [0b110]], np.uint64), 3)
    /// >>> bits.to_numpy().shape
    /// (2, 3)
    fn to_numpy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        self.unpack(py, None)
    }

    fn __getitem__<'py>(
        &self,
        py: Python<'py>,
        index: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (rows, columns) = self.shape();
        if let Ok(rows) = index.cast::<PySlice>() {
            return Ok(self.unpack(py, Some(rows))?.into_any());
        }
        if let Ok(row) = index.extract::<isize>() {
            let row = Self::index(row, rows, "row")?;
            let answers = self.unpacked(std::iter::once(row))?;
            return Ok(shaped(py, answers, &[columns])?.into_any());
        }
        if let Ok((row, column)) = index.extract::<(isize, isize)>() {
            let (row, column) = (
                Self::index(row, rows, "row")?,
                Self::index(column, columns, "column")?,
            );
            let answer = self.bits.get(row, column).into_pyobject(py)?;
            return Ok(answer.to_owned().into_any());
        }
        if let Ok((some, column)) = index.extract::<(Bound<'py, PySlice>, isize)>() {
            let column = Self::index(column, columns, "column")?;
            let found = some.indices(rows as isize)?;
            let place = |index: usize| (found.start + index as isize * found.step) as usize;
            let answers = py.detach(|| self.column((0..found.slicelength).map(place), column))?;
            let len = answers.len();
            return Ok(shaped(py, answers, &[len])?.into_any());
        }
        // Rows by a mask or by their numbers: the rest is numpy's.
        let is_pair = index.is_instance_of::<PyTuple>();
        let some = py.import("numpy")?.call_method1("asarray", (index,));
        if let (false, Ok(some)) = (is_pair, some) {
            let all = py.import("numpy")?.call_method1("arange", (rows,))?;
            let chosen = all.get_item(some)?;
            let shape: Vec<usize> = chosen.getattr("shape")?.extract()?;
            let chosen: Vec<usize> = chosen.call_method1("reshape", (-1,))?.extract()?;
            let answers = py.detach(|| self.unpacked(chosen.into_iter()))?;
            return Ok(shaped(py, answers, &[&shape[..], &[columns]].concat())?.into_any());
        }
        self.to_numpy(py)?.into_any().get_item(index)
    }

    /// All answers as an array, for ``np.asarray``.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if copy == Some(false) {
            return Err(PyValueError::new_err(
                "copy: found False, but bits become an array only by a copy; wanted True or None",
            ));
        }
        let array = self.to_numpy(py)?.into_any();
        match dtype {
            None => Ok(array),
            Some(dtype) => array.call_method1("astype", (dtype,)),
        }
    }

    /// Both: a matrix of the answers that are true in both.
    fn __and__(slf: &Bound<'_, Self>, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        Self::combined(slf, other, "&", |a, b| a & b)
    }

    fn __or__(slf: &Bound<'_, Self>, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        Self::combined(slf, other, "|", |a, b| a | b)
    }

    fn __xor__(slf: &Bound<'_, Self>, other: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        Self::combined(slf, other, "^", |a, b| a ^ b)
    }

    fn __invert__(&self) -> PyResult<Self> {
        let words = self.bits.words().iter().map(|&word| !word);
        Self::made(self.bits.rows(), self.bits.columns(), words)
    }

    /// The matrix with rows and columns exchanged.
    #[getter(T)]
    fn transposed(&self, py: Python<'_>) -> PyResult<Self> {
        let (rows, columns) = self.shape();
        memory::check(columns * rows.div_ceil(64), size_of::<u64>(), "words")?;
        let made = py.detach(|| {
            let mut made = Bits::new(columns, rows)?;
            for row in 0..rows {
                for column in antumbra_bake::ones(self.bits.row(row)) {
                    made.set(column, row, true);
                }
            }
            Ok(made)
        });
        Ok(made.map_err(failed)?.into())
    }

    /// Bytes of the bits.
    #[getter]
    fn nbytes(&self) -> usize {
        size_of_val(self.bits.words())
    }

    fn __sizeof__(&self) -> usize {
        size_of::<Self>() + self.nbytes()
    }

    fn __len__(&self) -> usize {
        self.bits.rows()
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        (other.cast::<Self>()).is_ok_and(|other| other.get().bits == self.bits)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Reduced<'py, (Bound<'py, PyArray2<u64>>, usize)> {
        let matrix = slf.get();
        let arguments = (matrix.words(slf.py())?, matrix.bits.columns());
        Ok((slf.get_type().into_any(), arguments))
    }

    fn __repr__(&self) -> String {
        let ((rows, columns), share) = (self.shape(), percent(self.share()));
        format!("<antumbra.BitMatrix: {rows} rows, {columns} columns, {share} ones>")
    }

    fn _repr_html_(&self) -> String {
        let (rows, columns) = self.shape();
        let ones = format!("{} ({})", self.bits.count(), percent(self.share()));
        let shape = shape_text(&[rows, columns]);
        let bytes = self.nbytes().to_string();
        html::table(
            "antumbra.BitMatrix",
            &[("shape", shape), ("ones", ones), ("bytes", bytes)],
        )
    }
}
