//! Objects, which are defined once, and instances, which put them into the world.

use glam::{Affine3, DMat4};
use serde::Serialize;

use crate::{Geometry, Shape, transform};

/// Shapes that stand in the world only through instances, once for each.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Object {
    /// What the file calls it. Two objects may have the same name; instances refer to them by position.
    pub name: String,
    /// Its shapes, in the space of the object; none is fine. Each keeps its own material.
    pub shapes: Vec<Shape>,
}

impl Object {
    /// Whether one of its shapes is a sphere, which instances must scale by the same along every axis.
    pub fn has_spheres(&self) -> bool {
        self.shapes
            .iter()
            .any(|shape| matches!(shape.geometry, Geometry::Sphere(_)))
    }
}

/// An object as it stands in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Instance {
    /// Index into [`crate::Scene::objects`].
    pub object: usize,
    /// Space of the object to world space. Readers guarantee an inverse; without one the instance is flat or
    /// a point, and nothing of it is hit.
    pub world_from_object: Affine3,
}

impl Instance {
    /// The transformation as shapes are moved by it.
    pub fn matrix(&self) -> DMat4 {
        DMat4::from(self.world_from_object.as_daffine3())
    }

    /// Whether it is a mirror image of its object.
    pub fn swaps_handedness(&self) -> bool {
        transform::swaps_handedness(&self.matrix())
    }
}
