//! A tree to be placed in worlds.

use core::fmt;
use core::ops::Deref;

use super::build::{Build, Source};
use super::bvh::Bvh;
use super::recipe::Recipe;
use super::save::Contents;
use crate::error::Error;
use crate::geometry::instance::ObjectShape;
use crate::geometry::primitives::Primitives;
use crate::geometry::{Functions, Geometry};
use crate::words::{Kind, Sink, Words};

/// Geometry with its tree, built once and placed in any number of [worlds](crate::World), any number of times.
///
/// Can be shared among threads, by an `Arc` for example. An object is used as its [`Bvh`], which answers queries in the
/// space of the object.
///
/// ```
/// use std::sync::Arc;
///
/// use antumbra::{Geometry, Instance, Object, Ray, Recipe, World};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let object = Arc::new(Object::build(&geometry, &Recipe::default())?);
/// let five_along_x = Instance::new(0, [[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
/// let world = World::new(&[object], &[five_along_x])?;
/// assert!(world.occluded(&Ray::new([5.2, 0.2, 0.0], [0.0, 0.0, 1.0])));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone)]
pub struct Object {
    bvh: Bvh,
    shape: ObjectShape,
}

impl Object {
    pub(super) fn new(bvh: Bvh, primitives: &Primitives) -> Self {
        Self {
            bvh,
            shape: ObjectShape::new(primitives),
        }
    }

    /// Builds an object and learns its tree from surface rays: short for
    /// `Build::new(geometries).recipe(recipe).object()`.
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn build<'a>(source: impl Into<Source<'a>>, recipe: &Recipe) -> Result<Self, Error> {
        Build::new(source).recipe(recipe).object()
    }

    /// Moves the vertices of the object, as [`Bvh::refit`]. Worlds that it joined before keep what they have: see
    /// [`World::refit`](crate::World::refit).
    ///
    /// # Errors
    /// As [`Bvh::refit`].
    pub fn refit(&mut self, geometries: &[Geometry<'_>]) -> Result<(), Error> {
        self.bvh.refit(geometries)?;
        let tree = &self.bvh.tree;
        self.shape = ObjectShape::around(&tree.bounds, tree.prim_bounds(&tree.all_places()));
        Ok(())
    }

    pub(crate) fn shape(&self) -> &ObjectShape {
        &self.shape
    }
}

impl Contents for Object {
    const KIND: Kind = Kind::Object;

    fn tree(&self) -> &Bvh {
        &self.bvh
    }

    fn write_words(&self, sink: &mut Sink<'_>) {
        self.bvh.write_words(sink);
        self.shape.write(sink);
    }

    fn read_words(words: &mut Words<'_>, functions: &Functions) -> Result<Self, Error> {
        let bvh = Bvh::read_words(words, functions)?;
        if !bvh.tree.roots.is_empty() {
            return Err(words.error("an object has instances"));
        }
        let shape = ObjectShape::read(words, bvh.bounds().reach())?;
        Ok(Self { bvh, shape })
    }
}

impl Deref for Object {
    type Target = Bvh;

    fn deref(&self) -> &Bvh {
        &self.bvh
    }
}

impl AsRef<Self> for Object {
    fn as_ref(&self) -> &Self {
        self
    }
}

impl fmt::Debug for Object {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Object")
            .field("bvh", &self.bvh)
            .finish_non_exhaustive()
    }
}
