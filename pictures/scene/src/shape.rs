//! Shapes: meshes, spheres and curves with their attributes, and how transformations move them.

use std::collections::HashMap;
use std::sync::Arc;

use crate::{Curves, MediumInterface, Param, Rgb, transform};
use glam::{DMat3, DMat4, DVec3, Mat3, Vec2, Vec3};
use serde::Serialize;

/// Shape of the scene: a geometry with the attributes in force where it was declared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shape {
    /// Surface of the shape.
    pub geometry: Geometry,
    /// Index into [`crate::Scene::materials`].
    pub material: usize,
    /// Emission of the surface; `None` if it is no light.
    pub area_light: Option<AreaLight>,
    /// Media on the two sides of the surface. `None` if the medium is the same on both sides.
    pub media: Option<MediumInterface>,
    /// Alpha mask: the surface is cut out where the value is exactly 0, as in pbrt-v3. `None` means 1 everywhere.
    pub alpha: Option<Param<f32>>,
    /// Alpha mask that only occlusion queries see, in addition to `alpha`.
    pub shadow_alpha: Option<Param<f32>>,
    /// True if `ReverseOrientation` was in force: normals, and so the emitting side, point the other way.
    pub reverse_orientation: bool,
    /// True if the transformation that was applied to the shape contains a reflection.
    ///
    /// As in pbrt-v3, geometric normals are flipped when exactly one of `reverse_orientation` and
    /// `transform_swaps_handedness` is true. For spheres, and for meshes with normals of their own,
    /// only `reverse_orientation` decides. Curves also count `v` from the other side.
    pub transform_swaps_handedness: bool,
}

impl Shape {
    /// Shape of a geometry and a material, without light, media or masks.
    pub fn new(geometry: Geometry, material: usize) -> Self {
        Self {
            geometry,
            material,
            area_light: None,
            media: None,
            alpha: None,
            shadow_alpha: None,
            reverse_orientation: false,
            transform_swaps_handedness: false,
        }
    }

    /// Shape transformed by `matrix`; `None` for a sphere under a non-uniform scale.
    ///
    /// The identity shares the mesh instead of copying it. A reflection toggles [`Self::transform_swaps_handedness`],
    /// so that the transformed shape has the transformed normals, as instances of pbrt-v3 do.
    pub fn transformed(&self, matrix: &DMat4) -> Option<Self> {
        let geometry = match &self.geometry {
            unmoved if *matrix == DMat4::IDENTITY => unmoved.clone(),
            Geometry::Mesh(mesh) => {
                let mut mesh = TriangleMesh::clone(mesh);
                mesh.transform(matrix);
                Geometry::Mesh(Arc::new(mesh))
            }
            Geometry::Sphere(sphere) => Geometry::Sphere(sphere.transformed(matrix)?),
            Geometry::Curves(curves) => {
                let mut curves = Curves::clone(curves);
                curves.transform(matrix);
                Geometry::Curves(Arc::new(curves))
            }
        };
        let is_mirrored = transform::swaps_handedness(matrix);
        // Normals of curves are on a side of the ray, in a mirror as well.
        let turns_back = is_mirrored && matches!(geometry, Geometry::Curves(_));
        Some(Self {
            geometry,
            reverse_orientation: self.reverse_orientation != turns_back,
            transform_swaps_handedness: self.transform_swaps_handedness != is_mirrored,
            ..self.clone()
        })
    }
}

/// Geometry of a shape, in world space, or in the space of the object that the shape belongs to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Geometry {
    /// Indexed triangle mesh.
    Mesh(Arc<TriangleMesh>),
    /// Full sphere.
    Sphere(Sphere),
    /// Thin curves.
    Curves(Arc<Curves>),
}

/// Indexed triangle mesh.
///
/// Readers guarantee that every index is below `positions.len()`, and that `normals`, `uvs` and `colors` are empty or
/// as long as `positions`. Positions may be NaN or infinite: the kernel drops such triangles and counts them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TriangleMesh {
    /// Vertex positions, `[vertices, 3]`.
    #[serde(serialize_with = "crate::raw")]
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of every triangle, `[triangles, 3]`. A position in this list is the kernel's `prim_id`.
    #[serde(serialize_with = "crate::raw")]
    pub indices: Vec<[u32; 3]>,
    /// Shading normals per vertex, or empty. Normals have unit length unless the file contains zero vectors.
    #[serde(serialize_with = "crate::raw")]
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex, or empty.
    #[serde(serialize_with = "crate::raw")]
    pub uvs: Vec<Vec2>,
    /// Linear colours per vertex, or empty. [`Texture::VertexColor`](crate::Texture::VertexColor) looks them up.
    #[serde(serialize_with = "crate::raw")]
    pub colors: Vec<Rgb>,
}

impl TriangleMesh {
    /// Size of the lists in bytes.
    pub fn bytes(&self) -> u64 {
        let lists = [
            size_of_val(&self.positions[..]),
            size_of_val(&self.indices[..]),
            size_of_val(&self.normals[..]),
            size_of_val(&self.uvs[..]),
            size_of_val(&self.colors[..]),
        ];
        lists.iter().map(|&bytes| bytes as u64).sum()
    }

    /// Transforms the mesh in place, in double precision.
    ///
    /// Normals are transformed by the inverse transpose, as in pbrt-v3, and scaled to unit length. A singular matrix
    /// gives degenerate triangles and normals that are not finite.
    pub fn transform(&mut self, matrix: &DMat4) {
        if *matrix == DMat4::IDENTITY {
            return;
        }
        for position in &mut self.positions {
            let p = DVec3::from(position.map(f64::from));
            *position = transform::point(matrix, p).as_vec3().into();
        }
        let of_normals = transform::of_normals(matrix);
        for normal in &mut self.normals {
            *normal = transform::unit(of_normals * normal.as_dvec3());
        }
    }

    /// Gives corners whose normal is the zero vector the normal of their triangle. A vertex becomes several where such
    /// triangles differ. Without any normal, the list becomes empty.
    pub fn fill_normals(&mut self) {
        let is_open: Vec<bool> = self.normals.iter().map(|n| *n == Vec3::ZERO).collect();
        if is_open.iter().all(|&open| open) {
            self.normals.clear();
            return;
        }
        if !is_open.contains(&true) {
            return;
        }
        let mut copies: HashMap<(u32, [u32; 3]), u32> = HashMap::new();
        for index in 0..self.indices.len() {
            let corners = self.indices[index];
            let [a, b, c] = corners.map(|corner| Vec3::from(self.positions[corner as usize]));
            let normal = (b - a).cross(c - a).normalize_or_zero();
            for (place, corner) in corners.into_iter().enumerate() {
                if !is_open[corner as usize] || normal == Vec3::ZERO {
                    continue;
                }
                let known = (corner, normal.to_array().map(f32::to_bits));
                self.indices[index][place] = *copies.entry(known).or_insert_with(|| {
                    let vertex = corner as usize;
                    if self.normals[vertex] == Vec3::ZERO {
                        self.normals[vertex] = normal;
                        return corner;
                    }
                    self.positions.push(self.positions[vertex]);
                    self.normals.push(normal);
                    self.uvs.extend(self.uvs.get(vertex).copied());
                    self.colors.extend(self.colors.get(vertex).copied());
                    (self.positions.len() - 1) as u32
                });
            }
        }
    }
}

/// Full sphere in world space, or in the space of its object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sphere {
    /// Centre in the same space.
    pub center: Vec3,
    /// Radius in scene units, positive.
    pub radius: f32,
    /// Directions of the sphere's own axes: a rotation or a reflection. Coordinates u run around the z axis, from x to
    /// y, and v from its negative to its positive end.
    pub axes: Mat3,
}

impl Sphere {
    /// Sphere whose axes are the axes of its space.
    pub fn new(center: Vec3, radius: f32) -> Self {
        Self {
            center,
            radius,
            axes: Mat3::IDENTITY,
        }
    }

    /// Transformed sphere; `None` if a non-uniform scale would make it an ellipsoid.
    ///
    /// Axes turn with the sphere. Centre and radius are not finite if they leave the range of `f32`.
    pub fn transformed(&self, matrix: &DMat4) -> Option<Self> {
        let scale = transform::uniform_scale(matrix)?;
        let turn = DMat3::from_mat4(*matrix) * scale.recip();
        Some(Self {
            center: transform::point(matrix, self.center.as_dvec3()).as_vec3(),
            radius: (f64::from(self.radius) * scale) as f32,
            axes: (turn * self.axes.as_dmat3()).as_mat3(),
        })
    }
}

/// Diffuse emission of a surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AreaLight {
    /// Emitted radiance.
    pub radiance: Rgb,
    /// Factor of the radiance that varies over a mesh. `None` is 1 everywhere. Spheres ignore it.
    pub texture: Option<Param<Rgb>>,
    /// True if both sides emit.
    pub two_sided: bool,
    /// Samples of each emitting triangle or sphere per point, for `directlighting` with strategy `all`.
    pub samples: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_normals_become_those_of_the_triangles() {
        // Two walls that meet in the edge from 0 to 1. The normal of corner 3 is given.
        let mut mesh = TriangleMesh {
            positions: vec![[0., 0., 0.], [0., 0., 1.], [1., 0., 0.], [0., 1., 0.]],
            indices: vec![[0, 2, 1], [0, 1, 3]],
            normals: vec![Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Vec3::Z],
            uvs: vec![Vec2::X; 4],
            ..TriangleMesh::default()
        };
        mesh.fill_normals();
        assert_eq!(mesh.indices, [[0, 2, 1], [4, 5, 3]]);
        assert_eq!(mesh.positions[4..], [[0., 0., 0.], [0., 0., 1.]]);
        let [x, y, z] = [Vec3::NEG_X, Vec3::NEG_Y, Vec3::Z];
        assert_eq!(mesh.normals, [y, y, y, z, x, x]);
        assert_eq!(mesh.uvs.len(), 6);
        mesh.normals.fill(Vec3::ZERO);
        mesh.fill_normals();
        assert!(mesh.normals.is_empty());
    }
}
