//! Jobs about many points: ambient occlusion, sky, sun, and visibility between points.
//!
//! - here: the points of a job;  `sky`: patches and directions;  `sun`: positions and steps of time
//! - `sensors`: where points are made;  `bits`: the class `BitMatrix`

pub mod bits;
pub mod sensors;
pub mod sky;
pub mod sun;

use std::sync::Arc;

use antumbra::Bvh;
use numpy::{Element, PyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::broadcast::common_shape;
use crate::arrays::{Numbers, shape_text, shaped, wrong_shape};
use crate::call::Call;
use crate::call::watch::Signals;
use crate::errors::failed;
use crate::scene::SceneData;

/// What a job sees: the tree, points, and their normals or none.
pub type Sight<'a> = (&'a Bvh, &'a [[f32; 3]], &'a [[f32; 3]]);

/// A job about points of a scene, with normals or without.
pub struct Job<'py> {
    scene: Arc<SceneData>,
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    shape: Vec<usize>,
    call: Call<'py>,
}

impl<'py> Job<'py> {
    pub fn new(
        scene: Arc<SceneData>,
        points: &Bound<'_, PyAny>,
        normals: Option<&Bound<'_, PyAny>>,
        call: Call<'py>,
    ) -> PyResult<Self> {
        let points = Numbers::read(points, "points", 3)?;
        let shape = points.lead(3).to_vec();
        let mut of_points = Vec::new();
        if let Some(normals) = normals {
            let normals = Numbers::read(normals, "normals", 3)?;
            if common_shape(&[(&points, 3), (&normals, 3)])? != shape {
                let wanted = shape_text(points.shape());
                return Err(wrong_shape("normals", normals.shape(), &wanted));
            }
            of_points = normals.vectors(&shape)?;
        }
        Ok(Self {
            points: scene.local_points(&points)?,
            normals: of_points,
            scene,
            shape,
            call,
        })
    }

    /// Does the work; Ctrl-C ends it, and progress is reported.
    pub fn run<T: Send>(
        &mut self,
        work: impl FnOnce(Sight<'_>, &Signals) -> Result<T, antumbra_bake::Error> + Send,
    ) -> PyResult<T> {
        let sight = (self.scene.bvh(), &self.points[..], &self.normals[..]);
        let done = self.call.watch(|signals| work(sight, signals))?;
        done.map_err(failed)
    }

    /// Answers in the shape of the points, `item` behind it.
    pub fn array<T: Element>(
        &self,
        answers: Vec<T>,
        item: &[usize],
    ) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
        shaped(self.call.py, answers, &[&self.shape[..], item].concat())
    }
}
