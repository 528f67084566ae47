//! Scenes from files.

use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;

use antumbra::LocalOrigin;
use antumbra_load::{Options, Warning, load};
use antumbra_render::Lowered;
use pyo3::exceptions::{PyFileNotFoundError, PyUserWarning, PyValueError};
use pyo3::prelude::*;

use super::parts::{Part, Parts};

/// What a file holds, instances as they are.
pub fn read(py: Python<'_>, path: &Path) -> PyResult<Parts> {
    let loaded = py.detach(|| load(path, &Options::default()));
    let loaded = loaded.map_err(|error| unreadable(path, &error))?;
    warn(py, &loaded.warnings)?;
    py.detach(|| {
        let lowered = Lowered::new(&loaded.scene);
        let mut parts = Parts::default();
        let mut add = |list: &[antumbra::Geometry<'_>]| -> Vec<u32> {
            let first = parts.parts.len() as u32;
            let list = list.iter().map(Part::from).map(Arc::new);
            parts.parts.extend(list);
            (first..parts.parts.len() as u32).collect()
        };
        let world = add(&lowered.world);
        let objects = lowered.objects.iter().map(|object| add(object)).collect();
        parts.local = LocalOrigin {
            origin: loaded.scene.origin.into(),
        };
        parts.world = world;
        parts.objects = objects;
        parts.instances = lowered.instances;
        Ok(parts)
    })
}

/// Passes the reader's warnings on to Python's `warnings`.
pub fn warn(py: Python<'_>, warnings: &[Warning]) -> PyResult<()> {
    for Warning { place, text } in warnings {
        // No text of ours has a zero byte; names in files may.
        let text = format!("{place}: {text}").replace('\0', "?");
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(text)?, 1)?;
    }
    Ok(())
}

/// Exception for a scene that cannot be read.
pub fn unreadable(path: &Path, error: &antumbra_load::Error) -> PyErr {
    let is_missing = !path.exists() && !path.to_string_lossy().starts_with("builtin:");
    match is_missing {
        true => PyFileNotFoundError::new_err(error.to_string()),
        false => PyValueError::new_err(error.to_string()),
    }
}
