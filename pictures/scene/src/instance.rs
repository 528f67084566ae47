//! Objects, which are defined once, and instances, which place them in the world.

use glam::{Affine3, DMat4};
use serde::Serialize;

use crate::{Geometry, Shape, transform};

/// Group of shapes that appears in the world once per instance.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Object {
    /// Name in the file. Two objects may have the same name, because instances refer to objects by position.
    pub name: String,
    /// Shapes in the space of the object, each with its own material. The list may be empty.
    pub shapes: Vec<Shape>,
}

impl Object {
    /// Returns true if one of the shapes is a sphere. Instances of such an object need a uniform scale.
    pub fn has_spheres(&self) -> bool {
        self.shapes
            .iter()
            .any(|shape| matches!(shape.geometry, Geometry::Sphere(_)))
    }
}

/// Placement of an object in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Instance {
    /// Index into [`crate::Scene::objects`].
    pub object: usize,
    /// Space of the object to world space. Readers guarantee an inverse. An instance without one is flat or a point,
    /// and rays miss it.
    pub world_from_object: Affine3,
    /// Space of the object to world space at time 1, if the instance moves. `world_from_object` is then its place at time 0.
    /// Between, the translation moves in a straight line, the rotation turns about one axis, and the stretch changes
    /// linearly. Either both transformations mirror or none does.
    pub end: Option<Affine3>,
}

impl Instance {
    /// Transformation as a double-precision matrix.
    pub fn matrix(&self) -> DMat4 {
        DMat4::from(self.world_from_object.as_daffine3())
    }

    /// Returns true if the instance is a mirror image of its object.
    pub fn swaps_handedness(&self) -> bool {
        transform::swaps_handedness(&self.matrix())
    }
}
