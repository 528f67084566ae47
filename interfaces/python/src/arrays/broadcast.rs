//! Arguments of different leading shapes, brought together by numpy's rule.

use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;

use super::{Numbers, Values, shape_text};

/// Where the item of a result lies in an argument.
#[derive(Clone, Debug, PartialEq)]
pub enum Index {
    /// At the same place.
    Each,
    /// There is one for all.
    One,
    /// Axes of the result, the last one first: their lengths, and how far apart items lie along them.
    Strided(Vec<(usize, usize)>),
}

impl Index {
    /// For an argument of shape `lead` in a result of shape `out`, to which it fits.
    pub fn new(lead: &[usize], out: &[usize]) -> Self {
        if lead.iter().all(|&len| len == 1) {
            return Self::One;
        }
        if lead == out {
            return Self::Each;
        }
        let missing = out.len() - lead.len();
        let mut step = 1;
        let mut axes: Vec<(usize, usize)> = Vec::new();
        for axis in (0..out.len()).rev() {
            let len = if axis < missing {
                1
            } else {
                lead[axis - missing]
            };
            let stride = if len == 1 { 0 } else { step };
            step *= len;
            match axes.last_mut() {
                _ if out[axis] == 1 => {}
                // The axis before goes on where this one ends.
                Some((before, its)) if stride == *before * *its => *before *= out[axis],
                _ => axes.push((out[axis], stride)),
            }
        }
        match axes[..] {
            [(_, 1)] => Self::Each,
            [(_, 0)] | [] => Self::One,
            _ => Self::Strided(axes),
        }
    }

    /// The axes, if there are two.
    pub fn pair(&self) -> Option<[(usize, usize); 2]> {
        match self {
            Self::Strided(axes) => axes[..].try_into().ok(),
            _ => None,
        }
    }

    #[inline(always)]
    pub fn at(&self, place: usize) -> usize {
        match self {
            Self::Each => place,
            Self::One => 0,
            Self::Strided(axes) => {
                let (mut rest, mut offset) = (place, 0);
                for &(len, stride) in axes {
                    offset += rest % len * stride;
                    rest /= len;
                }
                offset
            }
        }
    }
}

/// One argument of a call, with the place of its items.
pub struct Operand<'a> {
    pub values: Values<'a>,
    pub index: Index,
    /// Numbers from one item to the next.
    pub item: usize,
    /// Numbers of an item that are passed over.
    skipped: usize,
}

impl<'a> Operand<'a> {
    pub fn new(numbers: &'a Numbers<'_>, item: usize, out: &[usize]) -> Self {
        Self {
            values: numbers.values(),
            index: Index::new(numbers.held(), out),
            item,
            skipped: 0,
        }
    }

    /// The last numbers of each item, without some of the first.
    pub fn skip(self, skipped: usize) -> Self {
        Self { skipped, ..self }
    }

    /// Where the numbers of an item begin.
    #[inline(always)]
    pub fn place(&self, item: usize) -> usize {
        self.item * self.index.at(item) + self.skipped
    }

    #[inline(always)]
    pub fn vector(&self, place: usize) -> [f64; 3] {
        let first = self.place(place);
        match self.values {
            Values::F32(values) => [0, 1, 2].map(|axis| f64::from(values[first + axis])),
            Values::F64(values) => [0, 1, 2].map(|axis| values[first + axis]),
        }
    }

    /// The first four numbers of an item.
    pub fn row(&self, place: usize) -> [f64; 4] {
        let first = self.place(place);
        match self.values {
            Values::F32(values) => [0, 1, 2, 3].map(|column| f64::from(values[first + column])),
            Values::F64(values) => [0, 1, 2, 3].map(|column| values[first + column]),
        }
    }

    /// The first two numbers of an item.
    pub fn pair(&self, place: usize) -> [f64; 2] {
        let first = self.place(place);
        match self.values {
            Values::F32(values) => [0, 1].map(|axis| f64::from(values[first + axis])),
            Values::F64(values) => [0, 1].map(|axis| values[first + axis]),
        }
    }

    #[inline(always)]
    pub fn number(&self, place: usize) -> f64 {
        let at = self.place(place);
        match self.values {
            Values::F32(values) => f64::from(values[at]),
            Values::F64(values) => values[at],
        }
    }
}

/// Shape that arguments have together: each is given with the numbers of one item.
pub fn common_shape(arguments: &[(&Numbers<'_>, usize)]) -> PyResult<Vec<usize>> {
    let mut out: Vec<usize> = Vec::new();
    for (numbers, item) in arguments {
        let lead = numbers.lead(*item);
        while out.len() < lead.len() {
            out.insert(0, 1);
        }
        let first = out.len() - lead.len();
        for (axis, &len) in lead.iter().enumerate() {
            let here = &mut out[first + axis];
            if *here == 1 {
                *here = len;
            } else if len != 1 && len != *here {
                return Err(do_not_fit(arguments));
            }
        }
    }
    let count = out
        .iter()
        .try_fold(1usize, |count, &len| count.checked_mul(len));
    if count.is_none_or(|count| count > isize::MAX as usize / 64) {
        return Err(PyMemoryError::new_err(format!(
            "not enough memory for a result of shape {}",
            shape_text(&out)
        )));
    }
    Ok(out)
}

fn do_not_fit(arguments: &[(&Numbers<'_>, usize)]) -> PyErr {
    let all: Vec<_> = arguments
        .iter()
        .map(|(numbers, _)| format!("{} {}", numbers.name(), shape_text(numbers.shape())))
        .collect();
    PyValueError::new_err(format!(
        "shapes do not fit: found {}, wanted leading shapes that are equal, or 1 where they differ",
        all.join(", ")
    ))
}
