//! Errors of other crates as exceptions.

use std::fmt::Display;

use pyo3::exceptions::{PyIndexError, PyMemoryError, PyOSError, PyValueError};
use pyo3::prelude::*;

/// A `ValueError` with the words of an error.
pub fn wrong(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Exception for an error of the kernel.
pub fn raised(error: antumbra::Error) -> PyErr {
    use antumbra::Error;
    match error {
        Error::IndexOutOfRange { .. } | Error::ObjectOutOfRange { .. } => {
            PyIndexError::new_err(error.to_string())
        }
        Error::Io { .. } => PyOSError::new_err(error.to_string()),
        Error::OutOfMemory { .. } => PyMemoryError::new_err(error.to_string()),
        _ => wrong(error),
    }
}

/// Exception for an error of a bake.
pub fn failed(error: antumbra_bake::Error) -> PyErr {
    use antumbra_bake::Error;
    match error {
        Error::TooLarge { .. } | Error::NoMemory { .. } => {
            PyMemoryError::new_err(error.to_string())
        }
        _ => wrong(error),
    }
}
