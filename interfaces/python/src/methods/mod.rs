//! The class `Queries`: what scenes and worlds answer.
//!
//! - here: the class itself;  `rays`: queries about rays;  `points`: queries about points
//! - `bakes`: jobs about many points;  `parts`: geometry, masks and files
//! - `scene`: the class `Scene`;  `world`: the class `World`

mod bakes;
mod parts;
mod points;
mod rays;
pub mod scene;
pub mod world;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pyo3::PyClass;
use pyo3::prelude::*;

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

impl Queries {
    /// A new object of a class that extends this one.
    fn extended<T>(data: Arc<SceneData>, class: T) -> PyClassInitializer<T>
    where
        T: PyClass<BaseType = Self>,
    {
        let data = Mutex::new(data);
        PyClassInitializer::from(Self { data }).add_subclass(class)
    }

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
