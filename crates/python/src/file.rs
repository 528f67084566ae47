//! Scenes from files.

use std::path::Path;

use antumbra::LocalOrigin;
use antumbra_load::{Options, load};
use antumbra_render::Lowered;
use pyo3::exceptions::{PyFileNotFoundError, PyValueError};
use pyo3::prelude::*;

use crate::geometry::{Part, Parts};

/// What a file holds, instances as they are.
pub fn read(py: Python<'_>, path: &Path) -> PyResult<Parts> {
    py.detach(|| {
        let loaded = load(path, &Options::default());
        let loaded = loaded.map_err(|error| unreadable(path, &error))?;
        let lowered = Lowered::new(&loaded.scene);
        let mut parts = Parts::default();
        let mut add = |list: &[antumbra::Geometry<'_>]| -> Vec<u32> {
            let first = parts.parts.len() as u32;
            parts.parts.extend(list.iter().map(Part::from));
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

/// Exception for a scene that cannot be read.
pub fn unreadable(path: &Path, error: &antumbra_load::Error) -> PyErr {
    let is_missing = !path.exists() && !path.to_string_lossy().starts_with("builtin:");
    match is_missing {
        true => PyFileNotFoundError::new_err(error.to_string()),
        false => PyValueError::new_err(error.to_string()),
    }
}
