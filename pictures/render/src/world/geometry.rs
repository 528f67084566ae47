//! Shapes and instances of a scene, as the kernel takes them.

use std::borrow::Cow;
use std::sync::Arc;

use antumbra::Primitives;
use antumbra::shapes::Sphere;
use antumbra_scene::{Geometry, Instance, Scene, Shape};
use glam::Affine3;

use crate::surface::{CurvePart, segments};
use crate::texture::Cutouts;
use crate::texture::Textures;

/// Geometry of a scene, as the kernel takes it. Meshes are borrowed from the scene.
#[derive(Debug, Default)]
pub struct Lowered<'s> {
    /// Shapes that are in the world without an instance.
    pub world: Vec<antumbra::Geometry<'s>>,
    /// Shapes of every object, in the space of the object.
    pub objects: Vec<Vec<antumbra::Geometry<'s>>>,
    /// Placed objects.
    pub instances: Vec<antumbra::Instance>,
}

impl<'s> Lowered<'s> {
    /// Geometry of a scene that [`World::new`](crate::World::new) accepts, alpha masks included.
    pub fn new(scene: &'s Scene) -> Self {
        Self::with(scene, &mut Textures::default()).0
    }

    /// Geometry of a scene, with textures shared with `textures`, and the parts of the curves of each stored shape.
    pub(crate) fn with(scene: &'s Scene, textures: &mut Textures) -> (Self, Vec<Vec<CurvePart>>) {
        let mut parts = Vec::new();
        let mut of_shapes = |shapes: &'s [Shape]| -> Vec<_> {
            let shapes = shapes.iter().map(|shape| {
                let (geometry, of_shape) = of_shape(shape, textures);
                parts.push(of_shape);
                geometry
            });
            shapes.collect()
        };
        let world = of_shapes(&scene.shapes);
        let objects = scene.objects.iter();
        let objects = objects.map(|object| of_shapes(&object.shapes)).collect();
        let lowered = Self {
            world,
            objects,
            instances: scene.instances.iter().map(of_instance).collect(),
        };
        (lowered, parts)
    }

    /// Primitives of the kernel, checked.
    ///
    /// # Errors
    /// As [`Primitives::with_instances`].
    pub fn primitives(&self) -> Result<Primitives, antumbra::Error> {
        Primitives::with_instances(&self.world, &self.objects, &self.instances)
    }
}

fn of_shape<'s>(
    shape: &'s Shape,
    textures: &mut Textures,
) -> (antumbra::Geometry<'s>, Vec<CurvePart>) {
    let geometry = match &shape.geometry {
        Geometry::Mesh(mesh) => {
            let (positions, indices) = (&mesh.positions[..], &mesh.indices[..]);
            match Cutouts::new(shape, textures) {
                Some(cutouts) => antumbra::Geometry::cutouts(positions, indices, Arc::new(cutouts)),
                None => antumbra::Geometry::triangles(positions, indices),
            }
        }
        Geometry::Sphere(sphere) => antumbra::Geometry::Spheres(Cow::Owned(vec![Sphere {
            center: sphere.center.to_array(),
            radius: sphere.radius,
        }])),
        Geometry::Curves(curves) => {
            let (curves, parts) = segments(curves);
            return (antumbra::Geometry::curves(curves), parts);
        }
    };
    (geometry, Vec::new())
}

/// Instance with its transforms: at time 0, and at time 1 if it moves. The kernel refuses instances of missing objects.
pub fn of_instance(instance: &Instance) -> antumbra::Instance {
    // Numbers beyond 32 bits are beyond the number of objects, too.
    let object = u32::try_from(instance.object).unwrap_or(u32::MAX);
    let keys = [Some(instance.world_from_object), instance.end];
    antumbra::Instance::moving(object, keys.iter().flatten().map(rows))
}

/// Rows of an affine map.
pub fn rows(matrix: &Affine3) -> [[f32; 4]; 3] {
    let rows = matrix.matrix3.transpose().to_cols_array_2d();
    let translation = matrix.translation.to_array();
    std::array::from_fn(|axis| {
        let [x, y, z] = rows[axis];
        [x, y, z, translation[axis]]
    })
}
