//! Shapes: what can be hit, and how a transformation moves it.

use std::sync::Arc;

use crate::{Param, Rgb, transform};
use glam::{DMat4, DVec3, Vec2, Vec3};
use serde::Serialize;

/// One shape of the scene: a geometry with the attributes in force where it was declared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shape {
    /// Where its points are.
    pub geometry: Geometry,
    /// Index into [`crate::Scene::materials`].
    pub material: usize,
    /// Emission of its surface, if it is a light.
    pub area_light: Option<AreaLight>,
    /// Where this is exactly 0 there is no surface, as in pbrt-v3; `None` is the same as 1.
    pub alpha: Option<Param<f32>>,
    /// The same for occlusion queries alone, in addition to `alpha`.
    pub shadow_alpha: Option<Param<f32>>,
    /// `ReverseOrientation` was in force: normals, and so the emitting side, point the other way.
    pub reverse_orientation: bool,
    /// The transformation that brought it to the space where it is was a mirror image. Geometric normals follow
    /// pbrt-v3: they are flipped when exactly one of `reverse_orientation` and this is true, but by
    /// `reverse_orientation` alone for spheres and meshes with normals of their own.
    pub transform_swaps_handedness: bool,
}

impl Shape {
    /// The same shape moved by `matrix`, its mesh shared if nothing moves; `None` for a sphere under a scale
    /// that differs by axis.
    ///
    /// A mirror image changes [`Self::transform_swaps_handedness`], so that normals are those of the shape as
    /// it was, moved. That is what pbrt-v3 does for instances.
    pub fn transformed(&self, matrix: &DMat4) -> Option<Self> {
        let geometry = match &self.geometry {
            unmoved if *matrix == DMat4::IDENTITY => unmoved.clone(),
            Geometry::Mesh(mesh) => {
                let mut mesh = TriangleMesh::clone(mesh);
                mesh.transform(matrix);
                Geometry::Mesh(Arc::new(mesh))
            }
            Geometry::Sphere(sphere) => Geometry::Sphere(sphere.transformed(matrix)?),
        };
        let is_mirrored = transform::swaps_handedness(matrix);
        Some(Self {
            geometry,
            transform_swaps_handedness: self.transform_swaps_handedness != is_mirrored,
            ..self.clone()
        })
    }
}

/// The geometry of a shape, in world space; in that of its object if it belongs to one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Geometry {
    /// An indexed triangle mesh.
    Mesh(Arc<TriangleMesh>),
    /// A full sphere.
    Sphere(Sphere),
}

/// An indexed triangle mesh.
///
/// Readers guarantee: every index is below `positions.len()`; `normals` and `uvs` are empty or as long
/// as `positions`. Positions may be NaN or infinite (the kernel drops such triangles and counts them).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TriangleMesh {
    /// Vertex positions.
    #[serde(serialize_with = "crate::raw")]
    pub positions: Vec<[f32; 3]>,
    /// Three positions of a triangle each. The position in this list is the kernel's `prim_id`.
    #[serde(serialize_with = "crate::raw")]
    pub indices: Vec<[u32; 3]>,
    /// Shading normals per vertex (unit length unless the file has zero ones), or empty.
    #[serde(serialize_with = "crate::raw")]
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex, or empty.
    #[serde(serialize_with = "crate::raw")]
    pub uvs: Vec<Vec2>,
}

impl TriangleMesh {
    /// The bytes of its lists.
    pub fn bytes(&self) -> u64 {
        let lists = [
            size_of_val(&self.positions[..]),
            size_of_val(&self.indices[..]),
            size_of_val(&self.normals[..]),
            size_of_val(&self.uvs[..]),
        ];
        lists.iter().map(|&bytes| bytes as u64).sum()
    }

    /// Moves the mesh, in double precision: normals by the inverse transpose, as in pbrt-v3, and scaled to
    /// unit length. A singular matrix gives degenerate triangles and normals that are not finite.
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
}

/// A full sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius, positive.
    pub radius: f32,
}

impl Sphere {
    /// The sphere moved; `None` if the scale differs by axis (it would become an ellipsoid). Centre and radius
    /// may leave the range of `f32`.
    pub fn transformed(&self, matrix: &DMat4) -> Option<Self> {
        let scale = transform::uniform_scale(matrix)?;
        Some(Self {
            center: transform::point(matrix, self.center.as_dvec3()).as_vec3(),
            radius: (f64::from(self.radius) * scale) as f32,
        })
    }
}

/// Diffuse emission of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AreaLight {
    /// Emitted radiance.
    pub radiance: Rgb,
    /// Emits from both sides.
    pub two_sided: bool,
    /// Samples that `directlighting` with strategy `all` takes of each emitting triangle or sphere.
    pub samples: u32,
}
