//! What can be hit: one primitive kind per file, each with its bounds, its leaf block and its exact test.
//!
//! The tests decide the answers, so they return the same bits on every level: no fused operations, and
//! `min`/`max` as documented in [`antumbra_simd::Lanes`].
//! - `ray_setup`: a ray made ready, and the proof that no box that matters is missed;  `slab_test`: boxes;
//!   `best`: the best hit so far
//! - `triangle`: triangles, eight at a time;  `edge_test`: the arithmetic of their test;  `sphere`: spheres, one by one
//! - `cutout`: leaves of partly transparent triangles, what users say of them, and micromaps
//! - `instance`: objects placed in the world;  `instance_ray`: into an instance and out again
//! - `local`: coordinates in double precision

pub(crate) mod best;
pub(crate) mod cutout;
pub(crate) mod edge_test;
pub(crate) mod instance;
pub(crate) mod instance_ray;
mod local;
pub(crate) mod primitives;
pub(crate) mod ray_setup;
pub(crate) mod slab_test;
pub(crate) mod sphere;
#[cfg(test)]
pub(crate) mod test_primitives;
pub(crate) mod triangle;

use std::borrow::Cow;
use std::sync::Arc;

pub use cutout::opacity::{Candidate, Coverage, Opacity, Pattern, QueryKind};

pub use instance::Instance;
pub use local::LocalOrigin;

/// Primitives per leaf, and so per leaf block.
pub const BLOCK: usize = 8;

/// An indexed triangle mesh, owned or borrowed. It is only read while a tree is built: trees keep copies
/// in their own layout.
#[derive(Clone, Debug)]
pub struct TriangleMesh<'a> {
    /// Vertex positions.
    pub positions: Cow<'a, [[f32; 3]]>,
    /// Three indices into `positions` per triangle; the place in this list is the `prim_id`.
    pub indices: Cow<'a, [[u32; 3]]>,
    /// How opaque the triangles are; all of them wholly, if there is none.
    pub opacity: Option<Arc<dyn Opacity>>,
}

/// A full sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub center: [f32; 3],
    /// Radius; a sphere whose radius is not positive and finite is dropped at build.
    pub radius: f32,
}

/// One geometry of a scene; its place in the list given to the builder is the `geom_id`.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Geometry<'a> {
    /// Triangles.
    Triangles(TriangleMesh<'a>),
    /// Spheres; the place in this list is the `prim_id`.
    Spheres(Cow<'a, [Sphere]>),
}

impl<'a> Geometry<'a> {
    /// A triangle mesh from owned or borrowed buffers.
    pub fn triangles(
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        indices: impl Into<Cow<'a, [[u32; 3]]>>,
    ) -> Self {
        Self::Triangles(TriangleMesh {
            positions: positions.into(),
            indices: indices.into(),
            opacity: None,
        })
    }

    /// A mesh of triangles that are partly transparent, from owned or borrowed buffers.
    pub fn cutouts(
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        indices: impl Into<Cow<'a, [[u32; 3]]>>,
        opacity: Arc<dyn Opacity>,
    ) -> Self {
        Self::Triangles(TriangleMesh {
            positions: positions.into(),
            indices: indices.into(),
            opacity: Some(opacity),
        })
    }

    /// Spheres from an owned or borrowed buffer.
    pub fn spheres(spheres: impl Into<Cow<'a, [Sphere]>>) -> Self {
        Self::Spheres(spheres.into())
    }
}

/// What a user calls a primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PrimRef {
    pub geom_id: u32,
    pub prim_id: u32,
}
