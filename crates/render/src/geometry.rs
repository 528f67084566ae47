//! Shapes and instances of a scene as the kernel takes them.

use std::borrow::Cow;
use std::sync::Arc;

use antumbra::{Opacity, Sphere, TriangleMesh};
use antumbra_scene::{Geometry, Instance, Shape};

use crate::texture::Textures;
use crate::texture::cutouts::Cutouts;

/// The geometries of shapes, in order; meshes are borrowed.
pub fn of_shapes<'s>(shapes: &'s [Shape], textures: &mut Textures) -> Vec<antumbra::Geometry<'s>> {
    shapes
        .iter()
        .map(|shape| of_shape(shape, textures))
        .collect()
}

fn of_shape<'s>(shape: &'s Shape, textures: &mut Textures) -> antumbra::Geometry<'s> {
    match &shape.geometry {
        Geometry::Mesh(mesh) => antumbra::Geometry::Triangles(TriangleMesh {
            positions: Cow::Borrowed(&mesh.positions),
            indices: Cow::Borrowed(&mesh.indices),
            opacity: Cutouts::new(shape, textures)
                .map(|cutouts| Arc::new(cutouts) as Arc<dyn Opacity>),
        }),
        Geometry::Sphere(sphere) => antumbra::Geometry::Spheres(Cow::Owned(vec![Sphere {
            center: sphere.center.to_array(),
            radius: sphere.radius,
        }])),
    }
}

/// An instance. The kernel refuses those of objects that are not there.
pub fn of_instance(instance: &Instance) -> antumbra::Instance {
    let matrix = instance.world_from_object;
    let rows = matrix.matrix3.transpose().to_cols_array_2d();
    let translation = matrix.translation.to_array();
    antumbra::Instance {
        // What is beyond is beyond the number of objects, too.
        object: u32::try_from(instance.object).unwrap_or(u32::MAX),
        transform: std::array::from_fn(|axis| {
            let [x, y, z] = rows[axis];
            [x, y, z, translation[axis]]
        }),
    }
}
