//! Any scene as what every kernel can trace: one triangle mesh.

use std::f32::consts::PI;
use std::sync::Arc;

use antumbra_scene::{Geometry, Integrator, LightStrategy, Scene, Sphere, TriangleMesh};
use glam::Vec3;

use crate::exit::Failure;

/// Bounces of the camera paths whose rays are traced.
const BOUNCES: u32 = 5;
/// Rows and columns of a sphere made of triangles.
const RINGS: u32 = 24;
const SECTORS: u32 = 48;

/// One indexed mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Soup {
    pub positions: Vec<[f32; 3]>,
    /// Three positions of a triangle each.
    pub triangles: Vec<[u32; 3]>,
}

impl Soup {
    /// The triangles of all meshes, shape by shape, those of instances written out. Those with a vertex that is not finite, which every
    /// kernel would have to leave out, are left out here. Spheres are: see [`prepare`].
    pub fn new(scene: &Scene) -> Result<Self, Failure> {
        let mut soup = Self::default();
        let flat = scene
            .flattened()
            .map_err(|error| Failure::scene(&scene.name, error))?;
        for shape in &flat.shapes {
            if let Geometry::Mesh(mesh) = &shape.geometry {
                soup.add(mesh)
                    .ok_or_else(|| Failure::scene(&scene.name, "more than 2^32 vertices"))?;
            }
        }
        Ok(soup)
    }

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

    /// The mesh as the kernel takes it.
    pub fn geometry(&self) -> antumbra::Geometry<'_> {
        antumbra::Geometry::triangles(&self.positions[..], &self.triangles[..])
    }
}

/// Makes a scene the same for every kernel: its spheres become meshes, and its integrator a path tracer of five
/// bounces, whatever the scene asks for.
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

/// A sphere as a closed mesh, its triangles facing outward.
fn triangulate(sphere: &Sphere) -> TriangleMesh {
    let point = |dir: Vec3| (sphere.center + sphere.radius * dir).to_array();
    let mut positions = vec![point(Vec3::Z)];
    for ring in 1..RINGS {
        let (sin, cos) = (PI * ring as f32 / RINGS as f32).sin_cos();
        for sector in 0..SECTORS {
            let (y, x) = (2.0 * PI * sector as f32 / SECTORS as f32).sin_cos();
            positions.push(point(Vec3::new(sin * x, sin * y, cos)));
        }
    }
    let last = positions.len() as u32;
    positions.push(point(-Vec3::Z));
    let vertex = |ring: u32, sector: u32| match ring {
        0 => 0,
        RINGS => last,
        _ => 1 + (ring - 1) * SECTORS + sector % SECTORS,
    };
    let mut indices = Vec::new();
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let [a, b] = [vertex(ring, sector), vertex(ring, sector + 1)];
            let [c, d] = [vertex(ring + 1, sector), vertex(ring + 1, sector + 1)];
            if ring > 0 {
                indices.push([a, c, b]);
            }
            if ring + 1 < RINGS {
                indices.push([b, c, d]);
            }
        }
    }
    TriangleMesh {
        positions,
        indices,
        ..TriangleMesh::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::{Instance, Object, Shape};
    use std::collections::HashMap;

    fn corners(mesh: &TriangleMesh, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|index| mesh.positions[index as usize].into())
    }

    #[test]
    fn spheres_become_closed_meshes_that_face_outward() {
        let (center, radius) = (Vec3::new(1.0, -2.0, 3.0), 0.5);
        let mesh = triangulate(&Sphere { center, radius });
        let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
        let mut volume = 0.0;
        for &triangle in &mesh.indices {
            let [a, b, c] = corners(&mesh, triangle).map(|corner| corner - center);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
            volume += a.dot(b.cross(c)) / 6.0;
            let [a, b, c] = triangle;
            for edge in [[a, b], [b, c], [c, a]] {
                *edges.entry(edge).or_default() += 1;
                *edges.entry([edge[1], edge[0]]).or_default() -= 1;
            }
        }
        assert!(edges.values().all(|&count| count == 0), "a gap");
        let exact = 4.0 / 3.0 * PI * radius.powi(3);
        assert!((0.98..1.0).contains(&(volume / exact)), "{volume} {exact}");
    }

    #[test]
    fn instances_are_written_out_and_their_spheres_made_of_triangles() {
        let ball = Shape {
            geometry: Geometry::Sphere(Sphere {
                center: Vec3::ZERO,
                radius: 1.0,
            }),
            material: 0,
            area_light: None,
            alpha: None,
            shadow_alpha: None,
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
        let soup = Soup::new(&scene).expect("small");
        let each = soup.triangles.len() / 3;
        assert_eq!(3 * each, scene.triangle_count());
        for (ball, x) in [0.0, 4.0, 8.0].into_iter().enumerate() {
            for &[first, ..] in &soup.triangles[ball * each..(ball + 1) * each] {
                let corner = Vec3::from(soup.positions[first as usize]);
                assert!(((corner - Vec3::X * x).length() - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_soup_has_the_finite_triangles_of_all_meshes() {
        let mut soup = Soup::default();
        let bad = [0.0, f32::NAN, 0.0];
        let mesh = TriangleMesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], bad],
            indices: vec![[0, 1, 2], [1, 2, 3], [2, 1, 0]],
            ..TriangleMesh::default()
        };
        soup.add(&mesh).expect("few");
        soup.add(&mesh).expect("few");
        let expected = [[0, 1, 2], [2, 1, 0], [4, 5, 6], [6, 5, 4]];
        assert_eq!(soup.triangles, expected);
        assert_eq!(soup.positions.len(), 8);
    }
}
