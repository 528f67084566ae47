//! Everything that can be hit: one primitive kind per file, each with its bounds, its leaf block and its exact test.
//!
//! The tests decide the answers, so they return the same bits on every level: no fused operations, and
//! `min`/`max` as documented in [`antumbra_simd::Lanes`].
//!
//! - `primitives`: checked copies of all primitives, numbered kind after kind
//! - `leaf_block`: what the leaf blocks of all kinds have in common
//! - `triangle`: triangles, eight at a time;  `edge_test`: the arithmetic of their test
//! - `quad`: pairs of triangles that are one primitive
//! - `scalar`: kinds that are tested one by one: `sphere`, `disk`, `curve`, segments of thin curves, and `user`, primitives of
//!   which users give boxes and functions;  `cubic`: cubic curves as segments
//! - `cutout`: leaves of partly transparent triangles; in it `opacity`, the filters of users, and `micromap`, parts of
//!   triangles for which no filter need be called
//! - `instance`: objects placed in the world;  `nested`: objects in objects;  `instance_ray`: a ray in an object;
//!   `ray_setup`: a ray made ready;  `slab_test`: boxes
//! - `best`: the best hit so far
//! - `sound`: which primitives can be kept;  `moved`: geometry whose vertices moved
//! - `masks`: which geometries and instances rays see
//! - `nearest`: distances of points;  `near_test`: their lower bounds;  `winding`: how often a surface goes around a point
//! - `local`: coordinates in double precision
//! - `path`: transforms between keys;  `motion`: geometry that moves while rays are traced
//! - `functions`: what files cannot hold

pub(crate) mod best;
mod cubic;
pub(crate) mod curve;
pub(crate) mod cutout;
mod disk;
pub(crate) mod edge_test;
pub(crate) mod functions;
pub(crate) mod instance;
pub(crate) mod instance_ray;
pub(crate) mod leaf_block;
mod local;
pub(crate) mod masks;
pub(crate) mod motion;
pub(crate) mod moved;
pub(crate) mod near_test;
pub(crate) mod nearest;
mod nested;
pub(crate) mod path;
pub(crate) mod primitives;
pub(crate) mod quad;
pub(crate) mod ray_setup;
pub(crate) mod scalar;
pub(crate) mod slab_test;
pub(crate) mod sound;
pub(crate) mod sphere;
#[cfg(test)]
pub(crate) mod test_primitives;
pub(crate) mod triangle;
pub(crate) mod triangle_hit;
pub(crate) mod user;
pub(crate) mod winding;

use alloc::borrow::Cow;
use alloc::sync::Arc;
use alloc::vec::Vec;

pub use cutout::opacity::{Candidate, Coverage, Opacity, Pattern, QueryKind};

pub use cubic::{CubicSegments, CurveBasis};
pub use curve::Curves;
pub use disk::Disk;
pub use functions::{Functions, GeometryId};
pub use instance::Instance;
pub use local::LocalOrigin;
pub use nested::NestedInstances;
pub use user::{UserGeometry, UserHit};

/// Primitives per leaf, and so per leaf block.
pub const BLOCK: usize = 8;

/// An indexed triangle mesh, owned or borrowed. Meshes are only read while a tree is built: trees keep copies
/// in their own layout.
///
/// Triangles with a NaN or infinite coordinate or two equal corners are dropped at build. An empty mesh is fine. An index
/// beyond the positions is an error at build.
///
/// ```
/// use antumbra::Geometry;
/// use antumbra::shapes::TriangleMesh;
///
/// let mesh = TriangleMesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]);
/// assert_eq!((mesh.positions.len(), mesh.indices.len()), (3, 1));
/// let geometry = Geometry::Triangles(mesh);
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct TriangleMesh<'a> {
    /// Vertex positions, `[n, 3]`.
    pub positions: Cow<'a, [[f32; 3]]>,
    /// Three indices into `positions` per triangle, `[m, 3]`; the place in this list is the `prim_id`.
    pub indices: Cow<'a, [[u32; 3]]>,
    /// Filter that returns how opaque the triangles are. Without one all of them are opaque.
    pub opacity: Option<Arc<dyn Opacity>>,
    /// Positions at later keys, each as long as `positions`, where the mesh moves while rays are traced: see
    /// [`Geometry::moving`].
    pub moves_to: Vec<Cow<'a, [[f32; 3]]>>,
}

impl<'a> TriangleMesh<'a> {
    /// An opaque mesh from owned or borrowed buffers. Indices are checked when a tree is built.
    #[must_use]
    pub fn new(
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        indices: impl Into<Cow<'a, [[u32; 3]]>>,
    ) -> Self {
        Self {
            positions: positions.into(),
            indices: indices.into(),
            opacity: None,
            moves_to: Vec::new(),
        }
    }
}

/// An indexed mesh of quads, owned or borrowed.
///
/// A quad with the corners 0, 1, 2, 3 is the two triangles (0, 1, 3) and (2, 3, 1), as in Embree. They have one
/// `prim_id`, and fit without a gap. Corners may lie in one plane or not. In a quad whose third corner is the fourth as
/// well, as files have them for triangles, there is only the first triangle.
///
/// `u` and `v` of a hit are coordinates in the whole quad: 0 and 0 at corner 0, 1 and 0 at corner 1, 1 and 1 at corner
/// 2, 0 and 1 at corner 3. On the first triangle they are its barycentrics, on the second one 1 less its barycentrics.
///
/// There are no filters for quads: a [filter of the query](crate::RayQuery::filter) can decide, or give triangles.
///
/// Each triangle of a quad is hit by itself: [`RayQuery::visit_hits`](crate::RayQuery::visit_hits) reports a quad twice
/// if a ray hits both, on the diagonal or because the quad is not flat.
///
/// Dropped at build are quads with a NaN or infinite coordinate and quads of which both triangles have two equal corners. An
/// index beyond the positions is an error at build.
///
/// ```
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// let corners = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
/// let bvh = Bvh::build(&[Geometry::quads(&corners[..], vec![[0, 1, 2, 3]])], &Recipe::default())?;
/// let hit = bvh.intersect(&Ray::new([0.75, 0.5, 0.0], [0.0, 0.0, 1.0])).expect("the quad");
/// assert_eq!((hit.prim_id, hit.u, hit.v), (0, 0.75, 0.5));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct QuadMesh<'a> {
    /// Vertex positions, `[n, 3]`.
    pub positions: Cow<'a, [[f32; 3]]>,
    /// Four indices into `positions` per quad, `[m, 4]`; the place in this list is the `prim_id`.
    pub indices: Cow<'a, [[u32; 4]]>,
}

/// A full sphere. Rays that start inside hit it from within.
///
/// ```
/// use antumbra::shapes::Sphere;
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// let ball = Sphere { center: [0.0, 0.0, 5.0], radius: 1.0 };
/// let bvh = Bvh::build(&[Geometry::spheres(vec![ball])], &Recipe::default())?;
/// let t = |z| bvh.intersect(&Ray::new([0.0, 0.0, z], [0.0, 0.0, 1.0])).map(|hit| hit.t);
/// assert_eq!((t(0.0), t(5.0)), (Some(4.0), Some(1.0)));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, in the coordinates of the world or of the object.
    pub center: [f32; 3],
    /// Radius. A sphere is dropped at build unless its radius is positive and finite and its centre is finite.
    pub radius: f32,
}

/// One geometry of a scene; its place in the list given to the builder is the `geom_id`.
///
/// ```
/// use antumbra::shapes::Sphere;
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let scene = [
///     Geometry::triangles(&positions[..], vec![[0, 1, 2]]),
///     Geometry::spheres(vec![Sphere { center: [5.0, 0.0, 0.0], radius: 1.0 }]),
/// ];
/// let bvh = Bvh::build(&scene, &Recipe::default())?;
/// let hit = bvh.intersect(&Ray::new([5.0, 0.0, -5.0], [0.0, 0.0, 1.0])).expect("the sphere");
/// assert_eq!((hit.geom_id, hit.prim_id), (1, 0));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Geometry<'a> {
    /// A mesh of triangles.
    Triangles(TriangleMesh<'a>),
    /// A mesh of quads.
    Quads(QuadMesh<'a>),
    /// Spheres; the place in this list is the `prim_id`.
    Spheres(Cow<'a, [Sphere]>),
    /// Flat disks; the place in this list is the `prim_id`.
    Disks(Cow<'a, [Disk]>),
    /// Thin curves as chains of straight segments.
    Curves(Curves<'a>),
    /// Primitives of which the user gives boxes and functions: see [`UserGeometry`].
    User {
        /// Number of primitives. Their `prim_id`s go from 0 to `count - 1`.
        count: u32,
        /// Boxes and functions of all primitives.
        shape: Arc<dyn UserGeometry>,
    },
}

impl<'a> Geometry<'a> {
    /// A triangle mesh from owned or borrowed buffers. Indices are checked when a tree is built.
    pub fn triangles(
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        indices: impl Into<Cow<'a, [[u32; 3]]>>,
    ) -> Self {
        Self::Triangles(TriangleMesh::new(positions, indices))
    }

    /// A mesh of quads from owned or borrowed buffers: see [`QuadMesh`]. Indices are checked when a tree is built.
    pub fn quads(
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        indices: impl Into<Cow<'a, [[u32; 4]]>>,
    ) -> Self {
        Self::Quads(QuadMesh {
            positions: positions.into(),
            indices: indices.into(),
        })
    }

    /// A mesh of triangles that are partly transparent, from owned or borrowed buffers. Indices are checked when a tree is
    /// built.
    pub fn cutouts(
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        indices: impl Into<Cow<'a, [[u32; 3]]>>,
        opacity: Arc<dyn Opacity>,
    ) -> Self {
        Self::Triangles(TriangleMesh {
            opacity: Some(opacity),
            ..TriangleMesh::new(positions, indices)
        })
    }

    /// Spheres from an owned or borrowed buffer. Unsound ones are dropped when a tree is built.
    pub fn spheres(spheres: impl Into<Cow<'a, [Sphere]>>) -> Self {
        Self::Spheres(spheres.into())
    }

    /// Flat disks from an owned or borrowed buffer. Unsound ones are dropped when a tree is built.
    pub fn disks(disks: impl Into<Cow<'a, [Disk]>>) -> Self {
        Self::Disks(disks.into())
    }

    /// Thin curves. Unsound segments are dropped, and indices checked, when a tree is built.
    pub fn curves(curves: Curves<'a>) -> Self {
        Self::Curves(curves)
    }

    /// User geometry of so many primitives. Those with unsound boxes are dropped when a tree is built.
    pub fn user(count: u32, shape: Arc<dyn UserGeometry>) -> Self {
        Self::User { count, shape }
    }

    /// Number of primitives. A quad counts as two triangles.
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Triangles(mesh) => mesh.indices.len(),
            Self::Quads(mesh) => 2 * mesh.indices.len(),
            Self::Spheres(spheres) => spheres.len(),
            Self::Disks(disks) => disks.len(),
            Self::Curves(curves) => curves.segments.len(),
            Self::User { count, .. } => *count as usize,
        }
    }
}

/// Name of a primitive: its geometry, and its number there, which is as the user knows it but for [quads](quad).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PrimRef {
    pub geom_id: u32,
    pub prim_id: u32,
}
