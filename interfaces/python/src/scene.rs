//! What a scene holds: a tree with everything that made it.

use std::sync::Arc;

use antumbra::{Build, BuildReport, Bvh, LocalOrigin, Ray, Recipe, World};
use pyo3::exceptions::{PyIndexError, PyMemoryError, PyOSError, PyValueError};
use pyo3::prelude::*;

use crate::DegenerateWarning;
use crate::arrays::Numbers;
use crate::geometry::Parts;
use crate::memory;
use crate::rays::Call;
use crate::watch::watch;

/// What a scene or a world holds, as it was when a call began.
#[derive(Clone)]
pub struct SceneData {
    tree: Tree,
    pub parts: Arc<Parts>,
    /// See [`Parts::is_plain`].
    pub is_plain: bool,
    /// See [`Parts::has_others`].
    pub has_others: bool,
    pub quality: Quality,
}

/// A tree that stays, or one whose instances move.
#[derive(Clone)]
pub enum Tree {
    Fixed(Box<Bvh>),
    World(Box<World>),
}

/// Named recipes of trees.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Quality {
    Fast,
    Default,
}

impl Quality {
    pub fn read(name: &str) -> PyResult<Self> {
        match name {
            "fast" => Ok(Self::Fast),
            "default" => Ok(Self::Default),
            _ => Err(PyValueError::new_err(format!(
                "quality: found {name:?}, wanted \"fast\" or \"default\""
            ))),
        }
    }

    pub fn recipe(self) -> Recipe {
        let recipe = match self {
            Self::Fast => Recipe::fast(),
            Self::Default => Recipe::default(),
        };
        recipe.clock(Some(antumbra_render::clock))
    }
}

impl SceneData {
    pub fn new(tree: Tree, parts: Parts, quality: Quality) -> Self {
        let mut data = Self {
            // Instances of a world come later.
            is_plain: matches!(tree, Tree::Fixed(_)) && parts.is_plain(),
            tree,
            has_others: parts.has_others(),
            parts: Arc::new(parts),
            quality,
        };
        if data.parts.kernel_masks().is_some() {
            data.renew_masks();
        }
        data
    }

    /// The tree that queries trace.
    pub fn bvh(&self) -> &Bvh {
        match &self.tree {
            Tree::Fixed(bvh) => bvh,
            Tree::World(world) => world,
        }
    }

    /// Whether there are only triangles, and no instance places them.
    pub fn has_only_world_triangles(&self) -> bool {
        self.parts.instances.is_empty() && !self.has_others
    }

    /// Name of what the leaves of the tree have.
    pub fn kind(&self) -> &'static str {
        match self.has_others {
            true => "primitives",
            false => "triangles",
        }
    }

    pub fn world(&self) -> Option<&World> {
        match &self.tree {
            Tree::Fixed(_) => None,
            Tree::World(world) => Some(world),
        }
    }

    /// The world, and what is known about its meshes. Both have to be changed together.
    pub fn world_mut(&mut self) -> Option<(&mut World, &mut Parts)> {
        match &mut self.tree {
            Tree::Fixed(_) => None,
            Tree::World(world) => Some((world, Arc::make_mut(&mut self.parts))),
        }
    }

    /// Gives masks to meshes and instances.
    pub fn set_masks(&mut self, masks: Vec<u32>, instance_masks: Vec<u32>) {
        let parts = Arc::make_mut(&mut self.parts);
        parts.masks = masks;
        parts.instance_masks = instance_masks;
        self.renew_masks();
    }

    fn renew_masks(&mut self) {
        let masks = self.parts.kernel_masks().unwrap_or_default();
        match &mut self.tree {
            Tree::Fixed(bvh) => bvh.set_masks(masks),
            Tree::World(world) => world.set_masks(masks),
        }
    }

    /// Bytes of the tree and of what is kept beside it.
    pub fn bytes(&self) -> usize {
        self.bvh().report().bytes + self.parts.bytes()
    }

    pub fn local(&self) -> LocalOrigin {
        self.parts.local
    }

    /// Points of an argument of shape (n, 3) as the tree has them.
    pub fn local_points(&self, numbers: &Numbers<'_>) -> PyResult<Vec<[f32; 3]>> {
        let count = numbers.lead(3).iter().product();
        let operand = crate::broadcast::Operand::new(numbers, 3, numbers.lead(3));
        let local = self.local();
        let points = (0..count).map(|place| local.local(operand.vector(place)));
        memory::collected(points, count, "points")
    }
}

/// Exception for an error of the kernel.
pub fn raised(error: antumbra::Error) -> PyErr {
    match error {
        antumbra::Error::IndexOutOfRange { .. } | antumbra::Error::ObjectOutOfRange { .. } => {
            PyIndexError::new_err(error.to_string())
        }
        antumbra::Error::Io { .. } => PyOSError::new_err(error.to_string()),
        antumbra::Error::OutOfMemory { .. } => PyMemoryError::new_err(error.to_string()),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// Builds the tree of a scene.
pub fn build(
    py: Python<'_>,
    parts: Parts,
    rays: &[Ray],
    quality: Quality,
    call: &mut Call<'_>,
) -> PyResult<Arc<SceneData>> {
    let made = watch(py, &call.threads, &mut call.progress, |signals| {
        let primitives = parts.primitives()?;
        let bvh = Build::new(&primitives)
            .rays(rays)
            .recipe(&quality.recipe())
            .monitor(signals)
            .bvh()?;
        Ok(SceneData::new(Tree::Fixed(Box::new(bvh)), parts, quality))
    })?;
    let data = Arc::new(made.map_err(raised)?);
    let report = data.bvh().report();
    if report.dropped > 0 {
        warn(py, &report)?;
    }
    Ok(data)
}

pub fn warn(py: Python<'_>, report: &BuildReport) -> PyResult<()> {
    let found = report.dropped;
    let all = found + report.primitives;
    let text = format!(
        "{found} of {all} triangles, segments or instances can never be hit and were left out: two corners or ends coincide, a number is not finite, a segment has no radius, or a transform has no inverse"
    );
    let text = std::ffi::CString::new(text)?;
    PyErr::warn(py, &py.get_type::<DegenerateWarning>(), &text, 1)
}
