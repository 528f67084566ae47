//! Filters: how opaque triangles are, and whether a hit counts.

use crate::prim_id::PrimId;
use core::fmt;

use crate::geometry::PrimRef;
use crate::geometry::ray_setup::RaySetup;
use crate::hash;

/// How opaque the triangles of a mesh are, point by point: leaves cut out of rectangles by a mask, or veils
/// that stop a part of the light.
///
/// A hit counts if `random < opacity`, where `random` in `[0, 1)` is a hash of the ray's origin and direction (inside an
/// instance, as they are in the object's space), `inst_id`, `geom_id` and `prim_id`. So opacity 1 stops every ray and
/// opacity 0 none, whatever the hash. Anything between stops its share of many different rays, and the decision is a new
/// one for each pair of a ray and a triangle. The interval of a ray is no part of the hash: a ray is occluded exactly if
/// one of the pieces is into which it is cut.
///
/// Must be a pure function: the same candidate has the same opacity in every call, on any thread. Calls come in no
/// particular order, and only for candidates that may matter for the answer. So answers do not depend on the tree.
///
/// ```
/// use std::sync::Arc;
///
/// use antumbra::cutout::{Candidate, Opacity};
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// /// Clear where `u` is above a half.
/// #[derive(Debug)]
/// struct Half;
///
/// impl Opacity for Half {
///     fn opacity(&self, candidate: &Candidate) -> f32 {
///         if candidate.u > 0.5 { 0.0 } else { 1.0 }
///     }
/// }
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let leaf = Geometry::cutouts(&positions[..], vec![[0, 1, 2]], Arc::new(Half));
/// let bvh = Bvh::build(&[leaf], &Recipe::default())?;
/// let blocked = |x| bvh.occluded(&Ray::new([x, 0.1, 0.0], [0.0, 0.0, 1.0]));
/// assert!(blocked(0.2) && !blocked(0.8));
/// # Ok::<(), antumbra::Error>(())
/// ```
pub trait Opacity: fmt::Debug + Send + Sync {
    /// The opacity at a point of a triangle, from 0, clear, to 1, opaque. Less is 0, more is 1; NaN is 0.
    fn opacity(&self, candidate: &Candidate) -> f32;

    /// Coverage of a part of the triangle `prim_id`: of the triangle whose corners have these barycentric weights
    /// `[u, v]`. The answer must hold up to 2⁻²⁰ around the part as well, because weights are rounded.
    ///
    /// Called when [`Primitives`] are made: first for the whole triangle, then, as long as the answer is `Mixed`, for its
    /// four quarters, down to 64 parts. Where many triangles have the same [`Opacity::pattern`] there are up to 4096 parts.
    ///
    /// [`Opacity::opacity`] is not called any more where parts are opaque or clear. A triangle that is opaque everywhere
    /// costs as little as one without a filter, and one that is clear costs nothing. `Unknown`, unless overridden, is
    /// always right.
    ///
    /// [`Primitives`]: crate::Primitives
    fn coverage(&self, _prim_id: u32, _corners: &[[f32; 2]; 3]) -> Coverage {
        Coverage::Unknown
    }

    /// Pattern that the triangle `prim_id` shows. Triangles with equal patterns, in whatever mesh or object of one list
    /// of primitives they are, have the same opacity at the same `(u, v)` for the same instance and query. So
    /// [`Opacity::coverage`] and [`Opacity::opacity`] are called with one of them for all. The more triangles share a
    /// pattern, the more parts its micromap may have. (The `random` of a hit is computed with the ids of the triangle
    /// that is hit.)
    ///
    /// A thousand leaves cut out of the same corner of the same picture have one pattern. `None`, unless overridden, is always
    /// right: the triangle is not known to be like any other.
    fn pattern(&self, _prim_id: u32) -> Option<Pattern> {
        None
    }
}

/// Pattern of a partly transparent triangle: see [`Opacity::pattern`]. Any 256 bits, such as the texture coordinates of
/// the three corners and a number for the picture.
///
/// ```
/// use antumbra::cutout::Pattern;
///
/// /// The texture coordinates of three corners, and the number of the picture.
/// fn pattern(uv: [[f32; 2]; 3], picture: u64) -> Pattern {
///     let corner = |[u, v]: [f32; 2]| u64::from(u.to_bits()) << 32 | u64::from(v.to_bits());
///     Pattern([corner(uv[0]), corner(uv[1]), corner(uv[2]), picture])
/// }
/// let uv = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
/// assert_eq!(pattern(uv, 3), pattern(uv, 3));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pattern(pub [u64; 4]);

/// Hit of a ray on a triangle of a mesh that has an [`Opacity`], before the filter decides whether it counts.
///
/// ```
/// use antumbra::PrimId;
/// use antumbra::cutout::{Candidate, QueryKind};
///
/// let triangle = PrimId { inst_id: antumbra::INVALID_ID, geom_id: 0, prim_id: 7 };
/// let candidate = Candidate::new([0.25, 0.5], triangle, QueryKind::Occluded);
/// assert_eq!((candidate.u, candidate.v, candidate.prim_id), (0.25, 0.5, 7));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Candidate {
    /// Barycentric weight of the triangle's second corner. Both weights are at least 0 (or -0), and each is at
    /// most 1; their sum may exceed 1 by a rounding.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner.
    pub v: f32,
    /// Index of the triangle in its mesh: of that which is hit or of one that shows the same, see [`Opacity::pattern`].
    pub prim_id: u32,
    /// Index of that triangle's mesh in the list of geometries.
    pub geom_id: u32,
    /// Index of the instance, or [`INVALID_ID`](crate::INVALID_ID).
    pub inst_id: u32,
    /// Kind of the query that found the candidate.
    pub query: QueryKind,
}

impl Candidate {
    /// A point of a triangle, given by the barycentric weights of its second and third corner.
    #[must_use]
    pub const fn new([u, v]: [f32; 2], triangle: PrimId, query: QueryKind) -> Self {
        Self {
            u,
            v,
            prim_id: triangle.prim_id,
            geom_id: triangle.geom_id,
            inst_id: triangle.inst_id,
            query,
        }
    }
}

/// The two questions about a ray. A mesh may answer them differently: some scene formats know surfaces that
/// are seen but throw no shadow.
///
/// ```
/// use antumbra::cutout::{Candidate, QueryKind};
///
/// /// Seen by a camera, and without a shadow.
/// fn opacity(candidate: &Candidate) -> f32 {
///     match candidate.query {
///         QueryKind::Occluded => 0.0,
///         QueryKind::Intersect => 1.0,
///     }
/// }
/// # let _ = opacity;
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum QueryKind {
    /// Is anything in the way? Training logs record this query, too.
    Occluded,
    /// Which hit is the closest?
    Intersect,
}

/// Knowledge of the opacity of a triangle or a part of one, for both kinds of query.
///
/// ```
/// use antumbra::cutout::Coverage;
///
/// /// Coverage of a part by a mask that is opaque where `u < 0.5`.
/// fn coverage(corners: &[[f32; 2]; 3]) -> Coverage {
///     // A margin, because weights are rounded.
///     let margin = 1.0 / 1024.0;
///     if corners.iter().all(|[u, _]| *u < 0.5 - margin) {
///         Coverage::Opaque
///     } else if corners.iter().all(|[u, _]| *u > 0.5 + margin) {
///         Coverage::Clear
///     } else {
///         Coverage::Mixed
///     }
/// }
/// assert_eq!(coverage(&[[0.0, 0.0], [0.25, 0.0], [0.0, 0.25]]), Coverage::Opaque);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Coverage {
    /// Opacity 1 everywhere.
    Opaque,
    /// Opacity 0 everywhere.
    Clear,
    /// Anything else; a closer look at its parts may pay.
    Mixed,
    /// Anything, and a closer look does not pay.
    #[default]
    Unknown,
}

/// Whether a hit of triangle `id` by this ray counts, by the definition that [`Opacity`] gives. The filter is called
/// with the triangle `asked`, which is one of its own and has the same opacity. The pair is `u` and `v`.
pub(crate) fn accepts(
    filter: &dyn Opacity,
    asked: PrimRef,
    [u, v]: [f32; 2],
    ray: &RaySetup,
    id: PrimRef,
    query: QueryKind,
) -> bool {
    let PrimRef { geom_id, prim_id } = asked;
    let opacity = filter.opacity(&Candidate {
        u,
        v,
        prim_id,
        geom_id,
        inst_id: ray.inst_id,
        query,
    });
    // The hash takes a while, and most masks are nearly everywhere one or the other.
    opacity >= 1.0 || opacity > 0.0 && random(ray, id) < f64::from(opacity)
}

/// The number in `[0, 1)` that decides for a ray and a triangle.
fn random(ray: &RaySetup, id: PrimRef) -> f64 {
    let pair = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    // Adding 0 makes zeros positive: rays that compare as equal have equal answers.
    let floats = |a: f32, b: f32| pair((a + 0.0).to_bits(), (b + 0.0).to_bits());
    let ([ox, oy, oz], [dx, dy, dz]) = (ray.org, ray.dir);
    let words = [
        floats(ox, oy),
        floats(oz, dx),
        floats(dy, dz),
        pair(ray.inst_id, id.geom_id),
        u64::from(id.prim_id),
    ];
    let mut state = 0u64;
    for word in words {
        state = hash::mixed(state.wrapping_add(hash::STEP) ^ word);
    }
    (state >> 11) as f64 / (1u64 << 53) as f64
}
