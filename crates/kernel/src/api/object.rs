//! A tree to be placed in worlds.

use super::bvh::Bvh;
use super::recipe::Recipe;
use crate::error::Error;
use crate::geometry::Geometry;
use crate::geometry::instance::ObjectShape;
use crate::geometry::primitives::Primitives;
use crate::monitor::BuildMonitor;
use crate::ray::Ray;
use crate::tree::any::on_tree;

/// Geometry with its tree, built once and placed in any number of [worlds](crate::World), any number of times.
///
/// Can be shared among threads, by an `Arc` for example.
#[derive(Clone, Debug)]
pub struct Object {
    bvh: Bvh,
    shape: ObjectShape,
}

impl Object {
    /// Builds an object and learns its tree from surface rays, as [`Bvh::build`].
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn build(geometries: &[Geometry<'_>], recipe: &Recipe) -> Result<Self, Error> {
        Self::learn(geometries, &[], recipe)
    }

    /// Builds an object and learns its tree from `rays`, as [`Bvh::learn`]. They are rays in the space of the object.
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn learn(
        geometries: &[Geometry<'_>],
        rays: &[Ray],
        recipe: &Recipe,
    ) -> Result<Self, Error> {
        Self::learn_monitored(geometries, rays, recipe, &())
    }

    /// [`Object::learn`] with a monitor, as [`Bvh::learn_monitored`].
    ///
    /// # Errors
    /// As [`Object::learn`]; [`Error::Cancelled`] if the monitor stopped the build before it was done.
    pub fn learn_monitored(
        geometries: &[Geometry<'_>],
        rays: &[Ray],
        recipe: &Recipe,
        monitor: &dyn BuildMonitor,
    ) -> Result<Self, Error> {
        let primitives = Primitives::new(geometries)?;
        Ok(Self {
            bvh: Bvh::learn_over_monitored(&primitives, rays, recipe, monitor)?,
            shape: ObjectShape::new(&primitives),
        })
    }

    /// Moves the vertices of the object, as [`Bvh::refit`]. Worlds that it joined before keep what they have: see
    /// [`World::refit`](crate::World::refit).
    ///
    /// # Errors
    /// As [`Bvh::refit`].
    pub fn refit(&mut self, geometries: &[Geometry<'_>]) -> Result<(), Error> {
        self.bvh.refit(geometries)?;
        self.shape = on_tree!(&self.bvh.tree, tree => {
            ObjectShape::around(&tree.bounds, tree.prim_bounds(&tree.all_places()))
        });
        Ok(())
    }

    /// The tree of the object, in its own space.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    pub(crate) fn shape(&self) -> &ObjectShape {
        &self.shape
    }
}

impl AsRef<Self> for Object {
    fn as_ref(&self) -> &Self {
        self
    }
}
