//! A scene as every kernel can trace it: triangle meshes of the world and of objects, and instances of the objects.

use std::sync::Arc;

use antumbra::{Error, Primitives};
use antumbra_scene::{Geometry, Integrator, Scene, Shape, TriangleMesh};
use serde::Serialize;

use super::kernel_next::{Instance, Opacity};
use super::sphere::triangulate;
use crate::exit::Failure;

/// Bounces of the camera paths whose rays are traced.
const BOUNCES: u32 = 5;

/// An indexed mesh.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    /// Three positions of a triangle each.
    pub triangles: Vec<[u32; 3]>,
    /// Where it has holes, if it has any.
    pub opacity: Option<Arc<dyn Opacity>>,
}

impl Mesh {
    /// Appends the triangles of a mesh; `None` if there would be too many vertices. Those with a vertex that is
    /// not finite, which every kernel would have to leave out, are left out here.
    fn add(&mut self, mesh: &TriangleMesh) -> Option<()> {
        let base = self.positions.len();
        u32::try_from(base + mesh.positions.len()).ok()?;
        let base = base as u32;
        self.positions.extend_from_slice(&mesh.positions);
        let position = |index: u32| mesh.positions[index as usize];
        let finite = mesh.indices.iter().filter(|triangle| {
            let corners = triangle.map(position);
            corners.as_flattened().iter().all(|x| x.is_finite())
        });
        let moved = finite.map(|triangle| triangle.map(|index| base + index));
        self.triangles.extend(moved);
        Some(())
    }

    /// The mesh as our kernel takes it.
    fn geometry(&self) -> antumbra::Geometry<'_> {
        antumbra::Geometry::triangles(&self.positions[..], &self.triangles[..])
    }
}

/// Two levels: meshes of the world, and objects that stand in it wherever there is an instance.
#[derive(Clone, Debug, Default)]
pub struct Model {
    pub world: Vec<Mesh>,
    /// The meshes of every object; none of those of which there is no instance.
    pub objects: Vec<Vec<Mesh>>,
    /// Placed objects, none of them without triangles.
    pub instances: Vec<Instance>,
}

/// How large a model is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Size {
    /// Triangles, those of an object once for every instance.
    pub triangles: usize,
    /// Triangles that are stored.
    pub unique_triangles: usize,
    /// Those of them that may have holes.
    pub cutouts: usize,
    pub instances: usize,
}

impl std::iter::Sum for Size {
    fn sum<I: Iterator<Item = Self>>(sizes: I) -> Self {
        sizes.fold(Self::default(), |a, b| Self {
            triangles: a.triangles + b.triangles,
            unique_triangles: a.unique_triangles + b.unique_triangles,
            cutouts: a.cutouts + b.cutouts,
            instances: a.instances + b.instances,
        })
    }
}

impl Model {
    /// The meshes of a scene: of the world and of each object one with all that is opaque, and one for every shape
    /// with holes. Spheres are left out: see [`prepare`].
    ///
    /// `opacity` says of a shape where it has holes, if it has any.
    pub fn new(
        scene: &Scene,
        opacity: &dyn Fn(&Shape) -> Option<Arc<dyn Opacity>>,
    ) -> Result<Self, Failure> {
        let failed = |reason: &str| Failure::scene(&scene.name, reason);
        let meshes = |shapes: &[Shape]| merged(shapes, opacity).ok_or("more than 2^32 vertices");
        let world = meshes(&scene.shapes).map_err(failed)?;
        let mut is_used = vec![false; scene.objects.len()];
        for instance in &scene.instances {
            *is_used
                .get_mut(instance.object)
                .ok_or_else(|| failed("an instance of no object"))? = true;
        }
        let objects: Result<Vec<_>, _> = (scene.objects.iter().zip(is_used))
            .map(|(object, is_used)| match is_used {
                true => meshes(&object.shapes),
                false => Ok(Vec::new()),
            })
            .collect();
        let objects = objects.map_err(failed)?;
        let instances = (scene.instances.iter())
            .filter(|instance| !objects[instance.object].is_empty())
            .map(|instance| {
                let affine = instance.world_from_object;
                let [x, y, z] = affine.matrix3.transpose().to_cols_array_2d();
                let [tx, ty, tz] = affine.translation.to_array();
                let row = |[a, b, c]: [f32; 3], shift| [a, b, c, shift];
                Instance {
                    object: instance.object as u32,
                    transform: [row(x, tx), row(y, ty), row(z, tz)],
                }
            });
        Ok(Self {
            instances: instances.collect(),
            world,
            objects,
        })
    }

    /// All meshes, each once.
    pub fn meshes(&self) -> impl Iterator<Item = &Mesh> {
        self.world.iter().chain(self.objects.iter().flatten())
    }

    pub fn size(&self) -> Size {
        let count = |meshes: &[Mesh]| -> usize {
            let counts = meshes.iter().map(|mesh| mesh.triangles.len());
            counts.sum()
        };
        let objects: Vec<usize> = self.objects.iter().map(|meshes| count(meshes)).collect();
        let placed = (self.instances.iter()).map(|instance| objects[instance.object as usize]);
        let holed = self.meshes().filter(|mesh| mesh.opacity.is_some());
        Size {
            triangles: count(&self.world) + placed.sum::<usize>(),
            unique_triangles: count(&self.world) + objects.iter().sum::<usize>(),
            cutouts: holed.map(|mesh| mesh.triangles.len()).sum(),
            instances: self.instances.len(),
        }
    }

    /// A tree over the model.
    pub fn bvh(&self, options: &antumbra::BuildOptions) -> Result<antumbra::AnyBvh, Error> {
        let primitives = self.primitives()?;
        let binary = antumbra::BinaryTree::build(&primitives, options.builder);
        let log = antumbra::TreeLog::of_surfaces(&primitives, &binary, None);
        let learning = antumbra::Learning::default();
        Ok(antumbra::AnyBvh::collapse_logged(
            &primitives,
            &binary,
            &log,
            &learning,
            options.width,
            options.isa,
        ))
    }

    /// The model as our kernel takes it.
    pub fn primitives(&self) -> Result<Primitives, Error> {
        let mut all = self.world.clone();
        for instance in &self.instances {
            for mesh in &self.objects[instance.object as usize] {
                let mut mesh = mesh.clone();
                for p in &mut mesh.positions {
                    let old = p.map(f64::from);
                    *p = instance.transform.map(|row| {
                        let [a, b, c, d] = row.map(f64::from);
                        (a * old[0] + b * old[1] + c * old[2] + d) as f32
                    });
                }
                all.push(mesh);
            }
        }
        let all: Vec<_> = all.iter().map(Mesh::geometry).collect();
        Primitives::new(&all)
    }
}

/// Opaque shapes as one mesh, if there are any, and shapes with holes as one each; `None` for too many vertices.
fn merged(
    shapes: &[Shape],
    opacity: &dyn Fn(&Shape) -> Option<Arc<dyn Opacity>>,
) -> Option<Vec<Mesh>> {
    let mut opaque = Mesh::default();
    let mut meshes = Vec::new();
    for shape in shapes {
        let Geometry::Mesh(mesh) = &shape.geometry else {
            continue;
        };
        match opacity(shape) {
            None => opaque.add(mesh)?,
            // All of it, so that the opacity is asked for triangles of the shape.
            Some(opacity) => meshes.push(Mesh {
                positions: mesh.positions.clone(),
                triangles: mesh.indices.clone(),
                opacity: Some(opacity),
            }),
        }
    }
    meshes.push(opaque);
    meshes.retain(|mesh| !mesh.triangles.is_empty());
    Some(meshes)
}

/// Makes a scene the same for every kernel: its spheres become meshes, and its integrator a path tracer of five
/// bounces, whatever the scene asks for.
pub fn prepare(scene: &mut Scene) {
    scene.integrator = Integrator::Path {
        max_depth: BOUNCES,
        rr_threshold: 1.0,
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

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::{Instance, Object, Sphere};
    use glam::Vec3;

    #[test]
    fn instances_are_written_out_and_their_spheres_made_of_triangles() {
        let ball = Shape {
            geometry: Geometry::Sphere(Sphere {
                center: Vec3::ZERO,
                radius: 1.0,
            }),
            material: 0,
            area_light: None,
            reverse_orientation: false,
            transform_swaps_handedness: false,
        };
        let mut scene = crate::mesh_scene::lit("test".into(), vec![ball.clone()], Vec::new());
        scene.objects = vec![Object {
            name: "ball".into(),
            shapes: vec![ball],
        }];
        let place = |x: f32| Instance {
            object: 0,
            world_from_object: glam::Affine3::from_translation(Vec3::X * x),
        };
        scene.instances = vec![place(4.0), place(8.0)];
        prepare(&mut scene);
        let model = Model::new(&scene, &|_| None).expect("small");
        let each = model.world[0].triangles.len();
        let size = Size {
            triangles: 3 * each,
            unique_triangles: 2 * each,
            cutouts: 0,
            instances: 2,
        };
        assert_eq!(model.size(), size);
        assert_eq!(size.triangles, scene.triangle_count());
        let row = |instance: usize| model.instances[instance].transform[0];
        assert_eq!(row(0), [1.0, 0.0, 0.0, 4.0]);
        assert_eq!(row(1), [1.0, 0.0, 0.0, 8.0]);
    }

    #[test]
    fn a_mesh_has_the_finite_triangles_of_all_meshes() {
        let mut all = Mesh::default();
        let bad = [0.0, f32::NAN, 0.0];
        let mesh = TriangleMesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], bad],
            indices: vec![[0, 1, 2], [1, 2, 3], [2, 1, 0]],
            ..TriangleMesh::default()
        };
        all.add(&mesh).expect("few");
        all.add(&mesh).expect("few");
        let expected = [[0, 1, 2], [2, 1, 0], [4, 5, 6], [6, 5, 4]];
        assert_eq!(all.triangles, expected);
        assert_eq!(all.positions.len(), 8);
    }
}
