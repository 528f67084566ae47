//! What a scene holds: a tree with everything that made it.
//!
//! - here: the tree and its build;  `parts`: what it is made of
//! - `meshes`: meshes of a call;  `curves`: curves;  `placements`: instances
//! - `file`: scenes from files;  `saved`: scenes in files and pickles

pub mod curves;
pub mod file;
pub mod meshes;
pub mod parts;
pub mod placements;
pub mod saved;

use std::sync::Arc;

use antumbra::{Build, BuildMonitor, Bvh, LocalOrigin, Object, PrimId, Ray, Recipe, World};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::DegenerateWarning;
use crate::arrays::broadcast::Operand;
use crate::arrays::{Numbers, memory};
use crate::call::Call;
use crate::errors::raised;
use parts::{Ids, Parts};

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

    /// The ids that users see of what the kernel names; the id of what is not there is -1.
    #[inline(always)]
    pub fn ids(&self, named: impl Into<PrimId>) -> Ids {
        let named = named.into();
        let mesh = match self.is_plain {
            true => named.geom_id,
            false => self.parts.part_of(named.geom_id, named.inst_id),
        };
        Ids {
            triangle: named.prim_id as i32,
            mesh: mesh as i32,
            instance: named.inst_id as i32,
        }
    }

    /// Points of an argument of shape (n, 3) as the tree has them.
    pub fn local_points(&self, numbers: &Numbers<'_>) -> PyResult<Vec<[f32; 3]>> {
        let count = numbers.lead(3).iter().product();
        let operand = Operand::new(numbers, 3, numbers.lead(3));
        let local = self.local();
        let points = (0..count).map(|place| local.local(operand.vector(place)));
        memory::collected(points, count, "points")
    }
}

/// What the tree of a build is for.
pub enum Use<'a> {
    /// Meshes that stay, seen by such rays as these.
    Fixed(&'a [Ray]),
    /// Objects whose instances move.
    Moving,
}

/// Builds the tree of a scene or a world.
pub fn build(
    call: &mut Call<'_>,
    parts: Parts,
    quality: Quality,
    purpose: Use<'_>,
) -> PyResult<Arc<SceneData>> {
    let made = call.watch(|signals| {
        let recipe = quality.recipe();
        let tree = match purpose {
            Use::Fixed(rays) => {
                let primitives = parts.primitives()?;
                let build = Build::new(&primitives).rays(rays).recipe(&recipe);
                Tree::Fixed(Box::new(build.monitor(signals).bvh()?))
            }
            Use::Moving => Tree::World(Box::new(world(&parts, &recipe, signals)?)),
        };
        Ok(SceneData::new(tree, parts, quality))
    })?;
    let data = made.map_err(raised)?;
    let report = data.bvh().report();
    if report.dropped > 0 {
        let (found, all) = (report.dropped, report.dropped + report.primitives);
        let text = format!(
            "{found} of {all} triangles, segments or instances can never be hit and were left out: two corners or ends coincide, a number is not finite, a segment has no radius, or a transform has no inverse"
        );
        let warning = call.py.get_type::<DegenerateWarning>();
        PyErr::warn(call.py, &warning, &std::ffi::CString::new(text)?, 1)?;
    }
    Ok(Arc::new(data))
}

/// Builds a tree of every object, and a world of their instances.
fn world(
    parts: &Parts,
    recipe: &Recipe,
    monitor: &dyn BuildMonitor,
) -> Result<World, antumbra::Error> {
    let build = |list: &[u32]| {
        let geometries = parts.geometries(list);
        let build = Build::new(&geometries[..]).recipe(recipe);
        build.monitor(monitor).object()
    };
    let objects = parts.objects.iter().map(|list| build(list));
    let objects = objects.collect::<Result<Vec<Object>, _>>()?;
    match parts.world.is_empty() {
        true => World::new(&objects, &parts.instances),
        false => World::on_ground(&build(&parts.world)?, &objects, &parts.instances),
    }
}
