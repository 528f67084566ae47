//! Shapes: what can be hit.

use std::sync::Arc;

use crate::Rgb;
use glam::{Vec2, Vec3};

/// One shape of the scene: a geometry with the attributes in force where it was declared.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Where its points are.
    pub geometry: Geometry,
    /// Index into [`crate::Scene::materials`].
    pub material: usize,
    /// Emission of its surface, if it is a light.
    pub area_light: Option<AreaLight>,
    /// `ReverseOrientation` was in force: normals, and so the emitting side, point the other way.
    pub reverse_orientation: bool,
    /// The transformation that brought it to world space was a mirror image. Geometric normals follow
    /// pbrt-v3: they are flipped when exactly one of `reverse_orientation` and this is true, and only
    /// for shapes without normals of their own.
    pub transform_swaps_handedness: bool,
}

/// The geometry of a shape, in world space.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// An indexed triangle mesh.
    Mesh(Arc<TriangleMesh>),
    /// A full sphere.
    Sphere(Sphere),
}

/// An indexed triangle mesh in world space.
///
/// Readers guarantee: every index is below `positions.len()`; `normals` and `uvs` are empty or as long
/// as `positions`. Positions may be NaN or infinite (the kernel drops such triangles and counts them).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions.
    pub positions: Vec<[f32; 3]>,
    /// Three positions of a triangle each. The position in this list is the kernel's `prim_id`.
    pub indices: Vec<[u32; 3]>,
    /// Shading normals per vertex (unit length unless the file has zero ones), or empty.
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex, or empty.
    pub uvs: Vec<Vec2>,
}

/// A full sphere in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius, positive.
    pub radius: f32,
}

/// Diffuse emission of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaLight {
    /// Emitted radiance.
    pub radiance: Rgb,
    /// Emits from both sides.
    pub two_sided: bool,
    /// Samples that `directlighting` with strategy `all` takes of each emitting triangle or sphere.
    pub samples: u32,
}
