//! A scene as every kernel can trace it, and how large it is.

use std::iter::Sum;
use std::sync::Arc;

use antumbra_render::Lowered;
use antumbra_scene::{Geometry, Integrator, LightStrategy, Scene};
use serde::Serialize;

use super::sphere::triangulate;

/// Bounces of the camera paths whose rays are traced.
const BOUNCES: u32 = 5;

/// Makes a scene the same for every kernel: its spheres become meshes, and its integrator a path tracer of five
/// bounces, whatever the scene names.
pub fn prepare(scene: &mut Scene) {
    scene.integrator = Integrator::Path {
        max_depth: BOUNCES,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    };
    let of_objects = scene
        .objects
        .iter_mut()
        .flat_map(|object| &mut object.shapes);
    for shape in scene.shapes.iter_mut().chain(of_objects) {
        if let Geometry::Sphere(sphere) = &shape.geometry {
            shape.geometry = Geometry::Mesh(Arc::new(triangulate(sphere)));
            // Normals of spheres do not depend on it.
            shape.transform_swaps_handedness = false;
        }
    }
}

/// Size of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Size {
    /// Triangles; an object counts once for every instance.
    pub triangles: usize,
    /// Triangles; an object with instances counts once.
    pub unique_triangles: usize,
    /// Unique triangles whose mesh has an alpha mask.
    pub cutouts: usize,
    /// Instances.
    pub instances: usize,
}

impl Size {
    /// Spheres do not count: see [`prepare`].
    pub(super) fn of(model: &Lowered) -> Self {
        let objects: Vec<Self> = (model.objects.iter())
            .map(|object| Self::of_meshes(object))
            .collect();
        let mut is_placed = vec![false; objects.len()];
        let mut size = Self::of_meshes(&model.world);
        size.instances = model.instances.len();
        for instance in &model.instances {
            let object = &objects[instance.object as usize];
            size.triangles += object.triangles;
            if !std::mem::replace(&mut is_placed[instance.object as usize], true) {
                size.unique_triangles += object.unique_triangles;
                size.cutouts += object.cutouts;
            }
        }
        size
    }

    fn of_meshes(geometries: &[antumbra::Geometry]) -> Self {
        let mut size = Self::default();
        for geometry in geometries {
            if let antumbra::Geometry::Triangles(mesh) = geometry {
                size.triangles += mesh.indices.len();
                if mesh.opacity.is_some() {
                    size.cutouts += mesh.indices.len();
                }
            }
        }
        size.unique_triangles = size.triangles;
        size
    }
}

impl Sum for Size {
    fn sum<I: Iterator<Item = Self>>(sizes: I) -> Self {
        sizes.fold(Self::default(), |a, b| Self {
            triangles: a.triangles + b.triangles,
            unique_triangles: a.unique_triangles + b.unique_triangles,
            cutouts: a.cutouts + b.cutouts,
            instances: a.instances + b.instances,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::{Instance, Object, Shape, Sphere};
    use glam::Vec3;

    #[test]
    fn spheres_of_objects_become_meshes_too_and_count_once_for_every_instance() {
        let ball = Shape {
            geometry: Geometry::Sphere(Sphere::new(Vec3::ZERO, 1.0)),
            material: 0,
            area_light: None,
            media: None,
            alpha: None,
            shadow_alpha: None,
            reverse_orientation: false,
            transform_swaps_handedness: false,
        };
        let model = antumbra_mesh::Model {
            shapes: vec![ball.clone()],
            ..Default::default()
        };
        let mut scene = antumbra_load::scene_of_model("test".into(), model).0;
        scene.objects = vec![Object {
            name: "ball".into(),
            shapes: vec![ball],
        }];
        let place = |x: f32| Instance {
            object: 0,
            world_from_object: glam::Affine3::from_translation(Vec3::X * x),
            end: None,
        };
        scene.instances = vec![place(4.0), place(8.0)];
        prepare(&mut scene);
        let model = Lowered::new(&scene);
        let antumbra::Geometry::Triangles(mesh) = &model.world[0] else {
            panic!("still a sphere");
        };
        let each = mesh.indices.len();
        let size = Size {
            triangles: 3 * each,
            unique_triangles: 2 * each,
            cutouts: 0,
            instances: 2,
        };
        assert_eq!(Size::of(&model), size);
        assert_eq!(size.triangles, scene.triangle_count());
    }
}
