//! The class `Queries`: what scenes and worlds answer.
//!
//! - here: the class itself;  `rays`: queries about rays;  `points`: queries about points
//! - `bakes`: jobs about many points;  `parts`: geometry, masks and files

mod bakes;
mod parts;
mod points;
mod rays;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;

use crate::arrays::{Numbers, wrong_shape};
use crate::bake;
use crate::rays::mask;
use crate::scene::SceneData;

/// Queries that scenes and worlds have in common: see ``Scene`` and ``World``.
///
/// Calls may run in any number of threads at once. Long ones release the lock of the interpreter.
///
/// Examples
/// --------
/// >>> import antumbra as am
/// >>> isinstance(am.Scene([]), am.Queries)
/// True
#[pyclass(frozen, subclass, weakref, module = "antumbra")]
pub struct Queries {
    data: Mutex<Arc<SceneData>>,
}

impl From<Arc<SceneData>> for Queries {
    fn from(data: Arc<SceneData>) -> Self {
        Self {
            data: Mutex::new(data),
        }
    }
}

impl Queries {
    /// The scene as it is now. Whoever moves it meanwhile moves a copy.
    pub fn data(&self) -> Arc<SceneData> {
        self.held().clone()
    }

    /// Changes the scene. Calls that are running go on with what they have.
    pub fn change<T>(&self, change: impl FnOnce(&mut SceneData) -> T) -> T {
        change(Arc::make_mut(&mut self.held()))
    }

    fn held(&self) -> MutexGuard<'_, Arc<SceneData>> {
        self.data.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Masks of an argument: one for all of `count` things, or one for each. All bits without an argument.
pub fn read_masks(
    object: Option<&Bound<'_, PyAny>>,
    name: &'static str,
    count: usize,
) -> PyResult<Vec<u32>> {
    let Some(object) = object else {
        return Ok(Vec::new());
    };
    let numbers = Numbers::whole(object, name)?;
    if !numbers.shape().is_empty() && numbers.shape() != [count] {
        let wanted = format!("() or ({count},)");
        return Err(wrong_shape(name, numbers.shape(), &wanted));
    }
    bake::each(&numbers, count)?.into_iter().map(mask).collect()
}
