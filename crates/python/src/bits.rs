//! The class `BitMatrix`.

use antumbra_bake::BitMatrix as Bits;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayDyn, PyReadonlyArray2};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PySlice, PyTuple};

use crate::arrays::{Numbers, shaped};
use crate::bake::{each, failed};
use crate::memory;
use crate::saved::Reduced;

/// Answers of yes and no about every pair of two lists, one bit each.
///
/// ``matrix[i, j]`` is one answer, ``matrix[i]`` and ``matrix[i:j]`` are rows as bool arrays.
///
/// Parameters
/// ----------
/// words : array (rows, ceil(columns / 64)) of uint64
///     Bits: column ``j`` is bit ``j % 64`` of word ``j // 64`` of its row.
/// columns : int
///     Number of columns.
#[pyclass(frozen, module = "antumbra")]
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

    /// An index as Python has it: negative ones count from the end.
    fn index(index: isize, len: usize, what: &str) -> PyResult<usize> {
        let from_start = if index < 0 {
            index.saturating_add_unsigned(len)
        } else {
            index
        };
        match usize::try_from(from_start) {
            Ok(place) if place < len => Ok(place),
            _ => Err(PyIndexError::new_err(format!(
                "{what} {index} of a matrix with {len} {what}s"
            ))),
        }
    }
}

#[pymethods]
impl BitMatrix {
    #[new]
    fn new(words: PyReadonlyArray2<'_, u64>, columns: usize) -> PyResult<Self> {
        let words = words.as_array();
        let (rows, per_row) = words.dim();
        if per_row != columns.div_ceil(64) {
            return Err(crate::arrays::wrong_shape(
                "words",
                &[rows, per_row],
                &format!("(n, {}) for {columns} columns", columns.div_ceil(64)),
            ));
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
        let words = words.map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(words.into_pyarray(py))
    }

    /// Number of ones: of all, of each column (``axis=0``) or of each row (``axis=1``).
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

    /// Sum of the weights of the ones of each row: float64. There is one weight for each column.
    fn sums<'py>(
        &self,
        py: Python<'py>,
        weights: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let columns = self.bits.columns();
        let numbers = Numbers::read(weights, "weights", 1)?;
        if numbers.shape() != [columns] {
            let wanted = crate::arrays::shape_text(&[columns]);
            return Err(crate::arrays::wrong_shape(
                "weights",
                numbers.shape(),
                &wanted,
            ));
        }
        let weights = each(&numbers, columns)?;
        memory::check(self.bits.rows(), size_of::<f64>(), "sums")?;
        let sums = py.detach(|| self.bits.weighted_sums(&weights));
        Ok(PyArray1::from_vec(py, sums.map_err(failed)?))
    }

    /// All answers, or those of some rows: bool of shape (rows, columns), one byte each.
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

    /// All answers: bool of shape (rows, columns), one byte each.
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
        if index.is_instance_of::<PyTuple>() {
            let (row, column): (isize, isize) = index.extract()?;
            let (row, column) = (
                Self::index(row, rows, "row")?,
                Self::index(column, columns, "column")?,
            );
            let answer = self.bits.get(row, column).into_pyobject(py)?;
            return Ok(answer.to_owned().into_any());
        }
        let row = Self::index(index.extract()?, rows, "row")?;
        let answers = self.unpacked(std::iter::once(row))?;
        Ok(shaped(py, answers, &[columns])?.into_any())
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
        let (rows, columns) = self.shape();
        let ones = self.bits.count();
        format!("<antumbra.BitMatrix: {rows} rows, {columns} columns, {ones} ones>")
    }
}
